"""The result of a trace: a curve of configurations, its limit positions and change points, and outputs along it."""

import bisect
import dataclasses
import itertools
from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from jounce.base.display import Displayed
from jounce.errors import MechanismError
from jounce.execution.chunks import in_chunks
from jounce.jet.derivatives import plain_derivatives
from jounce.jet.turns import WHOLE_TURN
from jounce.kinematics.continuation.path_following import within_steps
from jounce.kinematics.curves.crossings import ChangePoint, departed
from jounce.kinematics.curves.limits import CurveBranch, LimitPosition, limits_between, values_between
from jounce.kinematics.curves.path import End, Path, step_to_configuration, track_both_directions
from jounce.kinematics.curves.path_tracker import LANES, CurvePoint, PathTracker, with_angular_velocity
from jounce.kinematics.curves.start import Freed, freed, posed, start_of_curve
from jounce.kinematics.results.motion import Motion
from jounce.kinematics.results.pose_outputs import output_values
from jounce.kinematics.status import Status
from jounce.mechanism import AbstractOutput, Mechanism
from jounce.mechanism.outputs.base import AbstractMotionOutput, lost_orders
from jounce.mechanism.transmissions.axis_angles import AttitudeHistory

if TYPE_CHECKING:
    import xarray

SAMPLES = 8  # attitudes per step for counting turns
AXES = ("point", "arc_length", "driver_value")
MOST_CURVES = 64  # in a circuit
FULL_TURN = 1e-6  # rad: tolerance of whole turns gained by the driver


class CurveSettings(NamedTuple):
    """Extent and resolution of a traced curve."""

    order: int = 0  # of derivatives of outputs with respect to arc length
    count: int = 2  # of points of the dataset
    length: float = 200.0  # largest arc length of a curve that does not close


