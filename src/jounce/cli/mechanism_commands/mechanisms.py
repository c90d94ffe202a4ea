"""The commands that solve and simulate mechanism files, and print their schema."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from jounce.base.activity import Count
from jounce.cli.options import (
    NO_TABLE,
    PLAIN,
    PLAIN_MECHANISM,
    Heading,
    MechanismReading,
    TableOutput,
    errors_about,
    spare_inputs,
    written,
)
from jounce.cli.robot_motion import RobotRun, simulate_robot_file
from jounce.errors import JounceError
from jounce.io.files import ROBOT_FILES
from jounce.reporting.terminal import print_text, show_peaks, show_table

if TYPE_CHECKING:
    from jounce.integrate import AbstractMethod
    from jounce.kinematics import ChunkedMotion, Motion
    from jounce.mechanism import Mechanism

PLAIN_RUN = RobotRun()


def run(
    file: Path,
    /,
    *,
    order: int = 4,
    tolerance: float = 1e-12,
    no_refine: bool = False,
    holding: bool = False,
    holding_out: Path | None = None,
    reading: MechanismReading = PLAIN_MECHANISM,
    heading: Heading = PLAIN,
    output: TableOutput = NO_TABLE,
) -> int:
    """Solve a mechanism file and print peak values, position to jounce.

    Parameters
    ----------
    file
        Mechanism file: .yaml, .yml, .toml or .json.
    order
        Highest derivative, 0 to 30; 3 is jerk, 4 jounce.
    tolerance
        Tolerance of positions, rad or sizes of the mechanism.
    no_refine
        Search peaks at the instants only, not between them.
    holding
        Print the range of drive forces that hold it at rest.
    holding_out
        Write this range at every instant to this .csv file, SI.

    Examples
    --------
      jounce run examples/four_bar.yaml
      jounce run examples/rsur.yaml --order 8 --out motion.nc
      jounce run examples/four_bar.yaml --set "BC=15 cm" --set tau=3
      jounce run examples/four_bar.yaml --times 0:tau:1001 --out fine.csv
      jounce run examples/four_bar.yaml --units angle=deg,length=mm
      jounce run examples/screw_jack.yaml --holding
      jounce run examples/worm_gearhead.yaml --holding-out torque.csv
    """
    output.check()
    if holding_out is not None:
        from jounce.io.files.writing import check_target

        check_target(holding_out, (".csv",), "a table of holding forces", overwrite=output.overwrite)
    units = heading.units
    mechanism = reading.mechanism(file)
    for target in (output.out, holding_out):
        spare_inputs(target, overwrite=output.overwrite)
    refine, holding = not no_refine, holding or holding_out is not None
    if _is_long(mechanism, file):
        if holding:
            raise JounceError("is for motions of fewer instants: give a coarser time grid", name="--holding", path=file)
        motion = _streamed(mechanism, file, order, tolerance, output, refine=refine, heading=units)
        return _write_result("run", motion, file, output, refine=refine)
    motion = solved(mechanism, file, order, tolerance)
    holding_options: Any = {"holding": holding, "holding_out": holding_out}
    return _finished("run", motion, file, output, refine=refine, heading=units, **holding_options)


def simulate(
    file: Path,
    /,
    *,
    order: int = 4,
    method: str = "taylor",
    tolerance: float = 1e-15,
    step: float | None = None,
    longest_step: float = math.inf,
    no_refine: bool = False,
    reading: MechanismReading = PLAIN_MECHANISM,
    robot: RobotRun = PLAIN_RUN,
    heading: Heading = PLAIN,
    output: TableOutput = NO_TABLE,
) -> int:
    r"""Simulate a mechanism or robot that moves under forces.

    Parameters
    ----------
    file
        Mechanism file with masses, or robot file: .urdf, .xml or .sdf.
    order
        Highest derivative, 0 to 30; 3 is jerk, 4 jounce.
    method
        taylor, obreshkov-4, obreshkov-6 or obreshkov-8.
    tolerance
        Tolerance of the error per step, rad or mechanism sizes.
    step
        Fixed step length, s, instead of error control.
    longest_step
        Largest step, s; each step is checked at 32 points or more.
    no_refine
        Search peaks at the instants only, not between them.

    Examples
    --------
      jounce simulate examples/andrews.yaml
      jounce simulate examples/double_pendulum.yaml --order 2 --out pendulum.nc
      jounce simulate examples/flyball_governor.yaml \
        --method obreshkov-6 --tolerance 1e-9
      jounce simulate examples/robots/scara.urdf --until "2 s" \
        --start "elbow=30 deg" --torque "shoulder=5*sin(t)" \
        --driven quill=0 --no-drives
    """
    output.check()
    if file.suffix.lower() in ROBOT_FILES:
        _refuse_options(file, reading)
        control: Any = {"method": method_of(method, step), "tolerance": tolerance, "longest_step": longest_step}
        return simulate_robot_file(file, order, robot, reading.allow, output, **control)
    for name in robot.given():
        option = f"--{name.replace('_', '-')}"
        message = (
            "is for robot files; a mechanism file has its own forces, and its own time unless --times gives another"
        )
        raise JounceError(message, name=option, path=file)
    units = heading.units
    mechanism = reading.mechanism(file)
    chosen = method_of(method, step)  # after the files of --import, which may register it
    spare_inputs(output.out, overwrite=output.overwrite)
    motion = simulated(mechanism, file, order, method=chosen, tolerance=tolerance, longest_step=longest_step)
    return _finished("simulate", motion, file, output, refine=not no_refine, heading=units)


def _refuse_options(file: Path, reading: MechanismReading) -> None:
    """Raise an error if an option of mechanism files is given for a robot file."""
    given = {"--set": reading.set_, "--import": reading.import_, "--times": reading.times, "--units": reading.units}
    given["--redundant-reactions"] = reading.redundant_reactions
    for name, value in given.items():
        if value:
            raise JounceError("is for mechanism files; results for robots are in SI units", name=name, path=file)


def _is_long(mechanism: Mechanism, file: Path) -> bool:
    from jounce.kinematics import needs_chunks

    with errors_about(file):
        return needs_chunks(mechanism)


def _streamed(
    mechanism: Mechanism,
    file: Path,
    order: int,
    tolerance: float,
    output: TableOutput,
    *,
    refine: bool,
    heading: bool | None,
) -> ChunkedMotion:
    """Solve in chunks, each written before the next one is solved."""
    from jounce.io import in_units
    from jounce.kinematics import solve_in_chunks
    from jounce.reporting.peaks import parts_with_peaks

    with Count("solving") as bar:
        with errors_about(file):
            motion = solve_in_chunks(mechanism, order=order, tolerance=tolerance, progress=bar)
        parts = (in_units(part.dataset, mechanism.shown_units) for part in parts_with_peaks(motion, refine=refine))
        output.write_parts(parts, len(motion.time), header_units=heading)
    return motion


def _finished(
    command: str,
    motion: Motion,
    file: Path,
    output: TableOutput,
    *,
    refine: bool,
    heading: bool | None,
    holding: bool = False,
    holding_out: Path | None = None,
) -> int:
    """Print and write the results of a motion, and return the exit status."""

    def write() -> None:
        from jounce.io import in_units

        output.write(lambda: in_units(motion.dataset, motion.mechanism.shown_units), header_units=heading)

    holding_results = None
    if holding:
        from jounce.dynamics import holding_forces
        from jounce.reporting.facts.holding_facts import holding_facts, write_holding

        with errors_about(file):
            ranges = holding_forces(motion)
        holding_results = holding_facts(ranges)
        if holding_out is not None:
            target = holding_out
            written(lambda: write_holding(ranges, target, overwrite=output.overwrite))
    return _write_result(command, motion, file, output, refine=refine, write=write, held=holding_results)


def _write_result(
    command: str,
    motion: Motion | ChunkedMotion,
    file: Path,
    output: TableOutput,
    *,
    refine: bool,
    write: Callable[[], None] = lambda: None,
    held: list[dict[str, Any]] | None = None,
) -> int:
    """Print the results of a motion, write it, and return the exit status."""
    from jounce.reporting.facts.motion_facts import motion_facts
    from jounce.reporting.json.results import motion_result
    from jounce.reporting.peaks import peaks, shown_peaks
    from jounce.reporting.text.summaries import motion_summary

    if not output.json:
        print_text(motion_summary(motion_facts(motion), file.name))
        show_peaks(shown_peaks(peaks(motion, refine=refine), motion.mechanism.shown_units))
        if held is not None:
            from jounce.reporting.facts.holding_facts import holding_table

            show_table(holding_table(held, motion.mechanism.shown_units))
    write()
    extra = {} if held is None else {"holding": held}
    output.tell(command, lambda: motion_result(motion, file, output.out, refine) | extra)
    return outcome(motion, file)


def method_of(name: str, step: float | None) -> AbstractMethod:
    """Return the integrator with a name."""
    from jounce.integrate import method_named

    try:
        return method_named(name, step)
    except JounceError as error:
        error.name = "--method" if error.name == "method" else "--step"
        raise


def schema(of: Literal["mechanism", "results"] = "mechanism", /) -> int:
    """Print the JSON Schema of mechanism files, or of results.

    Editors use it to complete and check files.

    Parameters
    ----------
    of
        mechanism: files; results: what the commands print with --json.

    Examples
    --------
      jounce schema > mechanism.schema.json
      jounce schema results
    """
    import json

    if of == "results":
        from jounce.reporting.json.result_schema import result_schema as schema_function
    else:
        from jounce.io import json_schema as schema_function

    print_text(json.dumps(schema_function(), indent=1))
    return 0


def solved(mechanism: Mechanism, file: Path, order: int, tolerance: float = 1e-12) -> Motion:
    """Return the solution at all instants of the file, NaN where it fails."""
    from jounce.kinematics import solve

    with errors_about(file), Count("solving") as bar:
        return solve(mechanism, order=order, tolerance=tolerance, strict=False, progress=bar)


def simulated(mechanism: Mechanism, file: Path, order: int, **options: Any) -> Motion:
    """Return the simulation at all instants of the file, NaN where they are not reached."""
    from jounce.integrate import simulate as integrate

    with errors_about(file), Count("simulating") as bar:
        return integrate(mechanism, order=order, strict=False, progress=bar, **options)


def solve_or_simulate(mechanism: Mechanism, file: Path, order: int) -> Motion:
    """Return the simulation of a mechanism with initial conditions, or the solution of any other."""
    return simulated(mechanism, file, order) if mechanism.initial else solved(mechanism, file, order)


def outcome(motion: Motion | ChunkedMotion, file: Path) -> int:
    """Return 0, or raise the error of the first instant that failed."""
    from jounce.kinematics import raise_for_status

    with errors_about(file):
        raise_for_status(motion)
    return 0
