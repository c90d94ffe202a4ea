"""Modules: dataclasses that JAX sees as trees, beside those of Equinox, and functions compiled over arrays alone."""

import abc
import copy
import dataclasses
import inspect
import json
import pickle
import subprocess
import sys
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jounce.base.modules import Module, field

CHECKED = []


class Spring(Module):
    """A spring between bodies."""

    stiffness: Any
    bodies: tuple[str, ...] = field(static=True, converter=tuple)
    length: Any = 0.1
    found: Any = field(default=None, init=False)

    def __check_init__(self):
        CHECKED.append(("Spring", type(self.bodies)))


class Damped(Spring):
    """One with damping."""

    damping: Any = field(kw_only=True)

    def __check_init__(self):
        CHECKED.append(("Damped", type(self.bodies)))


class Centered(Module):
    """A rod by its ends."""

    center: Any
    half: Any

    def __init__(self, low, high):
        self.center = (low + high) / 2
        self.half = (high - low) / 2


def leaves_with_names(tree):
    return [(jax.tree_util.keystr(path), leaf) for path, leaf in jax.tree_util.tree_leaves_with_path(tree)]


def test_a_tree_is_that_of_a_module_of_equinox():
    class OfEquinox(eqx.Module):
        stiffness: Any
        bodies: tuple[str, ...] = eqx.field(static=True, converter=tuple)
        length: Any = 0.1
        found: Any = eqx.field(default=None, init=False)

    class WithItsFields(Module):
        stiffness: Any
        bodies: tuple[str, ...] = eqx.field(static=True, converter=tuple)
        length: Any = 0.1
        found: Any = eqx.field(default=None, init=False)

    expected = leaves_with_names(OfEquinox(3.0, ["a", "b"]))
    assert expected == [(".stiffness", 3.0), (".length", 0.1)]
    for kind in (Spring, WithItsFields):
        made = kind(3.0, ["a", "b"])
        assert made.bodies == ("a", "b")
        assert leaves_with_names(made) == expected
        assert jax.tree.structure(made) == jax.tree.structure(kind(4.0, ["a", "b"]))
        assert jax.tree.structure(made) != jax.tree.structure(kind(3.0, ["a", "c"]))


def test_modules_of_equinox_are_values_that_have_gradients():
    network = eqx.nn.Linear(2, 1, key=jax.random.key(1))
    one = Spring(network, ["a"])
    gradient = jax.grad(lambda spring: spring.stiffness(jnp.array([1.0, 2.0]))[0])(one)
    np.testing.assert_array_equal(gradient.stiffness.weight, [[1.0, 2.0]])


def test_once_made_all_are_checked_and_a_copy_from_leaves_is_not():
    CHECKED.clear()
    made = Damped(3.0, ["a"], damping=0.2)
    assert [("Damped", tuple), ("Spring", tuple)] == CHECKED
    twice = jax.tree.map(lambda x: 2 * x, made)
    assert (twice.stiffness, twice.length, twice.damping, twice.bodies) == (6.0, 0.2, 0.4, ("a",))
    assert len(CHECKED) == 2
    assert dataclasses.replace(made, bodies=["b"]).bodies == ("b",)
    assert len(CHECKED) == 4


def test_fields_keep_their_values():
    made = Spring(3.0, ["a"])
    for change in (lambda: setattr(made, "stiffness", 4.0), lambda: delattr(made, "length")):
        with pytest.raises(dataclasses.FrozenInstanceError, match=r"field '(stiffness|length)' of Spring"):
            change()
    assert vars(made) == {"stiffness": 3.0, "bodies": ("a",), "length": 0.1}


