"""Efficiencies of screws with friction in both directions, and whether they are self-locking."""

from typing import Any

import numpy as np
from typing_extensions import TypedDict

from jounce.constraints import spatial
from jounce.mechanism.building.builder import named_groups
from jounce.reporting.facts.mechanism.freedom_facts import StartingState


class ScrewFacts(TypedDict):
    """A screw with friction: its lead angle at the radius of the thread, rad; its efficiency from turning to advance,
    and from advance to turning, zero if it is self-locking.
    """

    joint: str
    lead_angle: float
    efficiency: float
    back_efficiency: float
    self_locking: bool


def screw_facts(state: StartingState) -> list[dict[str, Any]]:
    """Return the screws with friction of a mechanism: ScrewFacts.

    With the lead angle alpha and the friction angle phi, the efficiencies are those of a square thread,
    ``tan(alpha) / tan(alpha + phi)`` and ``tan(alpha - phi) / tan(alpha)`` (Budynas and Nisbett 2015, Shigley's
    Mechanical Engineering Design, section 8-2), for slip far above the characteristic speed of the friction law.

    Parameters
    ----------
    state : StartingState
        Start of the mechanism.
    """
    records: list[dict[str, Any]] = []
    for group, members in named_groups(state.model):
        screw = group.element
        if not isinstance(screw, spatial.Screw) or screw.friction is None:
            continue
        values = (screw.lead, screw.friction.radius, screw.friction.coefficient)
        leads, radii, coefficients = (np.broadcast_to(np.ravel(value), group.instances) for value in values)
        names = [row.partition(".")[2] for row in members]
        for name, lead, radius, mu in zip(names, leads, radii, coefficients, strict=True):
            rise = abs(float(lead)) / (2 * np.pi * float(radius))
            records.append({"joint": name, **_efficiencies(rise, float(mu))})
    return records


def _efficiencies(rise: float, mu: float) -> dict[str, Any]:
    """Return the facts of a screw from the slope of its thread and its coefficient of friction.

    Examples
    --------
    >>> found = _efficiencies(0.0579, 0.12)
    >>> round(found["efficiency"], 3), found["self_locking"]
    (0.323, True)
    """
    turning = rise * (1 - rise * mu) / (rise + mu) if rise + mu else 1.0
    pushing = (rise - mu) / (rise * (1 + rise * mu)) if rise else 0.0
    return {
        "lead_angle": float(np.arctan(rise)),
        "efficiency": max(turning, 0.0),
        "back_efficiency": max(pushing, 0.0),
        "self_locking": mu >= rise,
    }
