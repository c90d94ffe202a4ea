"""Parts of MuJoCo's dynamics that a robot lacks: some springs and tendons, gravity compensation, fluids."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from jounce.errors import RobotFileError
from jounce.io.robots.elements.faults import JOINT_SPRINGS, Faults
from jounce.io.robots.mjcf.drives import single_spring, works
from jounce.io.robots.mjcf.files import line_of

COMPENSATION = "gravity compensation of bodies"
FLUID = "forces of the fluid around"
YIELD = "yielding of springs"
UNCONTROLLED = "forces of actuators without an input"
RANGE_OF_BALLS = "ranges of balls"
RANGE_OF_TENDONS = "ranges of tendons"
OF_TENDONS = {
    "stiffness": "springs of tendons",
    "springyield": YIELD,
    "damping": "damping of tendons",
    "frictionloss": "friction of tendons",
    "armature": "armature of tendons",
}
OF_DRIVES = {
    "damping": "damping of actuators on tendons",
    "armature": "armature of actuators on tendons",
}
SHELLS = "the moments of inertia of shells of ellipsoids are those of MuJoCo, which are up to 13 percent wrong"
OWN_INERTIA = "give the body an <inertial>, or read the file without strict to have the values of MuJoCo"
ROUND = 0.01  # relative difference of half axes below which the moments are right to 2e-5
FLUID_UNITS = {"density": "kg/m^3", "viscosity": "Pa s"}


class SkippedPart(NamedTuple):
    """A part of the file that is not read: heading, shown name, line, dotted name of the entry, and value."""

    heading: str
    shown: str
    line: int | None
    name: str
    value: object


def left_out_of_spec(spec: Any, mujoco: Any) -> list[SkippedPart]:
    """Return the parts that are left out with tendons and their actuators, before these are removed."""
    active = _is_enabled(spec.option.disableflags, mujoco)
    # MuJoCo itself refuses damping and armature of actuators of other kinds
    drives = [(k, x) for k, x in enumerate(spec.actuators) if x.trntype == mujoco.mjtTrn.mjTRN_TENDON]
    kinds = ((OF_TENDONS, "tendon", enumerate(spec.tendons)), (OF_DRIVES, "actuator", drives))
    skipped = []
    for headings, kind, parts in kinds:
        for k, part in parts:
            name = part.name or f"{kind}_{k}"
            read = _read_of(part, mujoco) if kind == "tendon" else ()
            for key, heading in headings.items():
                value = np.ravel(getattr(part, key))
                if value.any() and active(key) and (key not in read or value[1:].any()):
                    skipped.append(
                        SkippedPart(heading, name, line_of(part.info), f"{kind}s.{name}.{key}", _plain(value))
                    )
    for k, actuator in enumerate(spec.actuators if active("actuation") else ()):
        if actuator.ctrlspec == int(mujoco.mjtCtrlInput.mjINPUT_NONE):  # such as friction of a motor, or its brake
            name = actuator.name or f"actuator_{k}"
            skipped.append(SkippedPart(UNCONTROLLED, name, line_of(actuator.info), f"actuators.{name}.input", "none"))
    for k, tendon in enumerate(spec.tendons if active("range") else ()):
        automatic = spec.compiler.autolimits and tendon.limited == int(mujoco.mjtLimited.mjLIMITED_AUTO)
        if tendon.limited == int(mujoco.mjtLimited.mjLIMITED_TRUE) or (automatic and tendon.range[0] < tendon.range[1]):
            name = tendon.name or f"tendon_{k}"
            location = f"tendons.{name}.range"
            skipped.append(SkippedPart(RANGE_OF_TENDONS, name, line_of(tendon.info), location, tendon.range.tolist()))
    return skipped


def _read_of(tendon: Any, mujoco: Any) -> tuple[str, ...]:
    """Return the attributes of a tendon that are read, as far as they are single numbers."""
    if not len(tendon.path) or any(part.type != mujoco.mjtWrap.mjWRAP_JOINT for part in tendon.path):
        return ()
    lengths = np.ravel(tendon.springlength)
    slack = len(set(lengths.tolist())) > 1 and lengths[0] != -1 and lengths[1] != -1
    read = ("damping", "frictionloss", "armature")
    return read if slack else ("stiffness", *read)


def left_out_of_model(
    model: Any, mujoco: Any, bodies: Sequence[str], joints: Sequence[str], fixed: Container[str]
) -> Iterator[SkippedPart]:
    """Yield the parts of the joints, the bodies and the whole of a compiled model that are left out.

    Lines are those of the elements.

    Parameters
    ----------
    model, mujoco
        Compiled model, and the package.
    bodies, joints : sequence of str
        Names of the bodies and joints, by number.
    fixed : container of str
        Joints that an equality holds in place, which no force moves.
    """
    active = _is_enabled(model.opt.disableflags, mujoco)
    is_free = [name not in fixed for name in joints]
    for j, name in enumerate(joints):
        stiffness = np.array([model.jnt_stiffness[j], *model.jnt_stiffnesspoly[j]])
        if stiffness.any() and active("stiffness") and is_free[j] and not single_spring(model, j):
            yield SkippedPart(JOINT_SPRINGS, name, None, f"joints.{name}.stiffness", _plain(stiffness))
        elif stiffness.any() and active("stiffness") and is_free[j] and model.jnt_springyield[j]:
            yield SkippedPart(YIELD, name, None, f"joints.{name}.springyield", float(model.jnt_springyield[j]))
        if model.jnt_limited[j] and model.jnt_type[j] == int(mujoco.mjtJoint.mjJNT_BALL) and active("range"):
            yield SkippedPart(RANGE_OF_BALLS, name, None, f"joints.{name}.range", float(model.jnt_range[j, 1]))
    passive = active("stiffness") or active("damping")  # MuJoCo disables all such forces if it disables both
    falls = model.opt.gravity.any() and active("gravity")
    needs_compensation = passive and falls and model.jnt_actgravcomp.any()  # otherwise bodies feel less gravity
    for k in np.flatnonzero((model.body_gravcomp != 0) & (model.body_mass > 0)).tolist() if needs_compensation else ():
        if any(is_free[j] and not model.jnt_actgravcomp[j] for j in _moved_by(model, k)):
            yield SkippedPart(
                COMPENSATION, bodies[k], None, f"links.{bodies[k]}.gravcomp", float(model.body_gravcomp[k])
            )
    fluid = {key: float(getattr(model.opt, key)) for key in FLUID_UNITS if getattr(model.opt, key)}
    massive = np.flatnonzero(model.body_mass).tolist()
    if fluid and passive and any(is_free[j] for k in massive for j in _moved_by(model, k)):
        phrase = " and ".join(f"{key} {value:g} {FLUID_UNITS[key]}" for key, value in fluid.items())
        yield SkippedPart(FLUID, phrase, None, f"option.{next(iter(fluid))}", next(iter(fluid.values())))


def note_shells(spec: Any, model: Any, mujoco: Any, bodies: Sequence[str], path: str, faults: Faults) -> None:
    """Record the bodies with mass on the surface of ellipsoids other than spheres, whose moments are not right.

    Raises
    ------
    RobotFileError
        If they are errors.
    """
    for shape in spec.geoms:
        size = model.geom_size[shape.id]
        ellipsoid = model.geom_type[shape.id] == int(mujoco.mjtGeom.mjGEOM_ELLIPSOID)
        hollow = shape.typeinertia == mujoco.mjtGeomInertia.mjINERTIA_SHELL
        if ellipsoid and hollow and np.ptp(size) > ROUND * size.max():
            name = bodies[int(model.geom_bodyid[shape.id])]
            location = {"path": path, "line": line_of(shape.info), "name": f"links.{name}.shellinertia"}
            error = RobotFileError(f"{SHELLS}; {OWN_INERTIA}", **location, value=size.tolist())
            faults.add(SHELLS, name, error)


def _moved_by(model: Any, body: int) -> Iterable[int]:
    """Yield the joints between a body and the world."""
    while body > 0:
        first = int(model.body_jntadr[body])
        yield from range(first, first + int(model.body_jntnum[body]))
        body = int(model.body_parentid[body])


def _is_enabled(flags: int, mujoco: Any) -> Callable[[str], bool]:
    """Return a function that tells whether the file leaves the dynamics of an attribute enabled."""
    parts = {"stiffness": "SPRING", "damping": "DAMPER", "frictionloss": "FRICTIONLOSS", "gravity": "GRAVITY"}
    parts |= {"springyield": "SPRING", "actuation": "ACTUATION", "range": "LIMIT"}
    return lambda key: key not in parts or works(flags, parts[key], mujoco)


def _plain(values: np.ndarray) -> object:
    """Return a single number if those of higher powers are zero, else all numbers."""
    return values.tolist() if values[1:].any() else float(values[0])
