"""Forces of drivers and reactions of joints: balances, rates, frames, outputs, what is refused."""

import dataclasses
import math
import pickle

import jax
import numpy as np
import pytest

import jounce as jn
from jounce.errors import MechanismError
from tests.problems import small
from tests.problems.massed import arm, massed, massed_example

TIME = np.array([0.1, 0.35, 0.6, 0.85])
# with the order of a motion, two more than that of the rates of forces; the power of every type of joint, driver and
# force is balanced in tests/contracts/test_frames.py
BANK = {"slider_crank": 4, "epicyclic": 4, "rolling_disc": 4, "rack_pinion": 3, "rspu_slide": 3}


@pytest.mark.slow
@pytest.mark.parametrize("name", BANK)
def test_power_balance_of_the_bank(name):
    # the two sides share no code but the motion; 2e-15 measured
    balance = jn.energy.power_balance(jn.solve(massed_example(name), TIME, order=BANK[name]))
    left = (np.abs(balance["residual"]) / balance["scale"].max("time")).max("time")
    assert float(balance["scale"].min()) > 0
    assert (left <= 3e-13).all(), left.values


@pytest.mark.slow
@pytest.mark.parametrize("name", ["slider_crank", pytest.param("rspu_slide", marks=pytest.mark.slow)])
def test_every_body_obeys_newton_and_euler(name):
    mechanism = massed_example(name)
    motion = jn.solve(mechanism, TIME, order=BANK[name])
    elements = {**mechanism.joints, **mechanism.drivers}
    for body, given in mechanism.bodies.items():
        spatial = mechanism.space == "spatial"
        force = given.mass * (motion.point(body, given.center_of_mass).values[:, 2] - mechanism.gravity)
        spin = motion.angular_velocity(body, "body").values
        if spatial:
            inertia = np.asarray(given.inertia)
            moment = spin[:, 1] @ inertia + np.cross(spin[:, 0], spin[:, 0] @ inertia)
        else:
            moment = spin[:, 1] * given.inertia
        felt = [
            jn.joint_reaction(motion, name, body, point=given.center_of_mass, frame="body")
            for name, element in elements.items()
            if body in element.bodies
        ]
        global_force = sum(
            jn.joint_reaction(motion, name, body).force.values[:, 0]
            for name, element in elements.items()
            if body in element.bodies
        )
        np.testing.assert_allclose(global_force, force, atol=1e-12 * np.abs(force).max())
        torque = sum(part.torque.values[:, 0] for part in felt)
        sizes = max(np.abs(part.torque.values[:, 0]).max() for part in felt)
        np.testing.assert_allclose(torque, moment, atol=1e-12 * sizes)


@pytest.mark.slow
def test_rates_are_those_of_differenced_multipliers_at_the_order_of_the_difference():
    # central differences err by h^2 f''' / 6: halving h must divide the error by four, at every rate
    mechanism = massed_example("slider_crank")
    errors = []
    for h in (2e-3, 1e-3):
        motion = jn.solve(mechanism, [0.4 - h, 0.4, 0.4 + h], order=4)
        torque = jn.driver_force(motion, "theta").values
        errors.append(np.abs((torque[2] - torque[0])[:-1] / (2 * h) - torque[1, 1:]))
    order = np.log2(errors[0] / errors[1])
    np.testing.assert_allclose(order, 2.0, atol=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["slider_crank", pytest.param("rspu_slide", marks=pytest.mark.slow)])
def test_a_joint_does_to_one_body_the_opposite_of_what_it_does_to_the_other(name):
    mechanism = massed_example(name)
    motion = jn.solve(mechanism, TIME, order=BANK[name])
    zero = [0.0] * len(mechanism.gravity)
    for joint, element in mechanism.joints.items():
        one, two = element.bodies
        first, second = (jn.joint_reaction(motion, joint, body, point=zero) for body in (one, two))
        size = max(float(np.abs(first.force).max()), float(np.abs(first.torque).max()))
        np.testing.assert_allclose(first.force, -second.force, atol=1e-12 * size)
        lever, force = position(motion, two, zero) - position(motion, one, zero), second.force.values
        for k in range(motion.order - 1):  # the rates of lever x force, by the rule of Leibniz
            moment = sum(math.comb(k, j) * cross(lever[:, j], force[:, k - j]) for j in range(k + 1))
            np.testing.assert_allclose(first.torque[:, k], -second.torque[:, k] - moment, atol=1e-11 * size)


def cross(a, b):
    """The vector product; in the plane its third component."""
    if a.shape[-1] == 3:
        return np.cross(a, b)
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def position(motion, body, point):
    """Position of a point of a body that may be the ground, (time, derivative, component)."""
    if body != "ground":
        return motion.point(body, point).values
    return np.zeros((len(TIME), motion.order + 1, len(point)))


