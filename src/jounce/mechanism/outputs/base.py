"""Outputs of a motion, each one a function on the jets of its bodies."""

import abc
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, ClassVar

from jounce.base.modules import Module, Names, as_names, field
from jounce.constraints.angles import relative_angle
from jounce.constraints.base import Vector, check_bodies, check_words
from jounce.constraints.facts import USUAL_DIMENSIONS, USUAL_SIGNS
from jounce.constraints.planar import length_of
from jounce.errors import MechanismError, check_name
from jounce.jet import Jet, sqrt
from jounce.jet.rounding import nan_where_rounding_in_plane
from jounce.mechanism.carriages import carriage_of
from jounce.rigid import PlanarPose, SpatialPose
from jounce.rigid.orientation import FRAMES
from jounce.rigid.pose import Pose


class AbstractQuantity(Module):
    """A quantity of a motion with its unit: a function of the poses of some bodies, or of the whole motion."""

    unit: ClassVar[str] = "m"
    space: ClassVar[str] = ""  # planar or spatial, if it exists in one only
    lost_orders: ClassVar[int] = 0  # derivatives by which the quantity is shorter than the motion
    rate_names: ClassVar[tuple[str, ...]] = ()  # names of the value and its rates, if they are not those of a position
    body_count: ClassVar[int] = 0
    labels: ClassVar[tuple[str, ...]] = ("x", "y", "z")  # of the components, if there are several
    axes: ClassVar[tuple[tuple[str, tuple[str, ...]], ...]] = ()  # of components other than those of a vector
    of_forces: ClassVar[bool] = False  # whether the quantity depends on applied forces
    dimensions: ClassVar[Mapping[str, str]] = USUAL_DIMENSIONS  # these four facts are those of `AbstractConstraint`
    signs: ClassVar[Mapping[str, str]] = USUAL_SIGNS
    choices: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType({})
    never_parallel: ClassVar[tuple[tuple[str, str], ...]] = ()

    def check(self, mechanism: Any) -> None:
        """Raise MechanismError unless the quantity exists in a mechanism; names of bodies are checked elsewhere."""

    def is_vector(self, mechanism: Any) -> bool:
        """Return whether the quantity has components along the axes of a frame."""
        del mechanism
        return False

    def component_labels(self, mechanism: Any) -> tuple[str, ...]:
        """Return the names of the components of the quantity in a mechanism; none for a scalar."""
        if self.axes:
            return tuple(self.labels)
        return tuple(self.labels[: 2 if mechanism.space == "planar" else 3]) if self.is_vector(mechanism) else ()


def lost_orders(outputs: Iterable[AbstractQuantity]) -> int:
    """Return the largest number of derivatives by which outputs are shorter than the motion."""
    return max((output.lost_orders for output in outputs), default=0)


class AbstractMotionOutput(AbstractQuantity):
    """A quantity that follows from the whole motion and the mechanism, such as a force."""

    bodies: ClassVar[tuple[str, ...]] = ()

    @abc.abstractmethod
    def coefficients(self, motion: Any) -> Any:
        """Return the Taylor coefficients of the quantity at all instants, shape (order + 1, components, time)."""

    def prepare(self, motion: Any) -> None:
        """Compile the programs that any motion of the same form needs; none by default."""
        del motion

    def remark(self, motion: Any, values: Any) -> str:
        """Return a remark on derivatives, time first, such as why they are NaN; an empty text by default."""
        del motion, values
        return ""


class AbstractOutput(AbstractQuantity):
    """A quantity of a motion: one function on jets, as a joint is, with the unit of its value.

    Parameters
    ----------
    bodies : tuple of str
        Names of the bodies on which it depends, in the order of the poses that `evaluate` takes.
    """

    bodies: Names = field(static=True, metadata={"converter": as_names})

    turning: ClassVar[bool] = False  # an angle known up to whole turns, to be continued along the motion
    wraps: ClassVar[tuple[bool, ...]] = ()  # which components are angles in a range, to be continued along the motion
    body_count: ClassVar[int] = 1
    may_repeat: ClassVar[bool] = False  # whether a body may be named more than once

    def __check_init__(self):
        if self.body_count:  # otherwise the output finds its bodies itself
            check_bodies(self, (self.body_count,), "takes", "be of")
        check_words(self)

    @abc.abstractmethod
    def evaluate(self, *bodies: Any, **_: Any) -> Jet:  # *bodies and **_ let subclasses name the parameters
        """Return the jet of the quantity, of shape (...) or (components, ...), from the poses of the bodies."""


