"""Laws through very many samples, which are fitted when they are used: smoothing needs the samples alone."""

import dataclasses
from collections.abc import Iterator, Mapping

import numpy as np
from jaxtyping import Float

from jounce.errors import MechanismError, TrajectoryError
from jounce.trajectory.motion import AbstractMotion, SplineMotion
from jounce.trajectory.sampled.hermite import HermiteMotion

LONG = 100_000  # samples from which on a law is fitted when it is used


@dataclasses.dataclass(frozen=True, eq=False)
class SampledLaw:
    """The samples of a law, checked.

    Parameters
    ----------
    times, values : array of shape (sample,)
        s, rad or m.
    degree : int
        Of the spline through them; of degree 1 it is a polygon.
    """

    times: Float[np.ndarray, " sample"]
    values: Float[np.ndarray, " sample"]
    degree: int

    def fitted(self) -> AbstractMotion:
        """Return the law.

        Raises
        ------
        MechanismError
            If no spline goes through the samples.
        """
        if self.degree == 1:
            return HermiteMotion(self.times, self.values[:, None])
        return SplineMotion(self.times, self.values, self.degree)


def law_through(times: np.ndarray, values: np.ndarray, degree: int) -> AbstractMotion | SampledLaw:
    """Return the law through checked samples; of very many, what fits it when it is used."""
    law = SampledLaw(times, values, degree)
    return law if len(times) > LONG else law.fitted()


class Laws(Mapping[str, AbstractMotion]):
    """Laws by name, those through very many samples fitted when they are first used.

    Parameters
    ----------
    given : dict of str to AbstractMotion or SampledLaw
        What they are made of.
    """

    def __init__(self, given: Mapping[str, AbstractMotion | SampledLaw]):
        self._given = dict(given)

    def __getitem__(self, name: str) -> AbstractMotion:
        law = self._given[name]
        if isinstance(law, SampledLaw):
            try:
                law = self._given[name] = law.fitted()
            except MechanismError as error:
                raise TrajectoryError(error.message, name=name, value=error.value) from None
        return law

    def __iter__(self) -> Iterator[str]:
        return iter(self._given)

    def __len__(self) -> int:
        return len(self._given)

    def given(self) -> dict[str, AbstractMotion | SampledLaw]:
        """Return what the laws are made of, by name, as it is."""
        return dict(self._given)
