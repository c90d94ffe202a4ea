"""Rack and pinion in space, against free bodies in closed form, in a frame that is drawn at random."""

import dataclasses
import math

import jax
import mpmath
import numpy as np
import pytest

import jounce as jn
from jounce import drivers, forces, spatial

TILT = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]
TILT[:, 2] *= np.sign(np.linalg.det(TILT))  # a rotation: along the rack, from the axis to the rack, the axis
PLACE, ZERO, SLOPE = np.array([0.3, -0.2, 0.5]), [0.0, 0.0, 0.0], math.tan(math.radians(20))
RADIUS, MASS, INERTIA = 0.05, 3.0, 0.02


def rack(height=RADIUS, load="0", guide=None, law="20*t + 3*sin(6*t)", **mesh):
    """A pinion on a motor and the rack above it, which is guided on the ground."""
    along, above, axis = TILT.T.tolist()
    line = (PLACE + height * TILT[:, 1]).tolist()
    joints = {
        "A": spatial.Revolute(("ground", "pinion"), PLACE.tolist(), ZERO, axis, axis),
        "guide": guide or spatial.Prismatic(("ground", "rack"), line, ZERO, along, along, above, above),
        "mesh": spatial.Rolling(("rack", "pinion"), ZERO, ZERO, along, axis, axis, RADIUS, None, math.radians(20)),
    }
    return jn.Mechanism(
        space="spatial",
        bodies={
            "pinion": jn.Body(PLACE.tolist(), mass=1.0, inertia=[INERTIA] * 3),
            "rack": jn.Body(line, mass=MASS, inertia=[0.1] * 3),
        },
        joints={**joints, "mesh": dataclasses.replace(joints["mesh"], **mesh)},
        drivers={"motor": drivers.RotationDriver(("ground", "pinion"), axis, law)},
        forces={"load": forces.SpatialPointForce("rack", ZERO, [f"{x}*({load})" for x in TILT[:, 0].tolist()])},
        outputs={"rack": jn.outputs.PointOutput("rack", ZERO)},
    )


def travelled(path):
    """Return how far the rack has gone along itself from where it began, with derivatives, (..., order)."""
    beginning = PLACE + RADIUS * TILT[:, 1]
    along = path @ TILT[:, 0]
    along[..., 0] -= beginning @ TILT[:, 0]
    return along


def rates(function, t, count):
    with mpmath.workdps(40):
        return np.array([float(mpmath.diff(function, mpmath.mpf(t), k)) for k in range(count)])


@pytest.mark.parametrize("sign", [1, pytest.param(-1, marks=pytest.mark.slow)])
@pytest.mark.slow
def test_a_tooth_loads_bearing_and_guide_along_the_rack_and_apart(sign):
    """Over ten turns, with rates to the fourth: the rack takes its inertia and the load from the pitch point."""
    time = [0.0, 0.7, 3.3]
    motion = jn.solve(rack(load=f"{sign}*(90 + 20*sin(5*t))", law="20*t + 0.3*sin(6*t)"), time, 6)

    def angle(t):
        return 20 * t + mpmath.mpf("0.3") * mpmath.sin(6 * t)

    def tooth(t):  # on the rack, along it
        return -MASS * RADIUS * mpmath.diff(angle, t, 2) - sign * (90 + 20 * mpmath.sin(5 * t))

    size = 90 * 5**4
    for k, t in enumerate(time):
        travel = -RADIUS * rates(angle, t, 7)
        np.testing.assert_allclose(
            travelled(motion.outputs["rack"][k]), travel, rtol=1e-11, atol=1e-11 * np.abs(travel).max()
        )
        force = rates(tooth, t, 5)
        assert np.sign(force[0]) == -sign
        apart = -sign * SLOPE * force
        for joint, body, expected in (("A", "pinion", (force, apart)), ("guide", "rack", (0 * force, -apart))):
            found = jn.joint_reaction(motion, joint, body).force.values[k] @ TILT
            np.testing.assert_allclose(found, np.stack([*expected, 0 * force], axis=1), rtol=1e-10, atol=1e-12 * size)
        torque = INERTIA * rates(lambda t: mpmath.diff(angle, t, 2), t, 5) - RADIUS * force
        np.testing.assert_allclose(jn.driver_force(motion, "motor").values[k], torque, rtol=1e-10, atol=1e-12 * size)


