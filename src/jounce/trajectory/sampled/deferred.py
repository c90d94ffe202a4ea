"""Laws through very many samples, which are fitted when used: smoothing needs the samples only."""

import dataclasses
from collections.abc import Iterator, Mapping

import numpy as np
from jaxtyping import Float

from jounce.errors import MechanismError, TrajectoryError
from jounce.trajectory.motion import AbstractMotion, SplineMotion
from jounce.trajectory.sampled.hermite import HermiteMotion

LONG = 100_000  # number of samples from which a law is fitted when used


@dataclasses.dataclass(frozen=True, eq=False)
class SampledLaw:
    """The checked samples of a law.

    Parameters
    ----------
    times, values : array of shape (sample,)
        Instants, s, and values, rad or m.
    degree : int
        Degree of the spline through them; 1 for a polygon.
    """

    times: Float[np.ndarray, " sample"]
    values: Float[np.ndarray, " sample"]
    degree: int

    def fitted(self) -> AbstractMotion:
        """Return the law through the samples.

        Raises
        ------
        MechanismError
            If no spline goes through the samples.
        """
        if self.degree == 1:
            return HermiteMotion(self.times, self.values[:, None])
        return SplineMotion(self.times, self.values, self.degree)


def law_through(times: np.ndarray, values: np.ndarray, degree: int) -> AbstractMotion | SampledLaw:
    """Return the law through checked samples; for very many, the samples, which are fitted when used."""
    law = SampledLaw(times, values, degree)
    return law if len(times) > LONG else law.fitted()


class Laws(Mapping[str, AbstractMotion]):
    """Laws by name; those through very many samples are fitted when first used.

    Parameters
    ----------
    given : dict of str to AbstractMotion or SampledLaw
        Laws, or samples to be fitted.
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
        """Return the laws, or the samples that are not yet fitted, by name."""
        return dict(self._given)
