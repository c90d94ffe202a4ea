"""Where the laws of a mechanism jump or bend: no series goes on beyond, and peaks may be limits from one side."""

import numpy as np
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


def laws_of(mechanism: Mechanism) -> list[AbstractMotion]:
    """Return the laws of drivers, with numbers in the place of parameters."""
    values, drivers = mechanism.parameter_values, with_outputs_held(mechanism).drivers.values()
    motions = (getattr(driver, "motion", None) for driver in drivers)
    return [resolve_motion(motion, values) for motion in motions if motion is not None]
