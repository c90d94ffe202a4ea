"""Common options of commands: reading of files, output of results, and the option or file named in errors."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from jounce.cli.file_kinds import explaining_other_kinds
from jounce.errors import JounceError, OutputError, RobotError, UnitError
from jounce.reporting.terminal import print_text, say_json

if TYPE_CHECKING:
    from jounce.mechanism import Mechanism
    from jounce.robot import CarriedLoad, Robot
    from jounce.trajectory import JointTrajectory
    from jounce.units.dimensions import Dimension
    from jounce.units.shown_units import ShownUnits

Overwrite = Annotated[bool, Parameter(alias="--force")]
"""The option with which commands may replace files; --force is its former name."""

AMONG_THE_OTHERS = Parameter(name="*")
"""Makes the fields of a class options of the command."""


OPTIONS = {
    "order",
    "tolerance",
    "longest_step",
    "port",
    "vary",
    "sample",
    "samples",
    "of",
    "indices",
    "scheduler",
    "workers",
    "chunk",
    "deviation",
    "duration",
    "hand_over",
    "as_controller",
    "topic",
    "joints",
}
"""Options by the arguments of library functions, which mostly have the same name."""

RENAMED = {"of": "output"}


class WritingError(Exception):
    """Raised if a computed result could not be written."""


@AMONG_THE_OTHERS
@dataclass(frozen=True, kw_only=True)
class MechanismReading:
    """How a mechanism file is read.

    Parameters
    ----------
    set_
        NAME=VALUE of a parameter, with a unit; repeatable.
    import_
        Python file with your own joints and forces; repeatable.
    allow
        Another folder from which the file may read others; repeatable.
    redundant_reactions
        Reactions of redundant constraints: unique only, or least_norm.
    times
        START:STOP:COUNT instead of the time of the file: 0:2s:201.
    units
        Units of all results, such as angle=deg,length=mm; repeatable.
    """

    set_: list[str] | None = None
    import_: list[Path] | None = None
    allow: list[Path] | None = None
    redundant_reactions: Literal["unique", "least_norm"] | None = None
    times: str | None = None
    units: list[str] | None = None

    def refuse_times(self, file: Path) -> None:
        """Raise an error if other instants are given for a file without a mechanism."""
        if self.times is not None:
            raise JounceError("is for mechanism files", name="--times", value=self.times, path=file)

    def mechanism(self, file: Path) -> Mechanism:
        """Return the mechanism of a file with changed parameters, after importing the classes of the user."""
        from jounce.io import load

        import_files(self.import_)
        with explaining_other_kinds(file, "mechanism"):
            mechanism = load(file, allow=allowed(self.allow))
        if self.redundant_reactions is not None:
            mechanism = replace(mechanism, redundant_reactions=self.redundant_reactions)
        if self.units:
            mechanism = replace(mechanism, units=dict(units_chosen(mechanism.shown_units, self.units).chosen))
        if self.set_ or self.times is not None:
            from jounce.io.mechanisms.overrides import override, times_chosen

            mechanism = override(mechanism, self.set_ or ())
            if self.times is not None:
                mechanism = replace(mechanism, time=times_chosen(mechanism, self.times))
        return mechanism


@AMONG_THE_OTHERS
@dataclass(frozen=True, kw_only=True)
class RobotReading:
    """How a robot and its trajectory are read.

    Parameters
    ----------
    payload
        LINK=MASS with a unit, at the origin of the link; repeatable.
        LINK=MASS@FROM:TO for a part of a motion, as @0.8s:2s.
    degree
        Degree of the splines through samples, odd, 3 to 11.
    strict
        Refuse a robot whose inertias no real body can have.
    allow
        Another folder from which the file may read others; repeatable.
    as_controller
        Interpolate as joint_trajectory_controller of ros2_control.
    topic
        Topic of a bag or of JSON lines, such as /joint_states.
    joints
        Joints to read, such as a,b; export writes them in this order.
    model
        Model to read from an SDF file with several.
    closures
        File with loops, springs and rotors to add to the robot.
    """

    payload: list[str] | None = None
    degree: int = 5
    strict: bool = False
    allow: list[Path] | None = None
    as_controller: bool = False
    topic: str | None = None
    joints: list[str] | None = None
    model: str | None = None
    closures: Path | None = None

    def robot(self, file: Path, *, carries: bool = False) -> Robot:
        """Return the robot of a file, with its permanent payload.

        With `carries`, loads during parts of a motion are left to `loads`; otherwise they are refused.
        """
        from jounce.io import load_robot
        from jounce.io.robots.payloads import with_payloads

        with explaining_other_kinds(file, "robot"):
            robot = load_robot(
                file, strict=self.strict, model=self.model, closures=self.closures, allow=allowed(self.allow)
            )
        return with_payloads(robot, [text for text in self.payload or () if not (carries and "@" in text)])

    def loads(self, robot: Robot, *, moving: bool = False) -> list[CarriedLoad]:
        """Return the loads that a robot carries during parts of a motion."""
        from jounce.io.robots.payloads import parsed_loads

        return parsed_loads(robot, [text for text in self.payload or () if "@" in text], moving=moving)

    def trajectory(self, file: Path, robot: Robot, *, samples: bool = False) -> JointTrajectory:
        """Return the trajectory of a file; without names of joints, it is that of the joints of the robot.

        With `samples`, only the positions of samples are used, with straight lines between them, as for smoothing.
        """
        from jounce.io import load_trajectory

        with explaining_other_kinds(file, "trajectory"):
            return load_trajectory(
                file,
                self.degree,
                allowed(self.allow),
                as_controller=self.as_controller,
                topic=self.topic,
                robot=robot,
                samples=samples,
                only=self.chosen,
            )

    @property
    def chosen(self) -> list[str] | None:
        """Joints to read from the trajectory; None for all."""
        if self.joints is None:
            return None
        return [name.strip() for text in self.joints for name in text.split(",")]


@AMONG_THE_OTHERS
@dataclass(frozen=True, kw_only=True)
class TableOutput:
    """Where the values of a result go.

    Parameters
    ----------
    out
        Write all values to this .csv or .nc (NetCDF) file.
    overwrite
        Let --out replace a file that is read here.
    json
        Print the result as JSON.
    """

    out: Path | None = None
    overwrite: bool = False
    json: bool = False

    def check(self) -> None:
        """Raise OutputError unless the file can be written."""
        from jounce.io import check_writable

        if self.out is not None:
            check_writable(self.out, overwrite=self.overwrite)

    def write(self, dataset: Callable[[], Any], *, header_units: bool | None = None) -> None:
        """Write the values, an xarray.Dataset, if they are requested."""
        if (out := self.out) is not None:
            from jounce.io import write

            written(lambda: write(dataset(), out, overwrite=self.overwrite, header_units=header_units))

    def write_parts(self, parts: Iterable[Any], count: int, *, header_units: bool | None = None) -> None:
        """Write values that arrive in parts along time, `count` instants in all; without a file, only iterate."""
        if (out := self.out) is None:
            for _ in parts:
                pass
            return
        from jounce.io import write_parts

        written(lambda: write_parts(parts, out, count, overwrite=self.overwrite, header_units=header_units))

    def tell(self, command: str, result: Callable[[], Mapping[str, Any]]) -> None:
        """Print the result as JSON, or where it was written."""
        print_result(command, result, self.out, json=self.json)


@AMONG_THE_OTHERS
@dataclass(frozen=True, kw_only=True)
class Heading:
    """What the heading of a CSV file says.

    Parameters
    ----------
    header_units
        Write units into the heading of a CSV file, SI units too.
    plain_header
        Write no units into the heading.
    """

    header_units: bool = False
    plain_header: bool = False

    @property
    def units(self) -> bool | None:
        """Whether the heading has units; None if it has them only for units other than SI.

        Raises
        ------
        JounceError
            If both options are given.
        """
        if self.header_units and self.plain_header:
            raise JounceError("cannot be given together with --header-units", name="--plain-header")
        return True if self.header_units else False if self.plain_header else None


def units_chosen(file_units: ShownUnits, texts: Sequence[str] | None) -> ShownUnits:
    """Return the units of a file, overridden by those of the option --units."""
    from jounce.units.shown_units import units_given

    given = units_given(texts or ())
    try:
        return file_units.merged(given)
    except JounceError as error:
        error.name = f"--units {str(error.name).removeprefix('units.')}"
        raise


PLAIN_MECHANISM, PLAIN_ROBOT, NO_TABLE, PLAIN = MechanismReading(), RobotReading(), TableOutput(), Heading()


def print_result(command: str, result: Callable[[], Mapping[str, Any]], out: Path | None, *, json: bool) -> None:
    """Print the result of a command as JSON, or where it was written."""
    if json:
        say_json(command, result())
    elif out is not None:
        print_text(f"\nWritten to {out}")


def import_files(paths: Sequence[Path] | None) -> None:
    """Run Python files with classes of the user."""
    if paths:
        from jounce.io.mechanisms.user_classes import import_file

        for path in paths:
            import_file(path)


def allowed(folders: Sequence[Path] | None) -> Sequence[Path]:
    """Return the folders allowed for files that are named in files; each must exist."""
    from jounce.io.files.reading import check_allowed

    try:
        check_allowed(folders or ())
    except JounceError as error:
        error.name = "--allow"
        raise
    return folders or ()


def spare_inputs(out: Path | None, *, overwrite: bool) -> None:
    """Raise OutputError if a result would replace a file that was read; to be called after reading."""
    if out is not None:
        from jounce.io.files.writing import check_target

        check_target(out, overwrite=overwrite)


def written(write: Callable[[], object]) -> None:
    """Call a function that writes a result, with its errors marked as errors of writing rather than of input."""
    try:
        write()
    except OutputError as error:
        raise WritingError(error) from None


@contextmanager
def errors_about(file: Path, robot: Path | None = None) -> Iterator[None]:
    """Add the option or the file to errors."""
    try:
        yield
    except JounceError as error:
        option, _, remainder = str(error.name or "").partition(" ")
        if option in OPTIONS:
            error.name = f"--{RENAMED.get(option, option).replace('_', '-')} {remainder}".rstrip()
            raise
        about_robot = robot is not None and isinstance(error, RobotError)
        raise error.located(path=robot if about_robot else file) from None


def positive_quantity(option: str, text: str, dimensions: Collection[Dimension], noun: str) -> float:
    """Return the positive number in a text, in SI units; its unit, if any, must have one of the dimensions."""
    from jounce.units.values import parse_value

    try:
        number: Any = float(text)
    except ValueError:
        number = text
    try:
        quantity = parse_value(number)
    except JounceError as error:
        raise error.located(name=option, value=text) from None
    if quantity.dimension is not None and quantity.dimension not in dimensions:
        raise UnitError(f"must be {noun}", name=option, value=text)
    if not isinstance(quantity.value, float) or quantity.value <= 0:
        raise JounceError("must be greater than zero", name=option, value=text)
    return quantity.value


CURVE_OPTIONS = {"driver": "--driver", "order": "--order", "count": "--points", "length": "--length", "time": "--time"}


@contextmanager
def options_named() -> Iterator[None]:
    """Add the option to errors about arguments of a trace."""
    try:
        yield
    except JounceError as error:
        error.name = CURVE_OPTIONS.get(str(error.name), error.name)
        raise
