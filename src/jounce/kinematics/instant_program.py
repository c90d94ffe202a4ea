"""`advance` for one instant, of which machine code is made that solves many side by side."""

from typing import Any

from jounce.execution.side_by_side import SideBySide
from jounce.kinematics.advance import Arrival, advance
from jounce.mechanism.system import System
from jounce.modules import with_fields
from jounce.rigid.pose import Pose


@SideBySide
def advance_instant(shared: Any, instants: Any, *, pose_type: type[Pose], order: int) -> Arrival:
    """Solve an instant from a neighbour solved before.

    Parameters
    ----------
    shared : tuple
        System, tolerance, whether to refine, and the highest derivative that must be finite.
    instants : tuple
        Coordinates, angles and sign of the neighbour, the time from there, the instant, s, and whether to look for
        the nearest singular position: each of length one.
    pose_type, order
        As those of `advance`.
    """
    (system, tolerance, refine, wanted), ((coordinates, angles, sign), step, instant, survey) = shared, instants
    return advance(
        with_fields(system, reflected=True),
        coordinates,
        angles,
        sign,
        step,
        instant,
        tolerance,
        refine,
        survey[0],
        wanted,
        pose_type=pose_type,
        order=order,
        with_turnover=finds_turnover(system),
    )


def finds_turnover(system: System) -> bool:
    """Tell whether the turnover of an instant is found with it; of many bodies it takes vectors of its own."""
    return system.fronts is None
