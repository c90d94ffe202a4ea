"""Events: instants at which a quantity of the motion crosses a value, found on the polynomials of the steps."""

import abc
import dataclasses
import itertools
import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from jounce.base.shapes import is_traced, real_numbers
from jounce.dynamics.forward.accelerations import State
from jounce.dynamics.forward.ground import turns_with_ground, with_ground
from jounce.dynamics.motion_values import Coordinates
from jounce.errors import JounceError, MechanismError, whole_number
from jounce.execution.chunks import in_chunks
from jounce.jet.turns import counted_by_rates
from jounce.kinematics.results.pose_outputs import output_series
from jounce.mechanism import AbstractOutput
from jounce.mechanism.system import Group

_ANGLES = np.pi * (np.arange(20)[::-1] + 0.5) / 20
NODES = 0.5 + 0.5 * np.cos(_ANGLES)  # Chebyshev nodes in a step, or in a piece of it
INTERPOLATION = np.cos(np.arange(20)[:, None] * _ANGLES) * np.where(np.arange(20) == 0, 0.05, 0.1)[:, None]
ENDS = np.array([0.0, 1.0])  # points at which polynomials are compared with the outputs that they interpolate
AT_ENDS = np.stack([(-1.0) ** np.arange(20), np.ones(20)])  # values of the Chebyshev polynomials at the ends
LAST = 4  # last coefficients of a polynomial, whose size estimates its error
RESOLVED = 1e-12  # a piece is resolved if the error is below this part of its largest value
LEAST = 1e-3  # of the largest value in a step: least size of a piece for relative errors
BLURRED = 1e-8  # last coefficients below this that do not shrink on half a piece are rounding errors
SPLITS = 40  # halvings of a step, which resolve a kink of a distance, or a sudden half turn of an angle
MOST_PIECES = 256  # pieces of a step on average
WIDTHS = (64,)  # instants evaluated together: one program serves few and many
REAL = 1e-4  # part of a step: a smaller imaginary part may be that of a multiple real root, blurred by rounding
FAINT = 1e-14  # part of the coefficients of a polynomial: smaller values are rounding errors
NEIGHBORHOOD = 1e-3  # part of a step: distance from a root at which the sign is evaluated
EDGE = 1e-9  # part of a step: a root at its very end may be found just beyond it, and again in the next step


@dataclasses.dataclass(frozen=True)
class Event:
    """A crossing of a value by an output, or by one of its derivatives.

    A quantity that begins at the value, or touches it and turns back, does not cross it. Angles count revolutions.

    Parameters
    ----------
    output : AbstractOutput
        Any output of poses, also a user-defined one.
    value : float, default 0
        The value that is crossed, in the unit of the output or its derivative.
    derivative : int, default 0
        Order of the time derivative that crosses the value; 1 with value 0 finds turning points.
    component : int or str, default 0
        Component of a vector output: an index from 0, or its name in datasets, such as ``"y"``.
    direction : int, default 0
        1 for rising crossings only, -1 for falling ones, 0 for both; with increasing time, also in a run backward.
    terminal : bool, default False
        Whether the simulation ends at the first crossing.

    Raises
    ------
    MechanismError
        If a value is not valid.

    Examples
    --------
    >>> import jounce as jn
    >>> jn.Event(jn.outputs.AngleOutput("rod"), direction=1).terminal
    False
    """

    output: Any
    value: Any = 0.0
    derivative: int = 0
    component: int | str = 0
    direction: int = 0
    terminal: bool = False

    def __post_init__(self):
        if not isinstance(self.output, AbstractOutput):
            message = "an event watches an output of the poses of bodies, such as AngleOutput"
            raise MechanismError(message, name="output", value=self.output)
        if self.output.wraps:
            message = (
                "Euler angles jump by whole turns; watch an entry of the rotation matrix, or a RelativeAngleOutput"
            )
            raise MechanismError(message, name="output", value=type(self.output).__name__)
        limits = {} if isinstance(self.component, str) else {"component": 4}
        check_crossing(self, MechanismError, derivative=4, **limits)


