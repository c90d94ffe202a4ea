"""The choice of reactions that redundant constraints leave open: its check, and its numeric values."""

import math
from collections.abc import Collection, Mapping
from typing import Any

from jounce.base.shapes import Refused
from jounce.errors import JounceError, MechanismError, check_name
from jounce.mechanism.resolve import resolve

CHOICES = ("unique", "least_norm")
STIFFNESSES = {"force": "stiffness", "torque": "torsional stiffness"}
PLACE = "redundant_reactions"

RedundantReactions = str | Mapping[str, Any]
"""One of the choices, or force and torque stiffnesses by the names of joints."""


def check_redundant_reactions(choice: RedundantReactions | Refused, names: Collection[str]) -> None:
    """Raise MechanismError unless the value is one of the choices, or stiffnesses by the names of joints."""
    if not isinstance(choice, Mapping):
        if not isinstance(choice, str) or choice not in CHOICES:
            message = f"must be one of {', '.join(CHOICES)}, or stiffnesses by the names of joints"
            raise MechanismError(message, name=PLACE, value=choice)
        return
    if not choice:
        raise MechanismError("must name a joint with its stiffness", name=PLACE, value=dict(choice))
    for name, stiffness in choice.items():
        check_name("joint", name, names, MechanismError, name=PLACE)
        if not isinstance(stiffness, Mapping) or not stiffness or not set(stiffness) <= set(STIFFNESSES):
            message = "must be the stiffness of the joint: force, N/m, and torque, N m/rad, or one of them"
            raise MechanismError(message, name=f"{PLACE}.{name}", value=stiffness)


def resolved_reactions(choice: RedundantReactions, parameters: Mapping[str, Any]) -> str | dict[str, dict[str, float]]:
    """Return the choice with numbers in the place of expressions of the parameters.

    Raises
    ------
    MechanismError
        If a stiffness is no positive number.
    """
    if not isinstance(choice, Mapping):
        return choice
    return {
        name: {key: _positive(value, f"{PLACE}.{name}.{key}", parameters) for key, value in stiffness.items()}
        for name, stiffness in choice.items()
    }


def _positive(given: Any, name: str, parameters: Mapping[str, Any]) -> float:
    try:
        value = resolve(given, parameters)
    except JounceError as error:
        raise error.located(name=name) from None
    if not (isinstance(value, float) and 0 < value < math.inf):
        raise MechanismError("a stiffness must be a number above zero", name=name, value=given)
    return float(value)
