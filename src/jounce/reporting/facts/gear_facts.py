"""How fast the gears of a mechanism turn for a turn of each driver: ratios of trains, from the Jacobian."""

from fractions import Fraction
from typing import Any

import numpy as np
from typing_extensions import TypedDict

from jounce.constraints.facts import facts_of
from jounce.mechanism.driver_outputs import is_turning
from jounce.mechanism.mechanism import GROUND
from jounce.reporting.facts.freedom_facts import StartingState

LARGEST_TEETH = 1000  # of ratios that are told as fractions
WHOLE = 1e-9
STILL = 1e-12


class TrainFacts(TypedDict):
    """Speed of a gear over that of a driver, the other drivers held, and as a fraction where it is one."""

    body: str
    driver: str
    ratio: float
    fraction: str | None


def train_facts(state: StartingState) -> list[dict[str, Any]]:
    """Return the speed ratios of all planar bodies that mesh or have a belt, at the position put together: TrainFacts.

    Parameters
    ----------
    state : StartingState
        Of a mechanism whose drivers determine it; else nothing is told.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.mechanism import build
    >>> train = jn.load("examples/epicyclic.yaml")
    >>> facts = train_facts(StartingState(train, build(train), 0.0))
    >>> [(x["body"], x["driver"], x["fraction"]) for x in facts if x["body"] == "ring"]
    [('ring', 'sun_drive', '-2/5'), ('ring', 'carrier_drive', '7/5')]
    """
    mechanism, model, here = state.mechanism, state.model, state.here
    meshing = _meshing(mechanism)
    if not meshing or here is None or not state.ok or state.freedom["left"]:
        return []
    turning = {name: driver for name, driver in mechanism.drivers.items() if is_turning(driver)}
    found = []
    scale = np.asarray(model.system.column_scale)
    for body in meshing:
        for name in turning:
            right = np.zeros(len(model.rows))
            right[model.rows.index(f"drivers.{name}")] = -1.0
            step = here.step(right)
            if step is None:
                continue
            turns = (step.reshape(-1, len(scale)) * scale)[:, model.pose_type.shifts :]
            speed = turns[list(mechanism.bodies).index(body)][0]
            unit = _unit(state, name)
            ratio = float(speed / unit)
            if abs(ratio) > STILL:
                found.append({"body": body, "driver": name, "ratio": ratio, "fraction": _fraction(ratio)})
    return found


def _meshing(mechanism: Any) -> list[str]:
    """Return the moving bodies that gears and belts turn, in the plane."""
    found: dict[str, None] = {}
    for joint in mechanism.joints.values() if mechanism.space == "planar" else ():
        symbol = facts_of(type(joint)).symbol
        if symbol in ("gear", "belt") or (symbol == "coordinate" and joint.coordinate == "angle"):
            found |= dict.fromkeys(body for body in joint.bodies if body != GROUND)
    return list(found)


def _unit(state: StartingState, driver: str) -> float:
    """Return how far a driver goes while its row of the residual changes by one."""
    return 1.0 / float(np.asarray(state.row_scale)[state.model.rows.index(f"drivers.{driver}"), 0])


def _fraction(ratio: float) -> str | None:
    found = Fraction(ratio).limit_denominator(LARGEST_TEETH)
    return (
        str(found)
        if abs(float(found) - ratio) <= WHOLE * abs(ratio) and abs(found.numerator) <= LARGEST_TEETH
        else None
    )
