"""Laws of several joints evaluated together: those of one structure are stacked along an axis of joints."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.shapes import is_traced
from jounce.execution.mapped import Mapped
from jounce.jet import Jet
from jounce.trajectory.laws.user_laws import read_laws
from jounce.trajectory.motion import AbstractMotion

Members = tuple[tuple[int, ...], ...]
"""Indices of the laws in each stacked law."""


def evaluate_laws(laws: Sequence[AbstractMotion], time: Jet) -> Jet:
    """Return the jet of several laws, joints first; laws of one structure are stacked and evaluated together."""
    return _evaluated(*_stacked(laws), time)


def law_derivatives(
    laws: list[AbstractMotion], times: Float[np.ndarray, " time"], order: int
) -> Float[np.ndarray, "order joint time"]:
    """Return the derivatives of laws at instants."""
    stacked, members = _stacked(read_laws(laws))
    options: Any = {"members": members, "order": order}
    return np.asarray(_derivatives.at_instants(stacked, lambda chunk: times[chunk], len(times), **options)[0])


@Mapped
def _derivatives(laws: list[AbstractMotion], times: Any, *, members: Members, order: int) -> Any:
    return _evaluated(laws, members, Jet.variable(times, order)).derivatives()


def _stacked(laws: Sequence[AbstractMotion]) -> tuple[list[AbstractMotion], Members]:
    """Return laws stacked by structure, with joints along an axis before that of instants, and their members."""
    groups: dict[Any, list[int]] = {}
    for index, law in enumerate(laws):
        leaves, structure = jax.tree.flatten(law)
        groups.setdefault((structure, tuple(map(np.shape, leaves))), []).append(index)
    members = tuple(map(tuple, groups.values()))
    return [jax.tree.map(_along_joints, *(laws[index] for index in indices)) for indices in members], members


def _along_joints(*leaves: Any) -> Any:
    if is_traced(leaves):
        return jnp.stack([jnp.asarray(leaf, float) for leaf in leaves], axis=-1)[..., None]
    return np.stack([np.asarray(leaf, float) for leaf in leaves], axis=-1)[..., None]


def _evaluated(laws: Sequence[AbstractMotion], members: Members, time: Jet) -> Jet:
    flat = time.map(lambda c: jnp.reshape(c, (1, -1)))
    series: list[tuple[Any, ...]] = []
    for law, indices in zip(laws, members, strict=True):
        shape = (len(indices), *flat.shape[1:])
        series.append(tuple(jnp.broadcast_to(c, shape) for c in law(flat).dense().coefficients))
    order = np.argsort([index for indices in members for index in indices])
    return Jet(
        jnp.reshape(jnp.concatenate(levels)[order], (len(order), *time.shape)) for levels in zip(*series, strict=True)
    )
