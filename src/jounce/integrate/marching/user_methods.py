"""Integration methods of users: what they compute is read off when a run begins."""

from typing import Any

import jax
import jax.numpy as jnp

from jounce.base.modules import changes_parts, field, is_ours
from jounce.dynamics.forward.accelerations import Equations, Expansion, Flags, Lanes, State
from jounce.integrate.marching.marching import IntegratorState
from jounce.integrate.steps.methods import AbstractMethod, Number, Sizes
from jounce.jet.programs.captured import Same, read_off, value_key

METHODS = ("prepared", "longest_step", "arrive", "polynomial", "error", "expansion_order")


class ReadIntegrator(AbstractMethod):
    """A method of a user, identified by what it computes.

    Parameters
    ----------
    method : AbstractMethod
        As the user wrote it.
    key : tuple
        Of what it computes, with all its numbers.
    """

    method: AbstractMethod
    key: tuple[Any, ...] = field(static=True)

    @property
    def controlled(self) -> bool:
        """See `AbstractMethod`."""
        return self.method.controlled

    def expansion_order(self, tolerance: float) -> int:
        """See `AbstractMethod`."""
        return self.method.expansion_order(tolerance)

    def longest_step(self, sizes: Sizes, tolerance: Number) -> Lanes:
        """See `AbstractMethod`."""
        return self.method.longest_step(sizes, tolerance)

    def prepared(
        self, expansion: Expansion, length: Number, tolerance: Number, singular: Flags, usual: Lanes
    ) -> tuple[Expansion, Lanes, Lanes]:
        """See `AbstractMethod`."""
        return self.method.prepared(expansion, length, tolerance, singular, usual)

    def arrive(self, equations: Equations, expansion: Expansion, time: Lanes, step: Lanes) -> State:
        """See `AbstractMethod`."""
        return self.method.arrive(equations, expansion, time, step)

    def polynomial(self, start: Expansion, end: Expansion, step: Lanes) -> State:
        """See `AbstractMethod`."""
        return self.method.polynomial(start, end, step)

    def error(self, start: Expansion, end: Expansion, step: Lanes, length: Number) -> Lanes:
        """See `AbstractMethod`."""
        return self.method.error(start, end, step, length)


def integrator(method: AbstractMethod, equations: Equations, current: IntegratorState) -> AbstractMethod:
    """Return a method for a run that begins in a state: one of a user as what it computes now."""
    kind = type(method)
    if all(is_ours(getattr(kind, name)) for name in METHODS) and not changes_parts(kind, (AbstractMethod,)):
        return method
    leaves, tree = jax.tree.flatten((method, equations, current))

    def whole(*given: Any) -> Any:
        method, equations, current = jax.tree.unflatten(tree, given)
        step, length = jnp.ones(current.time.shape), equations.system.column_scale[0]
        start, *prepared = method.prepared(current.expansion, length, jnp.ones(()), current.singular, step)
        arrived = method.arrive(equations, start, current.time, step)
        ends = method.polynomial(start, current.expansion, step), method.error(start, current.expansion, step, length)
        return jax.tree.leaves((start, prepared, arrived, ends))

    try:
        key = value_key(read_off(whole, *leaves).traced)
    except Exception:  # noqa: BLE001 - the call raises the error again
        key = (Same(object()),)
    return ReadIntegrator(method, (*key, method.controlled))