def test_an_own_init_gives_each_field_a_value_and_no_other():
    assert dataclasses.astuple(Centered(1.0, 2.0)) == (1.5, 0.5)
    assert str(inspect.signature(Centered)) == "(low, high)"

    class Longer(Centered):
        def __init__(self, low, high, more):
            super().__init__(low, high)
            if more:
                self.ratio = 2.0

    class Forgetful(Module):
        center: Any

        def __init__(self):
            pass

    assert Longer(1.0, 2.0, False).half == 0.5
    with pytest.raises(dataclasses.FrozenInstanceError, match="Longer has no field 'ratio': declare it in the class"):
        Longer(1.0, 2.0, True)
    with pytest.raises(TypeError, match="Forgetful: __init__ gives the field 'center' no value"):
        Forgetful()


def test_an_array_of_jax_cannot_be_a_constant():
    class Fixed(Module):
        table: Any = field(static=True)

    with pytest.raises(TypeError, match=r"Fixed\.table: a static field cannot hold an array of JAX"):
        Fixed(jnp.ones(2))


def test_equal_are_those_of_one_class_with_equal_values():
    one = Spring(np.array([1.0, 2.0]), ["a"])
    assert one == Spring(np.array([1.0, 2.0]), ["a"])
    assert one != Spring(np.array([1.0, 2.5]), ["a"])
    assert one != Spring(np.array([1.0, 2.0], np.float32), ["a"])
    assert one != Spring(jnp.array([1.0, 2.0]), ["a"])
    assert one != Spring(np.ones((1, 2)), ["a"])
    assert one != Spring(np.array([1.0, 2.0]), ["b"])
    assert one != (np.array([1.0, 2.0]), ("a",))
    assert Spring(3, ["a"]) != Spring(3.0, ["a"])
    assert hash(Spring(3.0, ["a"])) == hash(Spring(3.0, ["a"]))
    assert Spring(3.0, ["a"]) != Damped(3.0, ["a"], damping=0.2)


def test_copies_are_equal():
    made = Damped(np.arange(3.0), ["a", "b"], damping=0.2)
    for copied in (copy.copy(made), copy.deepcopy(made), pickle.loads(pickle.dumps(made)), dataclasses.replace(made)):
        assert copied == made


def test_what_is_shown_is_what_makes_one():
    assert repr(Spring(3.0, ["a"])) == "Spring(stiffness=3.0, bodies=('a',))"
    assert repr(Spring(np.zeros((3, 200)), ["a"], jnp.ones(2))) == (
        "Spring(stiffness=float64[3, 200], bodies=('a',), length=Array([1., 1.], dtype=float64))"
    )
    assert str(inspect.signature(Damped)) == "(stiffness: Any, bodies: Any, length: Any = 0.1, *, damping: Any) -> None"


def test_a_class_with_an_abstract_method_has_no_objects():
    class Law(Module):
        @abc.abstractmethod
        def __call__(self, time): ...

    with pytest.raises(TypeError, match="abstract"):
        Law()


@pytest.mark.slow
def test_type_checkers_take_one_name_or_several_and_find_a_tuple(tmp_path):
    (tmp_path / "pyrightconfig.json").write_text('{"typeCheckingMode": "standard"}')
    script = tmp_path / "script.py"
    script.write_text(
        "import jounce as jn\n"
        'one = jn.outputs.AngleOutput("crank")\n'
        'several = jn.forces.Spring(["ground", "crank"], [0, 0], [0, 0], 1.0, 0.1)\n'
        "reveal_type(one.bodies)\n"
        "reveal_type(several.bodies)\n"
        "jn.outputs.AngleOutput(3)\n"
    )
    command = [sys.executable, "-m", "pyright", "-p", tmp_path, "--outputjson", "--pythonpath", sys.executable]
    found = json.loads(subprocess.run(command, capture_output=True, text=True, check=False).stdout)
    said = [(one["severity"], one["range"]["start"]["line"] + 1, one["message"]) for one in found["generalDiagnostics"]]
    assert [(severity, line) for severity, line, _ in said] == [("information", 4), ("information", 5), ("error", 6)]
    assert 'Type of "one.bodies" is "tuple[str, ...]"' in said[0][2]
    assert 'Type of "several.bodies" is "tuple[str, ...]"' in said[1][2]
