"""Kinks and jumps along a simulation: when they are, and derivatives of the motion over them, against closed forms."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce import drivers, forces, planar
from jounce.integrate.marching.smoothness_breaks import breaks

# one law for all tests, so that it is compiled once: a stop, a jump, a kink and a pulse in time, what bends twice
LAW = "-k*(x + abs(x))/2 - J*(1 + x/abs(x)) + K*abs(t - t0) + A*exp(-((t - t0)/w)**2) - c*x*abs(x)"
RAIL = ([0, 0], [0, 0], [1, 0])
STOP = np.array([1.0, 0.2, 40.0])  # m/s, m, N/m
END = 0.45


def sled(**values):
    """A mass of 1 kg that comes from -x0 with v0."""
    none = dict.fromkeys(("k", "J", "K", "A", "c"), 0.0)
    return jn.Mechanism(
        space="planar",
        parameters={"v0": 1.0, "x0": 0.2, "t0": 0.3, "w": 1e-3, **none, **values},
        bodies={"sled": jn.Body([0, 0], mass=1.0, inertia=1.0)},
        joints={"rail": planar.Prismatic(("ground", "sled"), *RAIL, [1, 0])},
        forces={"push": forces.SlideForce(("ground", "sled"), *RAIL, LAW)},
        initial={"go": drivers.SlideDriver(("ground", "sled"), *RAIL, "-x0 + v0*t")},
        outputs={"x": jn.outputs.PointOutput("sled", [0, 0])},
    )


def last(values):
    """Return place and velocity of a sled behind the stop."""
    v0, x0, k = values
    return jn.simulate(sled(k=1.0).with_parameters(v0=v0, x0=x0, k=k), [0.0, END], order=1).outputs["x"][-1, :, 0]


def exact(values):
    v0, x0, k = values
    rate, since = jnp.sqrt(k), END - x0 / v0
    return jnp.stack([v0 / rate * jnp.sin(rate * since), v0 * jnp.cos(rate * since)])


@pytest.mark.slow
def test_kinks_are_found_to_rounding_and_none_is_left_out():
    for stop in (0.5, 2.0):
        kinks = jn.simulate(sled(k=400.0), [0.0, stop], 1).kinks
        np.testing.assert_allclose([time for time, _ in kinks], [0.2, 0.2 + np.pi / 20], rtol=1e-13)
        assert {name for _, name in kinks} == {"forces.push"}
    backward = jn.simulate(sled(k=400.0, x0=-0.05, v0=1.0), [0.0, -1.0], 1).kinks
    first = -np.arctan(20 * 0.05) / 20
    np.testing.assert_allclose([time for time, _ in backward], [first], rtol=1e-13)
    in_time = jn.simulate(sled(K=1.0), [0.0, 2.0], 1).kinks
    np.testing.assert_allclose([time for time, _ in in_time], [0.3], rtol=1e-13)


@pytest.mark.slow
def test_what_jumps_is_distinguished_from_what_bends_and_from_what_is_smooth():
    def orders(**values):
        run = jn.simulate(sled(**values), [0.0, 0.45], 1)
        return [found.order for found in breaks(run.dense_output, run.model.length)]

    assert orders(J=5.0) == [2, 2]
    assert orders(k=40.0) == [3]
    assert orders(c=40.0) == orders(A=3e3) == orders(A=3e3, w=1e-4) == []


@pytest.mark.slow
def test_a_jump_is_refused():
    def place(x0):
        return jn.simulate(sled(J=5.0).with_parameters(x0=x0), [0.0, END], order=1).outputs["x"][-1, 0, 0]

    with pytest.raises(jn.errors.UnsupportedError, match=r"forces\.push.*jumps at t = 0\.2"):
        jax.grad(place)(0.2)


@pytest.mark.slow
def test_derivatives_over_a_kink_forward():
    found, expected = (jax.jacfwd(function)(jnp.array(STOP)) for function in (last, exact))
    np.testing.assert_allclose(found, expected, rtol=1e-11)


@pytest.mark.slow
def test_derivatives_over_a_kink_in_reverse():
    found, expected = (jax.grad(lambda x, f=function: f(x)[0])(jnp.array(STOP)) for function in (last, exact))
    np.testing.assert_allclose(found, expected, rtol=1e-11)


@pytest.mark.slow
def test_second_derivatives_over_a_kink():
    along = jnp.array([0.3, 0.5, 2.0])

    def second(function):
        def first(s):
            return jax.jvp(lambda s: function(jnp.array(STOP) + s * along), (s,), (1.0,))[1]

        return jax.jvp(first, (0.0,), (1.0,))[1]

    np.testing.assert_allclose(second(last), second(exact), rtol=1e-10)
