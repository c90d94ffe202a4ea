"""Jumps of derivatives at the knots where the pieces of a law meet."""

import math

import numpy as np
from jaxtyping import Float

from jounce.jet import Jet
from jounce.trajectory.motion import AbstractMotion, SplineMotion

SMOOTH = 1e-9  # fraction of the peak of a derivative; smaller jumps are rounding
INSTANTS = 33  # samples of a law without known pieces, for these peaks

Jumps = tuple[Float[np.ndarray, " knots"], Float[np.ndarray, "levels knots"]]
"""Instants at which derivatives may jump, and the jumps: values from the right minus values from the left, by order."""


def knot_jumps(law: SplineMotion, order: int) -> Jumps:
    """Return the jumps of derivatives where pieces of a law meet, and at its ends; rounding is zero.

    For a law that repeats, the beginning represents the end, too. A law that ends at its data has no jumps at its ends.
    """
    begins, stop = np.asarray(law.breakpoints, float), float(law.stop)
    lengths = np.diff(np.append(begins, stop))
    powers = np.asarray(law.coefficients, float)
    sines = np.asarray(getattr(law, "sines", np.zeros((3, len(begins)))), float)
    left, right = (_derivatives(powers, sines, local_times, order) for local_times in (lengths, np.zeros(len(begins))))
    before, after, instants = left[:, :-1], right[:, 1:], begins[1:]
    jumps = after - before
    smooth = law.joined
    jumps[: smooth + 1] = 0.0  # a spline is smooth within: what is left is rounding
    if law.beyond == "repeat":
        wrapped = left[:, -1:] - np.append(float(law.advance), np.zeros(order))[:, None]
        closing = right[:, :1] - wrapped
        closing[: smooth + 1] = 0.0
        jumps, instants = np.column_stack([closing, jumps]), begins
    elif law.beyond == "hold":
        zeros = np.zeros((order + 1, 1))
        ends = right[:, :1] - zeros, zeros - left[:, -1:]
        for end in ends:
            end[0] = 0.0
        jumps, instants = np.column_stack([ends[0], jumps, ends[1]]), np.concatenate([begins[:1], instants, [stop]])
    peaks = _largest(powers, sines, lengths, law, order)[:, None]
    return instants, np.where(np.abs(jumps) <= SMOOTH * peaks, 0.0, jumps)


def derivative_sizes(law: AbstractMotion, first: float, last: float, order: int) -> Float[np.ndarray, " levels"]:
    """Return the largest finite sampled derivatives of a law between two instants.

    Derivatives at the knots are no scale for rounding: one that vanishes is only rounding.
    """
    looks = np.linspace(first, last, INSTANTS)
    derivatives = [np.abs(np.asarray(x, float)) for x in law(Jet.variable(looks, order)).dense().derivatives()]
    return np.array([np.max(x, initial=0.0, where=np.isfinite(x)) for x in derivatives])


def _derivatives(
    powers: Float[np.ndarray, "powers pieces"],
    sines: Float[np.ndarray, "3 pieces"],
    times: Float[np.ndarray, " pieces"],
    order: int,
) -> Float[np.ndarray, "levels pieces"]:
    """Return the derivatives of each piece at a time after its beginning."""
    amplitude, frequency, phase = sines
    derivatives = []
    for k in range(order + 1):
        polynomial = sum(
            (c * math.perm(j, k) * times ** (j - k) for j, c in enumerate(powers) if j >= k), np.zeros_like(times)
        )
        derivatives.append(polynomial + amplitude * frequency**k * np.sin(frequency * times + phase + k * math.pi / 2))
    return np.array(derivatives)


def _largest(
    powers: Float[np.ndarray, "powers pieces"],
    sines: Float[np.ndarray, "3 pieces"],
    lengths: Float[np.ndarray, " pieces"],
    law: SplineMotion,
    order: int,
) -> Float[np.ndarray, " levels"]:
    """Return bounds of the derivatives of a law, of the size of their peaks."""
    powers, (amplitude, frequency, _) = np.abs(powers), np.abs(sines)
    times = np.minimum(lengths, np.max(lengths[1:], initial=0.0)) if law.beyond == "continue" else lengths
    terms = [
        sum((c * math.perm(j, k) * times ** (j - k) for j, c in enumerate(powers) if j >= k), np.zeros_like(times))
        + amplitude * frequency**k
        for k in range(order + 1)
    ]
    return np.max(np.array(terms), axis=1)
