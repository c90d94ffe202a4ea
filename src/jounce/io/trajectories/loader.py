"""Reading of robot trajectories: laws, samples, messages and recordings of other tools."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from os import PathLike
from pathlib import Path

from jounce.errors import TrajectoryError, check_name
from jounce.io.files import DATA_FILES
from jounce.io.files.reading import name_of
from jounce.io.files.source import LINES, read_source
from jounce.io.trajectories.law_files import LawFile
from jounce.io.trajectories.recorded_trajectories import trajectory_of
from jounce.io.trajectories.recordings import Recording
from jounce.io.trajectories.ros.bags import SUFFIXES, is_bag, read_bag
from jounce.io.trajectories.ros.messages import is_message, read_messages
from jounce.io.trajectories.ros.topics import is_published, published
from jounce.io.trajectories.tables import read_recording
from jounce.robot import Robot
from jounce.settings import under_own_settings
from jounce.trajectory import JointTrajectory

CHOOSE = "to read one as a joint, choose joints by only=, or --joints on the command line"


@under_own_settings
def load_trajectory(
    path: str | PathLike[str],
    degree: int = 5,
    allow: Iterable[str | PathLike[str]] = (),
    joints: Iterable[str] | None = None,
    *,
    as_controller: bool = False,
    topic: str | None = None,
    robot: Robot | None = None,
    samples: bool = False,
    only: Iterable[str] | None = None,
) -> JointTrajectory:
    """Read the trajectory of a robot: laws, samples, or files of controllers and other tools.

    A CSV file has a row of names, ``time, JOINT, JOINT, ...``, and rows of numbers in s, m and rad, through which
    splines are laid. The columns ``JOINT_d1, JOINT_d2, ...`` of derivatives in result files are not read, but
    velocities ``JOINT_d1`` are compared with the positions. Velocities and accelerations ``JOINT_vel`` and
    ``JOINT_acc`` beside ``JOINT`` (or ``velocity``, ``acceleration``; positions ``JOINT_pos``) are read: the spline has
    them at its samples. Series of PlotJuggler (``/joint_states/JOINT/position``), ``rostopic echo -p``
    (``field.position0``) and libfranka (``state.q[0]``, with times in ms), and numbered columns (``q_0``, ``dq_0``),
    are read in the same way.

    A YAML, TOML or JSON file has either ``joints``, a law for each joint, or ``point_to_point`` with the keys
    ``profile``, ``duration``, ``start_time``, ``from``, ``to`` and ``limits``. Laws are expressions of ``t`` and of
    ``parameters``; ``time`` has the keys ``start``, ``stop`` and ``step`` or ``count``, and may be omitted with
    ``point_to_point``. A law may also go through samples, ``{samples: FILE.csv, value: COLUMN}``, of the coordinate or,
    with ``derivative: 2``, of its acceleration; ``initial`` holds the coordinate and the velocity at the first sample.
    Instead of ``joints``, ``motion: {samples: FILE.csv, derivative: 2}`` gives each column to the joint with its name;
    ``initial`` is then a list for each joint, and ``time`` may be omitted.

    Files for controllers (`export_trajectory`) are recognized by their content: tables with the columns ``q_d_0`` or
    ``target_q_0``, and ROS messages: JointTrajectory, FollowJointTrajectory goals, RobotTrajectory, DisplayTrajectory,
    plans and goals of ExecuteTrajectory of MoveIt, as YAML (also as printed by ``ros2 topic echo``) or JSON.
    Polynomials go through their positions, with velocities and accelerations if given. Joint states, echoed or in a bag
    (.bag, .db3, .mcap, or the folder of a bag; needs rosbags), are samples, as are the positions in dynamic joint
    states, and the measured values in the states of joint_trajectory_controller. JSON may have a message in each line,
    as rosbridge sends it and ``mcap cat --json`` prints it.

    Parameters
    ----------
    path
        File ending in .csv, .yaml, .yml, .toml, .json, .jsonl or .ndjson, or a bag.
    degree : int, default 5
        Degree of the splines through samples of positions only, odd from 3 to 11.
    allow
        Folders besides its own below which files named in it may lie.
    joints
        Names of the joints of a file without names, in its order; by default ``joint_0``, ``joint_1``, ... or the names
        of the columns.
    as_controller : bool, default False
        Whether to interpolate like joint_trajectory_controller of ros2_control: linearly between positions only, by
        cubics if velocities are given, by quintics if accelerations are given, too.
    topic : str, optional
        Topic of a bag, or of messages of rosbridge or mcap; by default that of the joint states, or of the only
        trajectory.
    robot : Robot, optional
        Robot whose joints are meant in a file without names: all moving joints, or all that turn, in its order.
    samples : bool, default False
        Whether to interpolate samples linearly instead of by splines, which suffices for `jounce.smooth`: an hour at 1
        kHz takes a third of the memory.
    only : iterable of str, optional
        Joints to read, if a file has more joints than the robot; by default all of them, except for columns of CSV
        files that are named after torques, currents and the like.

    Returns
    -------
    JointTrajectory
        Trajectory whose `times` are those of the samples, or the instants of ``time``; they start at the first stamp if
        stamps are counted from an epoch.

    Raises
    ------
    TrajectoryError
        If the file cannot be read or contains an error: the message names the file, the line, the column or entry, and
        the value.

    Warns
    -----
    RecordingWarning
        If parts of a recording were changed: rows out of order, repeated stamps, stamps from an epoch.

    Examples
    --------
    >>> import jounce as jn
    >>> trajectory = jn.load_trajectory("examples/trajectories/panda_good.csv")
    >>> trajectory.names[:2], trajectory.stop
    (('panda_joint1', 'panda_joint2'), 4.0)
    """
    recording = load_recording(path, allow, joints, topic)
    chosen = None if only is None else tuple(only)
    if isinstance(recording, LawFile):
        if as_controller:
            message = "contains laws, which no controller interpolates; give points or samples"
            raise TrajectoryError(message, path=str(path), name="as_controller")
        return _selected_laws(recording.trajectory(), chosen, str(path))
    if robot is not None and recording.unnamed:
        recording = _named_by(recording, robot)
    if chosen is None and joints is None and not recording.unnamed:
        recording = _positions_only(recording, robot)
    if chosen is not None:
        try:
            recording = recording.selected(chosen)
        except TrajectoryError as error:
            raise error.located(path=recording.path) from None
    if as_controller:
        _check_taken(recording)
    return trajectory_of(recording, degree, as_controller=as_controller, samples=samples)


def _selected_laws(trajectory: JointTrajectory, joints: tuple[str, ...] | None, path: str) -> JointTrajectory:
    """Return the trajectory of some joints."""
    if joints is None:
        return trajectory
    for name in joints:
        check_name("joint", name, trajectory.names, TrajectoryError, path=path, name="joints")
    return trajectory.part(joints)


def load_recording(
    path: str | PathLike[str],
    allow: Iterable[str | PathLike[str]] = (),
    joints: Iterable[str] | None = None,
    topic: str | None = None,
) -> Recording | LawFile:
    """Return the source of `load_trajectory`: rows of a recording, or laws."""
    name = name_of(path, TrajectoryError)
    given = None if joints is None else tuple(joints)
    if is_bag(name):
        return read_bag(name, given, topic)
    suffix = Path(name).suffix.lower()
    if suffix not in (".csv", *DATA_FILES, *LINES):
        message = "the kind of a trajectory file is given by its extension"
        raise TrajectoryError(f"{message}; valid: {', '.join(('.csv', *DATA_FILES, *LINES, *SUFFIXES))}", path=name)
    if suffix == ".csv":
        _check_no_topic(name, topic)
        return read_recording(name, given)
    source = read_source(name, allow, kind="trajectory", error_type=TrajectoryError, many=True)
    if is_published(source.data):
        source = published(source, topic)
    else:
        _check_no_topic(name, topic)
    if is_message(source.data):
        return read_messages(source, given)
    if source.several or source.unfinished is not None:
        second = source.unfinished if source.unfinished is not None else source.lines.get((1,))
        raise TrajectoryError("a second document starts; keep one", path=name, line=second)
    if given is not None:
        message = "this file names its joints; give names for what controllers take only"
        raise TrajectoryError(message, path=name, name="joints")
    return LawFile(source)


def _check_no_topic(name: str, topic: str | None) -> None:
    if topic is not None:
        message = "only bags, and messages of rosbridge or mcap, have topics"
        raise TrajectoryError(message, path=name, name="topic", value=topic)


def _named_by(recording: Recording, robot: Robot) -> Recording:
    """Return a recording without joint names with the names of a robot, if the number of joints determines them."""
    if all(name in robot.joint_names for name in recording.names):
        return recording
    turning = [name for name in robot.joint_names if robot.joints[name].turning]
    for names in (robot.joint_names, turning):
        if len(names) == len(recording.names):
            note = f"the columns name no joints: taken are {', '.join(names)}"
            return dataclasses.replace(recording.renamed(names), notes=(*recording.notes, note))
    message = (
        f"the file has {len(recording.names)} joints without names, and the robot {len(robot.joint_names)} that move, "
        f"{len(turning)} of which turn; name the columns after joints"
    )
    raise TrajectoryError(message, path=recording.path, name="joints")


def _positions_only(recording: Recording, robot: Robot | None) -> Recording:
    """Return a recording without columns whose names, unknown to the robot, are those of torques or the like."""
    joint_names = () if robot is None else robot.joints
    other_names = [name for name in recording.names if name in recording.others and name not in joint_names]
    if not other_names:
        return recording
    phrase = ", ".join(other_names)
    positions = [name for name in recording.names if name not in other_names]
    if not positions:
        message = f"columns hold positions, and these have names of other quantities: {phrase}; {CHOOSE}"
        raise TrajectoryError(message, path=recording.path, name=other_names[0])
    note = f"by their names no positions, and left out: {phrase}; {CHOOSE}"
    chosen = recording.selected(positions)
    return dataclasses.replace(chosen, notes=(*chosen.notes, note))


def _check_taken(recording: Recording) -> None:
    """Raise an error if a controller would refuse the points."""
    if recording.points and recording.notes:
        message = f"the controller refuses such points: {'; '.join(recording.notes)}; correct them"
        raise TrajectoryError(message, path=recording.path, name="as_controller")
