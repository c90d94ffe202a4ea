import dataclasses

import mpmath
import numpy as np
import pytest

import jounce as jn
from jounce import drivers, planar
from jounce.errors import MechanismError
from jounce.kinematics import Motion
from jounce.mechanism import build
from tests.problems import small
from tests.problems.massed import massed, massed_example
from tests.problems.mechanisms import MECHANISMS, example

TIME = np.array([0.1, 0.35, 0.6, 0.85])
ZERO, X = [0.0, 0.0], [1.0, 0.0]
TIME_OF_LAW = "0.3 + 0.7*t + 0.4*sin(3*t)"


def law(t):
    """The motion law of most mechanisms here, for mpmath."""
    return mpmath.mpf("0.3") + mpmath.mpf("0.7") * t + mpmath.mpf("0.4") * mpmath.sin(3 * t)


def rates(function, times, count=3):
    """Derivatives of a function of time in mpmath, shape (time, count)."""
    with mpmath.workdps(40):
        return np.array([[float(mpmath.diff(function, mpmath.mpf(t), k)) for k in range(count)] for t in times])


def arm(**body):
    """An arm on a pin, turned by the law."""
    return jn.Mechanism(
        space="planar",
        gravity=[0.0, -9.81],
        bodies={"arm": jn.Body(ZERO, **body)},
        joints={"pin": planar.Revolute(("ground", "arm"), [0.2, 0.1], ZERO)},
        drivers={"turn": drivers.CoordinateDriver(("ground", "arm"), "angle", TIME_OF_LAW)},
    )


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=() if n == "slider_crank" else pytest.mark.slow) for n in MECHANISMS]
)
def test_power_balance_of_the_bank(name):
    # the two sides share no code but the motion; 2e-15 measured, but for screw and swash plate at higher rates
    balance = jn.power_balance(jn.solve(massed_example(name), TIME, order=4))
    left = (np.abs(balance["residual"]) / balance["scale"].max("time")).max("time")
    assert float(balance["scale"].min()) > 0
    assert (left <= 1e-13).all(), left.values


@pytest.mark.parametrize("name", ["slider_crank", pytest.param("hooke_joint", marks=pytest.mark.slow)])
def test_every_body_obeys_newton_and_euler(name):
    mechanism = massed_example(name)
    motion = jn.solve(mechanism, TIME, order=4)
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


def test_driven_pendulum_against_its_closed_form():
    motion = jn.solve(arm(mass=2.0, inertia=0.3, center_of_mass=[0.5, 0.0]), TIME, order=4)

    def torque(t):
        with_steiner = mpmath.mpf("0.3") + 2 * mpmath.mpf("0.25")
        return with_steiner * mpmath.diff(law, t, 2) + 2 * mpmath.mpf("9.81") / 2 * mpmath.cos(law(t))

    def pin(component):
        def force(t):
            r, w, a = mpmath.mpf("0.5"), mpmath.diff(law, t), mpmath.diff(law, t, 2)
            c, s = mpmath.cos(law(t)), mpmath.sin(law(t))
            x = -a * r * s - w**2 * r * c
            y = a * r * c - w**2 * r * s + mpmath.mpf("9.81")
            return 2 * (x if component == 0 else y)

        return force

    np.testing.assert_allclose(jn.driver_force(motion, "turn"), rates(torque, TIME), rtol=1e-12, atol=1e-11)
    reaction = jn.joint_reaction(motion, "pin")
    for component in range(2):
        expected = rates(pin(component), TIME)
        np.testing.assert_allclose(reaction.force[..., component], expected, rtol=1e-12, atol=1e-10)
    assert np.abs(reaction.torque).max() <= 1e-12  # a pin carries none about itself


