"""Tracing the curve of configurations of a mechanism."""

from jounce.base.shapes import Real
from jounce.errors import MechanismError, whole_number
from jounce.kinematics.curves.choice import chosen
from jounce.kinematics.curves.curve import Curve, CurveSettings, curve_through
from jounce.kinematics.curves.start import check_number, instant_of
from jounce.mechanism import Mechanism, check_mechanism
from jounce.mechanism.building.preconditions import check_holonomic, concrete
from jounce.mechanism.carriages import check_without_ends

HIGHEST_ORDER = 8  # of derivatives with respect to arc length; higher ones lose all digits between the points


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

    The law of one driver is replaced by a free value, and the curve is followed by arc length: forward in the direction
    in which the value grows, until it closes, or else to both its ends.

    Parameters
    ----------
    mechanism : Mechanism
        Driven, or with one degree of freedom; constraints may be redundant.
    time : float, optional
        Instant of the start, at which all other drivers are held, s; by default the first of the mechanism's own.
    driver : str, optional
        Driver whose value is free, if there are several; ``"time"`` frees the instant, and all drivers follow their
        laws.
    order : int, default 2
        Highest derivative of the outputs with respect to arc length, up to 8.
    count : int, default 361
        Number of points, evenly spaced in arc length; limit positions and change points are added to them.
    length : float, default 200
        Largest arc length on either side of the start, rad or sizes of the mechanism; not every curve closes.

    Returns
    -------
    Curve
        The curve with its limit positions, change points, branches and outputs.

    Raises
    ------
    MechanismError
        If the mechanism or an option is not valid, or if none of several drivers is named.
    AssemblyError
        If the bodies cannot be assembled at the start.
    MobilityError
        If there is not exactly one degree of freedom with the driver free.
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