def check_crossing(event: Any, error: type[JounceError], **limits: int) -> None:
    """Raise `error` unless the value, the direction and the whole numbers of an event, up to their limits, are valid.

    The value is converted to a Python float.
    """
    number = real_numbers("value", event.value, error, "a finite number")
    if number.ndim or not np.isfinite(number):
        raise error("must be a finite number", name="value", value=event.value)
    object.__setattr__(event, "value", float(number))
    for name, limit in limits.items():
        whole_number(name, getattr(event, name), most=limit, error=error)
    if event.direction not in (-1, 0, 1):
        raise error("must be -1, 0 or 1", name="direction", value=event.direction)


def pose_coordinates(state: State) -> dict[str, Any]:
    """Return the coordinates of the poses of all bodies, the ground first, from Taylor coefficients of states.

    Arrays without tracers become NumPy arrays.
    """
    position, attitude, _, spin = state if is_traced(state) else state.map(np.asarray)
    if attitude.shape[1] == 1:
        return {"position": with_ground(position), "angle": with_ground(attitude)[:, 0]}
    return {
        "position": with_ground(position),
        "quaternion": turns_with_ground(attitude),
        "angular_velocity": with_ground(spin)[:-1],
    }


def series_of(
    groups: tuple[Group, ...], coordinates: Coordinates, pose_type: type
) -> tuple[Float[np.ndarray, "_ _ _ batch"], ...]:
    """Return `output_series` of a batch of any size, compiled for one size only."""

    def chunk(lanes: np.ndarray) -> Any:
        return output_series(groups, {name: part[..., lanes] for name, part in coordinates.items()}, pose_type)

    return in_chunks(chunk, coordinates["position"].shape[-1], WIDTHS)


class Pieces(NamedTuple):
    """Outputs at the nodes of pieces of steps, in the order of the steps.

    Attributes
    ----------
    step : array of int, shape (pieces,)
    begin, end : array of shape (pieces,)
        Beginning and end of each piece, as shares of its step.
    series : array of shape (levels, components, instances, pieces, nodes)
        Taylor coefficients of the outputs.
    """

    step: Int[np.ndarray, " piece"]
    begin: Float[np.ndarray, " piece"]
    end: Float[np.ndarray, " piece"]
    series: Float[np.ndarray, "levels component instance piece node"]

    def time(self, start: Float[np.ndarray, " step"], length: Float[np.ndarray, " step"]) -> Any:
        """Return the times of all nodes, flattened, from the starts and lengths of steps, s."""
        fractions = self.begin[:, None] + (self.end - self.begin)[:, None] * NODES
        return (start[self.step][:, None] + fractions * length[self.step][:, None]).ravel()


def in_pieces(
    group: Group,
    polynomial: State,
    length: Float[np.ndarray, " step"],
    order: int,
    pose_type: type,
    judged: Callable[[np.ndarray], Float[np.ndarray, "*quantity piece node"]],
) -> Pieces:
    """Return outputs in pieces of steps that are short enough for accurate interpolation by polynomials.

    Steps are well within the convergence radius of the series of the motion, but not of outputs: the distance of points
    that pass each other, or an angle about an axis that a vector passes, changes in a small part of a step.

    Parameters
    ----------
    group : Group
        Outputs.
    polynomial : State
        Coefficients in the time from the beginnings of steps, (steps, coefficients, components, bodies).
    length : array of shape (steps,)
        Lengths of the steps, s.
    order : int
        Highest coefficient of the outputs; outputs that use up derivatives have as many as possible.
    pose_type : type
        PlanarPose or SpatialPose.
    judged : callable
        Function from the series to the quantities that polynomials must interpolate, with the nodes last.
    """
    count = len(length)
    step, begin, end = np.arange(count), np.zeros(count), np.ones(count)
    size, before, finished = None, np.full(count, np.inf), []
    for split in range(SPLITS + 1):
        fractions = begin[:, None] + (end - begin)[:, None] * np.concatenate([NODES, ENDS])
        piece_series = polynomial.map(lambda part, index=step: part[index])
        series = _at(group, piece_series, length[step][:, None] * fractions, order, pose_type)
        size, errors = _unresolved(judged(series).reshape(-1, *fractions.shape), step, size)
        unresolved = (errors > RESOLVED) & ~((errors < BLURRED) & (errors > 0.25 * before))
        if split == SPLITS or len(step) + np.count_nonzero(unresolved) > MOST_PIECES * count:
            unresolved[:] = False
        finished.append(Pieces(step[~unresolved], begin[~unresolved], end[~unresolved], series[..., ~unresolved, :-2]))
        if not unresolved.any():
            break
        middle = 0.5 * (begin[unresolved] + end[unresolved])
        begin, end = np.concatenate([begin[unresolved], middle]), np.concatenate([middle, end[unresolved]])
        step, before = np.tile(step[unresolved], 2), np.tile(errors[unresolved], 2)
    step, begin, end = (np.concatenate([getattr(part, name) for part in finished]) for name in ("step", "begin", "end"))
    series, turn = np.concatenate([part.series for part in finished], axis=-2), np.lexsort((begin, step))
    return Pieces(step[turn], begin[turn], end[turn], series[..., turn, :])


