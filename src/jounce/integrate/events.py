"""Events: instants at which a quantity of the motion crosses a value, found on the polynomials of the steps."""

import dataclasses
import math
from typing import Any

import jax.numpy as jnp
import numpy as np

from jounce.errors import MechanismError
from jounce.jet import Jet
from jounce.kinematics.compilation import compiled
from jounce.mechanism import AbstractOutput
from jounce.mechanism.system import Group

SMALL_BATCH, LARGE_BATCH = 16, 64  # evaluated together
REAL = 1e-4  # of a step: an imaginary part below may be that of a real root of several, blurred by rounding
FAINT = 1e-14  # of a polynomial's coefficients: values below are rounding
BESIDE = 1e-3  # of a step: where the sign is looked at beside a root
EDGE = 1e-9  # of a step: a root at its very end may be found just beyond it, and then again in the next step


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
    component : int, default 0
        Of a vector output.
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
    >>> jn.Event(jn.AngleOutput("rod"), direction=1).terminal
    False
    """

    output: AbstractOutput
    value: float = 0.0
    derivative: int = 0
    component: int = 0
    direction: int = 0
    terminal: bool = False

    def __post_init__(self):
        if not isinstance(self.output, AbstractOutput):
            message = "an event watches an output of the poses of bodies, such as AngleOutput"
            raise MechanismError(message, name="output", value=self.output)
        if not (isinstance(self.value, int | float) and math.isfinite(self.value)):
            raise MechanismError("must be a finite number", name="value", value=self.value)
        for name in ("derivative", "component"):
            number = getattr(self, name)
            if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number <= 4:
                raise MechanismError("must be a whole number from 0 to 4", name=name, value=number)
        if self.direction not in (-1, 0, 1):
            raise MechanismError("must be -1, 0 or 1", name="direction", value=self.direction)


@compiled("pose_type")
def output_series(group: Group, coordinates: dict[str, Any], pose_type: type) -> Any:
    """Return the Taylor coefficients of outputs, (order + 1, components, instances, batch)."""
    pose = pose_type.from_coordinates({name: Jet(tuple(c)) for name, c in coordinates.items()})
    return jnp.stack(group.evaluate(pose).dense().coefficients)


def series_of(group: Group, coordinates: dict[str, Any], pose_type: type) -> np.ndarray:
    """Return `output_series` of a batch of any size, (order + 1, components, batch), compiled for two sizes only."""
    count = coordinates["position"].shape[-1]
    width = SMALL_BATCH if count <= SMALL_BATCH else LARGE_BATCH
    parts = []
    for first in range(0, count, width):
        lanes = np.minimum(np.arange(first, first + width), count - 1)
        taken = {name: part[..., lanes] for name, part in coordinates.items()}
        parts.append(np.asarray(output_series(group, taken, pose_type))[:, :, 0])
    return np.concatenate(parts, axis=-1)[..., :count]


def whole_turns(values: np.ndarray, rises: np.ndarray, before: float | None = None) -> np.ndarray:
    """Return what to add to angles known up to whole turns, one per step, to make them continuous.

    Parameters
    ----------
    values : array of shape (steps,)
        Angles at the beginnings of steps, rad.
    rises : array of shape (steps,)
        By how much they grow in the steps, rad.
    before : float, optional
        The continuous angle at the beginning of the first step, where steps went before.
    """
    arrived = values[:-1] + rises[:-1]
    arrived = np.append(values[0] if before is None else before, arrived)
    jumps = np.round((arrived - values) / (2 * np.pi))
    return 2 * np.pi * np.cumsum(jumps)


class Watch:
    """The crossings of one event along a run, of which the steps come piece by piece.

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
        self.event, self._group, self._pose_type = event, group, pose_type
        self._angle: float | None = None  # at the end of the steps so far, turns counted
        self._last = math.nan, 0.0  # time and sense of the last crossing in either direction
        self._begun = False

    def look(self, start: np.ndarray, length: np.ndarray, coordinates: dict[str, Any]) -> list[tuple[int, float]]:
        """Return the crossings in the next steps, each as the number of the step and the time from its beginning.

        Parameters
        ----------
        start, length : array of shape (steps,)
            s; lengths are negative backward in time.
        coordinates : dict of str to array
            Taylor coefficients of the poses, order first and steps last.
        """
        series = series_of(self._group, coordinates, self._pose_type)[:, self.event.component]
        powers = length ** np.arange(len(series))[:, None]
        if self._group.element.turning:
            rises = (series * powers)[1:].sum(axis=0)
            series[0] += whole_turns(series[0], rises, self._angle)
            self._angle = float(series[0, -1] + rises[-1])
        for _ in range(self.event.derivative):
            series = series[1:] * np.arange(1.0, len(series))[:, None]
        if len(series) < 2:
            message = "the polynomials of this method's steps have no such derivative that varies"
            raise MechanismError(message, name="events.derivative", value=self.event.derivative)
        scaled = series * powers[: len(series)]  # a step goes from 0 to 1
        scaled[0] -= self.event.value
        found = []
        for k in np.flatnonzero(np.abs(scaled[0]) <= 1.001 * np.abs(scaled[1:]).sum(axis=0)):
            for root, sense in crossings(scaled[:, k], first=k == 0 and not self._begun):
                after, rising = float(root * length[k]), float(sense * np.sign(length[k]))
                again = self._last[1] == rising and abs(start[k] + after - self._last[0]) < 2 * EDGE * abs(length[k])
                self._last = float(start[k] + after), rising
                if not again and self.event.direction * rising >= 0:
                    found.append((int(k), after))
        self._begun = True
        return found