@pytest.mark.slow
def test_frames_and_points_of_a_reaction_agree():
    motion = jn.solve(massed_example("slider_crank"), TIME, order=4)
    angle = motion.angle("rod").values[:, 0]
    turn = np.stack([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])  # global to rod
    plain, own = jn.joint_reaction(motion, "B"), jn.joint_reaction(motion, "B", frame="body")
    np.testing.assert_allclose(own.force[:, 0], np.einsum("ijt,tj->ti", turn, plain.force[:, 0]), rtol=1e-12)
    named = jn.joint_reaction(motion, "B", frame="rod")
    np.testing.assert_array_equal(named.force, own.force)
    ground = jn.joint_reaction(motion, "A")  # between bodies neither of which is the rod
    speed = motion.angle("rod").values[:, 1]
    across = np.stack([ground.force[:, 0, 1], -ground.force[:, 0, 0]], axis=1)
    rate = ground.force[:, 1] + speed[:, None] * across
    other = jn.joint_reaction(motion, "A", frame="rod").force
    np.testing.assert_allclose(other[:, 1], np.einsum("ijt,tj->ti", turn, rate), rtol=1e-10)
    moved = jn.joint_reaction(motion, "B", point=[0.3, -0.1])
    lever = (motion.point("rod", [0.0, 0.0]) - motion.point("rod", [0.3, -0.1])).values[:, 0]
    shifted = plain.torque[:, 0] + cross(lever, plain.force[:, 0].values)
    np.testing.assert_allclose(moved.torque[:, 0], shifted, atol=1e-12)


@pytest.mark.slow
def test_long_motions_in_chunks_agree_with_short_ones():
    mechanism = arm(mass=2.0, inertia=0.3)
    long = jn.driver_force(jn.solve(mechanism, np.linspace(0.0, 1.0, 1101), order=2), "turn")
    short = jn.driver_force(jn.solve(mechanism, np.linspace(0.0, 1.0, 1101)[::100], order=2), "turn")
    np.testing.assert_allclose(long[::100], short, rtol=1e-10)


@pytest.mark.slow
def test_outputs_are_the_functions_with_as_many_derivatives_as_the_motion():
    mechanism = massed_example("slider_crank")
    outputs = {
        "T": jn.outputs.DriverTorqueOutput("theta"),
        "B": jn.outputs.JointForceOutput("B", "crank"),
        "M": jn.outputs.JointTorqueOutput("guide", point=["r", 0.0]),
        "x": jn.outputs.PointOutput("slider", [0.0, 0.0]),
    }
    with_outputs = dataclasses.replace(mechanism, outputs=outputs)
    motion = jn.solve(with_outputs, TIME, order=2)
    assert motion.dataset["T"].shape == (len(TIME), 3)
    assert motion.dataset["B"].dims == ("time", "derivative", "component")
    assert [motion.dataset[name].attrs["units"] for name in "TBM"] == ["N*m", "N", "N*m"]
    longer = jn.solve(mechanism, TIME, order=4)
    np.testing.assert_allclose(motion.dataset["T"], jn.driver_force(longer, "theta"), rtol=1e-11)
    np.testing.assert_allclose(
        motion.dataset["B"], jn.joint_reaction(longer, "B", "crank").force, rtol=1e-11, atol=1e-9
    )
    torque = jn.joint_reaction(longer, "guide", point=[0.05, 0.0]).torque
    np.testing.assert_allclose(motion.dataset["M"], torque, rtol=1e-10, atol=1e-9)


@pytest.mark.slow
def test_instants_that_fail_are_nan():
    mechanism = massed(small.distance_slider("0.5 - t"))
    motion = jn.solve(mechanism, [0.1, 0.2, 0.9], order=4, strict=False)
    force = jn.driver_force(motion, "reach")
    assert np.isfinite(force[:2]).all()
    assert np.isnan(force[2]).all()
    assert np.isnan(jn.energy.power_balance(motion)["residual"][2]).all()


@pytest.mark.parametrize(
    "ask, name, says",
    [
        (lambda m: jn.driver_force(m, "trun"), "driver", "no driver has this name, got 'trun'; did you mean 'turn'?"),
        (lambda m: jn.joint_reaction(m, "pn"), "joint", "no joint has this name, got 'pn'; did you mean 'pin'?"),
        (lambda m: jn.joint_reaction(m, "pin", "am"), "body", "is not joined by 'pin', got 'am'; did you mean 'arm'?"),
        (
            lambda m: jn.joint_reaction(m, "pin", frame="local"),
            "frame",
            "unknown frame, got 'local'; did you mean 'global'? valid: arm, body",
        ),
        (lambda m: jn.joint_reaction(m, "pin", point=[1.0]), "outputs.pin.point", "must be a vector of 2 numbers"),
        (
            lambda m: jn.dynamics.applied_force(m, "spring"),
            "force",
            "no force has this name, got 'spring'; none is defined",
        ),
        (
            lambda m: m.evaluate(jn.outputs.DriverForceOutput("turn")),
            "quantity",
            "prescribes an angle, so that it exerts a torque",
        ),
    ],
)
def test_bad_requests(ask, name, says):
    motion = jn.solve(arm(mass=2.0), TIME, order=4)
    with pytest.raises(MechanismError, match=r".") as caught:
        ask(motion)
    assert caught.value.name == name
    assert says in str(caught.value)


