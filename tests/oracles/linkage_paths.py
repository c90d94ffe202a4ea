"""The branch of a linkage that its start leads to, from quadratic loop equations, proved step by step.

Written in natural coordinates (points and directions), the loop equations of a linkage are quadratic: for ``x``, the
unknowns, and ``u``, the cosine and sine of a driven angle (or a driven distance and zero), every equation is
``z^T H z = 0`` in ``z = (x, u, 1)``. Of such equations the curvature is known exactly, so that each step along the
motion can be accepted by the theorem of Newton and Kantorovich: over the whole step, between its ends too, there is one
solution in a ball about the prediction, and it is the one that the step began with (Kantorovich and Akilov, Functional
Analysis, chapter 18; Beltran and Leykin, Certified numerical homotopy tracking, 2012). What is followed in this way can
end at a dead point, and cannot change branch. Nothing here comes from jounce.
"""

import dataclasses
from typing import NamedTuple

import numpy as np

SMALLEST_STEP = 2e-14  # of the driven angle or distance: what needs smaller ones ends at a dead point
SHARPEST = 1e-9  # at the end of a motion, of the driven value: what may be left to the dead point
CONTRACTION = 0.5  # the largest that is accepted
LEAST_WEIGHT = 0.2  # of an unknown, by that of the fastest or of the driven value


class Law(NamedTuple):
    """A driven angle or distance over time, ``start + rate t + wave sin(speed t + phase)``, with rate or wave zero."""

    start: float
    rate: float
    wave: float
    speed: float
    phase: float

    def __call__(self, time):
        return self.start + self.rate * time + self.wave * np.sin(self.speed * time + self.phase)

    def turning_times(self, stop):
        """Return the instants in (0, stop) at which the law turns back."""
        if self.rate or not self.wave:
            return np.zeros(0)
        first = np.ceil((self.phase - np.pi / 2) / np.pi)
        times = (np.pi / 2 + np.pi * (first + np.arange(int(self.speed * stop / np.pi) + 2)) - self.phase) / self.speed
        return times[(times > 0) & (times < stop)]

    def series(self, time, order):
        """Return the Taylor coefficients at some instants, shape (order + 1, time)."""
        angle, factor = self.speed * time + self.phase, self.wave
        rows = [self(time)]
        for k in range(1, order + 1):
            factor *= self.speed / k
            rows.append(factor * np.sin(angle + k * np.pi / 2) + (self.rate if k == 1 else 0.0))
        return np.array(rows)


class Affine:
    """Points and directions as affine functions of ``z = (x, u, 1)``: a matrix of shape (components, unknowns + 3)."""

    def __init__(self, unknowns, components=2):
        self.unknowns, self.size, self.components = unknowns, unknowns + 3, components

    def fixed(self, *values):
        """Return a given point."""
        return self._columns([(self.size - 1, values)])

    def unknown(self, first):
        """Return the point of which the coordinates are unknowns, the first of them given."""
        return np.eye(self.size)[first : first + self.components]

    def input(self, first=(1.0, 0.0), second=(0.0, 1.0)):
        """Return ``first u_1 + second u_2``: a unit vector at the driven angle, unless others are given."""
        return self._columns([(self.unknowns, first), (self.unknowns + 1, second)])

    def _columns(self, columns):
        matrix = np.zeros((self.components, self.size))
        for column, values in columns:
            matrix[:, column] = values
        return matrix

    def product(self, a, b, value, scale=1.0):
        """Return the form that vanishes where the product of two vectors has a value, over a scale."""
        form = 0.5 * (a.T @ b + b.T @ a)
        form[-1, -1] -= value
        return form / scale

    def distance(self, a, b, length):
        """Return the form that vanishes where two points are a length apart, with a unit vector as its gradient."""
        return self.product(a - b, a - b, length**2, 2 * length)


def turned(vector, along, across):
    """Return ``along v + across (v turned by a quarter)`` of a plane vector: how a point is fixed on a link."""
    return along * vector + across * np.stack([-vector[1], vector[0]])


class Paths(NamedTuple):
    """Where the motion of each linkage leads, at every instant; NaN where it does not."""

    position: np.ndarray  # unknowns, shape (linkages, time, unknowns)
    determinant: np.ndarray  # of the scaled Jacobian, (linkages, time)
    margin: np.ndarray  # smallest size of the determinant on the way from the start to the instant, (linkages, time)
    limit: np.ndarray  # driven value at which the motion ends, NaN where it does not, (linkages,)
    proved: np.ndarray  # False where the end is none, but too close to a singular position to go on, (linkages,)
    steps: np.ndarray  # taken, (linkages,)


