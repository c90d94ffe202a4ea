"""Robots from MJCF files: compiled by MuJoCo, then read body by body."""

from __future__ import annotations

import dataclasses
import importlib
import itertools
import re
from collections.abc import Container, Iterable
from os import PathLike
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.errors import JounceError, RobotError, RobotFileError
from jounce.io.robots.elements.faults import FIXED_ALREADY, LEAVE, MOCAP, Faults, left_out
from jounce.io.robots.elements.followers import with_room
from jounce.io.robots.elements.xml_elements import Element
from jounce.io.robots.mjcf.drives import Drives, works
from jounce.io.robots.mjcf.files import check_assets, check_copies, check_fusion, included, line_of, quiet_mujoco
from jounce.io.robots.mjcf.left_out import SkippedPart, left_out_of_model, left_out_of_spec, note_shells
from jounce.io.robots.mjcf.ties import NO_CLOSURE, JointRelations, linear_tendons, tied_tendons
from jounce.rigid.inertia import Inertia
from jounce.robot.model.couplings import Coupling
from jounce.robot.model.floating_base import floating_joints
from jounce.robot.model.links_and_joints import Closure, Joint, Limits, Link
from jounce.robot.model.mimics import Mimic
from jounce.robot.model.tree import quaternion_matrix, turn_about
from jounce.robot.robot import Robot

_Vector = Float[np.ndarray, "3"]
_Matrix = Float[np.ndarray, "3 3"]
DEFORMABLE = "has deformable parts (flex), which no rigid body stands for"
POSE_KEYS = ("pos", "quat", "axisangle", "xyaxes", "zaxis", "euler")
NUMERIC = {  # attributes whose numbers MuJoCo accepts even if they are not finite
    **dict.fromkeys(("body", "site"), POSE_KEYS),
    "inertial": (*POSE_KEYS, "mass", "diaginertia", "fullinertia"),
    "joint": ("pos", "axis", "range", "ref", "armature", "damping", "frictionloss", "polycoef"),
    "freejoint": ("armature", "damping", "frictionloss"),
    "option": ("gravity",),
    **dict.fromkeys(("motor", "position", "velocity", "damper", "general"), ("gear",)),
}


def read_mjcf(root: Element, faults: Faults, allow: Iterable[str | PathLike[str]] = ()) -> Robot:
    """Return the robot of an MJCF file, as compiled by MuJoCo.

    The base is the link ``world``. Hinges and slides keep their anchors and reference positions: a coordinate is
    MuJoCo's ``qpos``. A ball becomes three turns z, y, x about moving axes, zero in the pose of the file. A free joint
    becomes three slides along the axes of the world, whose coordinates are the position of the body, and three such
    turns, zero where the axes of the body are those of the world. The drive of such joints acts on the angular velocity
    (`BallDrive`). Several joints on one body have massless links between them. Bodies and joints without a name are
    called ``body_1``, ``joint_0`` and so on, by their number in MuJoCo.

    The reader takes armature, damping, friction and linear springs of joints, with the armature and damping of their
    actuators, tendons along joints (`Tendon`), and the compensated share of gravity of bodies. Ranges become limits,
    and symmetric ranges of force limits of effort. A joint tied to another by a linear equality, of joints or of
    tendons along joints, follows it. Active equalities of type connect and weld become closures, named closure_0 and so
    on if they have no name. Contacts and everything else that is no body, joint or actuator of a joint are left out,
    with a warning of nonlinear springs, fluids, and contributions of other tendons and their actuators. A disabled part
    is zero.

    Parameters
    ----------
    root : Element
        Element ``<mujoco>``; MuJoCo itself reads the file again.
    faults : Faults
        Records values that no real robot has, and parts that are left out.
    allow
        Folders besides that of the file below which included files and meshes may lie.

    Raises
    ------
    RobotFileError
        If MuJoCo refuses the file, or it contains something that a tree of rigid bodies cannot have.
    """
    try:
        mujoco: Any = importlib.import_module("mujoco")
    except ImportError:
        message = 'reading MJCF files needs the package mujoco, which is not installed: pip install "jounce[mjcf]"'
        raise RobotFileError(message, path=root.path) from None
    parts = [root, *included(root, allow)]
    for part in parts:
        _check_numbers(part)
    check_copies(parts)
    try:
        with quiet_mujoco(mujoco):
            spec = mujoco.MjSpec.from_file(root.path)
            scaled = spec.compiler.fusestatic and getattr(spec.compiler, "settotalmass", 0.0) > 0  # deprecated
            check_fusion(spec, mujoco, root)
            unread = left_out_of_spec(spec, mujoco)
            if not works(spec.option.disableflags, "EQUALITY", mujoco):
                for equality in spec.equalities:
                    equality.active = False
            _strip(spec, mujoco, tied_tendons(spec, mujoco, root.path) | linear_tendons(spec, mujoco))
            check_assets(spec, parts, allow)
            model = spec.compile()
    except (ValueError, RuntimeError, OSError) as error:
        raise _as_file_error(str(error), root) from None
    if scaled and model.body_mass[model.body_weldid == 0].any():
        # whether MuJoCo counts bodies fixed to the world depends on references to them, such as by a sensor
        message = "settotalmass with fusestatic depends on which bodies fixed to the world are kept"
        raise root.error(f"{message}; remove fusestatic, or give masses instead", "compiler.settotalmass")
    reader = _Reader(root, mujoco, spec, model, faults)
    robot = reader.robot()
    reader.tell(unread, parts)
    return robot


