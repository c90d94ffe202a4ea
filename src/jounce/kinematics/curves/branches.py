"""From a mechanism to its curve of configurations."""

from jounce.base.shapes import Real
from jounce.errors import MechanismError, whole_number
from jounce.kinematics.curves.choice import chosen
from jounce.kinematics.curves.curve import Curve, CurveSettings, curve_through
from jounce.kinematics.curves.start import check_number, instant_of
from jounce.mechanism import Mechanism, check_mechanism
from jounce.mechanism.building.preconditions import check_holonomic, concrete
from jounce.mechanism.carriages import check_without_ends

HIGHEST_ORDER = 8  # of derivatives with respect to arc length: those above are worse than rounding between the points


@concrete
def trace(
    mechanism: Mechanism,
    time: Real | None = None,
    *,
    driver: str | None = None,
    order: int = 2,
    count: int = 361,
    length: float = 200.0,
) -> Curve:
    """Return the whole curve of configurations of a mechanism, through the dead points of its driver.

    The law of one driver is replaced by an unknown value, and the curve is followed by its arc length: forward, as the
    value grows at first, until it is closed, or else to both its ends.

    Parameters
    ----------
    mechanism : Mechanism
        Driven, or of one degree of freedom; joints may repeat equations of others.
    time : float, optional
        Instant of the start, at which all other drivers are held, s; the first of the mechanism's own unless given.
    driver : str, optional
        Whose value is free, where there are several; ``"time"`` for the instant, while all drivers follow their laws.
    order : int, default 2
        Highest derivative of the outputs with respect to arc length, up to 8.
    count : int, default 361
        Number of points, evenly spaced in arc length; limit positions and change points are added to them.
    length : float, default 200
        Largest arc length, rad or sizes of the mechanism, to either side: not every curve is closed.

    Returns
    -------
    Curve
        With its limit positions, change points, branches, and outputs along it.

    Raises
    ------
    MechanismError
        If the mechanism or an option is not valid, or it is not said which of several drivers is free.
    AssemblyError
        If the bodies cannot be assembled at the start.
    MobilityError
        If there is more than one degree of freedom with the driver free, or none.
    SingularityError
        If the start is a change point.

    Examples
    --------
    >>> import jounce as jn
    >>> curve = jn.trace(jn.load("examples/four_bar.yaml").with_parameters(AB="15 cm"))
    >>> curve.closed, [round(x.value, 6) for x in curve.limits]
    (True, [...])
    """
    check_mechanism(mechanism)
    check_without_ends(mechanism, "a trace")
    check_holonomic(mechanism, "a trace")
    order = whole_number("order", order, 0, HIGHEST_ORDER, error=MechanismError)
    count = whole_number("count", count, 2, 10**7, error=MechanismError)
    check_number("length", length, 1e-6, 1e6)
    instant = instant_of(mechanism, time)
    return curve_through(chosen(mechanism, instant), instant, driver, CurveSettings(order, count, float(length)))