def _unresolved(
    values: Float[np.ndarray, "quantity piece places"], step: Int[np.ndarray, " piece"], size: Any
) -> tuple[Float[np.ndarray, "quantity step"], Float[np.ndarray, " piece"]]:
    """Return the sizes of quantities in steps, and the relative errors of their interpolation in pieces.

    The sizes are computed if `size` is None, when the pieces are the steps themselves.
    """
    coefficients = values[..., :-2] @ INTERPOLATION.T
    local = np.abs(coefficients).max(axis=-1)
    size = local if size is None else size
    difference = np.abs(coefficients @ AT_ENDS.T - values[..., -2:]).max(axis=-1)
    last = np.abs(coefficients[..., -LAST:]).max(axis=-1)
    scale = np.maximum(np.maximum(local, LEAST * size[..., step]), 1e-300)
    return size, (np.maximum(last, difference) / scale).max(axis=0, initial=0.0)


def _at(
    group: Group, polynomial: State, elapsed: Float[np.ndarray, "piece node"], order: int, pose_type: type
) -> Float[np.ndarray, "levels component instance piece node"]:
    """Return the Taylor coefficients of outputs at times into steps.

    Low orders at many points are used instead of high orders at one, since the program for high orders of an angle
    takes minutes to compile.
    """
    count = polynomial.position.shape[1]
    j, k = np.arange(order + 1)[:, None], np.arange(count)
    powers = elapsed ** np.maximum(k - j, 0)[:, :, None, None]
    binomials = np.array([[math.comb(b, a) for b in range(count)] for a in range(order + 1)], float)
    weights = binomials[:, :, None, None] * powers
    shifted = (np.einsum("jksn,skcb->jcbsn", weights, part) for part in polynomial)
    coordinates = pose_coordinates(State(*(part.reshape(*part.shape[:3], -1) for part in shifted)))
    (series,) = series_of((group,), coordinates, pose_type)
    return series.reshape(*series.shape[:3], *elapsed.shape)


class AbstractDetector(abc.ABC):
    """A detector of the crossings of one event, an Event or JointEvent, in consecutive parts of a run."""

    def __init__(self, event: Any):
        self.event = event
        self._last = math.nan, 0.0  # time and sense of the last crossing in either direction
        self._started = False

    @abc.abstractmethod
    def detect(self, part: Any) -> list[tuple[int, float]]:
        """Return the crossings in the next steps, each as the index of the step and the time from its beginning."""

    def _crossings(
        self, values: Float[np.ndarray, "piece node"], pieces: Iterable[tuple[int, float, float]], part: Any
    ) -> list[tuple[int, float]]:
        """Return the crossings in pieces, each given by its step and by its beginning and end as shares of the step."""
        events = []
        for (k, begin, end), coefficients in zip(pieces, (values - self.event.value) @ INTERPOLATION.T, strict=True):
            length = part.length[k]
            for root, direction in crossings(coefficients, first=not self._started):
                after, sense = float((begin + root * (end - begin)) * length), float(direction * np.sign(length))
                again = self._last[1] == sense and abs(part.start[k] + after - self._last[0]) < 2 * EDGE * abs(length)
                self._last = float(part.start[k] + after), sense
                if not again and self.event.direction * sense >= 0:
                    events.append((k, after))
            self._started = True
        return events


