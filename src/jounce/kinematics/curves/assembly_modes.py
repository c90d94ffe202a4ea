"""All assemblies of a mechanism at one instant, from many random starts and along the circuits through those found."""

import dataclasses
from collections.abc import Sequence
from typing import Any, overload

import numpy as np

from jounce.base.display import Displayed
from jounce.base.modules import with_fields
from jounce.base.shapes import Real
from jounce.errors import AssemblyError, MechanismError, MobilityError, whole_number
from jounce.execution.device import resident
from jounce.kinematics.assembly.assemble import (
    check_assembled,
    check_mobility,
    find_assembly,
    nearest_to_guess,
    redundancy_of,
)
from jounce.kinematics.assembly.axis_directions import axis_signs, drawn_axis_signs
from jounce.kinematics.assembly.gauss_newton import assemble_from_guess
from jounce.kinematics.curves.curve import Curve, curve_through
from jounce.kinematics.curves.path_tracker import PathTracker
from jounce.kinematics.curves.start import instant_of, posed
from jounce.kinematics.curves.starts import assemble_side_by_side
from jounce.mechanism import Mechanism, build, check_mechanism
from jounce.mechanism.building.preconditions import check_holonomic, concrete
from jounce.mechanism.carriages import check_without_ends

BATCH = 256  # starts assembled side by side
OFTEN = 3  # hits of each assembly after which the search counts as complete
MOST_ROUNDS = 8  # largest multiple of the requested starts, if an assembly was found less often
CLOSED = 1e-9  # largest residual of an assembly
SAME, SAME_IF_SINGULAR = 1e-6, 1e-3  # rad or sizes of the mechanism: largest difference of equal assemblies
NEARLY_SINGULAR = 1e-5  # smallest singular value of the Jacobian
MOST_SINGULAR = 8
TOLERANCE = 1e-12


@dataclasses.dataclass(frozen=True)
class Assembly:
    """One of the ways in which a mechanism can be assembled.

    Attributes
    ----------
    number : int
        Number from 1, in the order of the distance from the starting guess.
    mechanism : Mechanism
        The mechanism with this configuration as its starting guess.
    circuit : int or None
        Number of its circuit, from 1: assemblies on one circuit can move into each other without being taken apart.
        None if circuits were not requested.
    branch : int or None
        Number of its branch of the circuit, from 1: assemblies on one branch can be driven into each other.
    hits : int
        Number of starts that led to it; 0 if it was found along a circuit.
    distance : float
        Distance from the starting guess, rad or sizes of the mechanism.
    smallest_singular_value : float
        Smallest singular value of the scaled Jacobian; near zero at a dead point.
    """

    number: int
    mechanism: Mechanism
    circuit: int | None
    branch: int | None
    hits: int
    distance: float
    smallest_singular_value: float


class Assemblies(Displayed, Sequence[Assembly]):
    """All assemblies that were found, in the order of their distance from the starting guess.

    Attributes
    ----------
    starts : int
        Number of starts.
    since_last_new : int
        Number of starts after the one that found the last new assembly; the larger, the fewer may be missing.
    circuits : tuple of Curve
        One curve of each circuit.
    movable : int
        Number of starts that led to configurations in which the mechanism can move with its drivers held. Such
        configurations are infinitely many, so they are not among the assemblies.
    """

    def __init__(
        self,
        members: Sequence[Assembly],
        starts: int,
        since_last_new: int,
        circuits: tuple[Curve, ...] = (),
        movable: int = 0,
    ):
        self._found, self.circuits, self.movable = tuple(members), circuits, movable
        self.starts, self.since_last_new = starts, since_last_new

    def __repr__(self) -> str:
        parts = [f"{len(self)} assemblies" if len(self) != 1 else "1 assembly"]
        if self.circuits:
            parts.append(f"{len(self.circuits)} circuit{'s' * (len(self.circuits) != 1)}")
        parts += [f"{self.starts} starts", f"{self.since_last_new} since the last new one"]
        if self.movable:
            parts.append(f"{self.movable} to configurations that move with the drivers held")
        return f"<Assemblies {', '.join(parts)}>"

    def __len__(self) -> int:
        return len(self._found)

    @overload
    def __getitem__(self, index: int) -> Assembly: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Assembly, ...]: ...
    def __getitem__(self, index: Any) -> Any:
        return self._found[index]

    def number(self, number: int) -> Assembly:
        """Return the assembly with a given number, from 1.

        Raises
        ------
        AssemblyError
            If there is no assembly with this number.
        """
        if not isinstance(number, int) or isinstance(number, bool) or not 1 <= number <= len(self):
            message = f"there is no assembly of this number: {len(self)} were found from {self.starts} starts"
            raise AssemblyError(message, name="assembly", value=number)
        return self._found[number - 1]


