"""User-defined integration methods, identified by the programs that they trace to when a run begins."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from jounce.base.modules import belongs_to_package, changes_parts, field
from jounce.dynamics.forward.accelerations import Equations
from jounce.integrate.marching.marching import IntegratorState
from jounce.integrate.steps.methods import AbstractMethod
from jounce.jet.programs.captured import OpaqueObject, captured_function, value_key

METHODS = ("prepared", "longest_step", "arrive", "polynomial", "error", "expansion_order")


def _of_method(name: str) -> Callable[..., Any]:
    """Return a method that calls the user's method of this name."""
    return lambda self, *arguments: getattr(self.method, name)(*arguments)


class ReadIntegrator(AbstractMethod):
    """A user-defined integration method, identified by its traced program.

    Parameters
    ----------
    method : AbstractMethod
        The user's method.
    key : tuple
        Key of its traced program, with all constants.
    """

    method: AbstractMethod
    key: tuple[Any, ...] = field(static=True)

    @property
    def controlled(self) -> bool:
        """See `AbstractMethod`."""
        return self.method.controlled

    prepared, longest_step, arrive, polynomial, error, expansion_order = map(_of_method, METHODS)  # in their order


def integrator(method: AbstractMethod, equations: Equations, current: IntegratorState) -> AbstractMethod:
    """Return a method for a run that begins in a state; a user-defined method is identified by its current program."""
    kind = type(method)
    if all(belongs_to_package(getattr(kind, name)) for name in METHODS) and not changes_parts(kind, (AbstractMethod,)):
        return method
    leaves, tree = jax.tree.flatten((method, equations, current))

    def one_step(*given: Any) -> Any:
        method, equations, current = jax.tree.unflatten(tree, given)
        step, length = jnp.ones(current.time.shape), equations.system.column_scale[0]
        start, *prepared = method.prepared(current.expansion, length, jnp.ones(()), current.singular, step)
        end_state = method.arrive(equations, start, current.time, step)
        ends = method.polynomial(start, current.expansion, step), method.error(start, current.expansion, step, length)
        return jax.tree.leaves((start, prepared, end_state, ends))

    try:
        key = value_key(captured_function(one_step, *leaves).traced)
    except Exception:  # noqa: BLE001 - the call raises the error again
        key = (OpaqueObject(object()),)
    return ReadIntegrator(method, (*key, method.controlled))
