"""However a program sets up JAX and NumPy, it gets the usual numbers and keeps its settings, or is refused in words."""

import contextlib
import json
import os
import subprocess
import sys

import jax
import numpy as np
import pytest

import jounce as jn
from jounce.base.jax_options import OPTIONS
from jounce.execution.threads import Threads
from jounce.settings import own_settings, under_own_settings


@contextlib.contextmanager
def updated(**options):
    """Set options for the whole process, as a program does at its start."""
    before = {name: getattr(jax.config, name) for name in options}
    for name, value in options.items():
        jax.config.update(name, value)
    try:
        yield
        assert {name: getattr(jax.config, name) for name in options} == options
    finally:
        for name, value in before.items():
            jax.config.update(name, value)


SETTINGS = {
    "nothing": contextlib.nullcontext,
    "jax_debug_nans": lambda: updated(jax_debug_nans=True),
    "jax_debug_infs": lambda: updated(jax_debug_infs=True),
    "jax_disable_jit": lambda: updated(jax_disable_jit=True),
    "with jax.debug_nans, jax.disable_jit": lambda: both(jax.debug_nans(True), jax.disable_jit()),
    "jax_transfer_guard": lambda: updated(jax_transfer_guard="disallow"),
    "with jax.transfer_guard": lambda: jax.transfer_guard("disallow_explicit"),
    "jax_default_matmul_precision": lambda: updated(jax_default_matmul_precision="bfloat16"),
    "matmul by an algorithm": lambda: updated(jax_default_matmul_precision="BF16_BF16_F32"),
    "strict promotion": lambda: updated(jax_numpy_dtype_promotion="strict", jax_numpy_rank_promotion="raise"),
    "jax_default_device": lambda: updated(jax_default_device=jax.devices("cpu")[0]),
    "jax_enable_x64": lambda: updated(jax_enable_x64=False),
    "jax_check_tracer_leaks": lambda: updated(jax_check_tracer_leaks=True),
    "jax_log_compiles": lambda: updated(jax_log_compiles=True),
    "np.errstate": lambda: np.errstate(all="raise"),
}


@contextlib.contextmanager
def both(first, second):
    with first, second:
        yield


@pytest.fixture(scope="module")
def models():
    joints = [jn.Joint("a", "base", "one", axis=[0, -1, 0])]
    joints += [jn.Joint("b", "one", "two", position=[0.3, 0, 0], axis=[0, -1, 0])]
    links = [jn.Link("base"), jn.Link("one", jn.Inertia(1.0, [0.15, 0, 0]))]
    links += [jn.Link("two", jn.Inertia(0.7, [0.1, 0, 0]))]
    return jn.load("examples/four_bar.yaml"), jn.load("examples/simple_pendulum.yaml"), jn.Robot("arm", links, joints)


def numbers(models):
    """Compute in each of the ways that the package has: jets, solutions, simulations, robots."""
    fourbar, pendulum, arm = models
    t = jn.Jet.variable(0.1, order=3)
    found = {
        "jet": (t**2 * jn.jet.sin(t)).derivatives(),
        "solve": jn.solve(fourbar, [0.0, 0.3], order=4).outputs["psi"],
        "simulate": next(iter(jn.simulate(pendulum, [0.0, 0.1]).outputs.values())),
        "torque": jn.inverse_dynamics(arm, np.array([[0.3, 0.1], [0.7, -0.2], [0.1, 0.9], [0.3, 0.4]])),
        "forward": jn.forward_dynamics(arm, np.array([[0.3, 0.1], [0.7, -0.2]]), np.zeros((1, 2))),
    }
    return {name: np.asarray(values) for name, values in found.items()}


@pytest.fixture(scope="module")
def usual(models):
    found = numbers(models)
    x = 0.1
    assert np.allclose(found["jet"][:2], [x**2 * np.sin(x), 2 * x * np.sin(x) + x**2 * np.cos(x)], rtol=1e-14, atol=0)
    return found


@pytest.mark.parametrize("name", SETTINGS)
def test_numbers_do_not_depend_on_what_the_host_sets(name, models, usual):
    with SETTINGS[name]():
        settings = np.geterr()
        found = numbers(models)
        assert np.geterr() == settings
    for key, values in usual.items():
        assert np.array_equal(found[key], values), key


