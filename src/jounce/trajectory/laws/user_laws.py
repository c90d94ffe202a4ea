"""Motion laws of users, functions and classes of their own: what they compute is read off whenever they are used."""

from typing import Any

import jax
import jax.numpy as jnp

from jounce.base.modules import changes_parts, is_ours
from jounce.jet import Jet
from jounce.jet.programs.composition import Composed
from jounce.jet.programs.read_methods import ReadObject
from jounce.trajectory.motion import AbstractMotion, FunctionMotion

ORDER = 2  # to which laws are compared with what was read off


class ReadMotion(AbstractMotion):
    """A motion law of a user as what it computed when it was read off.

    Parameters
    ----------
    computes : Composed or ReadObject
        Of time.
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
        """Raise MechanismError if the law says nothing of some instants from a first to a last one, s."""
        if isinstance(self.computes, ReadObject):
            self.computes.source.value.check_instants(first, last)


def read_laws(tree: Any) -> Any:
    """Return a law, or any pytree of laws, with those of users in it as what they compute now.

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
    """Tell whether a law is a user's own."""
    if not isinstance(law, AbstractMotion):
        return False
    kind = type(law)
    return isinstance(law, FunctionMotion) or not is_ours(kind.__call__) or changes_parts(kind, (AbstractMotion,))


def _read(law: AbstractMotion) -> ReadMotion:
    plain = isinstance(law, FunctionMotion) and is_ours(type(law).__call__)
    return ReadMotion(Composed.of(law.function) if plain else ReadObject.of(law, [ORDER]))
