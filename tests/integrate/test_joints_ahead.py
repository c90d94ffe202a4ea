"""Features of a user's joint that lie ahead of a step: seen, or told, but never passed over."""

import math

import numpy as np
import pytest

import jounce as jn
from jounce import drivers, jet, planar
from tests.problems.own_types import taken_back

with taken_back():

    class Track(jn.joints.AbstractConstraint, type="test_track", space="planar"):
        """A bead on y = height f((x - at) / width)."""

        shape: str
        height: jn.joints.Scalar
        at: jn.joints.Scalar
        width: jn.joints.Scalar

        def residual(self, body_i, body_j, time):
            u = (body_j.position[0] - self.at) / self.width
            heights = {
                "bell": lambda: jet.exp(-(u * u)),
                "step": lambda: 0.5 + 0.5 * jet.tanh(u),
                "bend": lambda: jet.abs(u),
                "wave": lambda: jet.sin(u),
            }
            return body_j.position[1] - self.height * heights[self.shape]()


def bead(shape, height, at, width, speed=2.0):
    return jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        parameters={"speed": speed},
        bodies={"bead": jn.Body([0, 0], mass=1.0, inertia=1e-3)},
        joints={
            "track": Track(("ground", "bead"), shape=shape, height=height, at=at, width=width),
            "upright": planar.Coordinate(("ground", "bead"), "angle", ratio=0.0),
        },
        initial={"go": drivers.CoordinateDriver(("ground", "bead"), "x", "speed*t")},
        outputs={"bead": jn.outputs.PointOutput("bead", [0, 0])},
    )


@pytest.mark.slow
def test_a_hill_too_high_turns_the_bead_back():
    # 2 m/s reach 0.204 m of 0.3 m: it comes back as it came
    motion = jn.simulate(bead("bell", 0.3, 2.0, 0.15), [0.0, 0.5, 2.0], 1)
    assert motion.outputs["bead"][-1, 1, 0] == pytest.approx(-2.0, abs=1e-11)
    assert np.ptp(motion.energy) < 1e-11


@pytest.mark.slow
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_what_is_a_hundredth_of_a_step_is_seen(sense):
    motion = jn.simulate(bead("bell", 0.05, sense * 1.3, 0.004), [0.0, sense * 2.0], 1)
    assert motion.outputs["bead"][-1, 1, 0] == pytest.approx(2.0, abs=1e-11)
    plain = 4.0
    assert abs(motion.outputs["bead"][-1, 0, 0]) < plain - 1e-3  # it was slower on the hill
    up = jn.simulate(bead("step", 0.05, sense * 1.3, 0.003), [0.0, sense * 2.0], 1)
    assert up.outputs["bead"][-1, 1, 0] == pytest.approx(math.sqrt(4.0 - 2 * 9.81 * 0.05 * sense), rel=1e-11)


@pytest.mark.slow
def test_every_run_of_a_batch_sees_what_is_ahead():
    batch = jn.simulate_batch(bead("bell", 0.3, 2.0, 0.15), {"speed": [1.0, 2.0, 3.0]}, [0.0, 4.0], 1)
    assert (batch.status == 0).all()
    np.testing.assert_allclose(batch.outputs["bead"][:, -1, 1, 0], [-1.0, -2.0, 3.0], rtol=1e-10)


@pytest.mark.slow
def test_implicit_formulas_see_it_too():
    motion = jn.simulate(bead("bell", 0.3, 2.0, 0.15), [0.0, 2.0], 1, method=jn.Obreshkov(8), tolerance=1e-12)
    assert motion.outputs["bead"][-1, 1, 0] == pytest.approx(-2.0, abs=1e-8)


@pytest.mark.slow
def test_a_bend_where_velocities_would_jump_is_an_error():
    mechanism = bead("bend", 0.05, 1.3, 1.0)
    motion = jn.simulate(mechanism, [0.0, 0.5, 1.0, 2.0], 1, strict=False)
    assert [jn.Status(int(s)).name for s in motion.status] == ["OK", "OK", "UNBALANCED", "NOT_REACHED"]
    assert "joints.track" in motion.faults[2]
    with pytest.raises(jn.errors.SolveError, match="energy of the motion would change"):
        jn.simulate(mechanism, [0.0, 2.0], 1)


@pytest.mark.slow
def test_a_bend_in_a_batch_has_the_same_status():
    batch = jn.simulate_batch(bead("bend", 0.05, 1.3, 1.0), {"speed": [0.1, 2.0]}, [0.0, 0.5, 2.0], 1)
    names = [[jn.Status(int(s)).name for s in run] for run in batch.status]
    assert names == [["OK", "OK", "OK"], ["OK", "OK", "UNBALANCED"]]


with taken_back():

    class Bump(jn.joints.AbstractConstraint, type="test_bump", space="spatial"):
        """A ball on z = height exp(-((x - 1.5) / width)^2), y = 0."""

        height: jn.joints.Scalar
        width: jn.joints.Scalar

        def residual(self, body_i, body_j, time):
            p = body_j.position
            u = (p[0] - 1.5) / self.width
            return jn.joints.rows(p[2] - self.height * jet.exp(-(u * u)), p[1])


@pytest.mark.slow
def test_a_joint_in_space():
    ball = jn.Mechanism(
        space="spatial",
        gravity=[0, 0, -9.81],
        bodies={"ball": jn.Body([0, 0, 0], mass=1.0, inertia=[1e-3, 1e-3, 1e-3])},
        joints={"bump": Bump(("ground", "ball"), height=0.3, width=0.1)},
        initial={"go": drivers.SpatialSlideDriver(("ground", "ball"), [0, 0, 0], [0, 0, 0], [1, 0, 0], "2*t")},
        outputs={"ball": jn.outputs.PointOutput("ball", [0, 0, 0])},
    )
    motion = jn.simulate(ball, [0.0, 2.0], 1)
    assert motion.outputs["ball"][-1, 1, 0] == pytest.approx(-2.0, abs=1e-10)
