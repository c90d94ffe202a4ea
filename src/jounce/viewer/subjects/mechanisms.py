"""Mechanisms in the viewer: their parameters, and the motion for given values."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
from jaxtyping import Bool, Float
from xarray import Dataset

from jounce.errors import SolveError
from jounce.integrate import simulate
from jounce.io.files.column_units import in_units
from jounce.kinematics import Motion, Status, raise_for_status, solve
from jounce.mechanism import AngularVelocityOutput, Mechanism, time_grid
from jounce.mechanism.mechanism import GROUND
from jounce.plot.labels import quantity_word
from jounce.reporting.facts.mechanism.mechanism_facts import parameter_facts
from jounce.trajectory import Expression
from jounce.viewer.shapes.appearance import Appearance, Position
from jounce.viewer.shapes.mechanism_appearance import mechanism_appearance
from jounce.viewer.shapes.recording import Load, Parameter, Quantity, Recording, poses, spatial_vectors
from jounce.viewer.subjects.loads import has_loads, mechanism_loads

FEWEST, MOST = 100, 2001  # shown instants


class MechanismSubject:
    """A mechanism with drivers, which is solved, or with initial conditions, which is simulated.

    Parameters
    ----------
    mechanism : Mechanism
        A mechanism with a time grid.

    Raises
    ------
    MechanismError
        If the mechanism has no time grid.
    """

    no_sliders = "There are no parameters. Name values under `parameters:` in the file to get sliders here."

    def __init__(self, mechanism: Mechanism):
        instants_shown(mechanism)
        self.mechanism, self.name, self.loaded = mechanism, mechanism.title or "mechanism", has_loads(mechanism)
        self.parameters = mechanism_parameters(mechanism)

    def solve(self, values: Mapping[str, float], order: int) -> Recording:
        """Return the motion for some values of the parameters.

        Raises
        ------
        JounceError
            If the bodies cannot be assembled, or the motion ends at once.
        """
        mechanism = self.mechanism.with_parameters(**values)
        solver = simulate if mechanism.initial else solve
        return recorded(solver(mechanism, instants_shown(mechanism), order=order, strict=False))


def mechanism_parameters(mechanism: Mechanism) -> tuple[Parameter, ...]:
    """Return the parameters of a mechanism with the ranges of their sliders."""
    given, values = mechanism.parameters, {k: float(v) for k, v in mechanism.parameter_values.items()}
    units = {facts["name"]: facts["unit"] or "" for facts in parameter_facts(mechanism, None)}
    return tuple(
        Parameter(
            name, value, *parameter_range(value), derived=isinstance(given[name], str | Expression), unit=units[name]
        )
        for name, value in values.items()
    )


def parameter_range(value: float) -> tuple[float, float]:
    """Return the ends of a slider: half and one and a half times a value, or -1 and 1 for zero.

    Examples
    --------
    >>> parameter_range(2.0), parameter_range(-4.0), parameter_range(0.0)
    ((1.0, 3.0), (-6.0, -2.0), (-1.0, 1.0))
    """
    if value == 0:
        return -1.0, 1.0
    low, high = sorted((0.5 * value, 1.5 * value))
    return low, high


def instants_shown(mechanism: Mechanism) -> Float[np.ndarray, " time"]:
    """Return the instants to show of a mechanism, more if too few to look smooth, fewer if too many."""
    given = time_grid(mechanism.time, mechanism.parameter_values)
    if len(given) > MOST:
        return np.linspace(given[0], given[-1], MOST)
    if 1 < len(given) < FEWEST:
        parts = -(-FEWEST // (len(given) - 1))
        return np.interp(np.arange((len(given) - 1) * parts + 1) / parts, np.arange(len(given)), given)
    return given


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class MechanismRecording(Recording):
    """The motion of a mechanism for the page.

    Parameters
    ----------
    solution : Motion
    solved : numpy.ndarray of bool, shape (all,)
        Mask of solved instants.
    ground : str
        Name of the ground.
    """

    solution: Motion
    solved: Bool[np.ndarray, " all"]
    ground: str

    def quantities(self) -> dict[str, Quantity]:
        """Return all outputs, or without outputs the rotation of each body."""
        outputs, quantities = self.solution.mechanism.outputs, {}
        units = self.solution.mechanism.shown_units
        for name, values in self.solution.outputs.items():
            names = tuple(quantity_word(outputs[name], k) for k in range(values.shape[1]))
            unit, factor = units.of(outputs[name].unit, name)
            quantities[name] = self._quantity(unit, values * factor, names, outputs[name].labels)
        return quantities or dict(map(self._turning, self.solution.mechanism.rigid_bodies))

    def _turning(self, body: str) -> tuple[str, Quantity]:
        rates = [quantity_word(AngularVelocityOutput(body), k) for k in range(self.order + 1)]
        if self.planar:
            values, names = self.solution.angle(body).values, ("angle", *rates)
            unit, factor = self.solution.mechanism.shown_units.of("rad")
            return f"angle of {body}", self._quantity(unit, values * factor, names[: values.shape[1]])
        values = self.solution.angular_velocity(body).values
        unit, factor = self.solution.mechanism.shown_units.of("rad/s")
        return f"angular velocity of {body}", self._quantity(unit, values * factor, tuple(rates[: values.shape[1]]))

    def _quantity(self, unit: str, values: np.ndarray, names: tuple[str, ...], *labels: tuple[str, ...]) -> Quantity:
        values = values[self.solved]
        return Quantity(unit, values.reshape(*values.shape[:2], -1), names, *labels)

    def derivatives(self, body: str, point: Position) -> Float[np.ndarray, "time derivative 3"]:
        """Return the position and derivatives of a point."""
        body = GROUND if body == self.ground else body
        return spatial_vectors(self.solution.point(body, np.asarray(point).tolist()).values[self.solved])

    def all_loads(self) -> list[Load]:
        """Return the loads of joints, drivers and applied forces."""
        return mechanism_loads(self.solution, self.solved)

    def dataset(self) -> Dataset:
        """Return the results at all instants, in the shown units."""
        return in_units(self.solution.dataset, self.solution.mechanism.shown_units)


def recorded(
    motion: Motion, appearance: Appearance | None = None, title: str = "", ground: str = GROUND
) -> MechanismRecording:
    """Return the recording of a motion.

    Parameters
    ----------
    motion : Motion
        The motion; unsolved instants are omitted.
    appearance : Appearance, optional
        Shapes of the bodies, by default from the joints.
    title : str, optional
        Title, by default that of the mechanism.
    ground : str, optional
        Name of the ground.

    Raises
    ------
    SolveError
        If no instant was solved.
    """
    mechanism, solved = motion.mechanism, np.asarray(motion.status == Status.OK)
    notice = ""
    try:
        raise_for_status(motion)
    except SolveError as error:
        if np.count_nonzero(solved) < min(2, len(solved)):
            raise
        notice = str(error)
    position, quaternion = poses(motion)
    return MechanismRecording(
        solution=motion,
        solved=solved,
        ground=ground,
        title=title or mechanism.title,
        planar=mechanism.space == "planar",
        time=motion.time[solved],
        order=motion.order,
        bodies=(ground, *mechanism.rigid_bodies),
        position=position[solved],
        quaternion=quaternion[solved],
        values={name: float(value) for name, value in mechanism.parameter_values.items()},
        appearance=appearance or mechanism_appearance(motion),
        notice=notice,
    )
