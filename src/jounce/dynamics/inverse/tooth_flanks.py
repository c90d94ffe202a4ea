"""Loaded tooth flanks: the direction of the radial component of a tooth force.

The radial component separates the gears for either direction of the load: it is proportional to the absolute value of
the multiplier. For a known flank, the tooth force acts along its line of action, and its residual gives all forces and
rates like any other. The radial component does no work, as the centers keep their distance, so the multipliers of gears
do not depend on the flank; those of bearings do. Where the multiplier passes zero, its absolute value has no
derivative.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.dynamics.friction.coupling import has_flanks
from jounce.kinematics import Motion, Status
from jounce.mechanism import Model
from jounce.mechanism.building.builder import group_rows
from jounce.mechanism.system import Group, with_field

Flanks = Mapping[int, Float[Numbers, "instance time"]]
"""For each group index, 1 or -1 for each pair of teeth."""

NONE = 1e-11  # fraction of the largest multiplier, or of its largest scaled rate: less is rounding
SLOWEST = 1e-3  # 1/s: lower bound of the rate of motions in scales of rates
MOST_CHANGES = 8  # iterations of flanks, if multipliers of redundant constraints depend on them
MOST_LISTED = 4  # instants


def either_flank(groups: Sequence[Group], count: int) -> dict[int, Any]:
    """Return initial flanks for a number of instants."""
    return {k: np.ones((group.instances, count)) for k, group in enumerate(groups) if has_flanks(group)}


def with_flanks(groups: Sequence[Group], flanks: Sequence[Numbers]) -> tuple[Group, ...]:
    """Return groups with flanks of teeth, (instances, batch) for each group that has some."""
    left = iter(flanks)
    return tuple(with_field(group, "flank", next(left)) if flanks and has_flanks(group) else group for group in groups)


def random_for_flanks(flanks: Flanks) -> dict[int, Any]:
    """Return random values of flanks, which change exactly the forces that depend on the distribution of loads."""
    random = np.random.default_rng(1)
    return {k: random.uniform(0.3, 0.7, flank.shape[:1])[:, None] * flank for k, flank in flanks.items()}


def multipliers_on_flanks(
    solve: Callable[[Flanks], Numbers], flanks: Flanks, model: Model, motion: Motion
) -> tuple[Numbers, Flanks, dict[int, Any]]:
    """Return multipliers, the flanks that they load, and the first undetermined rates.

    Parameters
    ----------
    solve : callable
        Function from flanks to multipliers, (cases, levels, rows, time).
    flanks : mapping
        Initial flanks.
    model : Model
        The model of the motion.
    motion : Motion
        The motion with these multipliers.

    Returns
    -------
    multipliers, flanks
        NaN rates where a load passes zero.
    reversals : dict of int to array of int, shape (instances, time)
        For each group index, the first level whose rate is undetermined; the number of levels if there is none.
    """
    rows, multipliers = group_rows(model), solve(flanks)

    def of_group(multipliers: Numbers, index: int) -> Numbers:
        return multipliers[:, rows[index]]

    if motion.traced:
        flanks = {k: jnp.where(jax.lax.stop_gradient(of_group(multipliers[0], k)[0]) < 0, -1.0, 1.0) for k in flanks}
        return solve(flanks), flanks, {}
    rate, reversals, unsettled = rate_of(motion), {}, []
    for _ in range(MOST_CHANGES):
        pairs = {k: _signs(of_group(multipliers[0], k), multipliers[0], rate) for k in flanks}
        next_flanks, reversals = ({k: pair[member] for k, pair in pairs.items()} for member in (0, 1))
        unsettled = [(next_flanks[k] != flanks[k]).any(axis=0) for k in flanks]
        if not np.any(unsettled):
            break
        flanks, multipliers = next_flanks, solve(next_flanks)
    else:
        multipliers = np.where(np.any(unsettled, axis=0), np.nan, multipliers)
    levels = multipliers.shape[1]
    if any((level < levels).any() for level in reversals.values()):
        other_multipliers = solve({k: np.where(reversals[k] < levels, -flank, flank) for k, flank in flanks.items()})
        drift = np.abs(other_multipliers[0] - multipliers[0]) > 1e-9 * np.abs(multipliers[0]).max(axis=1, keepdims=True)
        first = np.min([level.min(axis=0) for level in reversals.values()], axis=0)
        drift &= np.arange(levels)[:, None, None] >= first
        multipliers = np.where(np.logical_or.accumulate(drift, axis=0), np.nan, multipliers)
    return multipliers, flanks, reversals


def without_undetermined_rates(work: Numbers, first: Numbers | None, instance: int) -> Numbers:
    """Return the tooth force on a body, (levels, coordinates, time), NaN for rates that a reversal leaves open."""
    return work if first is None else np.where(np.arange(len(work))[:, None, None] >= first[instance], np.nan, work)


def rate_of(motion: Motion) -> Float[np.ndarray, " time"]:
    """Return the rate of change of a motion, 1/s: the largest k-th root of a Taylor term of order k, dimensionless."""
    rate = np.full(len(motion.time), SLOWEST)
    for name, series in motion.poses[1].items():
        scale = motion.model.length if name == "position" else 1.0
        for k, level in enumerate(np.asarray(series)[1:], 1):
            size = np.abs(np.nan_to_num(level)).reshape(-1, len(motion.time)).max(axis=0) / scale
            rate = np.maximum(rate, size ** (1.0 / k))
    return rate


def _signs(values: Numbers, all_values: Numbers, rate: Float[np.ndarray, " time"]) -> tuple[np.ndarray, np.ndarray]:
    """Return flanks, and the first level at which the absolute value of a multiplier has no derivative, if any."""
    levels = len(values)
    scaled = np.nan_to_num(np.asarray(values)) / rate ** np.arange(levels)[:, None, None]
    size = np.maximum(np.abs(np.nan_to_num(all_values[0])).max(), np.abs(scaled).max(axis=0))
    matters = np.abs(scaled) > NONE * size
    first = np.where(matters.any(axis=0), matters.argmax(axis=0), levels)
    leading = np.take_along_axis(scaled, np.minimum(first, levels - 1)[None], axis=0)[0]
    sign = np.where(first == levels, 1.0, np.where(leading < 0, -1.0, 1.0))
    return sign, np.where(first % 2 == 1, first, levels)


def flank_words(forces: Any, bodies: set[str]) -> str:
    """Return a remark on the instants at which tooth loads of some bodies change flanks; empty if none does.

    `forces` are `MotionForces`.
    """
    motion, phrases = forces.motion, []
    for name, place in forces.indices.items():
        if place.group in forces.flanks and bodies & {*motion.mechanism.joints[name].bodies}:
            phrases.append(_reversal_words(name, forces.multipliers[0][next(iter(place.own_rows))], motion))
    return "; ".join(filter(None, phrases))


def _reversal_words(name: str, forces: Numbers, motion: Motion) -> str:
    """Return a remark on the instants at which multipliers, (time,), change flanks; empty if they do not."""
    solved = (motion.status == Status.OK) & np.isfinite(forces)
    times, sign = motion.time[solved], np.sign(forces[solved])
    sign[np.abs(forces[solved]) <= NONE * np.max(np.abs(forces[solved]), initial=0.0)] = 0.0
    zero = times[sign == 0] if sign.any() else times[:0]
    if zero.size:
        instants = listed(zero)
        return (
            f"the load of {name} changes flanks at t = {instants}: rates of the bearing forces that it causes are not "
            "determined"
        )
    changes = times[1:][sign[1:] != sign[:-1]]
    return f"the load of {name} changes flanks before t = {listed(changes)}" if changes.size else ""


def listed(times: Float[np.ndarray, " time"]) -> str:
    """Return a text that lists the first few instants."""
    return ", ".join(f"{t:.4g} s" for t in times[:MOST_LISTED]) + (", ..." if len(times) > MOST_LISTED else "")