class PointOutput(AbstractOutput):
    """Global position of a point of a body, m."""

    point: Vector  # m, in the frame of the body

    def is_vector(self, mechanism):
        del mechanism
        return True

    def evaluate(self, body: Pose) -> Jet:
        return body.point(self.point)


class ParameterOutput(AbstractOutput):
    """Parameter of the curve on which a joint holds a point, in the unit of the curve.

    Parameters
    ----------
    joint : str
        Name of the joint.
    """

    bodies: Any = field(static=True, init=False)
    joint: str = field(static=True)

    unit = "1"
    body_count = 0
    source = "joint"
    count: ClassVar[int] = 1

    def __post_init__(self) -> None:
        self.bodies = (carriage_of(self.joint),)

    def check(self, mechanism: Any) -> None:
        """Raise MechanismError unless the joint holds a point on a curve, or on a surface."""
        check_name("joint", self.joint, mechanism.joints, MechanismError, name="joint")
        number = len(mechanism.joints[self.joint].hidden)
        if number != self.count:
            nouns = {0: "nothing with a parameter", 1: "a curve, of one parameter", 2: "a surface, of parameters"}
            raise MechanismError(f"this joint has {nouns[number]}", name="quantity")

    def evaluate(self, carriage: Pose) -> Jet:
        return carriage.position[0] / carriage.position[-1]


class ParametersOutput(ParameterOutput):
    """Parameters u and v of the surface on which a joint holds a point, in the units of the surface."""

    space = "spatial"
    count = 2
    labels = ("u", "v")
    axes = (("parameter", ("u", "v")),)

    def evaluate(self, carriage: Pose) -> Jet:
        return carriage.position[:2] / carriage.position[2][None]


class AngleOutput(AbstractOutput):
    """Angle of a planar body, rad, continuous over turns."""

    unit = "rad"
    space = "planar"

    def evaluate(self, body: PlanarPose) -> Jet:
        return body.angle


class RelativeAngleOutput(AbstractOutput):
    """Signed angle about an axis of body i, from a vector of body i to one of body j, rad, continuous over turns.

    Without vectors, it is the angle of ``A_i^T A_j`` at the assembled position plus the turn since then. With vectors,
    it is the angle between their projections along the axis, and undefined where a projection vanishes.
    """

    axis: Vector
    vector_i: Vector = None
    vector_j: Vector = None
    datum: Any = field(default=None, init=False)  # set when the mechanism is assembled

    unit = "rad"
    space = "spatial"
    turning = True
    body_count = 2
    never_parallel = (("vector_i", "axis"),)

    def evaluate(self, body_i: SpatialPose, body_j: SpatialPose) -> Jet:
        angle = relative_angle(body_i, body_j, self.axis, self.vector_i, self.vector_j, self.datum)
        if self.vector_j is None:
            return angle
        line, axis = body_j.direction(self.vector_j), body_i.direction(self.axis / length_of(self.axis)[None])
        return nan_where_rounding_in_plane(angle, line - line.dot(axis) * axis, line, axis)


class PlanarRelativeAngleOutput(AbstractOutput):
    """Angle of planar body j relative to body i, rad, continuous over turns."""

    unit = "rad"
    space = "planar"
    body_count = 2

    def evaluate(self, body_i: PlanarPose, body_j: PlanarPose) -> Jet:
        return body_j.angle - body_i.angle


class AngularVelocityOutput(AbstractOutput):
    """Angular velocity of a body in the global frame or its own, rad/s, shape (3, ...) in space."""

    frame: str = field(static=True, default="global")

    unit = "rad/s"
    lost_orders = 1
    choices = {"frame": FRAMES}

    def is_vector(self, mechanism):
        return mechanism.space == "spatial"

    def evaluate(self, body: Pose) -> Jet:
        if isinstance(body, PlanarPose):
            return body.angle.differentiate()
        if self.frame == "body" and body.angular_velocity is not None:
            return body.angular_velocity
        return body.global_angular_velocity()


class DistanceOutput(AbstractOutput):
    """Distance between a point on body i and a point on body j, m."""

    point_i: Vector  # m, in the frame of each body
    point_j: Vector

    body_count = 2

    def evaluate(self, body_i: Pose, body_j: Pose) -> Jet:
        d = body_j.point(self.point_j) - body_i.point(self.point_i)
        return sqrt(d.dot(d))
