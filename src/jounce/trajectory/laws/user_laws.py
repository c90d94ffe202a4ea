"""User-defined motion laws, functions or classes, read as programs whenever they are used."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jounce.base.modules import belongs_to_package, changes_parts
from jounce.errors import JounceError, MechanismError, TrajectoryError
from jounce.jet import Jet
from jounce.jet.programs.composition import Composed
from jounce.jet.programs.read_methods import ReadObject
from jounce.trajectory.checks import finite
from jounce.trajectory.motion import AbstractMotion, ExpressionMotion, FunctionMotion
from jounce.trajectory.sampled.deferred import SampledLaw
from jounce.units.expression import Expression

GIVEN = (str, int, float, np.integer, np.floating, Expression)
ORDER = 2  # of the comparison of laws with their programs


class ReadMotion(AbstractMotion):
    """A user's motion law as the program read from it.

    Parameters
    ----------
    computes : Composed or ReadObject
        Program, as a function of time.
    """

    computes: Composed | ReadObject

    def __call__(self, time: Jet) -> Jet:
        """Return the jet of the law at the instants of the time jet."""
        if isinstance(self.computes, Composed):
            return self.computes(time)
        wide = time if len(time.shape) > 1 else time.map(lambda c: jnp.reshape(c, (1, -1)))
        values = self.computes(wide)
        return values if wide is time else values.map(lambda c: jnp.reshape(c, time.shape))

    def check_instants(self, first: float, last: float) -> None:
        """Raise MechanismError if the law is not defined at some instants between two instants, s."""
        if isinstance(self.computes, ReadObject):
            self.computes.source.value.check_instants(first, last)


def shape_of_result(noun: str, advice: str, function: Callable[..., Any], *arguments: np.ndarray) -> tuple[int, ...]:
    """Return the shape of the result of a function of arrays; raise MechanismError if the function cannot be used."""
    try:
        return jax.eval_shape(function, *arguments).shape
    except JounceError:
        raise
    except (TypeError, ValueError, AttributeError, IndexError) as error:
        reason = (str(error).strip() or type(error).__name__).splitlines()[0]
        raise MechanismError(f"the {noun} cannot be used: {reason}; {advice}") from error


def tried_law(law: AbstractMotion | Callable[..., Any]) -> AbstractMotion:
    """Return a law, or the law of a function of time, after a trial on shapes, which explains failures.

    Raises
    ------
    MechanismError
        If the law cannot be used.
    """
    motion = law if isinstance(law, AbstractMotion) else FunctionMotion(law)
    advice = "it must map a scalar time to a scalar with functions of jax.numpy"
    shape_of_result("motion law", advice, lambda t: motion(Jet([t])).coefficients[0], np.zeros((1, 1)))
    return motion


def law_or_number(
    argument: str, name: Any, law: Any, error: type[JounceError] = TrajectoryError
) -> AbstractMotion | SampledLaw | float:
    """Return the law of time or the number given by a motion, an expression, a function of time or a number.

    Parameters
    ----------
    argument : str
        Name of the argument, for messages.
    name : str
        Name of the object with the law, such as a joint.
    law : AbstractMotion, SampledLaw, str, callable or number
        Law as a user gives it.
    error : class of JounceError, default TrajectoryError
        Type of the exceptions.

    Raises
    ------
    JounceError
        Of the given class, if it is none of these, or cannot be used.
    """
    location = f"{argument}.{name}"
    if isinstance(law, AbstractMotion | SampledLaw) and not isinstance(law, FunctionMotion):
        return law
    scalar = isinstance(law, (*GIVEN, np.ndarray, jax.Array)) and not isinstance(law, bool)
    if not (callable(law) or (scalar and getattr(law, "ndim", 0) == 0)):
        message = "must be a law of time: a motion law, an expression of t, a function of time, or a number"
        raise error(message, name=location, value=law)
    try:
        if isinstance(law, str | Expression):
            return ExpressionMotion(law)
        return tried_law(law) if callable(law) else finite(location, law)
    except JounceError as fault:
        raise error(fault.message, name=location, value=fault.value) from None


def given_law(name: Any, law: Any) -> AbstractMotion | SampledLaw:
    """Return the law of a joint of a trajectory; see `law_or_number`."""
    if not isinstance(name, str) or not name:
        raise TrajectoryError("the name of a joint must be text", name="laws", value=name)
    checked = law_or_number("laws", name, law)
    return ExpressionMotion(repr(checked)) if isinstance(checked, int | float) else checked


def read_laws(tree: Any) -> Any:
    """Return a law, or a pytree of laws, in which user-defined laws are replaced by programs of what they compute now.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.trajectory.laws.user_laws import read_laws
    >>> gain = [2.0]
    >>> first = read_laws(jn.laws.FunctionMotion(lambda t: gain[0] * t))
    >>> gain[0] = 3.0
    >>> second = read_laws(jn.laws.FunctionMotion(lambda t: gain[0] * t))
    >>> import jax
    >>> jax.tree.structure(first) == jax.tree.structure(second)
    True
    >>> float(second(jn.Jet.variable(2.0, 0)).coefficients[0])
    6.0
    """
    return jax.tree.map(lambda x: _read(x) if is_users(x) else x, tree, is_leaf=is_users)


def is_users(law: Any) -> bool:
    """Return whether a law is user-defined."""
    if not isinstance(law, AbstractMotion):
        return False
    kind = type(law)
    return (
        isinstance(law, FunctionMotion)
        or not belongs_to_package(kind.__call__)
        or changes_parts(kind, (AbstractMotion,))
    )


def _read(law: AbstractMotion) -> ReadMotion:
    is_plain = isinstance(law, FunctionMotion) and belongs_to_package(type(law).__call__)
    return ReadMotion(Composed.of(law.function) if is_plain else ReadObject.of(law, [ORDER]))