def crossings(coefficients: np.ndarray, *, first: bool = False) -> list[tuple[float, float]]:
    """Return where a polynomial changes its sign in [0, 1], and the sense: 1 where it rises through zero.

    Places at which it touches zero and turns back do not count.

    Parameters
    ----------
    coefficients : array of shape (order + 1,)
        Lowest first.
    first : bool, default False
        Whether a sign change at 0 itself does not count: there the polynomial begins.

    Examples
    --------
    >>> crossings(np.array([-0.25, 1.0]))
    [(0.25, 1.0)]
    >>> crossings(np.array([0.25, -1.0, 1.0]))
    []
    """
    size = np.abs(coefficients).max()
    if not size or not np.isfinite(size):
        return []
    polynomial, faint = np.polynomial.Polynomial(coefficients), FAINT * size
    places = _real_roots(coefficients, size)
    if first and abs(coefficients[0]) <= faint:
        places = np.append(places, 0.0)
    clusters: list[list[float]] = []
    for place in np.sort(places):
        # roots between which the polynomial stays at rounding are one place
        if clusters and abs(polynomial(0.5 * (clusters[-1][-1] + place))) <= faint:
            clusters[-1].append(float(place))
        else:
            clusters.append([float(place)])
    edges = [(a[-1] + b[0]) / 2 for a, b in zip(clusters, clusters[1:], strict=False)]
    found = []
    for cluster, before, after in zip(clusters, [None, *edges], [*edges, None], strict=True):
        place = cluster[len(cluster) // 2]
        low = polynomial(cluster[0] - BESIDE if before is None else max(before, cluster[0] - BESIDE))
        high = polynomial(cluster[-1] + BESIDE if after is None else min(after, cluster[-1] + BESIDE))
        if low * high < 0 and -EDGE <= place <= 1 + EDGE and not (first and 0.0 in cluster):
            found.append((min(max(place, 0.0), 1.0), float(np.sign(high))))
    return found


def _real_roots(coefficients: np.ndarray, size: float) -> np.ndarray:
    """Return the roots of a polynomial that may be real, in and about [0, 1], each corrected by Newton's method."""
    last = np.flatnonzero(np.abs(coefficients) > 1e-17 * size)[-1]  # what is below rounding has no root near
    polynomial = np.polynomial.Polynomial(coefficients[: last + 1])
    roots = polynomial.roots() if last else np.zeros(0)
    real = np.real(roots[(np.abs(np.imag(roots)) <= REAL) & (np.abs(np.real(roots) - 0.5) < 0.5 + 10 * BESIDE)])
    slope = polynomial.deriv()
    for _ in range(2):
        rate = slope(real)
        step = np.where(rate != 0, polynomial(real) / np.where(rate == 0, 1.0, rate), 0.0)
        real = real - np.where(np.abs(step) < BESIDE, step, 0.0)
    return np.unique(real)
