"""Mechanism files in another format, and robots as mechanism files."""

from __future__ import annotations

import copy
import dataclasses
import os
import re
from collections.abc import Iterable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

from jounce.dynamics import DriverForceOutput, DriverTorqueOutput
from jounce.errors import JounceError, RobotError, check_name
from jounce.io.files.reading import named_file
from jounce.io.files.source import read_source
from jounce.mechanism import Mechanism, TimeGrid
from jounce.mechanism.mechanism import GROUND, names_column
from jounce.robot import Robot
from jounce.robot.closed_loops.closed_loop import DRIVE
from jounce.robot.model.couplings import Tendon
from jounce.units.assignments import assignments
from jounce.units.values import parse_value


def converted(
    path: str | PathLike[str], target: str | PathLike[str], allow: Iterable[str | PathLike[str]] = ()
) -> tuple[dict[str, Any], dict[Path, str]]:
    """Return the checked data of a mechanism file, with values as written, for a file in another place.

    Parameters
    ----------
    path
        Mechanism file.
    target
        Path of the new file, relative to which sample files are named.
    allow
        Folders besides that of the file below which sample files may lie.

    Returns
    -------
    data : dict
        Data by the keys of the schema.
    samples : dict of Path to str
        Sample files outside the folder of the target, to be copied, by their new paths.

    Raises
    ------
    MechanismFileError
        If the file cannot be read or contains an error.

    Examples
    --------
    >>> converted("examples/four_bar.yaml", "four_bar.toml")[0]["parameters"]["BC"]
    '14.23 cm'
    """
    from jounce.io.mechanisms.loader import load

    allow = tuple(allow)
    load(path, allow=allow)
    data = copy.deepcopy(read_source(path).data)
    data = {key: value for key, value in data.items() if value is not None}
    copies: dict[Path, str] = {}
    if Path(os.path.realpath(path)).parent != Path(os.path.realpath(target)).parent:
        _move_samples(data, path, Path(target).parent, allow, copies)
    return data, copies


def _move_samples(
    node: Any,
    path: str | PathLike[str],
    target_folder: Path,
    allow: Iterable[str | PathLike[str]],
    copies: dict[Path, str],
) -> None:
    """Rename sample files relative to another folder, and record those to be copied."""
    folders = [Path(os.path.realpath(folder)) for folder in (target_folder, *allow)]
    for entry in node.values() if isinstance(node, dict) else node if isinstance(node, list) else ():
        if isinstance(entry, dict) and isinstance(entry.get("samples"), str):
            file = named_file(entry["samples"], path, allow)
            if any(Path(file).is_relative_to(folder) for folder in folders):
                entry["samples"] = Path(os.path.relpath(file, folders[0])).as_posix()
            else:
                target = target_folder / Path(file).name
                while copies.setdefault(target, file) != file:  # a different file of the same name
                    target = target.with_name(f"{target.stem}_{target.suffix}")
                entry["samples"] = target.name
        _move_samples(entry, path, target_folder, allow, copies)


def assigned(robot: Robot, texts: Iterable[str], option: str, *, law: bool) -> dict[str, Any]:
    """Return values or laws of joints from texts ``JOINT=VALUE`` with units.

    Parameters
    ----------
    robot : Robot
        Robot with the joints.
    texts : iterable of str
        Texts; a value is a number in SI units, a number with a unit, or, for a law, an expression of t.
    option : str
        Option by which they are given, for messages.
    law : bool
        Whether expressions of t are permitted.

    Raises
    ------
    JounceError
        If a name is no joint, or a value does not suit the joint.

    Examples
    --------
    >>> import jounce as jn
    >>> scara = jn.load_robot("examples/robots/scara.urdf")
    >>> assigned(scara, ["quill=5 cm"], "--start", law=False)
    {'quill': 0.05}
    """
    values: dict[str, Any] = {}
    form = "a joint is given a value by JOINT=VALUE, such as 'elbow=30 deg'"
    for name, value in assignments(texts, option, form).items():
        check_name("moving joint", name, robot.joint_names, JounceError, name=option)
        kind = "angle" if robot.joints[name].turning else "length"
        try:
            values[name] = parse_value(_number_or_text(value), kind, ("t",) if law else ()).value
        except JounceError as error:
            raise error.located(name=f"{option} {name}", value=value) from None
    return values


