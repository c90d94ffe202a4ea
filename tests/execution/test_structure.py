"""Names of programs: equal where the programs are, different where they are not, none for what users wrote."""

import dataclasses
import itertools
import subprocess
import sys

import jax
import numpy as np
import pytest

import jounce as jn
from jounce.execution.structure import UndescribedError, cache_key, description, tree_description
from jounce.kinematics import Status
from jounce.kinematics.continuation.correct_and_differentiate import advance
from jounce.mechanism import build
from jounce.rigid import PlanarPose, SpatialPose
from jounce.trajectory import Expression
from jounce.trajectory.motion import Untraced

DIFFERENT = [
    None, False, True, 0, 1, -1, 0.0, -0.0, 1.0, float("nan"), 1j, "", "1", "None", "int 1", b"1", (), [], {}, (1,),
    [1], (1, 2), ((1,), 2), (1, (2,)), ("a, str 'b'",), ("a", "b"), {"a": 1}, {"b": 1}, {1: "a"}, {"a": 1, "b": 2},
    {"b": 2, "a": 1}, frozenset({1}), frozenset({1, 2}), np.array([1]), np.array([1.0]), np.array([[1.0]]),
    np.array([-1.0]), np.float64(1.0), np.int64(1), PlanarPose, SpatialPose, advance, Status.OK,
    Status.SINGULAR, Expression("t"), Expression("2*t"), Expression("t*2"), Untraced(1), jn.forces.ExpressionLaw,
]  # fmt: skip


def test_what_is_different_is_distinguished():
    descriptions = list(map(description, DIFFERENT))
    assert len(set(descriptions)) == len(descriptions)


def test_what_jax_is_not_to_see_is_left_out():
    assert description(Untraced(1)) == description(Untraced(np.ones(3)))


class OwnLaw(jn.forces.ExpressionLaw):
    """A law of a user."""


@dataclasses.dataclass(frozen=True)
class OwnData:
    """Data of a user."""

    value: int = 1


class Disguised(jn.planar.Revolute):
    """A class that says it is another."""


Disguised.__module__, Disguised.__qualname__ = jn.planar.Revolute.__module__, "Revolute"


@pytest.mark.parametrize(
    "value",
    [lambda t: t, OwnLaw, Disguised, OwnData(), object(), np.array([object()]), (1, [OwnLaw]), {"law": len},
     jax.numpy.ones(2)],
)  # fmt: skip
def test_what_users_wrote_has_no_name(value):
    with pytest.raises(UndescribedError):
        description(value)


def structure(law):
    """The tree of a block that a force pushes along a line."""
    mechanism = jn.Mechanism(
        space="planar",
        bodies={"block": jn.Body([0, 0], mass=1.0, inertia=1.0)},
        joints={"A": jn.planar.Revolute(("ground", "block"), [0, 0], [0, 0])},
        forces={"pull": jn.forces.SlideForce(("ground", "block"), [0, 0], [0, 0], [1, 0], law)},
    )
    return jax.tree.structure(build(mechanism).system)


def test_the_structure_of_a_mechanism_has_its_laws_in_its_name():
    laws = ["-2*x", "-3*x", "-2*v", "-2*sin(x)"]
    descriptions = [tree_description(structure(jn.forces.ExpressionLaw(law))) for law in laws]
    again = [tree_description(structure(jn.forces.ExpressionLaw(law))) for law in laws]
    assert descriptions == again
    assert len(set(descriptions)) == len(laws)


def test_a_function_has_what_it_computes_in_its_name():
    functions = [lambda x, v, t: -2.0 * x, lambda x, v, t: -3.0 * x, lambda x, v, t: -2.0 * v, lambda x, v, t: x / 2.0]
    descriptions = [tree_description(structure(jn.forces.FunctionLaw(function))) for function in functions]
    assert descriptions[0] == descriptions[1]  # the numbers are arguments
    assert len(set(descriptions)) == 3

    def of_python(x, v, t):
        said = jax.ShapeDtypeStruct(x.shape, float)
        return x.map(lambda c: jax.pure_callback(lambda y: y, said, c, vmap_method="expand_dims"))

    with pytest.raises(UndescribedError):
        tree_description(structure(jn.forces.FunctionLaw(of_python)))


def test_a_program_is_named_by_all_that_it_depends_on():
    tree, leaves = jax.tree.structure((1, {"a": 2})), (((3,), "float64", False), ("float",))
    keys = {
        cache_key((function,), tree, kinds, static)
        for function, kinds, static in itertools.product(
            (advance, tree_description),
            (leaves, (((4,), "float64", False), ("float",)), (((3,), "float64", True), ("float",))),
            ({"order": 4}, {"order": 5}, {"pose_type": PlanarPose}),
        )
    }
    assert len(keys) == 18
    with jax.default_matmul_precision("float32"):
        assert cache_key((advance,), tree, leaves, {"order": 4}) not in keys


@pytest.mark.slow
def test_the_name_is_the_same_in_another_process():
    code = """
import jax, jounce as jn
from jounce.execution.structure import cache_key, tree_description
tree = jax.tree.structure(jn.forces.ExpressionLaw("-x*a", {"a": 1.0}))
print(cache_key((tree_description,), tree, (("float",),), {"s": frozenset(map(str, range(20)))}))"""
    found = {
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout for _ in "ab"
    }
    assert len(found) == 1
