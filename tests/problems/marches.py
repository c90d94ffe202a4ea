"""Runs of an integration method, step by step, for tests of its order: many fixed steps side by side."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from jounce.dynamics.forward.accelerations import State, expand, inverted
from jounce.integrate.marching.marching import Outcome, RunLimits, march, unexpanded

COUNT = 4096  # steps tried at most
LENIENT = 1e-6  # tolerance where the steps are given
march_side_by_side = jax.jit(march.function, static_argnames=("method", "count"))


def widened(state, lanes):
    """Return the state of one run as that of many."""
    return State(*(jnp.broadcast_to(jnp.asarray(part), (*part.shape[:-1], lanes)) for part in state))


@partial(jax.jit, static_argnames="order")
def expansion_at(equations, state, time, *, order):
    """Return the expansion of the motion through states at instants, (lanes,)."""
    inverse = inverted(equations.factored(state, time[None]))
    return expand(equations, state, time[None], order, inverse)


def marched(ready, method, stop, tolerance, longest=np.inf, *, lanes=1, instant=0.0):
    """Run from the start of a mechanism to a time; `longest` holds the largest steps of the runs side by side."""
    order = method.expansion_order(tolerance)
    current = unexpanded(ready.equations, widened(ready.state, lanes), np.full(lanes, instant), order=order)
    current, tried = onwards(ready, method, current, stop, tolerance, longest, instant=instant)
    return current, tried - 1  # the first expands the motion


def onwards(ready, method, current, stop, tolerance, longest=np.inf, *, instant=0.0):
    """Go on from where runs are that began at an instant; return where they then are and the number of steps tried."""
    arrived = np.asarray(current.outcome) == Outcome.ARRIVED
    running = np.where(arrived, int(Outcome.RUNNING), current.outcome)
    current, _, tried = march_side_by_side(
        ready.equations,
        current._replace(outcome=running),
        RunLimits(stop, tolerance, jnp.broadcast_to(jnp.asarray(longest, float), current.time.shape), instant),
        method=method,
        count=COUNT,
    )
    assert np.all(np.asarray(current.outcome) == Outcome.ARRIVED)
    return current, int(tried)


def ends(current):
    """Return the states at which runs have arrived, (components of all, runs)."""
    parts = [np.asarray(part[0]) for part in jax.tree.leaves(current.expansion.state)]
    return np.concatenate([part.reshape(-1, part.shape[-1]) for part in parts])


def orders(errors, steps):
    """Return the orders at which errors shrink from step to step."""
    return np.diff(np.log(errors)) / np.diff(np.log(steps))
