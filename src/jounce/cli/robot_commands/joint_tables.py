"""Tables of trajectories of joints, as written by commands that compute trajectories."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray

    from jounce.mechanism import Mechanism
    from jounce.robot import Robot
    from jounce.trajectory import JointTrajectory

ROWS = 3  # derivatives that are written


def joint_table(
    system: Robot | Mechanism, trajectory: JointTrajectory, times: Any, title: str | None = None
) -> xarray.Dataset:
    """Return the dataset of joints of a robot, or of drivers, from position to jerk at instants."""
    import xarray

    from jounce.mechanism import Mechanism
    from jounce.mechanism.laws.driver_outputs import is_turning
    from jounce.units.shown_units import time_axes

    def turns(name: str) -> bool:
        return is_turning(system.drivers[name]) if isinstance(system, Mechanism) else system.joints[name].turning

    values, variables = trajectory.derivatives(times, ROWS), {}
    for k, name in enumerate(trajectory.names):
        variables[name] = (("time", "derivative"), values[:, :, k], {"units": "rad" if turns(name) else "m"})
    attributes = {"source": "jounce"} if title is None else {"title": title, "source": "jounce"}
    return xarray.Dataset(variables, coords=time_axes(times, ROWS + 1), attrs=attributes)
