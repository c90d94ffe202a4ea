"""Remarks on forces: instants at which they change sign, and contact forces that they leave out."""

from collections.abc import Sequence

import numpy as np

from jounce.mechanism import Mechanism
from jounce.trajectory import FollowingMotion

ROUNDING = 1e-9  # fraction of the largest force
MOST_SHOWN = 4  # instants


def lift_off_words(time: np.ndarray, forces: np.ndarray) -> str:
    """Return a remark on the instants before which the force of a cam changes its sign; empty if it keeps it.

    Examples
    --------
    >>> lift_off_words(np.array([0.0, 0.1, 0.2]), np.array([3.0, 1.0, -0.5]))
    'changes its sign before t = 0.2 s: a follower that is pressed against a cam lifts off there'
    """
    is_known = np.isfinite(forces)
    times, sign = time[is_known], np.sign(forces[is_known])
    sign[np.abs(forces[is_known]) <= ROUNDING * np.max(np.abs(forces[is_known]), initial=0.0)] = 0.0
    times, sign = times[sign != 0], sign[sign != 0]
    changes = times[1:][sign[1:] != sign[:-1]]
    if not changes.size:
        return ""
    instants = ", ".join(f"{t:.4g} s" for t in changes[:MOST_SHOWN]) + (", ..." if len(changes) > MOST_SHOWN else "")
    return f"changes its sign before t = {instants}: a follower that is pressed against a cam lifts off there"


def following(mechanism: Mechanism, leader: str) -> list[str]:
    """Return the names of drivers whose laws are functions of the coordinate of a leading driver."""
    all_laws = {name: getattr(driver, "motion", None) for name, driver in mechanism.drivers.items()}
    laws = [(name, law.recipe.value[0][1]) for name, law in all_laws.items() if isinstance(law, FollowingMotion)]
    return [name for name, law in laws if law is all_laws[leader] or repr(law) == repr(all_laws[leader])]


def signal_words(names: Sequence[str]) -> str:
    """Return a remark that a driver does not bear the load of the drivers that follow it; empty if there are none.

    Examples
    --------
    >>> signal_words(["cam"])
    'cam follows it without loading it: define a cam that transmits its force under joints'
    """
    if not names:
        return ""
    verb = "follows" if len(names) == 1 else "follow"
    return f"{', '.join(names)} {verb} it without loading it: define a cam that transmits its force under joints"


def slack_words(time: np.ndarray, tensions: np.ndarray) -> str:
    """Return a remark on the instants at which a rope is slack, as it would have to push; empty if it always pulls.

    Examples
    --------
    >>> slack_words(np.array([0.0, 0.1, 0.2]), np.array([3.0, 1.0, -0.5]))
    'is below zero at t = 0.2 s: the rope is slack there, and holds nothing'
    >>> slack_words(np.array([0.0, 0.1, 0.2, 0.3]), np.array([-3.0, -1.0, 0.5, -1.0]))
    'is below zero from t = 0 s to 0.1 s, at 0.3 s: the rope is slack there, and holds nothing'
    """
    is_known = np.isfinite(tensions)
    times, pushes = time[is_known], tensions[is_known] < -ROUNDING * np.max(np.abs(tensions[is_known]), initial=0.0)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], pushes, [False]]).astype(int)))
    phrases = []
    for start, stop in zip(edges[::2], edges[1::2] - 1, strict=True):
        is_single = start == stop
        phrases.append(f"at {times[start]:.4g} s" if is_single else f"from {times[start]:.4g} s to {times[stop]:.4g} s")
    if not phrases:
        return ""
    phrases[0] = phrases[0].replace(" ", " t = ", 1)
    ellipsis = ", ..." if len(phrases) > MOST_SHOWN else ""
    return f"is below zero {', '.join(phrases[:MOST_SHOWN])}{ellipsis}: the rope is slack there, and holds nothing"


def ratio_words(names: Sequence[str]) -> str:
    """Return a remark that joints given by a ratio alone have no tooth forces; empty if there are none."""
    verb = "is" if len(names) == 1 else "are"
    return f"{', '.join(names)} {verb} given by a ratio alone: bearings show no tooth forces" if names else ""


def cam_words(names: Sequence[str]) -> str:
    """Return a remark that reactions of bearings leave out contact forces of cams; empty if there are none."""
    verb = "is a law" if len(names) == 1 else "are laws"
    return f"{', '.join(names)} {verb} between coordinates: bearings show no contact force" if names else ""


def belt_words(names: Sequence[str]) -> str:
    """Return a remark that reactions of bearings leave out the initial tension of belts; empty if there are none."""
    phrase = "bearings show the difference of the pulls of its strands, not the tension with which it is put on"
    return f"{', '.join(names)}: {phrase}" if names else ""
