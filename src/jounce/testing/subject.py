"""The subject of contracts of joints: samples of a class, claims about the class, and exceptions of contracts."""

import dataclasses
from functools import cached_property
from typing import Any

import jax.numpy as jnp
import numpy as np

from jounce.jet import Jet
from jounce.mechanism.system import Group
from jounce.testing.samples import Motion, Samples, group_of, lanes_of, pose_of, random_motion, time_jet, widened


class SkippedContract(Exception):  # noqa: N818 - not an error
    """The reason why a contract does not apply to a joint."""


class Broken(Exception):  # noqa: N818 - `ContractError` names the contract, too
    """The reason why a joint does not keep a contract."""


@dataclasses.dataclass(frozen=True)
class Subject:
    """A class of joints or drivers, and claims about the class.

    Parameters
    ----------
    samples : Samples
        Random joints of the class.
    order : int
        Highest derivative to check.
    relative : bool
        Whether a joint depends only on the relative poses of its bodies.
    period : str or float or None
        Period of the last row of the residual, if the row is known up to whole periods: a number, or the name of its
        field.
    equations : int or None
        Number of independent equations of a joint; None for the number of rows of the residual.
    seed : int
        Seed of all random numbers.
    positions : list
        Positions where the joint holds, empty before their computation.
    """

    samples: Samples
    order: int
    relative: bool
    period: str | float | None
    equations: int | None
    seed: int
    positions: list[Any] = dataclasses.field(default_factory=list)

    @property
    def space(self) -> str:
        """Planar or spatial."""
        return self.samples.space

    def random(self) -> np.random.Generator:
        """Return a new generator of random numbers, always with the same seed."""
        return np.random.default_rng(self.seed)

    def period_of(self, group: Group) -> float | None:
        """Return the period of the last row of a residual."""
        if isinstance(self.period, str):
            return float(np.squeeze(getattr(group.element, self.period)))
        return 2 * np.pi if self.period is None and self.samples.kind.periodic else self.period

    @cached_property
    def scale(self) -> float:
        """Magnitude of residuals, the unit of all tolerances."""
        random = self.random()
        group = group_of([self.samples.element(random)], self.space)
        largest = float(np.abs(residual(group, random_start(self, random))).max())
        return largest if largest > 10 else 1.0

    def same(self, actual: Any, expected: Any, tolerance: float, words: str) -> None:
        """Raise Broken unless numbers agree within a tolerance, in units of `scale`."""
        actual, expected = np.asarray(actual, float), np.asarray(expected, float)
        if actual.shape != expected.shape:
            raise Broken(f"{words}: shapes {actual.shape} and {expected.shape}")
        if not (np.isfinite(actual) & np.isfinite(expected)).all():
            raise Broken(f"{words}: there are values that are not finite")
        worst = float(np.abs(actual - expected).max(initial=0.0))
        if worst > tolerance * self.scale:
            raise Broken(f"{words}: they differ by {worst:.3g}, where {tolerance * self.scale:.3g} is allowed")


def random_start(subject: Subject, random: np.random.Generator) -> Motion:
    """Return a random position of all bodies."""
    return random_motion(random, subject.space, 0)


def residual(group: Group, motion: Motion, instants: np.ndarray | None = None) -> np.ndarray:
    """Return coefficients of the residual on a motion, shape (order + 1, rows, instances, batch).

    Time runs, at the instant of all samples, or is constant, at one instant for each lane.
    """
    batch = motion["position"].shape[-1]
    lanes = max(batch, lanes_of("planar" if "angle" in motion else "spatial"))
    widened_motion = {name: widened(series, lanes) for name, series in motion.items()}
    if instants is None:
        time = time_jet(len(motion["position"]) - 1, lanes)
    else:
        time = Jet([jnp.asarray(widened(instants, lanes))[None]])
    return evaluated(group, pose_of(widened_motion), time)[..., :batch]


def evaluated(group: Group, pose: Any, time: Jet) -> np.ndarray:
    """Return coefficients of the residual at a pose, shape (order + 1, rows, instances, batch)."""
    return np.array(group.residual(pose, time).dense().coefficients)