@dataclasses.dataclass
class State:
    """Linkages at one position, with what a step from there needs."""

    forms: np.ndarray  # (linkages, unknowns, size, size)
    circular: bool
    x: np.ndarray
    value: np.ndarray

    def __post_init__(self):
        n = self.x.shape[1]
        u, du, ddu = driven(self.value, self.circular)
        z = full(self.x, u)
        half = np.einsum("lijk,lk->lij", self.forms, z)
        self.residual = np.einsum("lij,lj->li", half, z)
        self.jacobian = 2 * half[..., :n]
        self.determinant = np.linalg.det(self.jacobian)
        regular = np.abs(self.determinant) > 0
        self.inverse = np.linalg.inv(np.where(regular[:, None, None], self.jacobian, np.eye(n)))
        self.inverse[~regular] = np.inf
        self.tangent = -np.einsum("lij,lj->li", self.inverse, 2 * np.einsum("lij,lj->li", half[..., n : n + 2], du))
        self.z, self.rate = z, full(self.tangent, du, 0.0)
        self.bend = full(np.zeros_like(self.x), ddu, 0.0)

    def steps(self, longest):
        """Return steps of at most a length, and how far about their linear predictions one solution is proved."""
        n = self.x.shape[1]
        g = np.einsum("lij,ljkm->likm", self.inverse, self.forms)
        with_rate, with_z = np.einsum("likm,lk->lim", g, self.rate), np.einsum("likm,lk->lim", g, self.z)
        # the prediction is off by half the second derivative over the step, and that changes by `third` a unit of it
        second = np.abs(np.einsum("lim,lm->li", with_rate, self.rate) + np.einsum("lim,lm->li", with_z, self.bend))
        size, u = np.abs(g), slice(n, n + 2)
        third = (2 * np.abs(with_rate) + np.abs(with_z))[..., u].sum(axis=2)
        third += np.einsum("likm,lk->li", size[:, :, :n, u], np.abs(self.tangent)) + size[:, :, u, u].sum(axis=(2, 3))
        fourth = size[:, :, u, u].sum(axis=(2, 3))
        offset = np.abs(np.einsum("lij,lj->li", self.inverse, self.residual))
        # every unknown is measured by how fast it moves
        speed = np.abs(self.tangent)
        speed = np.maximum(speed, LEAST_WEIGHT * np.maximum(speed.max(axis=1, keepdims=True), 1.0))
        weight = np.concatenate([speed, np.ones((len(speed), 2)), np.zeros((len(speed), 1))], axis=1)
        slope = (2 * np.einsum("likm,lk,lm->li", size[:, :, :n], speed, weight) / speed).max(axis=1)
        second, third, fourth, offset = ((term / speed).max(axis=1) for term in (second, third, fourth, offset))
        step = np.minimum(0.8 * CONTRACTION / slope, np.abs(longest))
        step = np.where(np.isfinite(step), step, 0.0)
        for _ in range(60):
            radius = (offset + (second + (third + fourth * step) * step) * step**2) / (1 - CONTRACTION)
            refused = ~(slope * (step + radius) <= CONTRACTION) & (step > 0)
            if not refused.any():
                break
            step = np.where(refused, 0.7 * step, step)
        step[step < SMALLEST_STEP] = 0.0
        return np.copysign(step, longest), radius[:, None] * speed

    def to_dead_point(self):
        """Return the way to the dead point ahead, where the square of the determinant vanishes with a finite slope."""
        change = 2 * np.einsum("lijk,lk->lij", self.forms, self.rate)[..., : self.x.shape[1]]
        with np.errstate(divide="ignore", invalid="ignore"):
            return 1 / np.abs(2 * np.einsum("lij,lji->l", self.inverse, change))


def driven(value, circular):
    """Return what is driven, cosine and sine of an angle or a distance and zero, with two derivatives by the value."""
    zero, one = np.zeros_like(value), np.ones_like(value)
    if not circular:
        return tuple(np.stack(pair, axis=-1) for pair in ((value, zero), (one, zero), (zero, zero)))
    c, s = np.cos(value), np.sin(value)
    return tuple(np.stack(pair, axis=-1) for pair in ((c, s), (-s, c), (-c, -s)))


def full(x, u, one=1.0):
    """Return z."""
    return np.concatenate([x, u, np.full((*x.shape[:-1], 1), one)], axis=-1)


def polished(forms, circular, x, value, iterations=8):
    """Return the position that Newton's method finds from x, and the size of the last correction."""
    n = x.shape[-1]
    u = driven(value, circular)[0]
    size = np.full(len(x), np.inf)
    for _ in range(iterations):
        z = full(x, u)
        half = np.einsum("lijk,lk->lij", forms, z)
        jacobian = 2 * half[..., :n]
        jacobian = np.where((np.abs(np.linalg.det(jacobian)) > 0)[:, None, None], jacobian, np.nan)
        change = np.linalg.solve(jacobian, np.einsum("lij,lj->li", half, z)[..., None])[..., 0]
        x, size = x - change, np.abs(change).max(axis=1)
        if (size < 1e-15).all():
            break
    return x, size