def _check_numbers(root: Element) -> None:
    """Raise an error for numbers that are not finite, which MuJoCo may accept, and for deformable parts."""
    names = {element.attributes.get(key) for element in root.walk() for key in ("name", "class")}
    for element in root.walk():
        if element.tag in ("flex", "flexcomp"):
            raise element.error(DEFORMABLE)
        numeric = NUMERIC.get(element.tag, ())
        for key, text in element.attributes.items():
            words = text.split()
            if key in numeric or (text not in names and any(re.fullmatch(r"[+-]?nan", word, re.I) for word in words)):
                element.numbers(key, len(words), element.attributes.get("name") or element.tag, key)


def _as_file_error(error_text: str, root: Element) -> RobotFileError:
    """Return a message of MuJoCo as an error with the place that it names."""
    name = re.search(r"[Ee]lement (?:name )?'([^']+)'", error_text)
    words = re.sub(r"\s*\n?Element (?:name )?'.*", "", error_text, flags=re.DOTALL)
    words = ascii(re.sub(r"^(?:XML )?Error: (?:Error: )?", "", words.strip()))[1:-1]
    message = f"MuJoCo cannot use this: {' '.join(words.replace(chr(92) + 'n', ' ').split())}"
    if "opening file" in words and (name is None or name[1] != "include"):
        advice = "meshes are needed only for bodies without an <inertial>: give those bodies one, or put the file where"
        message += f"; {advice} the model looks for it"
    elif "mass and inertia of moving bodies" in words:
        message += "; give the body an <inertial> with a mass and an inertia, or a <geom> with a size"
    named = None if name is None else ascii(name[1])[1:-1]
    return RobotFileError(message, path=root.path, line=line_of(error_text), name=named)


def _strip(spec: Any, mujoco: Any, tied: Container[str]) -> None:
    """Delete parts that do not affect the motion of rigid bodies, so that no mesh or texture has to exist.

    A shape is kept if it gives a body its mass, a tendon if it is tied.
    """
    spec.compiler.fusestatic = False  # otherwise bodies without joints would lose their frames
    joints = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)  # these differ for balls and free joints
    unused = [actuator for actuator in spec.actuators if actuator.trntype not in joints]
    unused += list(spec.lights)
    unused += [tendon for tendon in spec.tendons if tendon.name not in tied]
    for parts in (spec.sensors, spec.pairs, spec.excludes, spec.keys, spec.tuples, spec.skins):
        unused += list(parts)
    unused += [e for e in spec.equalities if e.type == mujoco.mjtEq.mjEQ_TENDON and not e.active]
    always = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    remaining = []
    for body in spec.bodies:
        moves = body.name != "world" and (always or not body.explicitinertial)
        for shape in body.geoms:
            (remaining if moves and _has_mass(shape, spec.compiler) else unused).append(shape)
    for shown in (*remaining, *spec.sites):
        shown.material = ""
    for material in spec.materials:  # materials are kept, because tendons keep their names whatever is set here
        material.textures = [""] * len(material.textures)
    meshes, fields = ({getattr(shape, name) for shape in remaining} for name in ("meshname", "hfieldname"))
    unused += [mesh for mesh in spec.meshes if mesh.name not in meshes]
    unused += [field for field in spec.hfields if field.name not in fields]
    unused += list(spec.textures)
    for part in unused:
        spec.delete(part)


