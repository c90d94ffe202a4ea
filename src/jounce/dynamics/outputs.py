"""Forces as outputs: of drivers along what they prescribe, of joints on their bodies, and applied ones, with rates."""

from typing import Any, ClassVar

import equinox as eqx
import numpy as np

from jounce.constraints.base import Vector
from jounce.dynamics.inverse import MotionForces
from jounce.dynamics.masses import check_loads
from jounce.errors import MechanismError, check_choice, check_name, did_you_mean
from jounce.kinematics import Motion, Status
from jounce.mechanism import AbstractMotionOutput, Mechanism
from jounce.mechanism.driver_outputs import is_turning
from jounce.mechanism.mechanism import GROUND
from jounce.mechanism.resolve import resolve_element
from jounce.shapes import ArrayLike, Numbers
from jounce.trajectory import FollowingMotion

ROUNDING = 1e-9  # of the largest force
MOST_TOLD = 4  # instants
RATES = ("yank", "second rate", "third rate", "fourth rate")


class AbstractForceOutput(AbstractMotionOutput):
    """A force or torque in a mechanism: two derivatives shorter than the motion, as accelerations are."""

    lost_orders = 2
    of_forces = True
    source: ClassVar[str] = ""  # the field that names what exerts it: driver, joint or force

    def check(self, mechanism: Mechanism) -> None:
        """Raise MechanismError unless the mechanism has what is named, and masses or applied forces."""
        kinds = {"driver": ("drivers",), "joint": ("joints", "drivers"), "force": ("forces",)}[self.source]
        known = {name: element for kind in kinds for name, element in getattr(mechanism, kind).items()}
        name = getattr(self, self.source)
        check_name(self.source, name, known, MechanismError, name=self.source)
        check_loads(mechanism, self.source)
        self._check_named(known[name])

    def _check_named(self, element: Any) -> None:
        """Raise MechanismError unless the quantity is one of what is named."""

    def remark(self, motion: Motion, values: np.ndarray) -> str:
        """Return why values are NaN at instants that were solved: redundant constraints leave them open."""
        forces = MotionForces.of(motion)
        solved = motion.status == Status.OK
        if forces.loose is None or np.isfinite(values[solved]).all():
            return ""
        return (
            f"not unique, as constraints are redundant: {forces.open.words}; redundant_reactions chooses by least "
            "norm or by stiffnesses"
        )


class _DriverOutput(AbstractForceOutput):
    driver: str = eqx.field(static=True)

    source = "driver"

    def coefficients(self, motion: Motion) -> Numbers:
        """Return the Taylor coefficients of what the driver exerts, (levels, 1, time)."""
        size = motion.model.length if self.unit == "N*m" else 1.0
        return MotionForces.of(motion).unique(lambda forces: forces.driver_force(self.driver), size)

    def remark(self, motion: Motion, values: np.ndarray) -> str:
        """Return why values are NaN, or where the force of a cam on its follower changes its sign."""
        if why := super().remark(motion, values):
            return why
        if not isinstance(getattr(motion.mechanism.drivers[self.driver], "motion", None), FollowingMotion):
            return ""
        forces = values[:, 0]
        known = np.isfinite(forces)
        times, sign = motion.time[known], np.sign(forces[known])
        sign[np.abs(forces[known]) <= ROUNDING * np.max(np.abs(forces[known]), initial=0.0)] = 0.0
        times, sign = times[sign != 0], sign[sign != 0]
        changes = times[1:][sign[1:] != sign[:-1]]
        if not changes.size:
            return ""
        where = ", ".join(f"{t:.4g} s" for t in changes[:MOST_TOLD]) + (", ..." if len(changes) > MOST_TOLD else "")
        return f"changes its sign before t = {where}: a follower that is pressed against a cam lifts off there"


class DriverForceOutput(_DriverOutput):
    """Force of a driver along the length that it prescribes, N; its product with the rate of the law is the power."""

    unit = "N"
    rate_names = ("force", *RATES)

    def _check_named(self, element):
        if is_turning(element):
            raise MechanismError("this driver prescribes an angle, so that it exerts a torque", name="quantity")


class DriverTorqueOutput(_DriverOutput):
    """Torque of a driver about the angle that it prescribes, N m; its product with the rate of the law is the power."""

    unit = "N*m"
    rate_names = ("torque", *RATES)

    def _check_named(self, element):
        if not is_turning(element):
            raise MechanismError("this driver prescribes a length, so that it exerts a force", name="quantity")