def test_gradients_do_not_depend_on_it(models):
    fourbar, _, _ = models

    def last_jounce(length):
        return jn.solve(fourbar.with_parameters(BC=length), [0.0, 0.1], order=4).outputs["psi"][-1, 4]

    slope = jax.grad(last_jounce)(0.14)
    with jax.debug_nans(True), jax.debug_infs(True):
        assert jax.grad(last_jounce)(0.14) == slope


def test_what_is_set_holds_between_calls_and_after_errors():
    @under_own_settings
    def steps():
        yield jax.config.jax_debug_nans, np.geterr()["under"]
        yield jax.config.jax_debug_nans, np.geterr()["under"]

    @under_own_settings
    def fails():
        raise ValueError("some")

    with jax.debug_nans(True), np.errstate(all="raise"):
        for seen in steps():
            assert seen == (False, "ignore")
            assert jax.config.jax_debug_nans
            assert np.geterr()["under"] == "raise"
        with pytest.raises(ValueError, match="some"):
            fails()
        assert jax.config.jax_debug_nans
        assert np.geterr()["under"] == "raise"
        with own_settings(), own_settings():
            assert np.float64(1e-200) * np.float64(1e-200) == 0
        assert jax.config.jax_debug_nans


def test_what_the_host_ignores_stays_ignored():
    with np.errstate(divide="ignore"), own_settings():
        assert np.geterr()["divide"] == "ignore"


def test_threads_compute_under_the_same_settings():
    with updated(jax_debug_nans=True, jax_disable_jit=True), own_settings(), Threads(2, compiled=True) as threads:
        seen = list(threads.map(lambda _: (jax.config.jax_debug_nans, jax.config.jax_disable_jit), range(6)))
    assert seen == [(False, False)] * 6


SET_BY_THE_SHELL = {"JAX_DEBUG_NANS": "1", "JAX_DEBUG_INFS": "1", "JAX_DISABLE_JIT": "1", "JAX_ENABLE_X64": "0"} | {
    "JAX_TRANSFER_GUARD": "disallow",
    "JAX_DEFAULT_MATMUL_PRECISION": "bfloat16",
    "JAX_NUMPY_DTYPE_PROMOTION": "strict",
    "JAX_NUMPY_RANK_PROMOTION": "raise",
}


def test_settings_of_the_environment_do_not_reach_the_command(models):
    done = run("-m", "jounce", "run", "examples/four_bar.yaml", "--json", JOUNCE_CACHE_DIR="", **SET_BY_THE_SHELL)
    assert not done.returncode, done.stderr
    assert done.stderr == ""
    peaks = {
        peak["derivative"]: peak["maximum"] for peak in json.loads(done.stdout)["peaks"] if peak["output"] == "psi"
    }
    psi = jn.solve(models[0], order=4).outputs["psi"]
    assert np.allclose([peaks["velocity"], peaks["jounce"]], psi[:, [1, 4]].max(axis=0), rtol=1e-2, atol=0)


def run(*arguments, **environment):
    return subprocess.run(
        [sys.executable, *arguments],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
        env=os.environ | environment,
    )


NO_SUCH_DEVICE = """
import warnings
warnings.simplefilter("error")
import jax
import jounce as jn

for name in ("abacus", "cuda"):
    jax.config.update("jax_platforms", name)
    for ask in (
        lambda: jn.Jet.variable(0.1, 3),
        lambda: jn.load("examples/four_bar.yaml"),
        lambda: jn.load_trajectory("examples/trajectories/panda_good.csv"),
    ):
        try:
            ask()
        except jn.errors.UnsupportedError as error:
            assert "JAX_PLATFORMS" in str(error) and repr(name) in str(error), error
            print(error)
"""


@pytest.mark.slow
def test_a_device_that_is_not_there_is_refused():
    done = run("-c", NO_SUCH_DEVICE)
    assert not done.returncode, done.stderr
    print(done.stdout)
    done = run("-m", "jounce", "run", "examples/four_bar.yaml", JAX_PLATFORMS="abacus", JOUNCE_CACHE_DIR="")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("error: ")
    assert "JAX_PLATFORMS: JAX is set to compute on a device that it does not find here, got 'abacus'" in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_device_that_is_not_there_by_default():
    with jax.default_device("tpu"), pytest.raises(jn.errors.UnsupportedError, match=r"jax_default_device: .* 'tpu'"):
        jn.Jet.variable(0.1, 3)


def test_options_are_those_of_jax():
    assert set(OPTIONS) <= set(jax.config.values)
