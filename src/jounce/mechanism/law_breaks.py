"""Where the laws of a mechanism jump or bend: no series goes on beyond, and peaks may be limits from one side."""

from collections.abc import Iterable
from typing import Any

import jax
import numpy as np
from jax.core import Tracer
from jaxtyping import Float

from jounce.mechanism.held_outputs import with_outputs_held
from jounce.mechanism.mechanism import Mechanism
from jounce.mechanism.resolve import resolve_motion
from jounce.settings import under_own_settings
from jounce.trajectory.breaks import law_breaks, may_break
from jounce.trajectory.motion import AbstractMotion


@under_own_settings
def breaks_of_laws(mechanism: Mechanism, first: float, last: float, order: int) -> Float[np.ndarray, " time"]:
    """Return the instants at which laws of drivers, or of outputs they follow from, jump or bend, s.

    Parameters
    ----------
    mechanism : Mechanism
        With numbers in the place of parameters.
    first, last : float
        s.
    order : int
        Of the highest derivative of the motion that matters.

    Examples
    --------
    >>> import jounce as jn
    >>> press = jn.load("examples/servo_press.yaml")
    >>> breaks_of_laws(press, 0.0, 1.2, 3).round(9).tolist()
    [0.05, 0.35, 0.55, 0.65, 0.75, 1.15]
    """
    return law_breaks(laws_of(mechanism), first, last, order)


@under_own_settings
def laws_may_break(mechanism: Mechanism) -> bool:
    """Tell whether a law of a mechanism may jump or bend anywhere, whatever the values of its parameters."""
    return any(map(may_break, laws_of(mechanism)))


@under_own_settings
def breaks_depend_on(mechanism: Mechanism, names: Iterable[str]) -> bool:
    """Tell whether where the laws of a mechanism jump or bend may depend on some of its parameters.

    Examples
    --------
    >>> import jounce as jn
    >>> press = jn.load("examples/servo_press.yaml")
    >>> breaks_depend_on(press, ["rod"]), breaks_depend_on(press, ["forming"])
    (False, True)
    """
    values = {name: float(mechanism.parameter_values[name]) for name in names}
    numbers = []

    def resolved(given: dict[str, Any]) -> dict[str, Any]:
        numbers.extend(jax.tree.leaves([law for law in laws_of(mechanism.with_parameters(**given)) if may_break(law)]))
        return given

    try:
        jax.eval_shape(resolved, values)
    except Exception:  # noqa: BLE001 - a law that needs numbers in the place of parameters
        return True
    return any(isinstance(number, Tracer) for number in numbers)


def laws_of(mechanism: Mechanism) -> list[AbstractMotion]:
    """Return the laws of drivers, with numbers in the place of parameters."""
    values, drivers = mechanism.parameter_values, with_outputs_held(mechanism).drivers.values()
    motions = (getattr(driver, "motion", None) for driver in drivers)
    return [resolve_motion(motion, values) for motion in motions if motion is not None]
