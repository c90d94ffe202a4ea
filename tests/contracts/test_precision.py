"""Everything is computed in double precision, and the precision of the program around it is left alone.

The examples of all docstrings run in single precision too, and fail where an operation does, see `tests.conftest`.
"""

import functools
import inspect
import json
import pkgutil
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from tests import public_names
from tests.precision import watched

WITHOUT = ("cli", "execution", "papers", "reporting", "io")  # rooms that offer nothing, or say it function by function
ROOMS = [room.name for room in pkgutil.iter_modules(jn.__path__) if room.ispkg and room.name not in WITHOUT]
FOR_JAX = {"tree_flatten", "tree_unflatten", "mro"}  # which JAX calls within programs of any precision


def doors(value):
    """Return the functions that are called where a value is used, if it is a function, a method or a property."""
    if isinstance(value, staticmethod | classmethod):
        return doors(value.__func__)
    if isinstance(value, property):
        return doors(value.fget)
    if isinstance(value, functools.cached_property):
        return doors(value.func)
    return [value] if inspect.isfunction(value) else []


def offered():
    """Yield what is public, each with its name: functions of rooms, methods and properties of their classes."""
    yield from public_names.offered().items()
    for name, module in list(sys.modules.items()):
        package, _, room = name.partition(".")
        if package != "jounce" or room.partition(".")[0] not in ROOMS:
            continue
        for inner, value in list(vars(module).items()):
            if room in ROOMS and not inner.startswith("_") and not inspect.isclass(value):
                yield f"{name}.{inner}", value
            if room in ROOMS and not inner.startswith("_") and inspect.isclass(value):
                for member, held in vars(value).items():
                    if not member.startswith("_") and member not in FOR_JAX:
                        yield f"{name}.{inner}.{member}", held


def test_all_that_is_public_has_a_door():
    found = [(name, door) for name, value in offered() for door in doors(value)]
    assert len(found) > 450
    without = [name for name, door in found if not hasattr(door, "own_settings")]
    assert without == ["keep_programs"]  # which computes nothing


def test_an_operation_in_single_precision_is_found(monkeypatch, single_precision):
    from jax._src import core

    monkeypatch.setattr(core.Primitive, "bind", watched(core.Primitive.bind))
    with pytest.raises(AssertionError, match=r"in single precision: .*settings.py"):
        inspect.unwrap(jn.Jet.variable.__func__)(jn.Jet, 0.1, 3)
    assert jn.Jet.variable(0.1, 3).dtype == np.float64


CALLS = """
import json, sys
if sys.argv[1] == "before":
    import jax
    jax.config.update("jax_enable_x64", False)
import numpy as np
import jounce as jn
import jax, jax.numpy as jnp

jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")
pendulum = jn.load("examples/simple_pendulum.yaml")
fourbar = jn.load("examples/four_bar.yaml")
joints = [jn.Joint("a", "base", "one", axis=[0, -1, 0])]
joints += [jn.Joint("b", "one", "two", position=[0.3, 0, 0], axis=[0, -1, 0])]
links = [jn.Link("base"), jn.Link("one", jn.Inertia(1.0, [0.15, 0, 0])), jn.Link("two", jn.Inertia(0.7, [0.1, 0, 0]))]
arm = jn.Robot("arm", links, joints)
spin = jn.laws.FunctionMotion(lambda t: jnp.sin(0.7 * t))
q = np.array([[0.3, 0.1], [0.7, -0.2], [0.1, 0.9], [0.3, 0.4]])


def numbers():
    t = jn.Jet.variable(0.1, order=3)
    motion = jn.solve(fourbar, [0.0, 0.3], order=4)
    run = jn.simulate(pendulum, [0.0, 0.1])
    moved = jn.simulate(arm, [0.0, 0.1], torque=lambda time, q, rate: -0.3 * jnp.sin(q))
    found = {
        "jet": (2 * t**2 + 0.1).derivatives(), "sine": jn.jet.sin(0.7 * t).derivatives(),
        "compose": jn.jet.compose(lambda x: jnp.exp(-0.3 * x), t).derivatives(), "law": spin(t).derivatives(),
        "narrow": jn.jet.sin(jn.Jet.variable(np.float32(0.25), 2)).derivatives(),
        "turn": jn.rigid.rotation_matrix("ZYX", jn.Jet.constant([0.1, 0.2, 0.3], 1)).derivatives(),
        "solve": motion.outputs["psi"], "point": motion.point("rocker", [0.1, 0.0]).values,
        "given": jn.solve(fourbar.with_parameters(BC=jnp.float32(0.140625)), [0.0, 0.3]).outputs["psi"],
        "simulate": [run.outputs[name] for name in run.outputs], "moved": moved.q,
        "torque": jn.inverse_dynamics(arm, q), "masses": jn.mass_matrix(arm, q[0]),
        "acceleration": jn.forward_dynamics(arm, q[:2], np.zeros((1, 2))),
        "pose": jn.forward_kinematics(arm, q, "two").position, "jacobian": jn.jacobian(arm, q, "two"),
    }
    for name, values in found.items():
        for array in jax.tree.leaves(values):
            assert array.dtype == np.float64, name
    return {name: [np.asarray(x).tolist() for x in jax.tree.leaves(values)] for name, values in found.items()}


results = []
for setting in (False, True, False) if sys.argv[1] == "before" else (None,):
    if setting is not None:
        jax.config.update("jax_enable_x64", setting)
    results.append(numbers())
    assert jax.config.jax_enable_x64 is bool(setting), setting
    assert jnp.sin(0.1).dtype == (np.float64 if setting else np.float32)
print(json.dumps(results))
"""


