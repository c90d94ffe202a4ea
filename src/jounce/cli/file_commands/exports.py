"""The command that writes a trajectory in the format of a controller."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Literal

from jounce.cli.options import PLAIN_ROBOT, RobotReading, errors_about, spare_inputs
from jounce.cli.robot_commands.servo import frequency_of
from jounce.errors import SampleWarning
from jounce.reporting.terminal import print_text, recorded_cautions


def export(
    robot: Path,
    trajectory: Path,
    /,
    *,
    format: Literal["franka", "ur", "ros"],  # noqa: A002 - the name of the option
    out: Path,
    rate: str | None = None,
    torques: bool = False,
    header_units: bool = False,
    reading: RobotReading = PLAIN_ROBOT,
    overwrite: bool = False,
) -> int:
    r"""Write a trajectory in the format of a robot controller.

    The file has positions, velocities and accelerations; --torques adds
    torques. jn.load_trajectory reads all formats back.

    Parameters
    ----------
    robot
        Robot file: URDF (.urdf), MJCF (.xml) or SDF (.sdf).
    trajectory
        Samples (.csv), laws or a motion (.yaml, .toml, .json).
    format
        franka or ur: a table (.csv); ros: a JointTrajectory (.yaml).
    out
        File to write.
    rate
        Rate of the rows [default: franka 1kHz, ur 500Hz, ros 100Hz].
    torques
        Write torques too.
    header_units
        Write units into the heading of a CSV file.
    overwrite
        Let --out replace a file that is read here.

    Examples
    --------
      jounce export examples/robots/panda.urdf \
        examples/trajectories/panda_pick.yaml --format franka --out pick.csv
      jounce export examples/robots/ur5.urdf \
        examples/trajectories/ur5_stack.yaml --format ros --rate 50Hz \
        --torques --out stack.yaml
    """
    from jounce.dynamics.limits.motion_ends import trajectory_ends
    from jounce.io import export_trajectory
    from jounce.reporting.motion_ends import between_words, ends_words
    from jounce.reporting.text.summaries import wrapped

    frequency = None if rate is None else frequency_of(rate)
    names = reading.chosen  # in the order of the controller, including joints at rest
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", SampleWarning)
        model = reading.robot(robot, carries=True)
        loads = reading.loads(model)
        motion = replace(reading, joints=None).trajectory(trajectory, model)
        if names is not None:
            motion = motion.part([name for name in motion.names if name in (*names, *model.joint_names)])
        spare_inputs(out, overwrite=overwrite)
        with errors_about(trajectory, robot):
            times = export_trajectory(
                model,
                motion,
                out,
                format,
                frequency,
                joints=names,
                torques=torques,
                loads=loads,
                header_units=header_units,
                overwrite=overwrite,
            )
            ends = trajectory_ends(model, motion)
    recorded_cautions(caught)
    first, last = float(times[0]), float(times[-1])
    print_text(f"{len(times)} rows from {first:g} s to {last:g} s written to {out}")
    print_text(
        "\n".join(
            wrapped(line) for line in [*between_words(motion), *ends_words(ends), *(load.words for load in loads)]
        )
    )
    return 0
