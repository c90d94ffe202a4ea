"""Laws of forces, as functions on jets."""

import abc
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp

from jounce.base.modules import Module, belongs_to_package, changes_parts, field
from jounce.jet import Jet, stack
from jounce.jet.algebra import Quantity
from jounce.jet.programs.read_methods import ReadObject
from jounce.trajectory import AbstractMotion, Expression
from jounce.trajectory.laws.user_laws import ORDER, is_users


class AbstractLaw(Module):
    """A law of a force: maps displacement, velocity and time, all jets, to the jet of the force, in SI units."""

    @abc.abstractmethod
    def value(self, displacement: Jet, velocity: Jet, time: Jet) -> Quantity:
        """Return the force: a jet or a constant, possibly with missing axes."""

    def __call__(self, displacement: Jet, velocity: Jet, time: Jet) -> Jet:
        """Return the jet of the force, of the shape of the displacement."""
        return _broadcast_to_jet(self.value(displacement, velocity, time), displacement, time)


class ExpressionLaw(AbstractLaw):
    """A law given by an expression of displacement, velocity, time and parameters; one component of a force.

    Parameters
    ----------
    expression : Expression
        For example ``-k*x**3 - c*v``.
    parameters : dict of str to float or array
        Values of the other names in the expression.
    displacements, velocities : tuple of str
        Names of the displacement and the velocity in the expression, or of their components if there are several. The
        time is always ``t``.

    Raises
    ------
    ExpressionError
        If a name in the expression has no value.

    Examples
    --------
    >>> import jounce as jn
    >>> law = jn.forces.ExpressionLaw("-k*x**3", {"k": 2.0})
    >>> x = jn.Jet([1.0, 3.0])  # at 1 m, 3 m/s
    >>> [float(rate) for rate in law(x, x.differentiate(), jn.Jet.variable(0.0, 1)).derivatives()]
    [-2.0, -18.0]
    """

    expression: Expression = field(static=True)
    parameters: dict[str, Any]
    displacements: tuple[str, ...] = field(static=True)
    velocities: tuple[str, ...] = field(static=True)

    def __init__(
        self,
        expression: Expression | str,
        parameters: Mapping[str, Any] | None = None,
        displacements: tuple[str, ...] = ("x",),
        velocities: tuple[str, ...] = ("v",),
    ):
        self.expression = Expression(expression) if isinstance(expression, str) else expression
        self.parameters = {} if parameters is None else dict(parameters)
        self.displacements, self.velocities = tuple(displacements), tuple(velocities)
        self.expression.check({*self.parameters, "t", *self.displacements, *self.velocities})

    def value(self, displacement: Jet, velocity: Jet, time: Jet) -> Quantity:
        """Return the value of the expression."""
        motion_values = _named(self.displacements, displacement) | _named(self.velocities, velocity)
        return self.expression.evaluate({**self.parameters, "t": time, **motion_values})


class TimeLaw(AbstractLaw):
    """A law of time alone, from a motion law such as a spline through samples.

    Examples
    --------
    >>> import jounce as jn
    >>> law = jn.forces.TimeLaw(jn.laws.ExpressionMotion("10*t**2"))
    >>> at_rest, time = jn.Jet([0.0, 0.0, 0.0]), jn.Jet.variable(1.0, 2)
    >>> [float(rate) for rate in law(at_rest, at_rest, time).derivatives()]
    [10.0, 20.0, 20.0]
    """

    motion: AbstractMotion

    def value(self, displacement: Jet, velocity: Jet, time: Jet) -> Jet:
        """Return the jet of the law of time."""
        return self.motion(time)


class FunctionLaw(AbstractLaw):
    """A law given by a Python function of the jets of displacement, velocity and time.

    Parameters
    ----------
    function : callable
        Maps three jets to the jet of the force, of the shape of the displacement, by operators and the functions of
        `jounce.jet`.

    Examples
    --------
    >>> import jounce as jn
    >>> law = jn.forces.FunctionLaw(lambda x, v, t: -5.0 * jn.jet.sin(x) - 0.1 * v)
    >>> x = jn.Jet([0.0, 2.0])
    >>> float(law(x, x.differentiate(), jn.Jet.variable(0.0, 1)).coefficients[0])
    -0.2
    """

    function: Callable[[Jet, Jet, Jet], Any] = field(static=True)

    def value(self, displacement: Jet, velocity: Jet, time: Jet) -> Quantity:
        """Return the result of the function."""
        return self.function(displacement, velocity, time)


class VectorLaw(AbstractLaw):
    """A law for each component of a force.

    Examples
    --------
    >>> import jounce as jn
    >>> names = ("x", "y"), ("vx", "vy")
    >>> law = jn.forces.VectorLaw([jn.forces.ExpressionLaw(text, {}, *names) for text in ("-vx", "-2*y")])
    >>> place, velocity = (jn.Jet.constant([*pair], 1) for pair in ((1.0, 2.0), (3.0, 0.0)))
    >>> law(place, velocity, jn.Jet.variable(0.0, 1)).coefficients[0].tolist()
    [-3.0, -4.0]
    """

    parts: Sequence[AbstractLaw] = field(converter=lambda parts: tuple(parts))

    def value(self, displacement: Jet, velocity: Jet, time: Jet) -> Jet:
        """Return the jet of the force, a vector."""
        components = [component.value(displacement, velocity, time) for component in self.parts]
        return stack([_broadcast_to_jet(component, displacement[0], time) for component in components])


class ReadLaw(AbstractLaw):
    """A law that contains users' code, with the program that it had when it was traced.

    Parameters
    ----------
    computes : ReadObject
        Traced function of displacement, velocity and time.
    """

    computes: ReadObject

    def value(self, displacement: Jet, velocity: Jet, time: Jet) -> Jet:
        """Return the value of the traced law."""
        return self.computes(displacement, velocity, time)


def read_law(law: AbstractLaw, shape: tuple[int, ...]) -> AbstractLaw:
    """Return the current reading of a law that is a user's own or has such parts; other laws unchanged.

    Parameters
    ----------
    law : AbstractLaw
        Law of a force.
    shape : tuple of int
        Shape of the displacement: empty, or its number of components.
    """
    parts = jax.tree.leaves(law, is_leaf=is_users_law)
    return ReadLaw(ReadObject.of(law, (ORDER, ORDER - 1, ORDER), shape)) if any(map(is_users_law, parts)) else law


def is_users_law(law: Any) -> bool:
    """Return whether a law of a force, or a motion law, is a user's own."""
    if not isinstance(law, AbstractLaw):
        return is_users(law)
    kind = type(law)
    return isinstance(law, FunctionLaw) or not belongs_to_package(kind.value) or changes_parts(kind, (AbstractLaw,))


def _named(names: tuple[str, ...], jet: Jet) -> dict[str, Jet]:
    if len(names) == 1:
        return {names[0]: jet}
    return {name: jet[k] for k, name in enumerate(names)}


def _broadcast_to_jet(value: Quantity, like: Jet, time: Jet) -> Jet:
    """Return a value as a jet of the shape of another; a law of time alone is the same for all instances."""
    shape = jnp.shape(like.coefficients[0])
    if not isinstance(value, Jet):
        return Jet.constant(jnp.broadcast_to(jnp.asarray(value, float), shape), time.order)
    return value + jnp.zeros(shape)
