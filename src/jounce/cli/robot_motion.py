"""The motion of a robot file under joint forces, for `jounce simulate`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jounce.base.activity import Count
from jounce.cli.options import AMONG_THE_OTHERS, RobotReading, TableOutput, errors_about, spare_inputs
from jounce.errors import JounceError, RobotError
from jounce.reporting.terminal import print_text, show_peaks

if TYPE_CHECKING:
    from jounce.integrate import AbstractMethod
    from jounce.robot import Robot


@AMONG_THE_OTHERS
@dataclass(frozen=True, kw_only=True)
class RobotRun:
    """Settings of the simulation of a robot file.

    Parameters
    ----------
    until
        End of the motion of a robot, from 0 s, with a unit.
    instants
        Number of instants, evenly spaced.
    start
        JOINT=VALUE at the start, with a unit; repeatable.
    torque
        JOINT=LAW, an expression of t, joints and JOINT_d1; repeatable.
    driven
        JOINT=LAW of t that the joint follows; repeatable.
    no_drives
        Omit armature, damping, friction and springs.
    model
        Model to read from an SDF file with several.
    closures
        File with springs and rotors to add to the robot.
    """

    until: str | None = None
    instants: int = 101
    start: list[str] | None = None
    torque: list[str] | None = None
    driven: list[str] | None = None
    no_drives: bool = False
    model: str | None = None
    closures: Path | None = None

    def given(self) -> list[str]:
        """Return the names of the given options."""
        defaults = RobotRun()
        return [name for name in self.__dataclass_fields__ if getattr(self, name) != getattr(defaults, name)]

    def time(self) -> Any:
        """Return the instants.

        Raises
        ------
        JounceError
            If the end or the number of instants is not valid.
        """
        import numpy as np

        from jounce.units.values import parse_value

        if self.until is None:
            raise JounceError("a robot needs the end of its motion, such as --until '2 s'", name="--until")
        try:
            stop = parse_value(self.until, "time").value
        except JounceError as error:
            raise JounceError(error.message, name="--until", value=self.until) from None
        if not isinstance(stop, float) or not np.isfinite(stop) or stop <= 0:
            raise JounceError("must be greater than zero", name="--until", value=self.until)
        if self.instants < 2:
            raise JounceError("must be 2 or more", name="--instants", value=self.instants)
        return np.linspace(0.0, stop, self.instants)

    def state(self, robot: Robot) -> Any:
        """Return the start state: coordinates, at rest."""
        import numpy as np

        from jounce.units.assignments import assignments
        from jounce.units.values import parse_value

        form = "a start is given by JOINT=VALUE, such as 'elbow=30 deg'"
        values = {}
        for name, text in assignments(self.start or (), "--start", form, RobotError).items():
            joint = robot.joints.get(name)
            try:
                kind = "length" if joint is not None and joint.moving and not joint.turning else "angle"
                values[name] = parse_value(text, kind).value
            except JounceError as error:
                raise RobotError(error.message, name="--start", value=f"{name}={text}") from None
        try:
            return np.stack([robot.coordinates(**values), np.zeros(len(robot.joint_names))])
        except JounceError as error:
            raise RobotError(error.message, name="--start", value=error.value) from None

    def laws(self, option: str) -> dict[str, str]:
        """Return the laws of an option by joint."""
        from jounce.units.assignments import assignments

        form = f"a law is given by JOINT=LAW, such as --{option} 'elbow=5*sin(t)'"
        return dict(assignments(getattr(self, option) or (), f"--{option}", form, RobotError))


def simulate_robot_file(
    file: Path,
    order: int,
    settings: RobotRun,
    allow: list[Path] | None,
    output: TableOutput,
    *,
    method: AbstractMethod,
    tolerance: float,
    longest_step: float,
) -> int:
    """Simulate a robot under joint forces, print its peaks and energy, and write its coordinates."""
    from jounce.integrate import simulate
    from jounce.kinematics.position_analysis.solve import raise_for_status
    from jounce.reporting.json.results import robot_motion_result
    from jounce.reporting.peaks import table_peaks
    from jounce.reporting.text.summaries import robot_motion_summary

    robot = RobotReading(allow=allow, model=settings.model, closures=settings.closures).robot(file)
    times = settings.time()
    spare_inputs(output.out, overwrite=output.overwrite)
    options: dict[str, Any] = {"method": method, "tolerance": tolerance, "longest_step": longest_step}
    options |= {"state": settings.state(robot), "torque": settings.laws("torque"), "driven": settings.laws("driven")}
    with errors_about(file), Count("simulating") as bar:
        motion = simulate(robot, times, order, strict=False, drives=not settings.no_drives, progress=bar, **options)
    peaks = table_peaks(motion.dataset)
    if not output.json:
        print_text(robot_motion_summary(motion, file))
        show_peaks(peaks)
    output.write(lambda: motion.dataset)
    output.tell("simulate", lambda: robot_motion_result(motion, peaks, file, output.out))
    with errors_about(file):
        raise_for_status(motion)
    return 0
