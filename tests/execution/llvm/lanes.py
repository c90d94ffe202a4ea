"""Runs functions of one instant as machine code for many, and compares them with JAX, which runs one after another."""

import itertools
import operator

import jax
import jax.numpy as jnp
import llvmlite.binding as llvm
import numpy as np
import pytest

from jounce.execution.llvm import machine, modules, programs

COUNT = 17  # two whole vectors and a rest
FEW = 3  # numbers of an array that is a single value each
SPECIAL = np.array(
    [np.nan, np.inf, -np.inf, 0.0, -0.0, 1.0, -1.0, 0.5, -0.5, 2.5, -2.5, 1e300, -1e300, 3.0, 1e-300, 1.5, -3.7]
)
WHOLE = np.array([0, 1, -1, 2, -2, 3, 7, -7, 8, 100, -100, 5, 2**31 - 1, -(2**31), 6, -3, 12], np.int32)
LONG = np.where(np.arange(COUNT) == 12, 2**63 - 1, np.where(np.arange(COUNT) == 13, -(2**63), WHOLE.astype(np.int64)))
TRUTH = np.arange(COUNT) % 3 == 0


def ordinary(*shape, seed=0, low=-2.0, high=2.0):
    """Return random numbers, with the lanes along the last axis."""
    return np.random.default_rng(seed).uniform(low, high, (*shape, COUNT))


def whole(*shape, seed=0, low=-9, high=10, dtype: type = np.int64):
    """Return random whole numbers, with the lanes along the last axis."""
    return np.random.default_rng(seed).integers(low, high, (*shape, COUNT), dtype=dtype)


def verified(text, **how):
    """Return the machine code of a module, if LLVM finds that each name in it is found before it is used."""
    llvm.parse_assembly(text).verify()
    return machine.compiled(text, **how)


def compiled(function, lanes, shared=(), known=(), width=8, large=None, brief=False):
    """Return what runs a function of one instant for many, by machine code for vectors of `width` lanes."""
    one = [jax.ShapeDtypeStruct((*x.shape[:-1], 1), x.dtype) for x in lanes]
    kinds = [jax.ShapeDtypeStruct(x.shape, x.dtype) for x in shared]
    whole_function = lambda shared, lanes: function(*shared, *lanes)  # noqa: E731
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(modules, "vector_width", lambda: width)
        patch.setattr(programs, "vector_width", lambda: width)
        patch.setattr(modules, "compiled", verified)
        values = {k: shared[k] for k in known}
        binary, results = modules.object_file(whole_function, kinds, one, values, large=large, brief=brief)
        return programs.Program(binary, (kinds, one), results)


def one_by_one(function, lanes, shared=()):
    """Return the results of JAX, for one instant after another."""
    run = jax.jit(function)
    found = [run(*shared, *(jnp.asarray(x[..., k : k + 1]) for x in lanes)) for k in range(lanes[0].shape[-1])]
    return jax.tree.map(lambda *parts: np.concatenate(parts, axis=-1), *found)


def assert_same(actual, expected, rtol=1e-13, names="", signs=True):
    """Compare results, also types, shapes and, if asked for, the signs of zeros."""
    for (path, mine), theirs in zip(jax.tree.leaves_with_path(actual), jax.tree.leaves(expected), strict=True):
        name = f"{names}{jax.tree_util.keystr(path)}"
        assert mine.dtype == theirs.dtype, name
        assert mine.shape == theirs.shape, name
        if theirs.dtype.kind != "f":
            np.testing.assert_array_equal(mine, theirs, err_msg=name)
            continue
        np.testing.assert_allclose(mine, theirs, rtol=rtol, atol=1e-290, err_msg=name)
        nothing = (theirs == 0) & signs
        np.testing.assert_array_equal(np.signbit(mine[nothing]), np.signbit(theirs[nothing]), err_msg=f"{name} (sign)")


def assert_agree(
    function, *lanes, shared=(), knowns=((),), width=8, counts=(COUNT,), rtol=1e-13, signs=True, larges=(None, FEW)
):
    """Compare machine code with JAX for the first lanes of some numbers of them: arrays as values, and in memory.

    What all lanes share is part of the program where one of `knowns` says so. LLVM optimizes the programs of the
    first, as it does by default; those of the others it compiles in a fraction of the time.
    """
    expected = one_by_one(function, lanes, shared)
    for place, (known, large) in enumerate(itertools.product(knowns, larges)):
        program = compiled(function, lanes, shared, known, width, large=large, brief=place >= len(larges))
        for count in counts:
            first = (..., slice(count))
            actual = program(shared, [x[first] for x in lanes])
            names = f"{count} lanes, {large}, {[*known]} known: "
            assert_same(actual, jax.tree.map(operator.itemgetter(first), expected), rtol, names, signs)
    assert_agree_alone(function, lanes, shared, expected, width, rtol, signs)


def assert_agree_alone(function, lanes, shared, expected, width, rtol, signs):
    """Compare machine code for one instant alone with JAX, for some of the lanes."""

    def of_one(given, _):
        return function(*given[0], *given[1])

    places = range(0, lanes[0].shape[-1], 4)
    each = [([*shared], [np.ascontiguousarray(x[..., k : k + 1]) for x in lanes]) for k in places]
    kinds = jax.tree.map(lambda x: jax.ShapeDtypeStruct(np.shape(x), np.asarray(x).dtype), each[0])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(modules, "vector_width", lambda: width)
        patch.setattr(modules, "compiled", verified)
        binary, results = modules.object_file(of_one, kinds, (), {}, large=FEW, single=True, brief=True)
    program = programs.Single(binary, kinds, results)
    for k, given in zip(places, each, strict=True):
        actual = program([np.asarray(x) for x in jax.tree.leaves(given)])
        assert_same(actual, jax.tree.map(lambda x, k=k: x[..., k : k + 1], expected), rtol, f"lane {k}: ", signs)
