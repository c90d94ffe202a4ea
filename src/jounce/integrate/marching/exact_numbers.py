"""Numbers of a robot that are exactly zero or one, as part of the cache key of its program.

If all joints of a robot are revolute about parallel axes, most products in the equations of motion have a factor that
is a known zero. A program compiled for these zeros leaves the products out; a robot with other zeros has its own
program.
"""

import dataclasses
import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jounce.base.modules import with_fields
from jounce.robot.recursions.tree_equations import TreeEquations

FIELDS = ("rotation", "position", "center", "inertia", "turning")  # of a tree, whose zeros eliminate products
INDICES = ("slot", "parent_slot", "coordinate")
ZERO, ONE = 1, 2
OF_TURN = np.array([[1, 1, 0], [1, 1, 0], [0, 0, 1]], bool)  # nonzero entries of a rotation about z


@dataclasses.dataclass(frozen=True)
class ExactNumbers:
    """The numbers of a tree that are exactly zero or one.

    Attributes
    ----------
    codes : bytes
        `ZERO`, `ONE` or 0 for each number of the fields, one after another.
    indices : bytes
        `INDICES` of the tree, one after another, which define its branches and followers.
    """

    codes: bytes
    indices: bytes

    @classmethod
    def of_parallel(cls, equations: TreeEquations) -> "ExactNumbers | None":
        """Return the exact numbers of a grounded tree whose joints are revolute about parallel axes; otherwise None."""
        tree = equations.tree
        numbers = np.concatenate([getattr(tree, name).ravel() for name in FIELDS])
        codes = (ZERO * (numbers == 0) + ONE * (numbers == 1)).astype(np.uint8)
        count = tree.rotation.size
        turns = (
            codes[:count].tobytes(),
            codes[-tree.shape.bodies :].tobytes(),
            tree.ancestors[:-1].astype(bool).tobytes(),
        )
        if equations.base is not None or not _are_parallel(*turns):
            return None
        return cls(codes.tobytes(), b"".join(getattr(tree, name).tobytes() for name in INDICES))

    def known(self, equations: TreeEquations) -> TreeEquations:
        """Return equations with the exact numbers, NaN for other numbers, and shapes in place of other arrays."""

        def of_field(_: Any, codes: np.ndarray) -> Any:
            return np.where(codes == 0, np.nan, codes == ONE)

        return self._replaced(forms_of(equations), of_field)

    def put(self, equations: TreeEquations) -> TreeEquations:
        """Return the same equations, with the exact numbers as constants of a program."""

        def of_field(array: Any, codes: np.ndarray) -> Any:
            return jnp.where(codes == 0, array, (codes == ONE).astype(float))

        return self._replaced(equations, of_field)

    def _replaced(self, equations: TreeEquations, of_field: Callable[[Any, np.ndarray], Any]) -> TreeEquations:
        fields, place, codes = {}, 0, np.frombuffer(self.codes, np.uint8)
        for name in FIELDS:
            array = getattr(equations.tree, name)
            size = math.prod(array.shape)
            fields[name] = of_field(array, codes[place : place + size].reshape(array.shape))
            place += size
        fields |= zip(INDICES, np.split(np.frombuffer(self.indices, int), len(INDICES)), strict=True)
        return with_fields(equations, tree=dataclasses.replace(equations.tree, **fields))


def forms_of(tree: Any) -> Any:
    """Return a pytree with the shape and type of each array in its place."""
    return jax.tree.map(lambda x: jax.ShapeDtypeStruct(jnp.shape(x), jnp.result_type(x)), tree)


@lru_cache(maxsize=100)
def _are_parallel(rotations: bytes, turning: bytes, ancestors: bytes) -> bool:
    """Return, from the zeros of a tree, whether all its joints are revolute about parallel axes."""
    count = len(turning)
    may_differ = np.frombuffer(rotations, np.uint8).reshape(count, 3, 3) != ZERO
    moves = np.frombuffer(ancestors, bool).reshape(count, count)
    axes, directions = [], set()
    for k in range(count):
        parents = np.flatnonzero(moves[k, :k])
        rotation = may_differ[k] if not parents.size else axes[parents[-1]] @ may_differ[k]
        if turning[k] != ZERO:
            directions.add(tuple(rotation[:, 2].tolist()))
            rotation = rotation @ OF_TURN
        axes.append(rotation)
    return len(directions) == 1 and sum(*directions) == 1