def _number_or_text(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def with_file_names(robot: Robot) -> tuple[Robot, dict[str, str]]:
    """Return a robot whose names are valid in a mechanism file, and the changed names.

    Raises
    ------
    RobotError
        If the robot cannot be rebuilt.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 12, 1 / 12])
    >>> arm = jn.Robot("arm", [jn.Link("base"), jn.Link("rod 1", rod)], [jn.Joint("pin", "base", "rod 1")])
    >>> with_file_names(arm)[1]
    {'rod 1': 'rod_1'}
    """
    links = _file_names(name for name in robot.links if name != robot.base)
    links[robot.base] = robot.base
    file_names = _file_names([*robot.joints, *robot.closures])
    new_names = {old: new for names in (links, file_names) for old, new in names.items() if old != new}
    if not new_names:
        return robot, {}

    def joint(given: Any) -> Any:
        mimic = given.mimic and dataclasses.replace(given.mimic, joint=[file_names[x] for x in given.mimic.weights])
        ends = {"parent": links[given.parent], "child": links[given.child]}
        return dataclasses.replace(given, name=file_names[given.name], mimic=mimic, **ends)

    renamed = Robot(
        robot.name,
        [dataclasses.replace(link, name=links[link.name]) for link in robot.links.values()],
        [joint(given) for given in robot.joints.values()],
        robot.gravity,
        [
            dataclasses.replace(given, name=file_names[given.name], links=[links[name] for name in given.links])
            for given in robot.closures.values()
        ],
        robot.strict,
        [_with_joints(given, file_names) for given in robot.couplings.values()],
    )
    return renamed, new_names


def _with_joints(coupling: Any, names: Mapping[str, str]) -> Any:
    """Return a tendon, or the drive of a ball joint, with other names of joints."""
    if isinstance(coupling, Tendon):
        return dataclasses.replace(coupling, weights={names[name]: x for name, x in coupling.weights.items()})
    return dataclasses.replace(coupling, joints=[names[name] for name in coupling.joints])


def _file_names(names: Iterable[str]) -> dict[str, str]:
    by_name: dict[str, str] = {}
    names = list(names)
    for name in names:
        new = re.sub(r"[^A-Za-z0-9_-]", "_", name)[:80] or "part"
        new = f"_{new}" if new.startswith("-") else new
        if new == GROUND or names_column(new):
            new += "_"
        while new in by_name.values() or (new != name and new in names):
            new += "_"
        by_name[name] = new
    return by_name


def robot_mechanism(
    robot: Robot,
    start: Mapping[str, float],
    laws: Mapping[str, Any],
    *,
    hold: bool = False,
    drives: bool = True,
) -> Mechanism:
    """Return a robot as a mechanism for a file, with coordinates and driver loads as outputs.

    Parameters
    ----------
    robot : Robot
        Robot whose names are valid in a file.
    start : dict of str to float
        Coordinates near which it is assembled, rad or m; zero by default.
    laws : dict of str to law
        Laws of the driven coordinates.
    hold : bool
        Whether the other coordinates are held at their start; refused for robots with loops.
    drives : bool
        Whether the damping and the armature of the joints are included.

    Raises
    ------
    RobotError
        If the robot cannot be such a mechanism, or its loops cannot be closed near the start.
    """
    laws = dict(laws)
    if hold:
        if robot.closures:
            message = "the coordinates of a robot with loops depend on one another; name the driven ones by --drive"
            raise RobotError(message, name="--hold", value=list(robot.closures))
        laws |= {name: float(start.get(name, 0.0)) for name in robot.joint_names if name not in laws}
    mechanism = robot.mechanism(dict(start), drivers=laws, drives=drives, time=TimeGrid(0.0, 1.0, 0.01))
    if any(body.mass for body in mechanism.bodies.values()):
        loads: dict[str, Any] = {}
        for name in laws:
            turning = robot.joints[name].turning
            kind, word = (DriverTorqueOutput, "torque") if turning else (DriverForceOutput, "force")
            loads[f"{name}_{word}"] = kind(driver=name + DRIVE)
        mechanism = dataclasses.replace(mechanism, outputs={**mechanism.outputs, **loads})
    return mechanism
