"""What an applied force is: named values on one or more bodies, where it acts, and how large it is, on jets."""

import abc
from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Any, ClassVar

import jax
import jax.numpy as jnp

from jounce.base.modules import Module, field
from jounce.constraints.base import catalogue, check_bodies, check_words, keep_words_static, register
from jounce.constraints.facts import USUAL_DIMENSIONS, USUAL_SIGNS
from jounce.jet import Jet
from jounce.rigid.pose import Pose

Law = Annotated[Any, "law"]
Laws = Annotated[Any, "laws"]


class AbstractForce(Module):
    """An applied force or torque: a displacement on which it does work, and its size.

    A subclass lists its values as fields and defines `displacement` and `force`. What it does to its bodies follows
    from how the displacement changes as they move, and the rates of that, to any order, follow too. Fields are
    annotated `Scalar`, `Vector`, `Law`, `Laws` or ``str``. Given a `type`, the subclass can be used in mechanism files
    by that name; the keys are those of joints: ``point_i`` and ``point_j`` are the key ``points``. What else there is
    to know, the class states as joints do: `dimensions`, `signs`, `choices`, `never_parallel` and `symbol`.

    Parameters
    ----------
    bodies : tuple of str
        Names of the bodies, ``"ground"`` among them if one is fixed; one name alone is enough for a force on one body.

    Raises
    ------
    MechanismError
        If the number of bodies is wrong or one is named twice.

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

    bodies: tuple[str, ...] = field(static=True, converter=lambda b: (b,) if isinstance(b, str) else tuple(b))

    space: ClassVar[str] = ""  # planar or spatial where only one makes sense
    role: ClassVar[str] = "force"
    type_name: ClassVar[str] = ""
    body_count: ClassVar[int] = 2
    unit: ClassVar[str] = "N"
    displacement_names: ClassVar[tuple[str, ...]] = ("x",)  # what expressions of the law call the displacement
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

        Its product with the velocity is the power that goes into the mechanism: a positive force drives a growing
        displacement. It may be as short as the velocity, which has one order less than the displacement.
        """

    def velocity(self, *bodies_and_time: Any, **_: Any) -> Jet:
        """Return the jet of the velocity on which the force works: the rate of the displacement by default."""
        return self.displacement(*bodies_and_time).differentiate()

    def variation(self, bodies: tuple[Pose, ...], changes: tuple[Pose, ...], time: Jet) -> Jet:
        """Return how far the force acts along as the bodies move by changes; linear in them.

        It follows from the displacement, unless the force works on what is no change of any displacement, as a moment
        in space does; `velocity` is then overridden, too.

        Parameters
        ----------
        bodies : tuple of PlanarPose or SpatialPose
            Where the bodies are.
        changes : tuple of PlanarPose or SpatialPose
            What ``varied`` of them gives.
        time : Jet
            In s.
        """
        return jax.jvp(lambda *poses: self.displacement(*poses, time), tuple(bodies), tuple(changes))[1]

    def energy(self, displacement: Jet) -> Jet:
        """Return the energy that the force has stored and gives back, in J; none by default."""
        first = displacement.coefficients[0]
        zero = jnp.zeros_like(first if jnp.ndim(first) < 3 else first[0])  # instances and batch stand last
        return Jet.constant(zero, displacement.order)


def by_law(self: Any, displacement: Jet, velocity: Jet, time: Jet) -> Jet:
    """Return the jet of a force that is given by a law: the method `force` of its class."""
    return self.law(displacement, velocity, time)


def force_catalogue(space: str) -> dict[str, type[AbstractForce]]:
    """Return the classes of forces that files may name, by their type, for planar or spatial mechanisms.

    Examples
    --------
    >>> import jounce as jn
    >>> jn.forces.force_catalogue("planar")["spring"].__name__
    'Spring'
    """
    return catalogue(space, "force")