class Curve(Displayed):
    """A curve of configurations of a mechanism with one free driver, by arc length.

    Arc length counts the shifts of the origins of all bodies, in sizes of the mechanism, and the rotations of all
    bodies, in rad: ``ds^2 = sum_b (|dr_b| / L)^2 + |dphi_b|^2`` with L as `size`.

    Attributes
    ----------
    mechanism : Mechanism
        The mechanism traced.
    driver : str or None
        Driver whose value is free; ``"time"`` if the instant is free, None if nothing is driven.
    unit : str
        Unit of the free value.
    first_value : float
        Driver value at which the trace began; a curve followed from a change point begins elsewhere.
    closed : bool
        Whether the curve returns to its start.
    ends : tuple of str
        Why the curve ends, at its start and at its stop.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        free: Freed,
        tracker: PathTracker,
        paths: tuple[Path, Path | None],
        settings: CurveSettings,
    ):
        self.mechanism, self.driver, self.unit = mechanism, free.driver, free.unit
        self._free, self._tracker, self._settings = free, tracker, settings
        self.first_value = free.value
        self._paths = paths
        forward, backward = paths
        self.closed = forward.end is End.CLOSED
        self._track = list(forward.points)
        self._crossings = list(forward.change_points)
        self.ends = (forward.end.value, forward.end.value)
        self.start, self.stop = 0.0, forward.length
        if backward is not None:
            before = backward.reversed()
            self._track = [*before.points[:-1], *self._track]
            self._crossings = [*before.change_points, *self._crossings]
            self.start, self.ends = -backward.length, (backward.end.value, forward.end.value)

    def __repr__(self) -> str:
        title = f"{self.mechanism.title}: " if self.mechanism.title else ""
        shape = "closed" if self.closed else "open"
        counts = f"{len(self.limits)} limit positions, {len(self.change_points)} change points"
        return f"<Curve {title}{shape}, length {self.length:.6g}, {counts}>"

    def sampled(self, order: int, count: int) -> "Curve":
        """Return the curve with outputs of another order at another number of points."""
        settings = self._settings._replace(order=order, count=count)
        return Curve(self.mechanism, self._free, self._tracker, self._paths, settings)

    @property
    def size(self) -> float:
        """Length by which shifts are divided in arc length, m."""
        return self._tracker.model.length

    @property
    def length(self) -> float:
        """Arc length from end to end, or once around."""
        return self.stop - self.start

    @property
    def _steps(self) -> list[tuple[CurvePoint, float]]:
        """The solved points, each with the arc length up to which its series is used."""
        return list(zip(self._track, [*(point.arc_length for point in self._track[1:]), self.stop], strict=True))

    @cached_property
    def limits(self) -> tuple[LimitPosition, ...]:
        """Limit positions in the order of arc length, located to rounding; empty if nothing is driven."""
        if self.driver is None:
            return ()
        positions = [x for step in self._steps for x in limits_between(*step, self._tracker.value_scale)]
        return tuple(sorted(positions, key=lambda x: x.arc_length))

    @property
    def turning_points(self) -> tuple[LimitPosition, ...]:
        """Limit positions at which the driver turns back."""
        return tuple(x for x in self.limits if x.kind != "stationary")

    @property
    def change_points(self) -> tuple[ChangePoint, ...]:
        """Change points, where branches cross, in the order of arc length."""
        return tuple(self._crossings)

    @property
    def turns(self) -> int:
        """Whole turns that an angular driver gains once around a closed curve, negative for backward ones."""
        if not self.closed or self.unit != "rad":
            return 0
        gained = (self.value(self.stop) - self.value(self.start)) / WHOLE_TURN
        return round(gained) if abs(gained - round(gained)) * WHOLE_TURN < FULL_TURN else 0

    @cached_property
    def branches(self) -> tuple[CurveBranch, ...]:
        """Branches of this circuit, the one with the start first; a single one if the driver never turns back."""
        if self.driver is None:
            return ()
        ends = [(x.arc_length, x.value) for x in self.turning_points]
        if self.closed and ends:
            ends = [(ends[-1][0] - self.length, ends[-1][1] - self._gain), *ends]  # over the start
        else:
            ends = [(self.start, self.value(self.start)), *ends, (self.stop, self.value(self.stop))]
        branches = [CurveBranch(a, b, *sorted((v, w))) for (a, v), (b, w) in itertools.pairwise(ends)]
        holding = next((k for k, x in enumerate(branches) if x.start <= 0 <= x.stop), 0)
        return tuple(branches[holding:] + branches[:holding])

    @property
    def range(self) -> tuple[float, float]:
        """Smallest and largest value of the driver on the branch with the start; infinite for whole turns."""
        if self.driver is None or (self.turns and not self.turning_points):
            return (-np.inf, np.inf)
        return self.branches[0].low, self.branches[0].high

    def value(self, arc_length: float) -> float:
        """Return the value of the driver at an arc length."""
        gain, reduced = 0.0, self._around(arc_length)
        if self.closed and self.driver is not None:
            gain = (arc_length - reduced) / self.length * self._gain
        return float(self._at(reduced).value[0]) + gain

    @cached_property
    def _gain(self) -> float:
        last = self._track[-1]
        return float(last.recentered(self.stop - last.arc_length, 20).value[0]) - float(self._track[0].value[0])

    def _around(self, arc_length: float) -> float:
        if self.closed and not self.start <= arc_length <= self.stop:
            return self.start + (arc_length - self.start) % self.length
        return arc_length

    def _at(self, arc_length: float) -> CurvePoint:
        """Return the point at an arc length by the series of the nearest solved point."""
        arc_lengths = [point.arc_length for point in self._track]
        after = bisect.bisect_left(arc_lengths, arc_length)
        nearest = min(self._track[max(after - 1, 0) : after + 1], key=lambda p: abs(p.arc_length - arc_length))
        return nearest.recentered(arc_length - nearest.arc_length)

    def at(self, arc_length: float) -> Mechanism:
        """Return the mechanism with the configuration at an arc length as its starting guess.

        Raises
        ------
        MechanismError
            If the arc length is outside of the curve.
        """
        slack = 1e-9 * max(1.0, self.length)
        if not self.closed and not self.start - slack <= arc_length <= self.stop + slack:
            message = f"the curve goes from {self.start:g} to {self.stop:g}"
            raise MechanismError(message, name="arc_length", value=arc_length)
        return posed(self.mechanism, self.coordinates_at(arc_length))

    def where(self, value: float) -> list[float]:
        """Return the arc lengths at which the driver has a value; whole turns of an angle do not count."""
        if self.driver is None:
            return []
        period = WHOLE_TURN if self.unit == "rad" else None
        return [s for point, stop in self._steps for s in values_between(point, stop, value, period)]

    def branch_at(self, arc_length: float) -> int:
        """Return the number, from 1, of the branch at an arc length."""
        for number, branch in enumerate(self.branches, start=1):
            candidates = (arc_length, arc_length - self.length) if self.closed else (arc_length,)
            if any(branch.start <= s <= branch.stop for s in candidates):
                return number
        return 1

    def coordinates_at(self, arc_length: float) -> dict[str, np.ndarray]:
        """Return the coordinates of all bodies at an arc length, the ground first, shape (..., bodies)."""
        point = self._at(self._around(arc_length))
        return {name: c[0] for name, c in point.coordinates.items()}

    def passes(self, coordinates: dict[str, np.ndarray]) -> bool:
        """Return whether the curve passes through a configuration."""
        steps = ((point, stop - point.arc_length) for point, stop in self._steps)
        return any(step_to_configuration(self._tracker, *step, coordinates) is not None for step in steps)

    def connected(self) -> tuple["Curve", ...]:
        """Return the whole circuit: this curve and all curves connected with it by change points."""
        curves: list[Curve] = [self]
        pending: list[Curve] = [self]
        while pending and len(curves) < MOST_CURVES:
            curve = pending.pop()
            for number, point in enumerate(curve.change_points):
                for branch in range(1, len(point.tangents)):
                    other = curve.follow(number, branch)
                    if not any(member.passes(other.coordinates_at(0.0)) for member in curves):
                        curves.append(other)
                        pending.append(other)
        return tuple(curves)

    def follow(self, change_point: int, branch: int = 1) -> "Curve":
        """Return the curve of another branch through a change point.

        Parameters
        ----------
        change_point : int
            Index in `change_points`.
        branch : int, default 1
            Index in its `tangents`; that of this curve is 0.

        Raises
        ------
        MechanismError
            If there is no such change point or branch.
        SolveError
            If the curve does not follow the tangent of the branch.
        """
        point = _one_of(self.change_points, change_point, "change_point", "change points")
        _one_of(point.tangents, branch, "branch", "branches")
        start = departed(self._tracker, point, branch)
        paths = track_both_directions(self._tracker, start, self._settings.length)
        return Curve(self.mechanism, self._free, self._tracker, paths, self._settings)

    def directions(self, change_point: int) -> list[dict[str, tuple[np.ndarray, np.ndarray]]]:
        """Return the motion of all bodies along each branch through a change point, per unit of arc length.

        Parameters
        ----------
        change_point : int
            Index in `change_points`.

        Returns
        -------
        list of dict
            For each branch, this curve first: shift and rotation of each body by name, (2,) or (3,) in m, and (1,) or
            (3,) in rad about the axes of the body. The signs of the other branches are arbitrary.
        """
        point = _one_of(self.change_points, change_point, "change_point", "change points")
        directions = [self._tracker.parts(tangent) for tangent in point.tangents]
        names = list(enumerate(self.mechanism.bodies, start=1))
        return [{name: (shift[:, k], turn[:, k]) for k, name in names} for shift, turn in directions]

    @cached_property
    def arc_lengths(self) -> Float[np.ndarray, " point"]:
        """Arc lengths of the points of the dataset: evenly spaced ones, limit positions and change points."""
        special = [x.arc_length for x in (*self.limits, *self.change_points)]
        even = np.linspace(self.start, self.stop, self._settings.count)
        spacing = self.length / max(1, self._settings.count - 1)
        extra = np.array([s for s in special if np.min(np.abs(even - s)) > 1e-9 * spacing])
        return np.sort(np.concatenate([even, extra]))

    @cached_property
    def _points(self) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """Taylor coefficients of the coordinates and of the driver value at the points, points last."""
        points = [self._at(s) for s in self.arc_lengths]
        names = points[0].coordinates
        coordinates = {name: np.stack([p.coordinates[name] for p in points], axis=-1) for name in names}
        return coordinates, np.stack([p.value for p in points], axis=-1)

    @cached_property
    def _motion(self) -> Motion:
        """The curve as a motion with arc length in the place of time, which evaluates outputs."""
        posed_outputs = {k: v for k, v in self.mechanism.outputs.items() if not isinstance(v, AbstractMotionOutput)}
        conflicts = set(posed_outputs) & set(AXES)
        if conflicts:
            message = f"the name '{min(conflicts)}' is that of an axis of a curve"
            raise MechanismError(message, name=f"outputs.{min(conflicts)}")
        mechanism = dataclasses.replace(self._free.mechanism, outputs=posed_outputs)
        order = self._settings.order
        levels = order + lost_orders(posed_outputs.values()) + 1
        coordinates = with_angular_velocity({name: c[:levels] for name, c in self._points[0].items()})
        model, instants, history = self._tracker.model, self.arc_lengths, self._history
        groups = model.system.outputs if history is None else history.counting(model.system.outputs, instants)
        series = output_values(groups, coordinates, model.pose_type)
        status = np.full(len(instants), int(Status.OK))
        return Motion(mechanism, model, instants, order, (coordinates, series), status, {}, (), history)

    @cached_property
    def _history(self) -> AttitudeHistory | None:
        if self._tracker.is_planar:
            return None
        instants = within_steps(np.array([*(point.arc_length for point in self._track), self.stop]), SAMPLES)
        quaternions = [self._at(s).coordinates["quaternion"][0] for s in instants]
        return AttitudeHistory(np.stack(quaternions, axis=-1), instants)

    @cached_property
    def values(self) -> Float[np.ndarray, "point derivative"]:
        """Driver value and its derivatives with respect to arc length at the points."""
        return np.asarray(plain_derivatives(self._points[1][: self._settings.order + 1])).T

    @cached_property
    def smallest_singular_values(self) -> Float[np.ndarray, " point"]:
        """Smallest singular values of the scaled Jacobian with the driver held, at the points; zero at dead points."""
        points = [self._at(s) for s in self.arc_lengths]
        points = [dataclasses.replace(point, rows=points[0].rows) for point in points]

        def jacobians(lanes: Int[np.ndarray, " lane"]) -> np.ndarray:
            batch = self._tracker.points([points[k] for k in lanes], np.zeros(len(lanes)), corrected=False)
            return batch.jacobian[:, : self._tracker.columns]

        matrices = in_chunks(jacobians, len(points), (LANES,), threads=1)
        return np.linalg.svd(np.moveaxis(matrices, -1, 0), compute_uv=False)[:, -1]

    @cached_property
    def outputs(self) -> Mapping[str, np.ndarray]:
        """Outputs by name, with derivatives with respect to arc length: (point, derivative) or with components."""
        return self._motion.outputs

    @cached_property
    def dataset(self) -> "xarray.Dataset":
        """Outputs as an `xarray.Dataset` with dimensions point, derivative and component.

        The coordinates of a point are ``arc_length`` and, if something is driven, ``driver_value``. Derivatives are
        with respect to arc length. Limit positions and change points are among the points.
        """
        dataset = self._motion.dataset.rename(time="point")
        coordinates = {"arc_length": ("point", self.arc_lengths, {"units": "1", "long_name": "arc length"})}
        if self.driver is not None:
            attributes = {"units": self.unit, "long_name": f"value of the driver {self.driver}"}
            coordinates["driver_value"] = ("point", self.values[:, 0], attributes)
        dataset = dataset.assign_coords({"point": np.arange(len(self.arc_lengths)), **coordinates})
        dataset["derivative"].attrs = {"long_name": "order of the derivative with respect to arc length"}
        dataset.attrs |= {"title": self.mechanism.title or "curve of a mechanism", "closed": int(self.closed)}
        dataset.attrs |= {"limit_positions": np.array([x.value for x in self.limits])}
        return dataset

    def evaluate(self, output: AbstractOutput, name: str = "output") -> "xarray.DataArray":
        """Return any output along the curve, as an `xarray.DataArray`."""
        return self._motion.evaluate(output, name).rename(time="point")


def curve_through(
    mechanism: Mechanism, instant: float, driver: str | None, settings: CurveSettings | None = None
) -> Curve:
    """Return the curve of a mechanism through its starting guess."""
    free, settings = freed(mechanism, instant, driver), settings or CurveSettings()
    tracker, start = start_of_curve(free)
    return Curve(mechanism, free, tracker, track_both_directions(tracker, start, settings.length), settings)


def _one_of(items: Any, number: Any, name: str, noun: str) -> Any:
    """Return an item by index, or raise MechanismError."""
    if not isinstance(number, int) or isinstance(number, bool) or not 0 <= number < len(items):
        range_words = f"there are {len(items)}, counted from 0" if len(items) else "there are none"
        raise MechanismError(f"no such one among the {noun}: {range_words}", name=name, value=number)
    return items[number]
