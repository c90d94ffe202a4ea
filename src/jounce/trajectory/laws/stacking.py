"""Laws of several joints evaluated together: those of the same structure as one law with an axis of joints."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.modules import jit_over_arrays
from jounce.jet import Jet
from jounce.trajectory.laws.user_laws import read_laws
from jounce.trajectory.motion import AbstractMotion


def evaluate_laws(laws: Sequence[AbstractMotion], time: Jet) -> Jet:
    """Evaluate laws of the same structure as one, stacked along the axis of joints; put all in order."""
    groups: dict[Any, list[int]] = {}
    for index, law in enumerate(laws):
        leaves, structure = jax.tree.flatten(law)
        groups.setdefault((structure, tuple(jnp.shape(leaf) for leaf in leaves)), []).append(index)
    batch = time.shape
    flat = time.map(lambda c: jnp.reshape(c, (1, -1)))
    evaluated: list[tuple[Any, ...]] = []
    for members in groups.values():
        stacked = jax.tree.map(_along_joints, *(laws[index] for index in members))
        jet = stacked(flat).dense()
        shape = (len(members), *flat.shape[1:])
        evaluated.append(tuple(jnp.broadcast_to(c, shape) for c in jet.coefficients))
    positions = np.argsort([index for members in groups.values() for index in members])
    return Jet(
        jnp.reshape(jnp.concatenate(levels)[positions], (len(laws), *batch)) for levels in zip(*evaluated, strict=True)
    )


def _along_joints(*leaves: Any) -> Any:
    return jnp.stack([jnp.asarray(leaf, float) for leaf in leaves], axis=-1)[..., None]


def law_derivatives(
    laws: list[AbstractMotion], times: Float[jax.Array, " time"], order: int
) -> Float[jax.Array, "order joint time"]:
    """Return the plain derivatives of laws at instants."""
    return _derivatives(read_laws(laws), times, order)


@jit_over_arrays
def _derivatives(
    laws: list[AbstractMotion], times: Float[jax.Array, " time"], order: int
) -> Float[jax.Array, "order joint time"]:
    return evaluate_laws(laws, Jet.variable(times, order)).derivatives()