@concrete
def assemblies(
    mechanism: Mechanism,
    time: Real | None = None,
    *,
    count: int = 1024,
    seed: int = 0,
    circuits: bool = True,
    driver: str | None = None,
) -> Assemblies:
    """Return all assemblies of a driven mechanism at one instant that many random starts lead to.

    Starts are random poses of all bodies. As many as requested are made, and more, up to eight times as many, while
    some assembly was found fewer than three times. Tracing the circuits through the assemblies then finds all others on
    them.

    Parameters
    ----------
    mechanism : Mechanism
        Joints and drivers must leave no degree of freedom.
    time : float, optional
        Instant, s; by default the first of the mechanism's own.
    count : int, default 1024
        Number of starts.
    seed : int, default 0
        Seed of the random numbers; the same seed gives the same starts.
    circuits : bool, default True
        Whether to trace the circuits, which determines the circuit and the branch of each assembly; with several
        drivers only if one is named.
    driver : str, optional
        Driver whose value is free on the circuits, if there are several; see `jounce.trace`.

    Returns
    -------
    Assemblies
        A sequence of assemblies, with the number of starts, and of those since the last new assembly.

    Raises
    ------
    MechanismError
        If the mechanism or an option is not valid.
    AssemblyError
        If no start leads to an assembly: a loop cannot close.
    MobilityError
        If degrees of freedom are left, so that assemblies are infinitely many.

    Examples
    --------
    >>> import jounce as jn
    >>> found = jn.assemblies(jn.load("examples/four_bar.yaml"))
    >>> [(assembly.circuit, assembly.branch) for assembly in found]
    [(1, 1), (2, 1)]
    """
    check_mechanism(mechanism)
    check_without_ends(mechanism, "a search for assemblies")
    check_holonomic(mechanism, "an assembly")
    count = whole_number("count", count, 1, 10**7, error=MechanismError)
    seed = whole_number("seed", seed, 0, 2**63 - 1, error=MechanismError)
    search = _Search(mechanism, instant_of(mechanism, time))
    search.from_starts(count, np.random.default_rng(seed))
    curves: tuple[Curve, ...] = ()
    if circuits and (driver is not None or len(mechanism.drivers) == 1):
        curves = search.along_circuits(driver)
    return search.result(curves)


@dataclasses.dataclass
class _Configuration:
    coordinates: dict[str, np.ndarray]
    smallest: float
    hits: int
    circuit: int | None = None
    branch: int | None = None