def test_a_mechanism_without_masses_and_forces_says_so():
    motion = jn.solve(arm(), TIME, order=4)
    with pytest.raises(MechanismError, match="forces need masses, and no body has one"):
        jn.driver_force(motion, "turn")
    with pytest.raises(MechanismError, match="forces need masses"):
        jn.energy.power_balance(motion)
    with pytest.raises(MechanismError, match=r"outputs\.T\.driver: forces need masses"):
        dataclasses.replace(arm(), outputs={"T": jn.outputs.DriverTorqueOutput("turn")})


def test_a_force_that_is_not_finite_is_named_with_its_time():
    law = "2/(t - 0.6)"
    mechanism = dataclasses.replace(arm(mass=2.0), forces={"brake": jn.forces.Torque(("ground", "arm"), law)})
    motion = jn.solve(mechanism, TIME, order=4)
    with pytest.raises(MechanismError, match=r"forces\.brake: .*finite value at t = 0\.6 s"):
        jn.driver_force(motion, "turn")


@pytest.mark.slow
def test_forces_at_a_change_point_are_not_reported():
    """A parallelogram in circular translation: its weight on the crank in closed form, but where it is stretched out.

    There the Jacobian is singular, and what rounding makes of the torque looks like any other number.
    """
    bodies = {
        "crank": jn.Body([0, 0], angle=0.5, mass=1.0, inertia=0.01, center_of_mass=[0.1, 0]),
        "coupler": jn.Body([0.2 * math.cos(0.5), 0.2 * math.sin(0.5)], mass=2.0, inertia=0.05),
        "rocker": jn.Body([0.5, 0], angle=0.5, mass=1.0, inertia=0.01, center_of_mass=[0.1, 0]),
    }
    pins = {
        "O": jn.planar.Revolute(("ground", "crank"), [0, 0], [0, 0]),
        "A": jn.planar.Revolute(("crank", "coupler"), [0.2, 0], [0, 0]),
        "B": jn.planar.Revolute(("coupler", "rocker"), [0.5, 0], [0.2, 0]),
        "C": jn.planar.Revolute(("ground", "rocker"), [0.5, 0], [0, 0]),
    }
    turn = {"turn": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", motion="0.5 + (pi - 0.5)*t")}
    linkage = jn.Mechanism(space="planar", gravity=[0, -9.81], bodies=bodies, joints=pins, drivers=turn)
    motion = jn.solve(linkage, [0.0, 0.9, 1.0 - 1e-4, 1.0, 1.1, 1.9], order=3)
    assert not motion.status.any()
    np.testing.assert_allclose(motion.change_points, [1.0], rtol=0, atol=1e-9)
    torque = jn.driver_force(motion, "turn").values
    expected = 9.81 * (0.1 + 0.1 + 0.4) * np.cos(0.5 + (np.pi - 0.5) * motion.time)
    finite = [0, 1, 2, 4, 5]
    np.testing.assert_allclose(torque[finite, 0], expected[finite], rtol=0, atol=1e-9)
    assert np.isnan(torque[3]).all()
    assert np.isnan(jn.joint_reaction(motion, "B").force.values[3]).all()
    equations = jn.constraint_equations(motion).isel(time=3)
    assert np.isnan(equations.multipliers).all()
    assert np.isfinite(equations.jacobian).all()
    inertia = jn.dynamics.gibbs_appell(motion).values[:, 0, 0]
    np.testing.assert_allclose(inertia[[0, 1, 4, 5]], 0, rtol=0, atol=1e-9)  # at a steady speed
    assert np.isnan(inertia[3])


@pytest.mark.slow
def test_gradient_of_what_a_bearing_does_to_the_ground():
    """A bar of mass m turns at w about its end: what it does to the ground is -m (a - g), a = -w^2 L/2 along it."""
    bar = jn.Body([0, 0], 0.3, mass=2.0, inertia=0.1, center_of_mass=["L/2", 0])
    mechanism = jn.Mechanism(
        space="planar",
        bodies={"bar": bar},
        joints={"O": jn.planar.Revolute(("ground", "bar"), [0, 0], [0, 0])},
        drivers={"turn": jn.drivers.CoordinateDriver(("ground", "bar"), "angle", motion="0.3 + 5*t")},
        outputs={"O": jn.outputs.JointForceOutput("O", body="ground")},
        parameters={"L": 0.4},
        gravity=[0, -9.81],
    )

    def felt(length):
        return jn.solve(mechanism.with_parameters(L=length), TIME, order=1).outputs["O"][:, 0]

    angle = 0.3 + 5 * TIME
    along = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    np.testing.assert_allclose(felt(0.4), 2.0 * 25 * 0.2 * along + [0, -2.0 * 9.81], rtol=1e-12)
    np.testing.assert_allclose(jax.jacfwd(felt)(0.4), 2.0 * 25 / 2 * along, rtol=1e-11, atol=1e-12)


def test_a_motion_whose_forces_were_asked_for_goes_to_other_processes():
    motion = jn.solve(jn.load("examples/press.yaml"), [0.0, 0.1], order=2)
    asked = dict(motion.outputs)
    copied = pickle.loads(pickle.dumps(motion))
    for name, values in asked.items():
        np.testing.assert_array_equal(copied.outputs[name], values)