class EventDetector(AbstractDetector):
    """The detector of one event of a mechanism.

    Parameters
    ----------
    event : Event
        The event.
    group : Group
        Its output, as a group of one.
    pose_type : type
        PlanarPose or SpatialPose.
    """

    def __init__(self, event: Event, group: Group, pose_type: type):
        super().__init__(event)
        self._group, self._pose_type = group, pose_type
        self._angle = np.zeros((3, 0))  # time, angle with revolutions, and rate at the last node so far

    def detect(self, part: Any) -> list[tuple[int, float]]:
        """See `AbstractDetector`."""
        start, length = part.start, part.length
        derivative, element = self.event.derivative, self._group.element
        order, component = derivative + element.lost_orders + 1, self.event.component
        smooth = max(derivative, 1) if element.turning else derivative  # rates have no revolutions
        pieces = in_pieces(
            self._group, part.polynomial, length, order, self._pose_type, lambda x: x[smooth : smooth + 1, component, 0]
        )
        series = pieces.series[:, component, 0]
        if len(series) <= derivative:
            raise MechanismError("the output has no such derivative", name="events.derivative", value=derivative)
        if element.turning:
            time = pieces.time(start, length)
            history = np.concatenate([self._angle, [time, series[0].ravel(), series[1].ravel()]], axis=1)
            history[1] = counted_by_rates(history[1], history[2], history[0])
            series[0] = history[1, -len(time) :].reshape(series[0].shape)
            self._angle = history[:, -1:]
        values = series[derivative] * math.factorial(derivative)
        return self._crossings(values, zip(pieces.step.tolist(), pieces.begin, pieces.end, strict=True), part)


def crossings(coefficients: Float[np.ndarray, " order"], *, first: bool = False) -> list[tuple[float, float]]:
    """Return the sign changes of a polynomial in [0, 1], each with its sense: 1 for rising, -1 for falling.

    Roots at which it touches zero and turns back do not count.

    Parameters
    ----------
    coefficients : array of shape (order + 1,)
        Coefficients of Chebyshev polynomials on [0, 1], lowest first.
    first : bool, default False
        Whether 0 is the beginning of the run, at which a sign change does not count.

    Examples
    --------
    >>> crossings(np.array([0.25, 0.5]))
    [(0.25, 1.0)]
    >>> crossings(np.array([0.125, 0.0, 0.125]))  # touches zero in the middle
    []
    """
    size = np.abs(coefficients).max()
    if not size or not np.isfinite(size) or abs(coefficients[0]) > 1.001 * np.abs(coefficients[1:]).sum():
        return []
    polynomial, faint = np.polynomial.Chebyshev(coefficients, [0, 1]), FAINT * size
    roots = _real_roots(polynomial)
    if first and abs(polynomial(0.0)) <= faint:
        roots = np.append(roots, 0.0)
    clusters: list[list[float]] = []
    for root in np.sort(roots):
        # roots between which the polynomial stays within rounding count as one
        if clusters and abs(polynomial(0.5 * (clusters[-1][-1] + root))) <= faint:
            clusters[-1].append(float(root))
        else:
            clusters.append([float(root)])
    edges = [-np.inf, *((a[-1] + b[0]) / 2 for a, b in itertools.pairwise(clusters)), np.inf]
    crossings_found = []
    for cluster, before, after in zip(clusters, edges, edges[1:], strict=False):
        root = cluster[len(cluster) // 2]
        low = polynomial(max(before, cluster[0] - NEIGHBORHOOD))
        high = polynomial(min(after, cluster[-1] + NEIGHBORHOOD))
        if low * high < 0 and -EDGE <= root <= 1 + EDGE and not (first and 0.0 in cluster):
            crossings_found.append((min(max(root, 0.0), 1.0), float(np.sign(high))))
    return crossings_found


def _real_roots(polynomial: np.polynomial.Chebyshev) -> Float[np.ndarray, " root"]:
    """Return the possibly real roots of a polynomial in and near [0, 1], each corrected by Newton's method."""
    sizes = np.abs(polynomial.coef)
    last = np.flatnonzero(sizes > 1e-17 * sizes.max())[-1]  # coefficients below rounding have no roots nearby
    polynomial = polynomial.truncate(last + 1)
    roots = polynomial.roots() if last else np.zeros(0)
    real = np.real(roots[(np.abs(np.imag(roots)) <= REAL) & (np.abs(np.real(roots) - 0.5) < 0.5 + 10 * NEIGHBORHOOD)])
    slope = polynomial.deriv()
    for _ in range(2):
        rate = slope(real)
        step = np.where(rate != 0, polynomial(real) / np.where(rate == 0, 1.0, rate), 0.0)
        real = real - np.where(np.abs(step) < NEIGHBORHOOD, step, 0.0)
    return np.unique(real)
