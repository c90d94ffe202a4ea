"""Forces as outputs, with rates: driver forces, joint reactions, and applied forces."""

from collections.abc import Iterable
from typing import Any, ClassVar

import numpy as np

from jounce.base.modules import field
from jounce.base.shapes import ArrayLike, Numbers
from jounce.constraints import Cam, Rope
from jounce.constraints.base import Vector, is_bare_ratio
from jounce.constraints.planar import Belt
from jounce.dynamics.inverse.locked_friction import passing_words
from jounce.dynamics.inverse.motion_forces import MotionForces
from jounce.dynamics.inverse.outputs.output_words import (
    belt_words,
    cam_words,
    following,
    lift_off_words,
    ratio_words,
    signal_words,
    slack_words,
)
from jounce.dynamics.inverse.tooth_flanks import flank_words
from jounce.dynamics.masses import check_loads
from jounce.errors import MechanismError, check_choice, check_name, did_you_mean
from jounce.forces import AbstractForce
from jounce.kinematics import Motion, Status
from jounce.mechanism import AbstractMotionOutput, Mechanism
from jounce.mechanism.laws.driver_outputs import is_turning
from jounce.mechanism.mechanism import GROUND
from jounce.mechanism.resolve import resolve_element
from jounce.mechanism.system import POSITION_COMPONENTS
from jounce.trajectory import FollowingMotion

RATES = ("yank", "second rate", "third rate", "fourth rate")


class AbstractForceOutput(AbstractMotionOutput):
    """A force or torque in a mechanism; like accelerations, it has two derivatives fewer than the motion."""

    lost_orders = 2
    of_forces = True
    source: ClassVar[str] = ""  # the field that names the exerting element: driver, joint or force

    def check(self, mechanism: Mechanism) -> None:
        """Raise MechanismError unless the mechanism has the named element, and masses or applied forces."""
        kinds = {"driver": ("drivers",), "joint": ("joints", "drivers", "forces"), "force": ("forces",)}[self.source]
        elements = {name: element for kind in kinds for name, element in getattr(mechanism, kind).items()}
        name = getattr(self, self.source)
        check_name(self.source, name, elements, MechanismError, name=self.source)
        check_loads(mechanism, self.source)
        self._check_named(elements[name])

    def prepare(self, motion: Motion) -> None:
        """Compile the program of the balance of forces."""
        MotionForces.of(motion).prepare()

    def _check_named(self, element: Any) -> None:
        """Raise MechanismError unless the named element has the quantity."""

    def remark(self, motion: Motion, values: np.ndarray) -> str:
        """Return the reason for NaN values at solved instants: redundant constraints, or undetermined friction."""
        forces = MotionForces.of(motion)
        solved = motion.status == Status.OK
        if np.isfinite(values[solved]).all():
            return ""
        if forces.undetermined is None:
            return passing_words(forces)
        return (
            f"not unique, as constraints are redundant: {forces.open.words}; set redundant_reactions to least_norm, "
            "or to stiffnesses, to share the loads"
        )


class _DriverOutput(AbstractForceOutput):
    driver: str = field(static=True)

    source = "driver"

    def coefficients(self, motion: Motion) -> Numbers:
        """Return the Taylor coefficients of the driver force or torque, (levels, 1, time)."""
        size = motion.model.length if self.unit == "N*m" else 1.0
        return MotionForces.of(motion).unique(lambda forces: forces.driver_force(self.driver), size)

    def remark(self, motion: Motion, values: np.ndarray) -> str:
        """Return the reason for NaN values, or the instants at which the force of a cam changes its sign."""
        if reason := super().remark(motion, values):
            return reason
        if isinstance(getattr(motion.mechanism.drivers[self.driver], "motion", None), FollowingMotion):
            return lift_off_words(motion.time, values[:, 0])
        return signal_words(following(motion.mechanism, self.driver))


class DriverForceOutput(_DriverOutput):
    """Force of a driver along its prescribed length, N; its product with the rate of the law is the power."""

    unit = "N"
    rate_names = ("force", *RATES)

    def _check_named(self, element):
        if is_turning(element):
            raise MechanismError("this driver prescribes an angle, so that it exerts a torque", name="quantity")


class DriverTorqueOutput(_DriverOutput):
    """Torque of a driver along its prescribed angle, N m; its product with the rate of the law is the power."""

    unit = "N*m"
    rate_names = ("torque", *RATES)

    def _check_named(self, element):
        if not is_turning(element):
            raise MechanismError("this driver prescribes a length, so that it exerts a force", name="quantity")


class _Reaction(AbstractForceOutput):
    def is_vector(self, mechanism: Mechanism) -> bool:
        """Return whether the reaction has components, as all but planar torques do."""
        return self.unit == "N" or mechanism.space == "spatial"


