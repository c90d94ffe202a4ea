"""Mechanisms as the view sees them: parameters to set, and the motion for their values."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from jounce.errors import JounceError, SolveError
from jounce.mechanism import AngularVelocityOutput, Mechanism
from jounce.mechanism.mechanism import GROUND
from jounce.reporting.peaks import rate_name
from jounce.trajectory import Expression
from jounce.viewer.forces import applied
from jounce.viewer.looks import looks_of
from jounce.viewer.take import Exertion, Parameter, Quantity, Take, poses, rotated, spatial_vectors

__all__ = ["MechanismSubject", "instants_shown", "parameter_range", "take_of"]

FEWEST, MOST = 100, 2001  # instants that are shown


class MechanismSubject:
    """A mechanism with drivers, which is solved, or with initial conditions, which is simulated.

    Parameters
    ----------
    mechanism : Mechanism
        With a time grid.

    Raises
    ------
    MechanismError
        If there is no time grid.
    """

    no_sliders = "There are no parameters. Name values under `parameters:` in the file to get sliders here."

    def __init__(self, mechanism: Mechanism):
        self.mechanism = mechanism
        self.simulated = bool(mechanism.initial)
        instants_shown(mechanism)

    @property
    def name(self) -> str:
        """The title."""
        return self.mechanism.title or "mechanism"

    @property
    def loaded(self) -> bool:
        """Whether anything has a mass, or forces are applied, so that joints carry something."""
        return has_loads(self.mechanism)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Those that are numbers, with sensible ranges, and those that follow from them."""
        found = []
        for name, value in self.mechanism.parameter_values.items():
            derived = isinstance(self.mechanism.parameters[name], str | Expression)
            found.append(Parameter(name, float(value), *parameter_range(float(value)), derived=derived))
        return tuple(found)

    def solve(self, values: Mapping[str, float], order: int) -> Take:
        """Return the motion for some values of the parameters.

        Raises
        ------
        JounceError
            If the bodies cannot be put together, or the motion ends at once.
        """
        mechanism = self.mechanism.with_parameters(**values)
        time = instants_shown(mechanism)
        return take_of(self._motion(mechanism, time, order))

    def _motion(self, mechanism: Mechanism, time: np.ndarray, order: int) -> Any:
        from jounce.integrate import simulate
        from jounce.kinematics import solve

        if self.simulated:
            return simulate(mechanism, time, order=order, strict=False)
        return solve(mechanism, time, order=order, strict=False)


def parameter_range(value: float) -> tuple[float, float]:
    """Return the ends of a slider: half and one and a half of a value, and from -1 to 1 for zero.

    Examples
    --------
    >>> parameter_range(2.0), parameter_range(-4.0), parameter_range(0.0)
    ((1.0, 3.0), (-6.0, -2.0), (-1.0, 1.0))
    """
    if value == 0:
        return -1.0, 1.0
    low, high = sorted((0.5 * value, 1.5 * value))
    return low, high