def rounding(forms, circular, x, value):
    """Return by how much the unknowns change if every equation does by the size of its terms."""
    n = x.shape[-1]
    z = full(x, driven(value, circular)[0])
    jacobian = 2 * np.einsum("lijk,lk->lij", forms, z)[..., :n]
    terms = np.einsum("lijk,lj,lk->li", np.abs(forms), np.abs(z), np.abs(z))
    return np.einsum("lij,lj->li", np.abs(np.linalg.inv(jacobian)), terms)


def follow(forms, circular, start, targets):
    """Follow linkages through driven values, one after another.

    Parameters
    ----------
    forms : array of shape (linkages, unknowns, size, size)
    circular : bool
        Whether an angle is driven, or a distance.
    start : array of shape (linkages, unknowns)
        Position at the first target, to rounding.
    targets : list of arrays
        Driven values of each linkage, to be visited in this order; the driven value is monotonic between neighbors.
    """
    count, n = start.shape
    lengths = np.array([len(t) for t in targets])
    values = np.full((count, lengths.max()), np.nan)
    for row, target in zip(values, targets, strict=True):
        row[: len(target)] = target
    shape = values.shape
    position, determinant, margin = np.full((*shape, n), np.nan), np.full(shape, np.nan), np.full(shape, np.nan)
    limit, proved, steps = np.full(count, np.nan), np.ones(count, bool), np.zeros(count, int)
    lanes, state = np.arange(count), State(forms, circular, start, values[:, 0])
    position[:, 0], determinant[:, 0], margin[:, 0] = start, state.determinant, np.abs(state.determinant)
    smallest, at = np.abs(state.determinant), np.ones(count, int)
    while True:
        going = at < lengths[lanes]
        if not going.all():
            lanes, at, smallest = lanes[going], at[going], smallest[going]
            state = State(state.forms[going], circular, state.x[going], state.value[going])
        if not lanes.size:
            return Paths(position, determinant, margin, limit, proved, steps)
        remaining = values[lanes, at] - state.value
        step, radius = state.steps(remaining)
        arriving = np.abs(step) >= np.abs(remaining)
        value = np.where(arriving, values[lanes, at], state.value + step)
        predicted = state.x + state.tangent * step[:, None]
        x, _ = polished(state.forms, circular, predicted, value)
        noise = 1e-14 * np.abs(state.inverse).sum(axis=2)  # of what Newton's method finds
        ended = (step == 0) & ~arriving | ~(np.abs(x - predicted) <= 1.01 * radius + noise).all(axis=1)
        limit[lanes[ended]] = state.value[ended]
        proved[lanes[ended]] = state.to_dead_point()[ended] < SHARPEST
        x, value = np.where(ended[:, None], state.x, x), np.where(ended, state.value, value)
        state = State(state.forms, circular, x, value)
        steps[lanes] += 1
        smallest = np.minimum(smallest, np.abs(state.determinant))
        here = arriving & ~ended
        k, j = lanes[here], at[here]
        position[k, j], determinant[k, j], margin[k, j] = x[here], state.determinant[here], smallest[here]
        at = np.where(ended, lengths[lanes], at + here)


def derivatives(form, circular, law, time, position, order):
    """Return time derivatives of the unknowns of one linkage, shape (time, order + 1, unknowns)."""
    n = position.shape[-1]
    value = law.series(time, order)
    z = np.zeros((order + 1, len(time), n + 3))
    z[0] = full(position, driven(value[0], circular)[0])
    for k in range(1, order + 1):
        if circular:
            weights = [j * value[j][:, None] for j in range(1, k + 1)]
            quarter = [np.stack([-z[k - j, :, n + 1], z[k - j, :, n]], axis=-1) for j in range(1, k + 1)]
            z[k, :, n : n + 2] = sum(w * q for w, q in zip(weights, quarter, strict=True)) / k
        else:
            z[k, :, n] = value[k]
        rest = sum(np.einsum("tj,ijk,tk->ti", z[j], form, z[k - j]) for j in range(k + 1))
        jacobian = 2 * np.einsum("ijk,tk->tij", form, z[0])[..., :n]
        z[k, :, :n] = -np.linalg.solve(jacobian, rest[..., None])[..., 0]
    factorials = np.cumprod([1.0, *range(1, order + 1)])
    return np.moveaxis(z[..., :n] * factorials[:, None, None], 0, 1)