class _Search:
    """Search for the assemblies at an instant, with those found so far."""

    def __init__(self, mechanism: Mechanism, instant: float):
        self.mechanism, self.instant = dataclasses.replace(mechanism, assembly=None), instant
        model = build(mechanism)
        if model.system.shape[0] < model.system.shape[1]:
            message = "joints and drivers leave degrees of freedom, so that there are infinitely many assemblies"
            raise MobilityError(f"{message}: add drivers")
        self.first, attempt = find_assembly(model, instant, TOLERANCE)
        self.attempt = attempt
        system = with_fields(self.first.system, row_scale=attempt.scale[:, None])
        self.system = resident(with_fields(system, outputs=(), forces=(), fronts=None))
        self.model = dataclasses.replace(self.first, system=system)
        self.tracker = PathTracker(self.model, driven=False)
        self.configurations: list[_Configuration] = []
        self.axis_signs = axis_signs(self.system, attempt.coordinates) if attempt.closed else drawn_axis_signs(model)
        self.starts = self.since_last_new = self.movable = 0
        if attempt.closed:
            check_mobility(self.model, redundancy_of(self.first, attempt, instant)[1])
            self.add({name: x[..., 0] for name, x in attempt.coordinates.items()}, hits=0)

    def from_starts(self, count: int, random: np.random.Generator) -> None:
        """Assemble from random starts until each assembly was found often enough."""
        start_limit = MOST_ROUNDS * count
        while self.starts < count or (self.starts < start_limit and any(x.hits < OFTEN for x in self.configurations)):
            self._round(min(BATCH, start_limit - self.starts), random)
        if not self.configurations and not self.movable:
            check_assembled(self.first, self.attempt, self.instant)
            raise AssemblyError(f"no assembly was found from {self.starts} starts at t = {self.instant:g} s")
        if not self.configurations:
            message = (
                f"at t = {self.instant:g} s the mechanism can move with its drivers held: infinitely many assemblies"
            )
            raise MobilityError(message)

    def _round(self, count: int, random: np.random.Generator) -> None:
        starts = self._random_poses(random)
        instant, kind = np.float64(self.instant), self.model.pose_type
        assembled, gaps = assemble_side_by_side(self.system, starts, instant, pose_type=kind)
        coordinates, gaps = {name: np.asarray(x) for name, x in assembled.items()}, np.asarray(gaps)
        for lane in range(count):
            self.starts += 1
            self.since_last_new += 1
            new = gaps[lane] <= CLOSED and self.add({name: x[..., lane] for name, x in coordinates.items()})
            if new and not self._remove_movable():
                self.since_last_new = 0

    def _remove_movable(self) -> bool:
        """Drop singular assemblies if too many to be dead points (they form a continuum); return whether any were."""
        singular = [x for x in self.configurations if x.smallest < NEARLY_SINGULAR]
        if len(singular) <= (0 if self.movable else MOST_SINGULAR):
            return False
        self.movable += sum(x.hits for x in singular)
        self.configurations = [x for x in self.configurations if x.smallest >= NEARLY_SINGULAR]
        return True

    def _random_poses(self, random: np.random.Generator) -> dict[str, np.ndarray]:
        """Return random poses of all bodies; the ground keeps its pose."""
        guess = self.model.guess
        position = np.repeat(np.asarray(guess["position"], float), BATCH, axis=-1)
        position[:, 1:] += self.model.length * random.uniform(-1.0, 1.0, size=position[:, 1:].shape)
        if "angle" in guess:
            angle = np.repeat(np.asarray(guess["angle"], float), BATCH, axis=-1)
            angle[1:] += random.uniform(-np.pi, np.pi, size=angle[1:].shape)
            return {"position": position, "angle": angle}
        quaternion = np.repeat(np.asarray(guess["quaternion"], float), BATCH, axis=-1)
        samples = random.normal(size=quaternion[:, 1:].shape)
        quaternion[:, 1:] = samples / np.linalg.norm(samples, axis=0)
        return {"position": position, "quaternion": quaternion}

    def add(self, coordinates: dict[str, np.ndarray], hits: int = 1) -> bool:
        """Add an assembly, and return whether it is new; reject it if a part is turned over in its joint."""
        batch = {name: x[..., None] for name, x in coordinates.items()}
        if not np.array_equal(axis_signs(self.system, batch), self.axis_signs):
            return False
        for configuration in self.configurations:
            tolerance = SAME if configuration.smallest > NEARLY_SINGULAR else SAME_IF_SINGULAR
            if np.max(np.abs(self.tracker.difference(coordinates, configuration.coordinates))) < tolerance:
                configuration.hits += hits
                return False
        coordinates = self._polished(coordinates)
        point = self.tracker.point_without_series({name: x[..., None] for name, x in coordinates.items()}, self.instant)
        sizes = np.linalg.svd(point.jacobian, compute_uv=False)
        self.configurations.append(_Configuration(coordinates, float(sizes[: self.tracker.columns][-1]), hits))
        return True

    def _polished(self, coordinates: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return an assembly corrected to rounding, with planar angles in the whole turn nearest to the guess."""
        start = {name: x[..., None] for name, x in coordinates.items()}
        attempt = assemble_from_guess(self.first, self.instant, TOLERANCE, start)
        if not attempt.closed:
            return coordinates  # near a singular position: no better accuracy is possible
        attempt = nearest_to_guess(self.first, attempt, self.instant) if "angle" in coordinates else attempt
        return {name: x[..., 0] for name, x in attempt.coordinates.items()}

    def along_circuits(self, driver: str | None) -> tuple[Curve, ...]:
        """Trace the circuits of all assemblies, and add the other assemblies on them."""
        circuits: list[Curve] = []
        number = 0
        while number < len(self.configurations):
            if self.configurations[number].circuit is None:
                start = posed(self.mechanism, self.configurations[number].coordinates)
                curves = curve_through(start, self.instant, driver).connected()
                circuits.append(curves[0])
                self.configurations[number].circuit, self.configurations[number].branch = len(circuits), 1
                before = 0  # number of branches on the curves before, through the same change points
                for curve in curves:
                    self._assign(curve, len(circuits), before)
                    before += len(curve.branches)
            number += 1
        return tuple(circuits)

    def _assign(self, curve: Curve, circuit: int, before: int) -> None:
        """Set circuit and branch of all assemblies on a curve; `before` branches of the circuit precede its own."""
        for arc_length in curve.where(curve.first_value):
            coordinates = curve.coordinates_at(arc_length)
            self.add(coordinates, hits=0)
            configuration = self._nearest(coordinates)
            if configuration.circuit is None:
                configuration.circuit, configuration.branch = circuit, before + curve.branch_at(arc_length)

    def _nearest(self, coordinates: dict[str, np.ndarray]) -> _Configuration:
        distances = [np.max(np.abs(self.tracker.difference(coordinates, x.coordinates))) for x in self.configurations]
        return self.configurations[int(np.argmin(distances))]

    def result(self, circuits: tuple[Curve, ...]) -> Assemblies:
        """Return the assemblies in the order of their distance from the starting guess."""
        guess = {name: np.asarray(x)[..., 0] for name, x in self.model.guess.items()}
        distances = [float(np.linalg.norm(self.tracker.difference(x.coordinates, guess))) for x in self.configurations]
        order = np.argsort(distances, kind="stable").tolist()
        ranked = [k for k in dict.fromkeys(self.configurations[k].circuit for k in order) if k is not None]
        members = []
        for number, k in enumerate(order, start=1):
            x = self.configurations[k]
            circuit = None if x.circuit is None else ranked.index(x.circuit) + 1
            mechanism = posed(self.mechanism, x.coordinates)
            members.append(Assembly(number, mechanism, circuit, x.branch, x.hits, distances[k], x.smallest))
        ranked_circuits = tuple(circuits[k - 1] for k in ranked)
        return Assemblies(members, self.starts, self.since_last_new, ranked_circuits, self.movable)