def instants_shown(mechanism: Mechanism) -> np.ndarray:
    """Return the instants of a mechanism, more where they are too few to look smooth, fewer where they are too many."""
    from jounce.mechanism import time_grid

    given = time_grid(mechanism.time, mechanism.parameter_values)
    if len(given) > MOST:
        return np.linspace(given[0], given[-1], MOST)
    if 1 < len(given) < FEWEST:
        parts = -(-FEWEST // (len(given) - 1))
        return np.interp(np.arange((len(given) - 1) * parts + 1) / parts, np.arange(len(given)), given)
    return given


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class MotionTake(Take):
    """The motion of a mechanism as the page shows it.

    Parameters
    ----------
    moving : Motion
    good : array of bool, shape (time,)
        Instants that were solved.
    ground : str
        What the ground is called.
    """

    moving: Any
    good: np.ndarray
    ground: str

    def quantities(self) -> dict[str, Quantity]:
        """Return the outputs, or the angles of the bodies."""
        return _quantities(self.moving, self.good)

    def motion_of(self, body: str, point: Any) -> np.ndarray:
        """Return position and derivatives of a point."""
        return spatial_vectors(self.moving.point(GROUND if body == self.ground else body, point).values[self.good])

    def exertions_of(self) -> list[Exertion]:
        """Return what joints, drivers and applied forces do."""
        return _exertions(self.moving, self.good)

    def dataset(self) -> Any:
        """Return the results of all instants."""
        return self.moving.dataset


def take_of(motion: Any, looks: Any = None, title: str = "", ground: str = GROUND) -> MotionTake:
    """Return a motion as the view shows it.

    Parameters
    ----------
    motion : Motion
        Instants that were not solved are left out.
    looks : Looks, optional
        Shapes of the bodies; from joints unless given.
    title : str, optional
        That of the mechanism unless given.
    ground : str, optional
        What the ground is called.

    Raises
    ------
    SolveError
        If no instant was solved.
    """
    from jounce.kinematics import Status, raise_for_status

    mechanism, good = motion.mechanism, motion.status == Status.OK
    notice = ""
    try:
        raise_for_status(motion)
    except SolveError as error:
        if np.count_nonzero(good) < min(2, len(good)):
            raise
        notice = str(error)
    position, quaternion = poses(motion)
    return MotionTake(
        moving=motion,
        good=good,
        ground=ground,
        title=title or mechanism.title,
        planar=mechanism.space == "planar",
        time=motion.time[good],
        order=motion.order,
        bodies=(ground, *mechanism.bodies),
        position=position[good],
        quaternion=quaternion[good],
        values={name: float(value) for name, value in mechanism.parameter_values.items()},
        looks=looks_of(motion) if looks is None else looks,
        notice=notice,
    )


def _quantities(motion: Any, good: np.ndarray) -> dict[str, Quantity]:
    """Return all outputs, and the angle of each body of a planar mechanism that has no outputs."""
    found = {}
    for name, values in motion.outputs.items():
        output = motion.mechanism.outputs[name]
        values = values[good].reshape(np.count_nonzero(good), values.shape[1], -1)
        words = tuple(rate_name(output, k) for k in range(values.shape[1]))
        if output.unit == "rad" and words[:1] == ("position",):
            words = ("angle", *words[1:])
        found[name] = Quantity(output.unit, values, words, output.labels)
    if found:
        return found
    for body in motion.mechanism.bodies:
        if motion.mechanism.space == "planar":
            values, unit = motion.angle(body).values, "rad"
            name, words = f"angle of {body}", ("angle", *(rate_name(AngularVelocityOutput(body), k) for k in range(30)))
        else:
            values, unit = motion.angular_velocity(body).values, "rad/s"
            name = f"angular velocity of {body}"
            words = tuple(rate_name(AngularVelocityOutput(body), k) for k in range(30))
        values = values[good].reshape(np.count_nonzero(good), values.shape[1], -1)
        found[name] = Quantity(unit, values, words[: values.shape[1]])
    return found


def has_loads(mechanism: Mechanism) -> bool:
    """Tell whether there are masses or applied forces, so that joints carry something."""
    return bool(mechanism.forces) or any(body.mass is not None for body in mechanism.bodies.values())


def _exertions(motion: Any, good: np.ndarray) -> list[Exertion]:
    """Return what joints, drivers and applied forces do to the bodies."""
    mechanism = motion.mechanism
    if not has_loads(mechanism):
        return []
    if motion.order < 2:
        raise JounceError("forces need accelerations; set the order to 2 or more", name="order", value=motion.order)
    found = []
    for kind in ("joints", "drivers"):
        found += [_reaction(motion, good, name, kind) for name in getattr(mechanism, kind)]
    return found + applied(motion, good)


def _reaction(motion: Any, good: np.ndarray, name: str, kind: str) -> Exertion:
    """Return what a joint or a driver does to its last body of two."""
    from jounce.dynamics import joint_reaction
    from jounce.mechanism.resolve import resolve_element

    mechanism = motion.mechanism
    element = getattr(mechanism, kind)[name]
    components = 2 if mechanism.space == "planar" else 3
    values = resolve_element(element, mechanism.parameter_values, components, f"{kind}.{name}")
    slot = min(1, len(element.bodies) - 1)
    local = values.get(f"point_{'ij'[slot]}")
    local = np.zeros(components) if local is None else np.asarray(local)
    reaction = joint_reaction(motion, name, point=local)
    force, torque = reaction.force.values[good][:, 0], reaction.torque.values[good]
    if torque.ndim == 2:  # planar: about z
        torque = np.stack([np.zeros(len(torque)), np.zeros(len(torque)), torque[:, 0]], axis=-1)
    else:
        torque = torque[:, 0]
    place = spatial_vectors(motion.point(element.bodies[slot], local.tolist()).values[good][:, 0])
    return Exertion(name, "reaction" if kind == "joints" else "driver", place, spatial_vectors(force), torque)


def directions(take: Take, body: str, vector: Any) -> np.ndarray:
    """Return a direction fixed in a body at all instants, (time, 3)."""
    index = take.bodies.index(body)
    return rotated(take.quaternion[:, index], spatial_vectors(np.asarray(vector, float)))