@pytest.mark.slow
def test_numbers_do_not_depend_on_the_setting():
    """Switched off before the import, on and off after it, and never touched: the same numbers, to the last bit."""
    results = []
    for when in ("before", "never"):
        done = subprocess.run([sys.executable, "-c", CALLS, when], capture_output=True, text=True, check=False)
        assert not done.returncode, done.stderr
        results += json.loads(done.stdout)
    assert len(results) == 4
    for name, first in results[0].items():
        assert all(one[name] == first for one in results), name
    assert np.isclose(results[0]["jet"][0][1], 0.4, rtol=0, atol=1e-16)


TRANSFORMED = {
    "jax.grad": lambda f: jax.grad(f)(0.14),
    "jax.jit": lambda f: jax.jit(f)(0.14),
    "jax.vmap": lambda f: jax.vmap(f)(jnp.array([0.14, 0.15])),
}


@pytest.mark.parametrize("name", TRANSFORMED)
def test_a_transformation_in_single_precision_is_refused(name, single_precision):
    mechanism = jn.load("examples/four_bar.yaml")

    def jounce_of(length):
        return jn.solve(mechanism.with_parameters(BC=length), [0.0, 0.1], order=4).outputs["psi"][-1, 4]

    with pytest.raises(jn.errors.UnsupportedError, match=r'jax.config.update\("jax_enable_x64", True\)'):
        TRANSFORMED[name](jounce_of)
    with pytest.raises(jn.errors.UnsupportedError, match=r"with jax.enable_x64\(True\):"):
        TRANSFORMED[name](lambda x: jn.Jet.variable(x, 2).derivatives()[1])


def test_what_is_compiled_calls_the_host_in_double_precision(single_precision):
    """Where a program waits for its operands, in a thread of its own: the setting of the process holds there."""
    from jounce.settings import called_back

    seen = []

    def on_the_host(x):
        seen.append(x)
        return 3.0 * x

    with jax.enable_x64(True):
        x = jnp.asarray(np.linspace(0.1, 0.7, 5))
        shape = jax.ShapeDtypeStruct(x.shape, x.dtype)
        program = jax.jit(lambda x: called_back(on_the_host, shape, x, vmap_method="sequential"))
        program(x).block_until_ready()  # compiles
        seen.clear()
        waited_for = jax.jit(lambda x: x @ x)(jnp.zeros((1000, 1000)))
        found = program(x + waited_for[0, :5])
        found.block_until_ready()
    assert seen
    assert all(np.array_equal(x, np.linspace(0.1, 0.7, 5)) for x in seen)
    assert found.dtype == np.float64
    assert np.array_equal(np.asarray(found), 3.0 * np.linspace(0.1, 0.7, 5))