class _JointOutput(_Reaction):
    joint: str = field(static=True)
    body: str | None = field(static=True, default=None)  # on which it acts; the second body of the joint by default
    frame: str = field(static=True, default="global")  # global, body, or the name of any body

    source = "joint"

    def check(self, mechanism: Mechanism) -> None:
        """Raise MechanismError unless the mechanism has the joint, its body and masses or applied forces."""
        super().check(mechanism)
        element = _exerting(mechanism, self.joint)
        felt = element.bodies if _is_load(element) else (*element.bodies, GROUND)
        if self.body is not None and self.body not in felt:
            message = f"is not joined by '{self.joint}'; {did_you_mean(self.body, felt)}"
            raise MechanismError(message, name="body", value=self.body)
        check_choice("frame", self.frame, ("global", "body", GROUND, *mechanism.bodies), MechanismError)

    def remark(self, motion: Motion, values: np.ndarray) -> str:
        """Return remarks: the reason for NaN values, contact forces that reactions leave out, and changes of flanks."""
        joints = motion.mechanism.joints
        bodies = {*_exerting(motion.mechanism, self.joint).bodies} - {GROUND}
        gears = [name for name, x in joints.items() if is_bare_ratio(x) and bodies & {*x.bodies}]
        cams = [
            name for name, x in joints.items() if isinstance(x, Cam) and name != self.joint and bodies & {*x.bodies}
        ]
        belts = [name for name, x in joints.items() if isinstance(x, Belt) and bodies & {*x.bodies}]
        forces = MotionForces.of(motion)
        loaded, pressed, pulled = ([x for x in names if forces.is_loaded(x)] for names in (gears, cams, belts))
        more_phrases = ratio_words(loaded), cam_words(pressed), belt_words(pulled), flank_words(forces, bodies)
        phrases = super().remark(motion, values), *more_phrases
        return "; ".join(filter(None, phrases))

    def _values(self, motion: Motion, point: ArrayLike | None, row: int, size: float) -> Numbers:
        """Return force or moment about a point of the body, by default that of the joint, with rates."""
        mechanism, forces = motion.mechanism, MotionForces.of(motion)
        element = _exerting(mechanism, self.joint)
        body = element.bodies[min(1, len(element.bodies) - 1)] if self.body is None else self.body
        index = [GROUND, *mechanism.bodies].index
        frame = {"global": None, "body": body}.get(self.frame, self.frame)
        center: Any = forces.point_of(self.joint, index(body)) if point is None else point

        def component_of(forces: MotionForces) -> Numbers:
            return forces.reaction(self.joint, index(body), None if frame is None else index(frame), center)[row]

        return component_of(forces) if isinstance(element, AbstractForce) else forces.unique(component_of, size)


def _exerting(mechanism: Mechanism, name: str) -> Any:
    """Return the driver, joint or applied force of a name, in this order."""
    return {**mechanism.forces, **mechanism.joints, **mechanism.drivers}[name]


def _is_load(element: Any) -> bool:
    """Return whether an element is an external load: an applied force on one body, without a reaction."""
    return isinstance(element, AbstractForce) and len(element.bodies) == 1


def _along_line(forces: MotionForces, name: str) -> Numbers:
    """Return the tension of a rope, or the pull of a belt, as Taylor coefficients, (levels, 1, time)."""
    index = forces.indices[name]
    factor = forces.model.system.groups[index.group].element.line_force()
    return forces.multipliers[:, list(index.own_rows)] * (factor if np.ndim(factor) == 0 else factor[index.instance])


class JointForceOutput(_JointOutput):
    """Reaction force of a joint, driver or force between bodies on one of its bodies, or on the ground, N.

    For a rope without a given body it is the tension. For a belt without a given body it is the pull of the strand that
    leaves the first pulley on the left of the line of centers, seen toward the second pulley, less that of the other
    strand.
    """

    unit = "N"
    rate_names = ("force", *RATES)

    def _is_line(self, mechanism: Mechanism) -> bool:
        return self.body is None and hasattr(mechanism.joints.get(self.joint), "line_force")

    def is_vector(self, mechanism: Mechanism) -> bool:
        """Return whether the force has components; a rope tension or belt pull has none."""
        return not self._is_line(mechanism)

    def check(self, mechanism: Mechanism) -> None:
        """Raise MechanismError unless the mechanism has the joint, its body and masses or applied forces."""
        super().check(mechanism)
        if self._is_line(mechanism) and self.frame != "global":
            message = "a force along a rope or a belt has no frame; give the body for the force on it"
            raise MechanismError(message, name="frame", value=self.frame)

    def coefficients(self, motion: Motion) -> Numbers:
        """Return the Taylor coefficients of the force, (levels, components, time)."""
        if self._is_line(motion.mechanism):
            return MotionForces.of(motion).unique(lambda forces: _along_line(forces, self.joint))
        return self._values(motion, None, 0, 1.0)

    def remark(self, motion: Motion, values: np.ndarray) -> str:
        """Return remarks: the reason for NaN values, forces that they leave out, and instants of a slack rope."""
        if not self._is_line(motion.mechanism):
            return super().remark(motion, values)
        rope = isinstance(motion.mechanism.joints[self.joint], Rope)
        slack = slack_words(motion.time, values[:, 0]) if rope else ""
        return "; ".join(filter(None, [AbstractForceOutput.remark(self, motion, values), slack]))


