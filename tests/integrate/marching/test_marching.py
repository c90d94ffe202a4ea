"""How a run begins and goes on: one program of each kind."""

import dataclasses
from functools import partial

import jax
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import jounce as jn
from jounce.dynamics.forward.initial_state import consistent_start
from jounce.integrate.marching.marching import RunLimits, march, unexpanded


def test_what_a_run_begins_with_is_compiled_for_once():
    # the types of its arrays are those of what comes out of its steps, to how strict they are
    mass = jn.Mechanism(
        space="planar",
        bodies={"mass": jn.Body([1, 0], mass=1.0, inertia=1.0)},
        joints={},
        forces={"spring": jn.forces.Spring(("ground", "mass"), [0, 0], [0, 0], 3.0, 0.5)},
    )
    start = consistent_start(mass, 0.0)
    equations, state = start.equations, start.state
    begun = jax.eval_shape(lambda: unexpanded(equations, state, np.zeros(1), order=4))
    going = partial(march.function, method=jn.Taylor(4), count=1)
    onwards = jax.eval_shape(going, equations, begun, RunLimits(1.0, 1e-9, np.inf, 0.0))[0]
    assert jax.tree.structure(begun) == jax.tree.structure(onwards)
    kinds = [[(x.shape, x.dtype, x.weak_type) for x in jax.tree.leaves(part)] for part in (begun, onwards)]
    assert kinds[0] == kinds[1]


@pytest.mark.slow
@pytest.mark.parametrize("order", [4, 5])
def test_series_of_the_lowest_orders_find_the_way_too(order):
    spring = jn.Mechanism(
        space="planar",
        bodies={"mass": jn.Body([1, 0], mass=2.0, inertia=1.0)},
        joints={"rail": jn.planar.Prismatic(("ground", "mass"), [0, 0], [0, 0], [1, 0], [1, 0])},
        forces={"spring": jn.forces.Spring(("ground", "mass"), [-1, 0], [0, 0], 8.0, 1.5)},
        outputs={"x": jn.outputs.PointOutput("mass", [0, 0])},
    )
    found = jn.simulate(spring, [0.0, 0.7], order=2, method=jn.Taylor(order), tolerance=1e-10)
    expected = 0.5 + 0.5 * np.cos(2.0 * 0.7)  # x'' = -4 (x - 0.5) from rest at 1
    np.testing.assert_allclose(found.outputs["x"][-1, 0, 0], expected, atol=1e-7)


