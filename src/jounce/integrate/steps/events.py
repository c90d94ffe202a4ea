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
NODES = 0.5 + 0.5 * np.cos(_ANGLES)  # Chebyshev nodes in a step, or in a piece of one
INTERPOLATION = np.cos(np.arange(20)[:, None] * _ANGLES) * np.where(np.arange(20) == 0, 0.05, 0.1)[:, None]
ENDS = np.array([0.0, 1.0])  # where polynomials are compared with the outputs that they stand for
AT_ENDS = np.stack([(-1.0) ** np.arange(20), np.ones(20)])  # values of the Chebyshev polynomials there
LAST = 4  # coefficients of a polynomial whose size tells how accurate it is
RESOLVED = 1e-12  # a piece is resolved where they are less than this part of its largest value
LEAST = 1e-3  # part of the largest value in a step that the one in a piece counts as at least: below it is rounding
BLURRED = 1e-8  # last coefficients below this that are no smaller on half a piece are rounding errors
SPLITS = 40  # halvings of a step: they find a kink of a distance, or half a turn of an angle at once
MOST_PIECES = 256  # pieces of a step on average
WIDTHS = (64,)  # instants evaluated together: one program serves few and many
REAL = 1e-4  # part of a step: a smaller imaginary part may be that of a multiple real root, blurred by rounding
FAINT = 1e-14  # part of the coefficients of a polynomial: smaller values are rounding errors
NEIGHBORHOOD = 1e-3  # part of a step: distance from a root at which the sign is looked at
EDGE = 1e-9  # part of a step: a root at its very end may be found just beyond it, and again in the next step


