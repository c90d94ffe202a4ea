"""The command that makes a smooth motion within a deviation of noisy samples."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from jounce.cli.options import PLAIN_ROBOT, RobotReading, errors_about, spare_inputs, written
from jounce.cli.retiming import ROWS, deviation_of
from jounce.cli.servo import frequency_of
from jounce.errors import SampleWarning
from jounce.reporting.terminal import say, show_table

BLOCK = 50_000  # rows at once
FOLLOWED = 3.0  # times the noise: within less, the motion follows noise


def smooth(
    robot: Path,
    trajectory: Path,
    /,
    *,
    deviation: str,
    out: Path,
    rate: str = "1kHz",
    reading: RobotReading = PLAIN_ROBOT,
    overwrite: bool = False,
) -> int:
    r"""Make a smooth motion within a deviation of noisy samples.

    Its derivatives to the sixth are continuous, it stands still where the
    samples do, and its jerk is that of the motion, not of the noise.
    Needs Clarabel: pip install 'jounce[planning]'.

    Parameters
    ----------
    robot
        Robot file: URDF (.urdf), MJCF (.xml) or SDF (.sdf).
    trajectory
        A log: samples (.csv), joint states (.yaml), a bag.
    deviation
        From each sample, as 0.01deg, 1mm; a plain number is in rad or m.
    out
        Write positions to jerk to this .csv or .nc (NetCDF) file.
    rate
        Of the rows, as 1kHz, 500Hz; a plain number is in Hz.
    overwrite
        Let --out replace a file that is read here.

    Examples
    --------
      jounce smooth examples/robots/panda.urdf \
        examples/trajectories/panda_good.csv --deviation 0.001deg \
        --out smooth.csv
    """
    from jounce.io import check_writable, write_parts
    from jounce.mechanism import TimeGrid, time_grid
    from jounce.planning import smooth as find
    from jounce.reporting.text.tables import Table

    check_writable(out, overwrite=overwrite)
    frequency, allowed = frequency_of(rate), deviation_of(deviation)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SampleWarning)
        model = reading.robot(robot)
        given = reading.trajectory(trajectory, model)
        spare_inputs(out, overwrite=overwrite)
        with errors_about(trajectory, robot):
            motion = find(given, allowed)
    times = time_grid(TimeGrid(motion.start, motion.stop, 1 / frequency), {})
    written(lambda: write_parts(_parts(motion, times), out, len(times), overwrite=overwrite))
    say(f"{len(times)} rows from {motion.start:g} s to {motion.stop:g} s, within {allowed:.3g} rad or m of each sample")
    rows = [
        [
            name,
            f"{own.noise:.3g}",
            f"{own.away:.3g}",
            f"{own.cutoff[0]:.3g} to {own.cutoff[1]:.3g}",
            _dwells(own.dwells),
        ]
        for name, own in motion.joints.items()
    ]
    heading = ("joint", "noise", "farthest", "followed below, Hz", "stands still, s")
    show_table(Table("", heading, rows, numbers=(1, 2)))
    loud = [name for name, own in motion.joints.items() if allowed < FOLLOWED * own.noise]
    if loud:
        say(f"\nThe deviation is below three times the noise of {', '.join(loud)}: the motion follows noise there.")
    say(f"\nWritten to {out}")
    return 0


def _dwells(spans: tuple[tuple[float, float], ...]) -> str:
    shown = [f"{first:.4g} to {last:.4g}" for first, last in spans[:3]]
    return ", ".join([*shown, f"and {len(spans) - 3} more"] if len(spans) > len(shown) else shown)


def _parts(motion: Any, times: Any) -> Iterator[Any]:
    """Yield positions of the joints, and their derivatives to jerk, some instants at a time."""
    import xarray

    from jounce.units.shown_units import time_axes

    for first in range(0, len(times), BLOCK):
        some = times[first : first + BLOCK]
        values = motion.derivatives(some, ROWS)
        variables = {name: (("time", "derivative"), values[:, :, k]) for k, name in enumerate(motion.names)}
        yield xarray.Dataset(variables, coords=time_axes(some, ROWS + 1), attrs={"source": "jounce"})