def free_linkage(length, base, inertias, **bodies):
    """A crank and a member that follows it, released with an angle and a speed of the crank."""
    crank = jn.Body([0, 0], "angle", mass=1.0, inertia=inertias[0], center_of_mass=[base, 0])
    return {
        "space": "planar",
        "gravity": [0, -9.81],
        "parameters": {"angle": 1.0, "speed": 0.0, "a": length},
        "bodies": {"crank": crank, **bodies},
        "initial": {"turn": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", "angle + speed*t")},
        "outputs": {"angle": jn.outputs.AngleOutput("crank")},
    }


def parallelogram():
    """Returns the mechanism, and as functions of the angle its inertia, the derivative of that, and its torque."""
    pin = jn.planar.Revolute
    parts = free_linkage(
        0.1,
        0.0,
        [1e-3],
        rocker=jn.Body([0.3, 0], "angle", mass=1.2, inertia=2e-3),
        coupler=jn.Body(["a*cos(angle)", "a*sin(angle)"], mass=0.5, inertia=1e-3, center_of_mass=[0.1, 0.02]),
    )
    joints = {
        "O": pin(("ground", "crank"), [0, 0], [0, 0]),
        "Q": pin(("ground", "rocker"), [0.3, 0], [0, 0]),
        "A": pin(("crank", "coupler"), ["a", 0], [0, 0]),
        "B": pin(("coupler", "rocker"), [0.3, 0], ["a", 0]),
    }
    inertia = 3e-3 + 0.5 * 0.1**2
    motion = lambda x: inertia, lambda x: 0.0, lambda x: -9.81 * 0.5 * 0.1 * np.cos(x)
    return jn.Mechanism(**parts, joints=joints), motion


def folding_slider_crank():
    """As `parallelogram`, with crank and rod of one length: the slider stands on the axis of the crank when folded."""
    pin, a = jn.planar.Revolute, 0.2
    parts = free_linkage(
        a,
        0.1,
        [3e-3],
        rod=jn.Body(["a*cos(angle)", "a*sin(angle)"], "-angle", mass=0.7, inertia=2e-3, center_of_mass=[0.1, 0]),
        slider=jn.Body(["2*a*cos(angle)", 0], mass=0.5, inertia=1e-3),
    )
    joints = {
        "O": pin(("ground", "crank"), [0, 0], [0, 0]),
        "A": pin(("crank", "rod"), ["a", 0], [0, 0]),
        "P": pin(("rod", "slider"), ["a", 0], [0, 0]),
        "guide": jn.planar.Prismatic(("ground", "slider"), [0, 0], [0, 0], [1, 0], [1, 0]),
    }

    def inertia(x):
        sine, cosine = np.sin(x) ** 2, np.cos(x) ** 2
        return 3e-3 + 0.01 + 2e-3 + a * a * (0.7 * (2.25 * sine + 0.25 * cosine) + 0.5 * 4.0 * sine)

    slope = a * a * (0.7 * 2.0 + 0.5 * 4.0)
    motion = inertia, lambda x: slope * np.sin(2 * x), lambda x: -9.81 * (0.1 + 0.7 * 0.1) * np.cos(x)
    return jn.Mechanism(**parts, joints=joints), motion


@pytest.mark.parametrize("linkage", [parallelogram, folding_slider_crank])
def test_free_linkages_pass_their_change_points(linkage):
    """Whatever the distance from them at which a step happens to begin; the reference is the motion in one angle."""
    mechanism, (inertia, slope, torque) = linkage()
    time = np.linspace(0, 3, 31)
    starts = [
        (1.0, 2.5),
        (1.0, 3.0),
        (1.0, -4.0),
        (0.557, -13.4),
        (-0.877, -11.8),
        (0.599049839449549, -2.241975255066697),
    ]
    starts += [(float(a), float(s)) for a, s in np.random.default_rng(5).uniform([0.3, -15], [1.2, 15], (14, 2))]
    for angle, speed in starts:
        motion = jn.simulate(mechanism.with_parameters(angle=angle, speed=speed), time, order=0)

        def rates(_, state):
            return state[1], (torque(state[0]) - 0.5 * slope(state[0]) * state[1] ** 2) / inertia(state[0])

        exact = solve_ivp(rates, (0, 3), (angle, speed), "DOP853", time, rtol=1e-12, atol=1e-12).y[0]
        np.testing.assert_allclose(motion.outputs["angle"][:, 0], exact, rtol=0, atol=3e-7)
        assert np.ptp(motion.energy) < 1e-8


@pytest.mark.parametrize("driven", [True, False])
def test_reactions_at_a_change_point_of_a_simulation_are_not_rounding(driven):
    """A parallelogram whose coupler has its mass in a pin turns evenly without load on the other pin."""
    linkage, _ = parallelogram()
    turn = {"turn": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", "1 + 2.5*t")}
    coupler = dataclasses.replace(linkage.bodies["coupler"], center_of_mass=[0, 0])
    parts = {"drivers": turn, "initial": {}} if driven else {"initial": turn}
    mechanism = dataclasses.replace(linkage, gravity=None, bodies={**linkage.bodies, "coupler": coupler}, **parts)
    flat = (np.pi - 1.0) / 2.5
    offsets = np.array([0.0, *(sign * 10.0**-k for k in (12, 10, 8, 7, 6, 5, 4, 3) for sign in (-1, 1))])
    motion = jn.simulate(mechanism, [0.0, 1.5], order=3).at(np.append(flat + offsets, 1.2))
    np.testing.assert_allclose(motion.outputs["angle"][:, 0], 1.0 + 2.5 * motion.time, rtol=0, atol=1e-9)
    forces = jn.joint_reaction(motion, "B").force.values  # (time, derivative, component)
    assert np.isnan(forces[0]).all()
    assert not np.isnan(forces[-1]).any()
    assert not np.isnan(forces[np.abs(np.append(offsets, 1.0)) > 1e-5, 0]).any()
    sizes = 0.5 * 0.1 * 2.5 ** np.arange(2.0, 2.0 + forces.shape[1])  # of the centripetal force of the coupler
    assert (np.nanmax(np.abs(forces), axis=(0, 2)) < 2e-3 * sizes).all()
    assert (motion.status == 0).all()