class _JointOutput(AbstractForceOutput):
    joint: str = eqx.field(static=True)
    body: str | None = eqx.field(
        static=True, default=None
    )  # on which it acts; the second one of the joint unless given
    frame: str = eqx.field(static=True, default="global")  # global, body, or the name of a body of the joint

    source = "joint"

    def _check_named(self, element):
        if self.body is not None and self.body not in element.bodies:
            message = f"is not joined by '{self.joint}'; {did_you_mean(self.body, element.bodies)}"
            raise MechanismError(message, name="body", value=self.body)
        check_choice("frame", self.frame, ("global", "body", *element.bodies), MechanismError)

    def _wrench(self, forces: MotionForces, mechanism: Mechanism, point: ArrayLike | None) -> tuple[Numbers, Numbers]:
        """Return force and moment about a point of the body, with rates; about that of the joint unless given."""
        element = {**mechanism.joints, **mechanism.drivers}[self.joint]
        body = element.bodies[min(1, len(element.bodies) - 1)] if self.body is None else self.body
        slot = element.bodies.index(body)
        index = [GROUND, *mechanism.bodies].index
        frame = {"global": None, "body": body}.get(self.frame, self.frame)
        if point is None:
            place = forces.indices[self.joint]
            fixed = getattr(forces.model.system.groups[place.group].element, f"point_{'ijmn'[slot : slot + 1]}", None)
            size = forces.pose_type.shifts
            point = np.zeros(size) if fixed is None else fixed.reshape(size, -1)[:, place.instance]
        place_on_body: Any = point
        work = forces.wrench(self.joint, slot)
        return forces.expressed(work, index(body), None if frame is None else index(frame), place_on_body)


class JointForceOutput(_JointOutput):
    """Reaction force of a joint, or of a driver, on one of its bodies, N."""

    unit = "N"
    rate_names = ("force", *RATES)

    def is_vector(self, mechanism: Mechanism) -> bool:
        """Tell that the force has components."""
        del mechanism
        return True

    def coefficients(self, motion: Motion) -> Numbers:
        """Return the Taylor coefficients of the force, (levels, components, time)."""
        return MotionForces.of(motion).unique(lambda forces: self._wrench(forces, motion.mechanism, None)[0])


class JointTorqueOutput(_JointOutput):
    """Reaction torque of a joint, or of a driver, on one of its bodies, about a point of that body, N m.

    The point is that of the joint unless given, or the origin of the body where the joint has none there.
    """

    point: Vector = None  # m, in the frame of the body

    unit = "N*m"
    rate_names = ("torque", *RATES)

    def is_vector(self, mechanism: Mechanism) -> bool:
        """Tell whether the torque has components: in space."""
        return mechanism.space == "spatial"

    def coefficients(self, motion: Motion) -> Numbers:
        """Return the Taylor coefficients of the torque, (levels, components, time)."""
        mechanism = motion.mechanism
        components = 2 if mechanism.space == "planar" else 3
        values = resolve_element(self, mechanism.parameter_values, components, f"outputs.{self.joint}")
        return MotionForces.of(motion).unique(
            lambda forces: self._wrench(forces, mechanism, values["point"])[1], motion.model.length
        )


class _AppliedOutput(AbstractForceOutput):
    force: str = eqx.field(static=True)

    source = "force"

    def is_vector(self, mechanism: Mechanism) -> bool:
        """Tell whether the applied force has several components."""
        return len(mechanism.forces[self.force].velocity_names) > 1

    def coefficients(self, motion: Motion) -> Numbers:
        """Return the Taylor coefficients of the force, (levels, components, time)."""
        return MotionForces.of(motion).applied_force(self.force)

    def _check_named(self, element):
        if element.unit != self.unit:
            kind, other = ("force", "torque") if element.unit == "N" else ("torque", "force")
            raise MechanismError(f"this is a {kind}, no {other}", name="quantity")


class AppliedForceOutput(_AppliedOutput):
    """Applied force along its displacement, or with its components, N; it drives a growing displacement if positive."""

    unit = "N"
    rate_names = ("force", *RATES)


class AppliedTorqueOutput(_AppliedOutput):
    """Applied torque about its angle, or with its components, N m; it drives a growing angle if positive."""

    unit = "N*m"
    rate_names = ("torque", *RATES)