def slack_ropes(motion: Motion) -> dict[str, str]:
    """Return the slack ropes of a motion that have no output of their tension, with a text on the instants.

    While a rope would have to push, all results that depend on it are wrong. The tension is not checked in a mechanism
    without masses and applied forces, nor in a motion without accelerations.
    """
    mechanism, slack = motion.mechanism, {}
    ropes = [name for name, joint in mechanism.joints.items() if isinstance(joint, Rope)]
    reported = {x.joint for x in mechanism.outputs.values() if isinstance(x, JointForceOutput) and x.body is None}
    loaded = mechanism.forces or any(body.mass is not None for body in mechanism.rigid_bodies.values())
    if not loaded or len(motion.poses[1]["position"]) < 3:
        return {}
    for name in (name for name in ropes if name not in reported):
        tension = JointForceOutput(name).coefficients(motion)
        if phrase := slack_words(motion.time, np.asarray(tension)[0, 0]):
            slack[name] = f"its tension {phrase}"
    return slack


class JointTorqueOutput(_JointOutput):
    """Reaction torque of a joint, driver or force on one of its bodies, or the ground, about a point of that body, N m.

    By default the point is that of the joint, or the origin of a body on which the joint has none.
    """

    point: Vector = None  # m, in the frame of the body

    unit = "N*m"
    rate_names = ("torque", *RATES)

    def coefficients(self, motion: Motion) -> Numbers:
        """Return the Taylor coefficients of the torque, (levels, components, time)."""
        mechanism = motion.mechanism
        components = POSITION_COMPONENTS[mechanism.space]
        values = resolve_element(self, mechanism.parameter_values, components, f"outputs.{self.joint}")
        return self._values(motion, values["point"], 1, motion.model.length)


class _GroundOutput(_Reaction):
    source = "mechanism"  # the key of a file that names the owner of the force

    def check(self, mechanism: Mechanism) -> None:
        """Raise MechanismError unless there are masses or applied forces."""
        check_loads(mechanism, self.source)

    def _values(self, motion: Motion, point: ArrayLike, row: int, size: float) -> Numbers:
        """Return total force or moment about a point of the ground, with rates."""
        mechanism, forces, center = motion.mechanism, MotionForces.of(motion), np.asarray(point)
        internal_forces = [name for name, force in mechanism.forces.items() if not _is_load(force)]

        def sum_of(forces: MotionForces, names: Iterable[str]) -> Numbers:
            start = np.zeros((forces.levels, (forces.pose_type.shifts, forces.pose_type.turns)[row], len(motion.time)))
            return sum((forces.reaction(name, 0, None, center)[row] for name in names), start)

        constraints = (*mechanism.joints, *mechanism.drivers)
        return forces.unique(lambda f: sum_of(f, constraints), size) + sum_of(forces, internal_forces)


class GroundForceOutput(_GroundOutput):
    """Total force of all joints, drivers and forces between bodies on the ground, N (shaking force)."""

    unit = "N"
    rate_names = ("force", *RATES)

    def coefficients(self, motion: Motion) -> Numbers:
        """Return the Taylor coefficients of the force, (levels, components, time)."""
        return self._values(motion, np.zeros(len(self.component_labels(motion.mechanism))), 0, 1.0)


class GroundTorqueOutput(_GroundOutput):
    """Total torque of a mechanism on the ground about one of its points, N m (shaking moment)."""

    point: Vector = None  # m; the origin by default

    unit = "N*m"
    rate_names = ("torque", *RATES)

    def coefficients(self, motion: Motion) -> Numbers:
        """Return the Taylor coefficients of the torque, (levels, components, time)."""
        mechanism = motion.mechanism
        components = POSITION_COMPONENTS[mechanism.space]
        point = resolve_element(self, mechanism.parameter_values, components, "outputs.ground")["point"]
        return self._values(motion, np.zeros(components) if point is None else point, 1, motion.model.length)


class _AppliedOutput(AbstractForceOutput):
    force: str = field(static=True)

    source = "force"

    def is_vector(self, mechanism: Mechanism) -> bool:
        """Return whether the applied force has several components."""
        return len(mechanism.forces[self.force].velocity_names) > 1

    def coefficients(self, motion: Motion) -> Numbers:
        """Return the Taylor coefficients of the force, (levels, components, time)."""
        return MotionForces.of(motion).applied_force(self.force)

    def _check_named(self, element):
        if element.unit != self.unit:
            kind, other_kind = ("force", "torque") if element.unit == "N" else ("torque", "force")
            raise MechanismError(f"this is a {kind}, not a {other_kind}", name="quantity")


class AppliedForceOutput(_AppliedOutput):
    """Applied force along its displacement, or its components, N; a positive force increases the displacement."""

    unit = "N"
    rate_names = ("force", *RATES)


class AppliedTorqueOutput(_AppliedOutput):
    """Applied torque along its angle, or its components, N m; a positive torque increases the angle."""

    unit = "N*m"
    rate_names = ("torque", *RATES)