@pytest.mark.slow
def test_a_rack_that_is_pushed_accelerates_its_pinion():
    """From rest, by a force that is constant: both reach ``F s = m v^2 / 2``."""
    pushed = dataclasses.replace(rack(load="40"), drivers={})
    motion = jn.simulate(pushed, [0.0, 0.5, 1.0])
    acceleration = 40 / (MASS + INERTIA / RADIUS**2)
    time = motion.time
    np.testing.assert_allclose(
        travelled(motion.outputs["rack"])[:, 0], acceleration * time**2 / 2, rtol=1e-9, atol=1e-12
    )
    np.testing.assert_allclose(travelled(motion.outputs["rack"])[:, 1], acceleration * time, rtol=1e-9, atol=1e-12)


@pytest.mark.slow
def test_travel_by_the_pitch_radius_counts_all_turns():
    def travel(radius):
        changed = rack(radius=radius, pressure_angle=None)
        rack_x = jn.solve(changed, [0.0, 3.3], 1).outputs["rack"][:, 0] @ TILT[:, 0]
        return rack_x[1] - rack_x[0]

    angle = 20 * 3.3 + 3 * math.sin(6 * 3.3)
    assert float(jax.grad(travel)(RADIUS)) == pytest.approx(-angle, rel=1e-10)
    varied = rack(radius="r", pressure_angle=None)
    family = jn.solve_batch(dataclasses.replace(varied, parameters={"r": 0.05}), {"r": [0.04, 0.05]}, [0.0, 3.3], 1)
    np.testing.assert_allclose(
        np.diff(family["rack"].values[:, :, 0] @ TILT[:, 0])[:, 0], -np.array([0.04, 0.05]) * angle, rtol=1e-11
    )


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::jounce.errors.AssemblyWarning")  # the last is on the other side of its rack
def test_what_does_not_mesh_is_refused():
    along, above, _ = TILT.T.tolist()
    line = (PLACE + RADIUS * TILT[:, 1]).tolist()
    tilted = (TILT[:, 2] + 0.1 * TILT[:, 0]).tolist()
    loose = spatial.Cylindrical(("ground", "rack"), line, ZERO, along, along)
    for mechanism, words in (
        (rack(guide=loose), "does not turn about this axis on the rack: hinge it, and guide the rack"),
        (rack(axis_i=tilted), r"joints\.mesh\.axes: .*leans along it by 5\.71 deg"),
        (rack(axis_i=above), r"joints\.mesh\.axes: by the joints between them, the axis of the pinion is"),
        (rack(axis_i=(-TILT[:, 2]).tolist()), "give that one, or the opposite on both"),
        (rack(axis_j=above), "does not turn about this axis on the rack: hinge it"),
        (rack(radius=-0.05), r"joints\.mesh\.radius: must be greater than zero"),
    ):
        with pytest.raises(jn.errors.MechanismError, match=words):
            jn.solve(mechanism, [0.0], 1)
    for height, words in ((0.052, r"-0\.052 m to the left"), (-0.05, r"0\.05 m to the left")):
        with pytest.raises(jn.errors.MechanismError, match=words):
            jn.driver_force(jn.solve(rack(height), [0.0], 3), "motor")


@pytest.mark.slow
def test_a_pinion_climbs_a_rack_that_is_fixed():
    """The rack on the ground, the pinion on a lift: the lift hangs on the tooth."""
    along, above, axis = TILT.T.tolist()
    mechanism = jn.Mechanism(
        space="spatial",
        gravity=(-9.81 * TILT[:, 0]).tolist(),
        bodies={
            "lift": jn.Body(PLACE.tolist(), mass=80.0, inertia=[1.0] * 3),
            "pinion": jn.Body(PLACE.tolist(), mass=2.0, inertia=[INERTIA] * 3),
        },
        joints={
            "rails": spatial.Prismatic(("ground", "lift"), PLACE.tolist(), ZERO, along, along, above, above),
            "A": spatial.Revolute(("lift", "pinion"), ZERO, ZERO, axis, axis),
            "mesh": spatial.Rolling(
                ("ground", "pinion"), (PLACE + RADIUS * TILT[:, 1]).tolist(), ZERO, along, axis, axis, RADIUS
            ),
        },
        drivers={"motor": drivers.RotationDriver(("lift", "pinion"), axis, "30*t")},
        outputs={"lift": jn.outputs.PointOutput("lift", ZERO)},
    )
    motion = jn.solve(mechanism, [0.0, 2.0], 2)
    np.testing.assert_allclose((motion.outputs["lift"][:, 0] - PLACE) @ TILT[:, 0], [0.0, 3.0], atol=1e-12)
    np.testing.assert_allclose(jn.driver_force(motion, "motor").values[:, 0], 82 * 9.81 * RADIUS, rtol=1e-12)
    tooth = jn.joint_reaction(motion, "mesh", "pinion").force.values[:, 0] @ TILT
    np.testing.assert_allclose(tooth, [[82 * 9.81, 0, 0]] * 2, atol=1e-9)