def _has_mass(shape: Any, compiler: Any) -> bool:
    """Return whether a shape contributes to the mass of its body; its mass is NaN if it follows from the density."""
    first, last = compiler.inertiagrouprange
    return bool(first <= shape.group <= last and (shape.density if np.isnan(shape.mass) else shape.mass) > 0)


class _Reader:
    """Converts a compiled model to links and joints."""

    def __init__(self, root: Element, mujoco: Any, spec: Any, model: Any, faults: Faults):
        self.root, self.mujoco, self.spec, self.model, self.faults = root, mujoco, spec, model, faults
        kinds = ("free", "ball", "hinge", "slide")
        self.kind = {name: int(getattr(mujoco.mjtJoint, f"mjJNT_{name.upper()}")) for name in kinds}
        self.bodies = names_of_bodies(model)
        self.joint_names = _names([model.joint(k).name for k in range(model.njnt)], "joint")
        self.lines = {  # a <freejoint> has no line of its own
            f"joints.{self.joint_names[joint.id]}": line_of(joint.info) or line_of(joint.parent.info)
            for joint in spec.joints
        }
        self.lines |= {f"links.{self.bodies[body.id]}": line_of(body.info) for body in spec.bodies}
        self.links: list[Link] = []
        self.joints: list[Joint] = []
        self.ties = JointRelations(model, mujoco, self.joint_names)
        self.mimics: dict[str, Mimic] = {}
        self.closures: list[Closure] = []
        self.drives = Drives(model, mujoco, self.joint_names)
        self.couplings: list[Coupling] = []

    def error(self, message: str, name: str, **value: Any) -> RobotFileError:
        """Return an error about a joint or link, with its line."""
        key = name
        while key and key not in self.lines:
            key = key.rpartition(".")[0]
        return RobotFileError(message, path=self.root.path, line=self.lines.get(key), name=ascii(name)[1:-1], **value)

    def robot(self) -> Robot:
        """Return the robot."""
        model = self.model
        if model.nflex:
            raise RobotFileError(DEFORMABLE, path=self.root.path)
        self._tie()
        try:
            for k in range(model.nbody):
                self._body(k)
            gravity = model.opt.gravity if self.drives.works("GRAVITY") else (0.0, 0.0, 0.0)
            couplings = [*self.couplings, *self.drives.tendons(self.ties.fixed)]
            name = self.root.attributes.get("model") or "robot"
            joints = with_room(self.joints, self.faults, self._located, self.ties.fixed)
            robot = Robot(name, self.links, joints, gravity, self.closures, couplings=couplings)
            return robot.locked(self.ties.fixed) if self.ties.fixed else robot
        except RobotFileError:
            raise
        except RobotError as error:
            raise self._located(error) from None

    def _located(self, error: RobotError) -> RobotFileError:
        return self.error(error.message, error.name or "", value=error.value)

    def tell(self, skipped: Iterable[SkippedPart], parts: Iterable[Element]) -> None:
        """Record the parts that are left out, of tendons and actuators (`skipped`) and of the compiled model."""
        options = [element for part in parts for element in part.walk() if element.tag == "option"]
        self.lines |= {f"option.{key}": element.line for element in options for key in element.attributes}
        others = left_out_of_model(self.model, self.mujoco, self.bodies, self.joint_names, self.ties.fixed)
        for heading, label, line, name, value in (*skipped, *others):
            if line is not None:
                self.lines[name] = line
            self.faults.leave_out(heading, label, self.error(left_out(heading), name, value=value))
        note_shells(self.spec, self.model, self.mujoco, self.bodies, self.root.path, self.faults)

    def _tie(self) -> None:
        """Read the equalities: ties between joints, and closures of loops."""
        model, kinds = self.model, self.mujoco.mjtEq
        lines = [line_of(equality.info) for equality in self.spec.equalities]
        names = _names([model.equality(k).name for k in range(model.neq)], "closure")
        for k in np.flatnonzero(model.eq_active0):
            kind, name = model.eq_type[k], model.equality(int(k)).name
            location = {"path": self.root.path, "line": lines[k], "name": f"equality.{name}" if name else "equality"}
            self.lines[f"closures.{names[k]}"] = lines[k]
            if kind in (int(kinds.mjEQ_CONNECT), int(kinds.mjEQ_WELD)):
                closure = self._closure(k, names[k])
                welded = [int(model.body_weldid[self.bodies.index(link)]) for link in closure.links]
                mocap = [model.body_mocapid[body] >= 0 for body in welded]
                rigid = [0 if is_mocap else body for body, is_mocap in zip(welded, mocap, strict=True)]
                if rigid[0] == rigid[1]:
                    message = f"{closure.links[0]} and {closure.links[1]} are fixed to one another, and need no closure"
                    self.faults.leave_out(FIXED_ALREADY, names[k], RobotFileError(message, **location))
                else:
                    self.closures.append(closure)
                    for link in itertools.compress(closure.links, mocap):
                        self.faults.leave_out(MOCAP, link, RobotFileError(LEAVE.format(MOCAP), **location))
                continue
            if kind == int(kinds.mjEQ_JOINT):
                self.ties.add_joints(k, location)
            elif kind == int(kinds.mjEQ_TENDON):
                self.ties.add_tendons(k, location)
            else:
                word = kinds(int(kind)).name.removeprefix("mjEQ_").lower()
                raise RobotFileError(f"an active equality of type {word} {NO_CLOSURE}", **location)
        self.mimics = self.ties.mimics

    def _closure(self, k: Any, name: str) -> Closure:
        """Return a connect or weld equality as a closure, with the anchors and the relative pose in MuJoCo."""
        model, data = self.model, self.model.eq_data[k]
        weld = model.eq_type[k] == int(self.mujoco.mjtEq.mjEQ_WELD)
        numbers = (int(model.eq_obj1id[k]), int(model.eq_obj2id[k]))
        if model.eq_objtype[k] == int(self.mujoco.mjtObj.mjOBJ_SITE):
            sites, turns = list(numbers), [quaternion_matrix(model.site_quat[i]) for i in numbers]
            points, rotation = [model.site_pos[i] for i in sites], turns[0] @ turns[1].T
            numbers = tuple(int(model.site_bodyid[i]) for i in sites)
        elif weld:  # the anchor in the frame of the second body, and its target in the frame of the first
            points, rotation = [data[3:6], data[0:3]], quaternion_matrix(data[6:10])
        else:
            points, rotation = [data[0:3], data[3:6]], None
        turning = weld and data[10] != 0  # a weld without torque holds only a point
        links = (self.bodies[numbers[0]], self.bodies[numbers[1]])
        return Closure(name, links, "weld" if turning else "connect", points, rotation=rotation if turning else None)

    def _body(self, k: int) -> None:
        """Add the link of a body, the joints that move it, and the massless links between them."""
        model, name = self.model, self.bodies[k]
        inertia = None
        if model.body_mass[k] > 0 or model.body_inertia[k].any():
            try:
                principal = Inertia(model.body_mass[k], tensor=model.body_inertia[k], strict=False)
                inertia = principal.moved(model.body_ipos[k], quaternion_matrix(model.body_iquat[k]))
            except JounceError as error:
                raise self.error(error.message, f"links.{name}.{error.name}", value=error.value) from None
            self.faults.check(principal, name, self.lines.get(f"links.{name}"))
        self.links.append(Link(name, inertia, 1.0 - self.drives.compensated(k)))
        if k == 0:
            return
        parent = self.bodies[model.body_parentid[k]]
        position, rotation = np.array(model.body_pos[k]), quaternion_matrix(model.body_quat[k])
        numbers = range(model.body_jntadr[k], model.body_jntadr[k] + model.body_jntnum[k])
        for j in numbers:
            anchor, is_last = np.array(model.jnt_pos[j]), j == numbers[-1]
            link = name if is_last and not anchor.any() else self._unused(f"{name}_{self.joint_names[j]}")
            if model.jnt_type[j] == self.kind["free"]:
                self._expand(j, parent, name, np.zeros(3), np.eye(3))
                return
            if link != name:
                self.links.append(Link(link))
            if model.jnt_type[j] == self.kind["ball"]:
                self._expand(j, parent, link, position + rotation @ anchor, rotation)
            else:
                self._single(j, parent, link, position + rotation @ anchor, rotation)
            parent, position, rotation = link, -anchor, np.eye(3)
        if parent != name:
            self.joints.append(Joint(self._unused(f"{name}_fixed"), parent, name, "fixed", position, rotation))

    def _unused(self, name: str) -> str:
        """Return a name that no body, joint or link has."""
        used = {*self.bodies, *self.joint_names, *(link.name for link in self.links), *(j.name for j in self.joints)}
        while name in used:
            name += "_"
        return name

    def _single(self, j: int, parent: str, child: str, position: _Vector, rotation: _Matrix) -> None:
        """Add a hinge or a slide; the pose in the file is that at the reference coordinate."""
        model, name = self.model, self.joint_names[j]
        turning, axis, reference = model.jnt_type[j] == self.kind["hinge"], model.jnt_axis[j], self.ties.reference(j)
        if turning and reference:
            rotation = rotation @ turn_about(axis, -reference)
        elif reference:
            position = position - rotation @ axis * reference
        drives, fault = self.drives.of_joint(j)
        if fault:
            raise self.error(f"{fault} must be one number, proportional to the velocity", f"joints.{name}.damping")
        limited = bool(model.jnt_limited[j])
        lower, upper = (float(value) for value in model.jnt_range[j]) if limited else (None, None)
        kind = "prismatic" if not turning else "revolute" if limited else "continuous"
        limits = Limits(lower=lower, upper=upper, effort=self.drives.efforts.get(j))
        mimic = self.mimics.get(name)
        self.joints.append(
            Joint(name, parent, child, kind, position, rotation, axis, limits, mimic, **drives, start=reference)
        )

    def _expand(self, j: int, parent: str, child: str, position: _Vector, rotation: _Matrix) -> None:
        """Add the slides and turns that represent a free joint or a ball."""
        model, name = self.model, self.joint_names[j]
        _, joints = floating_joints(child, prefix=name)
        start = [0.0] * 6
        if model.jnt_type[j] == self.kind["ball"]:
            joints = joints[3:]
        else:
            first = model.jnt_qposadr[j]
            from scipy.spatial.transform import Rotation  # local, since the import of SciPy takes half a second

            turns = Rotation.from_matrix(quaternion_matrix(model.qpos0[first + 3 : first + 7])).as_euler("ZYX")
            start = [*model.qpos0[first : first + 3], *turns]
        drives = self.drives.of_several(j)
        if model.dof_dampingpoly[model.jnt_dofadr[j]].any():
            raise self.error("damping must be one number, proportional to the velocity", f"joints.{name}.damping")
        for k in np.flatnonzero(model.actuator_trnid[:, 0] == j):
            for field in ("armature", "damping", "dampingpoly"):
                values = getattr(model, f"actuator_{field}")[k]
                if np.any(values):
                    message = f"{field} of an actuator of a ball or free joint has no counterpart in slides and turns"
                    value = np.ravel(values).tolist()
                    raise self.error(f"{message}; set it to zero", f"joints.{name}.{field}", value=value)
        pose = {"position": position, "rotation": rotation}
        for part, place in zip(joints, start[-len(joints) :], strict=True):  # base_x may be the name of another joint
            end = child if part is joints[-1] else self._unused(part.child)
            if end != child:
                self.links.append(Link(end))
            arguments = {"name": self._unused(part.name), "parent": parent, "child": end, "start": float(place)}
            drive_arguments = {} if part.turning else drives
            self.joints.append(dataclasses.replace(part, **arguments, **pose, **drive_arguments))
            parent, pose = end, {}
        self.couplings += self.drives.ball(name, [joint.name for joint in self.joints[-3:]], drives)


def names_of_bodies(model: Any) -> list[str]:
    """Return the names of the links of the bodies of a compiled model, by number."""
    return _names([model.body(k).name for k in range(model.nbody)], "body")


def _names(given: list[str], kind: str) -> list[str]:
    """Return the names, with new ones in the place of empty ones."""
    names = list(given)
    for k, name in enumerate(names):
        if not name:
            name = f"{kind}_{k}"
            while name in names:
                name += "_"
            names[k] = name
    return names