@dataclasses.dataclass(frozen=True)
class Event:
    """A crossing of a value by an output, or by one of its derivatives.

    What begins at the value, or touches it and turns back, does not cross it. Turns of angles count.

    Parameters
    ----------
    output : AbstractOutput
        Any output, also one of a user's own: its value is a function on the jets of bodies.
    value : float, default 0
        That is crossed, in the unit of the output (of its derivative).
    derivative : int, default 0
        Which time derivative crosses it: 1 with value 0 finds turning points.
    component : int or str, default 0
        Of a vector output: counted from 0, or as datasets call it, such as ``"y"``.
    direction : int, default 0
        1 for rising crossings only, -1 for falling ones, 0 for both; as time goes on, also in a run backward.
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
        counted = {} if isinstance(self.component, str) else {"component": 4}
        check_crossing(self, MechanismError, derivative=4, **counted)


def check_crossing(event: Any, error: type[JounceError], **most: int) -> None:
    """Raise an error unless the value, the direction and whole numbers of an event, up to some limits, are valid.

    The value becomes a number of Python, whichever it is.
    """
    number = real_numbers("value", event.value, error, "a finite number")
    if number.ndim or not np.isfinite(number):
        raise error("must be a finite number", name="value", value=event.value)
    object.__setattr__(event, "value", float(number))
    for name, limit in most.items():
        whole_number(name, getattr(event, name), most=limit, error=error)
    if event.direction not in (-1, 0, 1):
        raise error("must be -1, 0 or 1", name="direction", value=event.direction)


def pose_coordinates(state: State) -> dict[str, Any]:
    """Return Taylor coefficients of states, order first, as those of the pose of all bodies, the ground first.

    Those that JAX does not trace become arrays of NumPy.
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
        Of each piece, as shares of its step.
    series : array of shape (levels, components, instances, pieces, nodes)
        Taylor coefficients of the outputs.
    """

    step: Int[np.ndarray, " piece"]
    begin: Float[np.ndarray, " piece"]
    end: Float[np.ndarray, " piece"]
    series: Float[np.ndarray, "levels component instance piece node"]

    def time(self, start: Float[np.ndarray, " step"], length: Float[np.ndarray, " step"]) -> Any:
        """Return the times of all nodes one after another, from where steps begin and how long they are, s."""
        share = self.begin[:, None] + (self.end - self.begin)[:, None] * NODES
        return (start[self.step][:, None] + share * length[self.step][:, None]).ravel()


def in_pieces(
    group: Group,
    polynomial: State,
    length: Float[np.ndarray, " step"],
    order: int,
    pose_type: type,
    judged: Callable[[np.ndarray], Float[np.ndarray, "*quantity piece node"]],
) -> Pieces:
    """Return outputs in pieces of steps, so short that polynomials through their nodes are the outputs.

    Steps reach a small part of where the series of the motion converge, not those of outputs: the distance of points
    that pass each other, or an angle about an axis that a vector passes, changes in a small part of a step.

    Parameters
    ----------
    group : Group
        Outputs.
    polynomial : State
        Coefficients in the time from the beginnings of steps, (steps, coefficients, components, bodies).
    length : array of shape (steps,)
        Of the steps, s.
    order : int
        Highest coefficient of the outputs; what is shorter by nature is as long as it can be.
    pose_type : type
        PlanarPose or SpatialPose.
    judged : callable
        Returns of their series what polynomials must follow, the nodes last.
    """
    count = len(length)
    step, begin, end = np.arange(count), np.zeros(count), np.ones(count)
    size, before, whole = None, np.full(count, np.inf), []
    for split in range(SPLITS + 1):
        share = begin[:, None] + (end - begin)[:, None] * np.concatenate([NODES, ENDS])
        own = polynomial.map(lambda part, of=step: part[of])
        series = _at(group, own, length[step][:, None] * share, order, pose_type)
        size, left = _unresolved(judged(series).reshape(-1, *share.shape), step, size)
        wide = (left > RESOLVED) & ~((left < BLURRED) & (left > 0.25 * before))
        if split == SPLITS or len(step) + np.count_nonzero(wide) > MOST_PIECES * count:
            wide[:] = False
        whole.append(Pieces(step[~wide], begin[~wide], end[~wide], series[..., ~wide, :-2]))
        if not wide.any():
            break
        middle = 0.5 * (begin[wide] + end[wide])
        begin, end = np.concatenate([begin[wide], middle]), np.concatenate([middle, end[wide]])
        step, before = np.tile(step[wide], 2), np.tile(left[wide], 2)
    step, begin, end = (np.concatenate([getattr(part, name) for part in whole]) for name in ("step", "begin", "end"))
    series, turn = np.concatenate([part.series for part in whole], axis=-2), np.lexsort((begin, step))
    return Pieces(step[turn], begin[turn], end[turn], series[..., turn, :])


def _unresolved(
    values: Float[np.ndarray, "quantity piece places"], step: Int[np.ndarray, " piece"], size: Any
) -> tuple[Float[np.ndarray, "quantity step"], Float[np.ndarray, " piece"]]:
    """Return how far polynomials through the nodes of pieces are from quantities, as a part of these.

    Also return how large the quantities are in the steps, which is found from the steps themselves, where it is None.
    """
    coefficients = values[..., :-2] @ INTERPOLATION.T
    local = np.abs(coefficients).max(axis=-1)
    size = local if size is None else size
    difference = np.abs(coefficients @ AT_ENDS.T - values[..., -2:]).max(axis=-1)
    last = np.abs(coefficients[..., -LAST:]).max(axis=-1)
    scale = np.maximum(np.maximum(local, LEAST * size[..., step]), 1e-300)
    return size, (np.maximum(last, difference) / scale).max(axis=0, initial=0.0)


def _at(
    group: Group, polynomial: State, since: Float[np.ndarray, "piece node"], order: int, pose_type: type
) -> Float[np.ndarray, "levels component instance piece node"]:
    """Return outputs at times into steps as Taylor coefficients.

    A few at many places cost less than many at one: the program for high orders of an angle takes minutes to compile.
    """
    count = polynomial.position.shape[1]
    j, k = np.arange(order + 1)[:, None], np.arange(count)
    powers = since ** np.maximum(k - j, 0)[:, :, None, None]
    binomials = np.array([[math.comb(b, a) for b in range(count)] for a in range(order + 1)], float)
    weights = binomials[:, :, None, None] * powers
    shifted = (np.einsum("jksn,skcb->jcbsn", weights, part) for part in polynomial)
    coordinates = pose_coordinates(State(*(part.reshape(*part.shape[:3], -1) for part in shifted)))
    (series,) = series_of((group,), coordinates, pose_type)
    return series.reshape(*series.shape[:3], *since.shape)


class AbstractDetector(abc.ABC):
    """The crossings of one event, an Event or JointEvent, along a run, of which the steps come piece by piece."""

    def __init__(self, event: Any):
        self.event = event
        self._last = math.nan, 0.0  # time and sense of the last crossing in either direction
        self._begun = False

    @abc.abstractmethod
    def detect(self, part: Any) -> list[tuple[int, float]]:
        """Return the crossings in the next steps, each as the number of the step and the time from its beginning."""

    def _crossings(
        self, values: Float[np.ndarray, "piece node"], pieces: Iterable[tuple[int, float, float]], part: Any
    ) -> list[tuple[int, float]]:
        """Return the crossings in pieces of steps: their steps, and where they begin and end as shares of these."""
        events = []
        for (k, begin, end), coefficients in zip(pieces, (values - self.event.value) @ INTERPOLATION.T, strict=True):
            length = part.length[k]
            for root, direction in crossings(coefficients, first=not self._begun):
                after, rising = float((begin + root * (end - begin)) * length), float(direction * np.sign(length))
                again = self._last[1] == rising and abs(part.start[k] + after - self._last[0]) < 2 * EDGE * abs(length)
                self._last = float(part.start[k] + after), rising
                if not again and self.event.direction * rising >= 0:
                    events.append((k, after))
            self._begun = True
        return events


class EventDetector(AbstractDetector):
    """The crossings of one event of a mechanism.

    Parameters
    ----------
    event : Event
        What is looked for.
    group : Group
        Its output, as a group of one.
    pose_type : type
        PlanarPose or SpatialPose.
    """

    def __init__(self, event: Event, group: Group, pose_type: type):
        super().__init__(event)
        self._group, self._pose_type = group, pose_type
        self._angle = np.zeros((3, 0))  # time, angle with its turns, and rate, at the last node so far

    def detect(self, part: Any) -> list[tuple[int, float]]:
        """See `AbstractDetector`."""
        start, length = part.start, part.length
        derivative, element = self.event.derivative, self._group.element
        order, component = derivative + element.lost_orders + 1, self.event.component
        smooth = max(derivative, 1) if element.turning else derivative  # rates have no whole turns
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
    """Return where a polynomial changes its sign in [0, 1], and the sense: 1 where it rises through zero.

    Places at which it touches zero and turns back do not count.

    Parameters
    ----------
    coefficients : array of shape (order + 1,)
        Of Chebyshev polynomials on [0, 1], lowest first.
    first : bool, default False
        Whether a sign change at 0 itself does not count: there the polynomial begins.

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
        # roots between which the polynomial stays at rounding are one place
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
    """Return the roots of a polynomial that may be real, in and about [0, 1], each corrected by Newton's method."""
    sizes = np.abs(polynomial.coef)
    last = np.flatnonzero(sizes > 1e-17 * sizes.max())[-1]  # what is below rounding has no root near
    polynomial = polynomial.truncate(last + 1)
    roots = polynomial.roots() if last else np.zeros(0)
    real = np.real(roots[(np.abs(np.imag(roots)) <= REAL) & (np.abs(np.real(roots) - 0.5) < 0.5 + 10 * NEIGHBORHOOD)])
    slope = polynomial.deriv()
    for _ in range(2):
        rate = slope(real)
        step = np.where(rate != 0, polynomial(real) / np.where(rate == 0, 1.0, rate), 0.0)
        real = real - np.where(np.abs(step) < NEIGHBORHOOD, step, 0.0)
    return np.unique(real)
