"""The equations of motion in the solvers of diffrax."""

import dataclasses
import importlib

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce.dynamics.forward.accelerations import State
from jounce.errors import MechanismError
from tests.problems import dynamics

STOP = 0.8


@eqx.filter_jit
def solved(term, state, equations, instants):
    """Solve from 0 to STOP; return the solution at the instants."""
    return diffrax.diffeqsolve(
        term,
        diffrax.Dopri8(),
        0.0,
        STOP,
        0.01,
        state,
        args=equations,
        saveat=diffrax.SaveAt(ts=instants),
        stepsize_controller=diffrax.PIDController(rtol=1e-12, atol=1e-12),
        adjoint=diffrax.ForwardMode(),
    )


@pytest.mark.slow
def test_a_run_of_diffrax_agrees_with_taylor_series():
    mechanism = dynamics.double_pendulum(0.3, 1.0, 1.0, -2.0)
    equation = jn.integrate.ode_term(mechanism)
    instants = np.array([0.0, 0.35, STOP])
    solution = solved(equation.term, equation.state, equation.equations, jnp.asarray(instants))
    motion = equation.motion(solution.ts, solution.ys, order=3)
    expected = jn.simulate(mechanism, instants, order=3)
    for name, values in expected.outputs.items():
        found = motion.outputs[name]
        assert found.shape == values.shape
        size = np.max(np.abs(values), axis=0)
        assert np.max(np.abs(found - values) / np.where(size, size, 1)) < 1e-9
    drift = np.max(np.abs(np.asarray(solution.ys.position)[-1][:, 1] - tip_of_the_first(motion)))
    assert 0 < drift < 1e-10  # nothing holds the joint together but the accuracy of the solver


def tip_of_the_first(motion):
    angle = motion.outputs["a"][-1, 0]
    return np.array([np.cos(angle), np.sin(angle)])


@pytest.mark.slow
def test_states_and_values_may_be_batched_and_differentiated():
    equation = jn.integrate.ode_term(dynamics.double_pendulum(0.3, 1.0, 1.0, -2.0))
    instants = jnp.array([STOP])

    def end(spin, gravity):
        state = equation.state._replace(spin=equation.state.spin.at[0, 1].add(spin))
        # the frame of the lower body lies in its pin, so that any spin of it is permitted
        equations = dataclasses.replace(equation.equations, gravity=jnp.array([0.0, -gravity])[:, None, None])
        return solved(equation.term, state, equations, instants).ys.attitude[0, 0, 1]

    spins = jnp.array([-0.1, 0.0, 0.1])
    together = jax.jit(jax.vmap(lambda s: end(s, 9.81)))(spins)
    single = [end(s, jnp.asarray(9.81)) for s in spins]
    assert np.allclose(together, single, rtol=0, atol=1e-10)
    _, slope = jax.jvp(lambda g: end(0.0, g), (jnp.asarray(9.81),), (jnp.asarray(1.0),))
    beside = [end(0.0, jnp.asarray(9.81 + d)) for d in (-1e-4, 1e-4)]
    assert abs(slope - (beside[1] - beside[0]) / 2e-4) < 1e-6 * abs(slope)


@pytest.mark.slow
def test_the_term_in_space_is_the_first_coefficients_of_the_series():
    equation = jn.integrate.ode_term(dynamics.spatial_double_pendulum())
    rates = equation.term.vector_field(0.0, equation.state, equation.equations)
    assert isinstance(rates, State)
    motion = jn.simulate(equation.mechanism, [0.0], order=2)
    _, coordinates = motion.poses
    pairs = {"position": rates.position, "quaternion": rates.attitude, "angular_velocity": rates.spin}
    for name, found in pairs.items():
        assert np.allclose(found, coordinates[name][1][:, 1:, 0], rtol=0, atol=1e-13 * np.abs(found).max())
    assert np.allclose(rates.velocity, 2 * coordinates["position"][2][:, 1:, 0], rtol=0, atol=1e-12)


def test_missing_diffrax_is_named(monkeypatch):
    real = importlib.import_module

    def refuse(name, *rest):
        if name == "diffrax":
            raise ImportError(name)
        return real(name, *rest)

    monkeypatch.setattr(importlib, "import_module", refuse)
    with pytest.raises(MechanismError, match=r"jounce\[integrators\]"):
        jn.integrate.ode_term(dynamics.simple_pendulum())
