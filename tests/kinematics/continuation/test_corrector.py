"""Simplified Newton corrections: poses exact to rounding, and factors valid at the final pose."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce.jet import Jet
from jounce.kinematics.assembly.assemble import assemble
from jounce.kinematics.continuation.corrector import newton_raphson
from jounce.mechanism import build
from jounce.mechanism.building.starting_guess import pose_at

LANES = 5
TOLERANCE = 1e-12
LINKAGES = ["four_bar", "rsur", "bennett"]  # the last with a redundant constraint


@pytest.fixture(scope="module", params=LINKAGES)
def assembled(request):
    """Return the system of an assembled mechanism, its pose, and functions that correct and check poses."""
    model, coordinates = assemble(build(jn.load(f"examples/{request.param}.yaml")), 0.0, TOLERANCE)
    wide = {name: np.repeat(values, LANES, axis=-1) for name, values in coordinates.items()}
    system, time = model.system, Jet([np.zeros((1, LANES))])
    begun = pose_at(wide, model.pose_type)

    @jax.jit
    def solved(step, refine):
        guess = begun.displaced(*system.coordinates(step, begun.shifts))
        return newton_raphson(system, guess, time, np.asarray(TOLERANCE), refine)

    @jax.jit
    def judged(pose, factor, known):
        jacobian = system.jacobian(pose, time)
        right = jnp.sum(jacobian * known[None], axis=1)
        return system.residual(pose, time).coefficients[0], jacobian, factor.solve(right)

    return system, begun, solved, judged


def corrected(assembled, away, *, refine=True):
    """Return the corrections of poses displaced by up to `away`, each in another direction."""
    system, _, solved, _ = assembled
    return solved(away * np.random.default_rng(3).uniform(-1, 1, (system.shape[1], LANES)), np.asarray(refine))


@pytest.mark.parametrize("away", [1e-2, 1e-3, 1e-5, 1e-8, 1e-11, 0.0])
def test_poses_are_corrected_to_rounding_and_factors_solve_there(assembled, away):
    system, *_, judged = assembled
    pose, factor, correction = corrected(assembled, away)
    known = np.random.default_rng(4).normal(size=(system.shape[1], LANES))
    residual, jacobian, found = map(np.asarray, judged(pose, factor, known))
    assert np.abs(residual).max() < 5e-15
    assert correction.contracts().all()
    assert (correction.last <= TOLERANCE).all()
    np.testing.assert_allclose(found, known, rtol=0, atol=3e-15 * np.linalg.cond(jacobian[..., 0]))


def test_without_refinement_an_accepted_pose_is_left_as_it_is(assembled):
    system, begun, *_ = assembled
    pose, _, correction = corrected(assembled, 1e-13, refine=False)
    shift = np.asarray(pose.position.coefficients[0]) - np.asarray(begun.position.coefficients[0])
    assert (correction.last <= TOLERANCE).all()
    assert 1e-15 < np.abs(shift).max() / float(system.column_scale[0]) < 1e-11


def test_what_cannot_be_corrected_is_not_called_converged(assembled):
    *_, correction = corrected(assembled, np.nan)
    assert not (correction.last <= 1.0).any()
