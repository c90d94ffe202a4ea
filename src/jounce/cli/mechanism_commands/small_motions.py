"""The command for the equilibrium of a mechanism and its modes of small motion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

from jounce.base.activity import Count
from jounce.cli.arguments import check_ending
from jounce.cli.file_kinds import explaining_other_kinds
from jounce.cli.options import (
    PLAIN_MECHANISM,
    MechanismReading,
    Overwrite,
    RobotReading,
    errors_about,
    print_result,
    spare_inputs,
    written,
)
from jounce.errors import JounceError
from jounce.reporting.terminal import print_text, show_table

OPTIONS = ("time", "without", "hold", "release", "coordinates", "method", "mode", "amplitude")


def modes(
    file: Path,
    /,
    *,
    time: float | None = None,
    method: Literal["settle", "newton"] = "settle",
    without: list[str] | None = None,
    hold: list[str] | None = None,
    release: list[str] | None = None,
    coordinate: list[str] | None = None,
    moving: bool = False,
    out: Path | None = None,
    animation: Path | None = None,
    mode: int = 1,
    amplitude: float = 0.1,
    reading: MechanismReading = PLAIN_MECHANISM,
    overwrite: Overwrite = False,
    json: bool = False,
) -> int:
    r"""Find an equilibrium of a mechanism, and its modes there.

    The command prints the equilibrium and its stability, natural
    frequencies, damping ratios, and what moves most in each mode. With
    --moving, the modes are those about the initial motion.

    Parameters
    ----------
    file
        Mechanism file with masses, or robot file: .urdf, .xml or .sdf.
    time
        Instant at which motion laws stop, s [default: the first].
    method
        settle minimizes energy; newton finds any equilibrium.
    without
        Driver to omit; repeatable.
    hold
        Joint of a robot to lock, or all; repeatable.
    release
        Driver whose force, not motion, stays constant; repeatable.
    coordinate
        Output or coordinate of a body to use; repeatable [chosen].
    moving
        Linearize about the initial motion, as for a bicycle.
    out
        Write eigenvalues and shapes to this .csv file.
    animation
        Write a mode as an animation to this .gif or .mp4 file.
    mode
        Number of the mode to animate, from 1.
    amplitude
        Amplitude of the animation, rad or sizes of the mechanism.
    overwrite
        Let --out replace a file that is read here.
    json
        Print the result as JSON.

    Examples
    --------
      jounce modes examples/sprung_four_bar.yaml
      jounce modes examples/press.yaml --without motor --json
      jounce modes examples/robots/planar_arm.xml
      jounce modes examples/double_pendulum.yaml --animation second.gif \
        --mode 2
      jounce modes examples/bicycle.yaml --moving --set push=0 \
        --coordinate frame.x --coordinate frame.turn_x --coordinate steer
    """
    from jounce.io.files.writing import check_target
    from jounce.reporting.facts.modes_facts import equilibrium_tables, equilibrium_words, modes_facts, modes_table

    if out is not None:
        check_target(out, (".csv",), "a table of modes", overwrite=overwrite)
    if animation is not None:
        from jounce.plot import check_animation

        check_animation(animation, overwrite=overwrite)
    subject, settings = _subject(file, reading, without or (), hold or ())
    for target in (out, animation):
        spare_inputs(target, overwrite=overwrite)
    from jounce.dynamics import equilibrium, linearize

    state = None
    with _errors_about(file):
        if moving:
            linearization = _in_motion(subject, time, coordinate, settings | {"release": release})
        else:
            state = equilibrium(subject, time, method=method, **settings)
            linearization = linearize(state, coordinates=coordinate, release=release or ())
        modes_found = linearization.modes
        facts = modes_facts(linearization, file, without or [])
        mode_motion = None if animation is None else modes_found.motion(mode, amplitude)
    if not json:
        resting = facts["equilibrium"]
        phrase = f"in motion at t = {linearization.time:g} s" if resting is None else equilibrium_words(resting)
        print_text(f"{linearization.mechanism.title or file.name}\n{phrase}\n")
        for table in (*(() if state is None else equilibrium_tables(state)), modes_table(modes_found)):
            show_table(table)
    if out is not None:
        from jounce.reporting.facts.modes_facts import write_modes

        written(lambda: write_modes(modes_found, linearization.mechanism.space, out, overwrite=overwrite))
    if mode_motion is not None and animation is not None:
        from jounce.plot import animate

        with errors_about(file), Count("drawing") as bar:
            duration = float(mode_motion.time[-1])
            written(lambda: animate(mode_motion, animation, speed=duration / 2, progress=bar, overwrite=overwrite))
        if not json:
            print_text(f"\nMode {mode} is in {animation}, {_slowly(duration)}")
    print_result("modes", lambda: {**facts, "written": out}, out, json=json)
    return 0


def _in_motion(subject: Any, time: float | None, coordinates: Sequence[str] | None, settings: dict[str, Any]) -> Any:
    """Return the linearization about the initial motion of a mechanism."""
    from jounce.dynamics import linearize
    from jounce.integrate import simulate
    from jounce.mechanism import Mechanism
    from jounce.mechanism.time import instants_of

    if not isinstance(subject, Mechanism) or any(settings.values()):
        message = "is for a mechanism as its file has it: a robot, --without, --hold and --release are about rest"
        raise JounceError(message, name="--moving")
    first = instants_of(subject.time, subject.parameter_values)[0] if time is None else time
    return linearize(simulate(subject, [float(first)], 2), coordinates=coordinates)


def _subject(file: Path, reading: MechanismReading, without: Sequence[str], hold: Sequence[str]) -> tuple[Any, Any]:
    """Return the mechanism or the robot of a file, and the setting of omitted drivers or held joints."""
    from jounce.io.files import DATA_FILES, ROBOT_FILES

    with explaining_other_kinds(file, "mechanism", "robot"):
        check_ending(file, (*DATA_FILES, *ROBOT_FILES))
    if file.suffix.lower() not in ROBOT_FILES:
        if hold:
            raise JounceError("is for robot files; drivers hold a mechanism", name="--hold")
        return reading.mechanism(file), {"without": without}
    reading.refuse_times(file)
    if without or reading.set_:
        raise JounceError("is for mechanism files; a robot file has none", name="--without" if without else "--set")
    robot = RobotReading(allow=reading.allow).robot(file)
    return robot, {"hold": "all" if list(hold) == ["all"] else hold}


def _slowly(period: float) -> str:
    """Return the speed of an animation with two seconds per period, in words."""
    slower = 2.0 / period
    return f"{slower:.3g} times slower than it is" if slower >= 1 else f"{1 / slower:.3g} times faster than it is"


@contextmanager
def _errors_about(file: Path) -> Iterator[None]:
    """Add the option or the file to errors."""
    try:
        yield
    except JounceError as error:
        if error.name in OPTIONS:
            error.name = f"--{'coordinate' if error.name == 'coordinates' else error.name}"
            raise
        raise error.located(path=file) from None
