"""The base of applied forces: named values on one or more bodies, a displacement, and a force, on jets."""

import abc
from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Any, ClassVar

import jax
import jax.numpy as jnp

from jounce.base.modules import Module, Names, as_names, field
from jounce.constraints.base import catalogue, check_bodies, check_words, keep_words_static, register
from jounce.constraints.facts import USUAL_DIMENSIONS, USUAL_SIGNS
from jounce.jet import Jet
from jounce.rigid.pose import Pose

Law = Annotated[Any, "law"]
Laws = Annotated[Any, "laws"]


class AbstractForce(Module):
    """An applied force or torque: a displacement on which it does work, and its magnitude.

    A subclass lists its values as fields and defines `displacement` and `force`. Its effect on the bodies follows from
    the change of the displacement as they move; its rates follow, too, to any order. Fields are annotated `Scalar`,
    `Vector`, `Law`, `Laws` or ``str``. With a `type`, the subclass can be used in mechanism files by that name; the
    keys are those of joints: ``point_i`` and ``point_j`` become the key ``points``. The class states other facts as
    joints do: `dimensions`, `signs`, `choices`, `never_parallel` and `symbol`.

    Parameters
    ----------
    bodies : tuple of str
        Names of the bodies, including ``"ground"`` if one is fixed; for a force on one body, its name alone is enough.

    Raises
    ------
    MechanismError
        If the number of bodies is wrong, or a body is named twice.

    Examples
    --------
    >>> import jounce as jn
    >>> class Rubber(jn.forces.AbstractForce, space="planar"):
    ...     point_j: jn.joints.Vector  # m, in the frame of body j
    ...     stiffness: jn.joints.Scalar  # N/m^3
    ...
    ...     def displacement(self, body_i, body_j, time):
    ...         return body_j.point(self.point_j)[0] - body_i.position[0]
    ...
    ...     def force(self, displacement, velocity, time):
    ...         return -self.stiffness * displacement**3
    >>> Rubber(("ground", "slider"), point_j=[0, 0], stiffness=5.0).stiffness
    5.0
    """

    bodies: Names = field(static=True, metadata={"converter": as_names})

    space: ClassVar[str] = ""  # planar or spatial, if only one makes sense
    role: ClassVar[str] = "force"
    type_name: ClassVar[str] = ""
    body_count: ClassVar[int] = 2
    unit: ClassVar[str] = "N"
    displacement_names: ClassVar[tuple[str, ...]] = ("x",)  # names of the displacement in expressions of the law
    velocity_names: ClassVar[tuple[str, ...]] = ("v",)
    dimensions: ClassVar[Mapping[str, str]] = USUAL_DIMENSIONS  # these facts are those of `AbstractConstraint`
    signs: ClassVar[Mapping[str, str]] = USUAL_SIGNS
    choices: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType({})
    never_parallel: ClassVar[tuple[tuple[str, str], ...]] = ()
    symbol: ClassVar[str] = ""

    def __init_subclass__(cls, type: str = "", space: str = "", **keywords: Any):  # noqa: A002
        super().__init_subclass__(**keywords)
        keep_words_static(cls)
        if space:
            cls.space = space
        if type:
            register(cls, type, space, "force")

    def __check_init__(self):
        check_bodies(self, (self.body_count,), "acts on", "act between")
        check_words(self)

    @abc.abstractmethod
    def displacement(self, *bodies_and_time: Any, **_: Any) -> Jet:  # with both, parameters may be named
        """Return the jet of the displacement: ``displacement(self, body_i, body_j, time)``.

        Bodies are poses (`PlanarPose` or `SpatialPose`), `time` is a jet in s. The result is a scalar, of shape (...),
        or a vector, (components, ...), in m or rad.
        """

    @abc.abstractmethod
    def force(self, displacement: Jet, velocity: Jet, time: Jet) -> Jet:
        """Return the jet of the force, of the shape of the displacement.

        Its product with the velocity is the power supplied to the mechanism: a positive force drives a growing
        displacement. It may be as short as the velocity, which has one order less than the displacement.
        """

    def velocity(self, *bodies_and_time: Any, **_: Any) -> Jet:
        """Return the jet of the velocity on which the force does work: by default, the rate of the displacement."""
        return self.displacement(*bodies_and_time).differentiate()

    def variation(self, bodies: tuple[Pose, ...], changes: tuple[Pose, ...], time: Jet) -> Jet:
        """Return the variation of the displacement of the force by variations of the bodies, in which it is linear.

        It follows from the displacement, unless the force works on a velocity that is not the rate of any displacement,
        as a moment in space does; `velocity` is then overridden, too.

        Parameters
        ----------
        bodies : tuple of PlanarPose or SpatialPose
            Poses of the bodies.
        changes : tuple of PlanarPose or SpatialPose
            Variations from ``varied``.
        time : Jet
            Time, s.
        """
        return jax.jvp(lambda *poses: self.displacement(*poses, time), tuple(bodies), tuple(changes))[1]

    def energy(self, displacement: Jet) -> Jet:
        """Return the recoverable energy that the force stores, J; zero by default."""
        first = displacement.coefficients[0]
        zero = jnp.zeros_like(first if jnp.ndim(first) < 3 else first[0])  # instances and batch are last
        return Jet.constant(zero, displacement.order)


def by_law(self: Any, displacement: Jet, velocity: Jet, time: Jet) -> Jet:
    """Return the jet of a force that is given by a law; serves as the method `force` of its class."""
    return self.law(displacement, velocity, time)


def force_catalogue(space: str) -> dict[str, type[AbstractForce]]:
    """Return the classes of forces that files may name, by type, for planar or spatial mechanisms.

    Examples
    --------
    >>> import jounce as jn
    >>> jn.forces.force_catalogue("planar")["spring"].__name__
    'Spring'
    """
    return catalogue(space, "force")