@pytest.mark.slow
def test_slider_crank_against_the_textbook():
    # crank 1 and rod 3 without mass, slider of 4 kg on x: torque = 4 x'' dx/dtheta, guide force from the rod's angle
    mechanism = small.slider_crank()
    bodies = {**mechanism.bodies, "slider": dataclasses.replace(mechanism.bodies["slider"], mass=4.0)}
    driver = drivers.CoordinateDriver(("ground", "crank"), "angle", TIME_OF_LAW)
    mechanism = dataclasses.replace(mechanism, bodies=bodies, drivers={"drive": driver})
    motion = jn.solve(mechanism, TIME, order=4)

    def x(angle):
        return mpmath.cos(angle) + mpmath.sqrt(9 - mpmath.sin(angle) ** 2)

    def push(t):
        return 4 * mpmath.diff(lambda s: x(law(s)), t, 2)

    def torque(t):
        return push(t) * mpmath.diff(x, law(t))

    def guide(t):
        return push(t) * mpmath.sin(law(t)) / mpmath.sqrt(9 - mpmath.sin(law(t)) ** 2)

    np.testing.assert_allclose(jn.driver_force(motion, "drive"), rates(torque, TIME), rtol=1e-9, atol=1e-9)
    normal = jn.joint_reaction(motion, "guide").force
    np.testing.assert_allclose(normal[..., 1], rates(guide, TIME), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(normal[..., 0], 0.0, atol=1e-10)
    rod = jn.joint_reaction(motion, "B", "rod", frame="rod").force  # a rod without mass carries along itself only
    assert np.abs(rod[..., 1]).max() <= 1e-11 * np.abs(rod[..., 0]).max()


@pytest.mark.slow
def test_gear_pair_adds_the_inertia_of_the_other_shaft():
    mechanism = jn.Mechanism(
        space="planar",
        bodies={"one": jn.Body(ZERO, mass=1.0, inertia=0.2), "two": jn.Body([3, 0], mass=1.0, inertia=0.7)},
        joints={
            "A": planar.Revolute(("ground", "one"), ZERO, ZERO),
            "B": planar.Revolute(("ground", "two"), [3.0, 0.0], ZERO),
            "mesh": planar.Coordinate(("one", "two"), "angle", ratio=-0.5),
        },
        drivers={"turn": drivers.CoordinateDriver(("ground", "one"), "angle", TIME_OF_LAW)},
    )
    motion = jn.solve(mechanism, TIME, order=4)
    angle = rates(law, TIME, 5)
    np.testing.assert_allclose(jn.driver_force(motion, "turn"), (0.2 + 0.25 * 0.7) * angle[:, 2:], rtol=1e-12)
    mesh = jn.joint_reaction(motion, "mesh")
    np.testing.assert_allclose(mesh.torque, -0.5 * 0.7 * angle[:, 2:], rtol=1e-12)
    assert np.abs(mesh.force).max() <= 1e-13
    shaft = jn.joint_reaction(motion, "mesh", "one")
    np.testing.assert_allclose(shaft.torque, -0.25 * 0.7 * angle[:, 2:], rtol=1e-12)


@pytest.mark.slow
def test_rolling_disc_needs_friction_for_its_spin():
    # a disc of 3 kg, 0.5 kg m^2 and radius 0.4 on the x axis, pushed at its centre
    bodies = ("ground", "disc")
    mechanism = jn.Mechanism(
        space="planar",
        gravity=[0.0, -9.81],
        bodies={"disc": jn.Body([0.0, 0.4], mass=3.0, inertia=0.5)},
        joints={
            "line": planar.Parallel2(bodies, [0.0, 0.4], ZERO, X),
            "roll": planar.Rolling(bodies, [0.0, 0.4], ZERO, [-1.0, 0.0], 0.4),
        },
        drivers={"push": drivers.SlideDriver(bodies, [0.0, 0.4], ZERO, X, TIME_OF_LAW)},
    )
    motion = jn.solve(mechanism, TIME, order=4)
    x = rates(law, TIME, 5)
    np.testing.assert_allclose(jn.driver_force(motion, "push"), (3.0 + 0.5 / 0.16) * x[:, 2:], rtol=1e-12)
    roll = jn.joint_reaction(motion, "roll", point=[0.0, 0.0])
    np.testing.assert_allclose(roll.force[..., 0], -0.5 / 0.16 * x[:, 2:], rtol=1e-12)
    weight = jn.joint_reaction(motion, "line").force[..., 1]
    np.testing.assert_allclose(weight, np.array([[3.0 * 9.81, 0.0, 0.0]] * len(TIME)), atol=1e-11)


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
def test_a_body_at_rest_gives_its_weight_and_no_rates():
    mechanism = massed(small.crank("0.7"))
    motion = jn.solve(mechanism, TIME, order=4)
    body = mechanism.bodies["crank"]
    weight = -body.mass * np.array(mechanism.gravity)
    force = jn.joint_reaction(motion, "O").force
    np.testing.assert_allclose(force[:, 0], np.tile(weight, (len(TIME), 1)), rtol=1e-13)
    assert np.abs(force[:, 1:]).max() == 0


@pytest.mark.parametrize(
    "name", ["slider_crank", *[pytest.param(n, marks=pytest.mark.slow) for n in ("screw_press", "rccc", "rsur")]]
)
def test_a_joint_does_to_one_body_the_opposite_of_what_it_does_to_the_other(name):
    mechanism = massed_example(name)
    motion = jn.solve(mechanism, TIME, order=4)
    for joint, element in mechanism.joints.items():
        one, two = element.bodies
        first, second = (
            jn.joint_reaction(motion, joint, body, point=[0.0] * len(mechanism.gravity)) for body in (one, two)
        )
        size = max(float(np.abs(first.force).max()), float(np.abs(first.torque).max()))
        np.testing.assert_allclose(first.force, -second.force, atol=1e-12 * size)
        zero = [0.0] * len(mechanism.gravity)
        lever = jn.Jet.from_derivatives(
            np.swapaxes((position(motion, two, zero) - position(motion, one, zero)), 0, 1)[:3]
        )
        about = [np.moveaxis(jet, -1, 1) for jet in (lever.derivatives(), np.swapaxes(second.force.values, 0, 1))]
        arm_, force = (jn.Jet.from_derivatives(part) for part in about)
        moment = np.asarray(arm_.cross(force).derivatives())  # (derivative, component, time) or (derivative, time)
        moment = np.moveaxis(moment, -1, 0)
        np.testing.assert_allclose(first.torque, -second.torque - moment, atol=1e-11 * size)


def position(motion, body, point):
    """Position of a point of a body that may be the ground, (time, derivative, component)."""
    if body != "ground":
        return motion.point(body, point).values
    return np.zeros((len(TIME), 5, len(point)))


def test_frames_and_points_of_a_reaction_agree():
    motion = jn.solve(massed_example("slider_crank"), TIME, order=4)
    angle = motion.angle("rod").values[:, 0]
    turn = np.stack([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])  # global to rod
    plain, own = jn.joint_reaction(motion, "B"), jn.joint_reaction(motion, "B", frame="body")
    np.testing.assert_allclose(own.force[:, 0], np.einsum("ijt,tj->ti", turn, plain.force[:, 0]), rtol=1e-12)
    named = jn.joint_reaction(motion, "B", frame="rod")
    np.testing.assert_array_equal(named.force, own.force)
    moved = jn.joint_reaction(motion, "B", point=[0.3, -0.1])
    lever = (motion.point("rod", [0.0, 0.0]) - motion.point("rod", [0.3, -0.1])).values[:, 0]
    shifted = (
        plain.torque[:, 0]
        + np.cross(np.pad(lever, ((0, 0), (0, 1))), np.pad(plain.force[:, 0], ((0, 0), (0, 1))))[:, 2]
    )
    np.testing.assert_allclose(moved.torque[:, 0], shifted, atol=1e-12)


def test_free_motion_has_the_reactions_of_the_driven_one():
    # the law's own torque, in closed form, on a pendulum that nothing drives: the same motion, so the same pin forces
    body = {"mass": 2.0, "inertia": 0.3, "center_of_mass": [0.5, 0.0]}
    driven = jn.solve(arm(**body), TIME, order=4)
    torque = f"-0.8*3.6*sin(3*t) + 9.81*cos({TIME_OF_LAW})"
    free = dataclasses.replace(arm(**body), drivers={}, forces={"motor": jn.forces.Torque(("ground", "arm"), torque)})
    status = np.zeros(len(TIME), int)
    motion = Motion(free, build(free), TIME, 4, (driven.poses[1], ()), status, {})
    for frame in ("global", "body"):
        expected, found = (jn.joint_reaction(m, "pin", frame=frame).force for m in (driven, motion))
        np.testing.assert_allclose(found, expected, atol=1e-11)
    balance = jn.power_balance(motion)
    assert (np.abs(balance["residual"]) <= 1e-12 * balance["scale"].max()).all()


def test_springs_are_balanced_by_the_driver():
    mechanism = dataclasses.replace(
        arm(),
        forces={"spring": jn.forces.TorsionalSpring(("ground", "arm"), stiffness=3.0, angle=0.1, damping=0.5)},
    )
    motion = jn.solve(mechanism, TIME, order=4)
    angle = rates(law, TIME, 5)
    expected = 3.0 * (angle - [0.1, 0, 0, 0, 0])[:, :3] + 0.5 * angle[:, 1:4]
    np.testing.assert_allclose(jn.driver_force(motion, "turn"), expected, rtol=1e-12)
    np.testing.assert_allclose(jn.applied_force(motion, "spring"), -expected, rtol=1e-12)
    assert jn.applied_force(motion, "spring").attrs["units"] == "N*m"


@pytest.mark.slow
def test_long_motions_in_chunks_agree_with_short_ones():
    mechanism = arm(mass=2.0, inertia=0.3)
    long = jn.driver_force(jn.solve(mechanism, np.linspace(0.0, 1.0, 1101), order=2), "turn")
    short = jn.driver_force(jn.solve(mechanism, np.linspace(0.0, 1.0, 1101)[::100], order=2), "turn")
    np.testing.assert_allclose(long[::100], short, rtol=1e-10)


def test_outputs_are_the_functions_with_as_many_derivatives_as_the_motion():
    mechanism = massed_example("slider_crank")
    outputs = {
        "T": jn.DriverTorqueOutput("theta"),
        "B": jn.JointForceOutput("B", "crank"),
        "M": jn.JointTorqueOutput("guide", point=["r", 0.0]),
        "x": jn.PointOutput("slider", [0.0, 0.0]),
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
    assert np.isnan(jn.power_balance(motion)["residual"][2]).all()


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
        (lambda m: jn.applied_force(m, "spring"), "force", "no force has this name, got 'spring'; none is defined"),
        (
            lambda m: m.evaluate(jn.DriverForceOutput("turn")),
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
        jn.power_balance(motion)
    with pytest.raises(MechanismError, match=r"outputs\.T\.driver: forces need masses"):
        dataclasses.replace(arm(), outputs={"T": jn.DriverTorqueOutput("turn")})


@pytest.mark.slow
def test_reactions_of_a_chain_against_recursive_newton_euler():
    rod = jn.Inertia(1.3, center_of_mass=[0.4, 0.05, -0.1], tensor=[0.02, 0.11, 0.12])
    links = [jn.Link("base"), jn.Link("a", rod), jn.Link("b", rod), jn.Link("c", rod)]
    joints = [
        jn.Joint("A", "base", "a", axis=[0.0, 1.0, 2.0], position=[0.1, 0.0, 0.2]),
        jn.Joint("B", "a", "b", axis=[1.0, 0.0, 0.3], position=[0.5, 0.1, 0.0]),
        jn.Joint("C", "b", "c", axis=[0.0, 1.0, 0.0], position=[0.3, 0.0, 0.1]),
    ]
    robot = jn.Robot("chain", links, joints)
    laws = {"A": "0.4*sin(2*t)", "B": "0.3 + 0.5*t", "C": "cos(1.5*t)"}
    motion = jn.solve(robot.mechanism(drivers=laws), TIME, order=5)
    q = np.stack([motion.outputs[name] for name in "ABC"], axis=-1)
    for frame, axes in (("body", "link"), ("global", "base")):
        expected = jn.joint_wrenches(robot, q, frame=axes)
        for k, (name, link) in enumerate(zip("ABC", "abc", strict=True)):
            parts = [jn.joint_reaction(motion, j, link, frame, [0.0, 0.0, 0.0]) for j in (name, f"{name}_drive")]
            force = sum(part.force.values for part in parts)
            torque = sum(part.torque.values for part in parts)
            found = np.concatenate([force, torque], axis=-1)[:, : expected.shape[1]]
            sizes = np.abs(expected[:, :, k]).max(axis=(0, 2))
            error = np.abs(found - expected[:, : found.shape[1], k]).max(axis=(0, 2)) / sizes[: found.shape[1]]
            assert (error <= 1e-13).all(), (name, frame, error)


def test_a_force_that_is_not_finite_is_named_with_its_time():
    law = "2/(t - 0.6)"
    mechanism = dataclasses.replace(arm(mass=2.0), forces={"brake": jn.forces.Torque(("ground", "arm"), law)})
    motion = jn.solve(mechanism, TIME, order=4)
    with pytest.raises(MechanismError, match=r"forces\.brake: has no finite value at t = 0\.6 s; check its law"):
        jn.driver_force(motion, "turn")


@pytest.mark.slow
def test_reactions_in_a_simulation():
    # a double pendulum: what holds the lower mass is m (a - g), with rates, from derivatives of its place alone
    mechanism = jn.load(example("double_pendulum"))
    simulation = jn.simulate(mechanism, np.linspace(0.0, 1.0, 5), order=3)
    tip = simulation.point("lower", mechanism.bodies["lower"].center_of_mass).values
    expected = tip[:, 2:].copy()
    expected[:, 0] += [0.0, 9.81]
    force = jn.joint_reaction(simulation, "B").force.values[:, : expected.shape[1]]
    np.testing.assert_allclose(force, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    balance = jn.power_balance(simulation)
    assert (np.abs(balance["residual"]) <= 1e-12 * balance["scale"].max("time")).all()
