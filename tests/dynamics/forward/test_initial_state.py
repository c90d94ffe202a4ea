"""Where a simulation starts: consistent states from partial conditions, mobility in words, and what is refused."""

import dataclasses
import sys

import jax
import numpy as np
import pytest

import jounce as jn
from jounce import drivers, forces, planar
from jounce.dynamics.forward import initial_state as start
from jounce.dynamics.forward.initial_state import consistent_start
from tests.problems.dynamics import simple_pendulum


def turn(body, law, of="ground"):
    return drivers.CoordinateDriver((of, body), "angle", law)


def with_initial(**initial):
    return dataclasses.replace(simple_pendulum(0.3, 1.0), initial=initial)


def test_a_condition_fixes_the_position_and_the_rate():
    state = consistent_start(simple_pendulum(0.3, 1.5), 0.0)
    assert state.state.attitude[0, 0, 0] == pytest.approx(0.3, abs=1e-14)
    assert state.state.spin[0, 0, 0] == pytest.approx(1.5, abs=1e-14)
    assert np.allclose(state.state.velocity, 0.0, atol=1e-14)
    assert state.mobility == "1 degree of freedom: bob"


def test_without_a_condition_the_guess_is_kept_and_the_body_rests():
    state = consistent_start(with_initial(), 0.0).state
    assert state.attitude[0, 0, 0] == pytest.approx(0.3, abs=1e-14)
    assert np.allclose([*state.spin.ravel(), *state.velocity.ravel()], 0.0, atol=1e-14)


def test_masses_are_those_of_now_where_the_model_is_stored():
    """Values that change between calls, and in place, are read; nobody writes to masses that are kept."""
    center = np.array([0.5, 0.0])
    rod = jn.Body([0, 0], mass="m", inertia=0.1, center_of_mass=center)
    mechanism = jn.Mechanism(
        space="planar",
        bodies={"rod": rod},
        joints={"O": planar.Revolute(("ground", "rod"), [0, 0], [0, 0])},
        parameters={"m": 1.0},
    )
    object.__setattr__(rod, "center_of_mass", center)  # the array itself
    given = [(1.0, 0.5), (1.0, 0.5), (1.0, 0.5), (2.0, 0.5), (1.0, 0.5), (1.0, 0.7), (1.0, 0.5), (2.0, 0.7)]
    for mass, at in given * 2:
        center[0] = at
        masses = consistent_start(dataclasses.replace(mechanism, parameters={"m": mass}), 0.0).equations.masses
        assert (masses.mass[1, 0], masses.center[0, 1, 0]) == (mass, at)
        assert not any(part.flags.writeable or np.shares_memory(part, center) for part in masses)


STARTS = ["simple_pendulum", "double_pendulum", "andrews", "sprung_four_bar", "flyball_governor"]
SLOW = [pytest.param(name, marks=pytest.mark.slow) for name in (*STARTS[2:], "spatial_slider_crank_free")]


@pytest.mark.parametrize("name", [*STARTS[:2], *SLOW])
def test_where_conditions_let_go_the_rest_is_together(name, monkeypatch):
    mechanism = jn.load(f"examples/{name}.yaml")
    used, let_go = [], start._without_initial_conditions
    monkeypatch.setattr(start, "_without_initial_conditions", lambda *given: used.append(let_go(*given)) or used[-1])
    found = consistent_start(mechanism, 0.0)
    monkeypatch.setattr(start, "_without_initial_conditions", lambda *_: None)
    assembled = consistent_start(mechanism, 0.0)
    assert all(model is not None for model in used)
    assert len(used) == bool(mechanism.initial)
    assert found.model.rows == assembled.model.rows
    assert found.mobility == assembled.mobility
    for (path, mine), theirs in zip(
        jax.tree.leaves_with_path((found.equations, found.state, found.model.guess, found.model.reference)),
        jax.tree.leaves((assembled.equations, assembled.state, assembled.model.guess, assembled.model.reference)),
        strict=True,
    ):
        np.testing.assert_allclose(mine, theirs, rtol=1e-12, atol=1e-12, err_msg=jax.tree_util.keystr(path))


FAR = "sqrt((50 - cos(0.3))**2 + sin(0.3)**2)"
UNLIKE = {
    "the same twice": {"start": turn("bob", "0.3"), "again": turn("bob", "0.3")},
    "another size": {"start": drivers.DistanceDriver(("ground", "bob"), [50, 0], [1, 0], FAR)},
}


@pytest.mark.parametrize("unlike", UNLIKE)
def test_the_rest_is_assembled_where_conditions_repeat_each_other_or_give_the_size(unlike, monkeypatch):
    used, let_go = [], start._without_initial_conditions
    monkeypatch.setattr(start, "_without_initial_conditions", lambda *given: used.append(let_go(*given)) or used[-1])
    found = consistent_start(with_initial(**UNLIKE[unlike]), 0.0).state
    assert used == [None]
    assert found.attitude[0, 0, 0] == pytest.approx(0.3, abs=1e-10)
    assert np.allclose([*found.spin.ravel(), *found.velocity.ravel()], 0.0, atol=1e-12)


@pytest.mark.slow
def test_velocities_left_open_are_those_of_least_kinetic_energy():
    # a double rod: only the tip's vertical speed is told; minimize 1/2 v^T M v by hand over the two rates
    rods = jn.Mechanism(
        space="planar",
        bodies={
            "upper": jn.Body([0, 0], mass=2.0, inertia=0.5, center_of_mass=[0.5, 0]),
            "lower": jn.Body([1, 0], mass=1.0, inertia=0.2, center_of_mass=[0.5, 0]),
        },
        joints={
            "A": planar.Revolute(("ground", "upper"), [0, 0], [0, 0]),
            "B": planar.Revolute(("upper", "lower"), [1, 0], [0, 0]),
        },
        initial={"lift": drivers.SlideDriver(("ground", "lower"), [0, 0], [1, 0], [0, 1], "3*t")},
    )
    spin = consistent_start(rods, 0.0).state.spin[0, :, 0]
    mass = np.array([[0.5 + 2 * 0.25 + 1.0, 0.5], [0.5, 0.2 + 0.25]])
    expected = np.linalg.solve(mass, [1.0, 1.0])
    assert np.allclose(spin, 3.0 * expected / expected.sum(), rtol=1e-13)


def two_rods(**initial):
    rods = {
        "upper": jn.Body([0, 0], angle=0.3, mass=2.0, inertia=0.5),
        "lower": jn.Body([1, 0.3], angle=-0.4, mass=1.0, inertia=0.2),
    }
    joints = {
        "A": planar.Revolute(("ground", "upper"), [0, 0], [0, 0]),
        "B": planar.Revolute(("upper", "lower"), [1, 0], [0, 0]),
    }
    return jn.Mechanism(space="planar", bodies=rods, joints=joints, initial=initial)


def reach(law):
    return drivers.DistanceDriver(("ground", "lower"), [0, 0], [0.8, 0], law)


@pytest.mark.slow
def test_a_speed_in_the_limit_of_a_reach_is_refused():
    """The tip is 1.8 m away, as far as it goes; rounding hides that no joint can move it on, at 1e7 rad/s or more."""
    words = "dead point.*only 4 equations are independent and lower, upper can move"
    refused(jn.errors.MobilityError, words, two_rods(r=reach("1.8 + 0.3*t")))
    refused(jn.errors.MobilityError, words, two_rods(r=reach("1.8 - 0.3*t")))
    refused(jn.errors.MobilityError, words, two_rods(r=reach("1.8")))
    near = consistent_start(two_rods(r=reach("1.8 - 1e-8 - 0.3*t")), 0.0).state
    bend = np.sqrt(2e-8 * 1.8 / 0.8)  # 1.8^2 - r^2 = 2 * 0.8 (1 - cos bend)
    expected = 0.3 * 1.8 / (0.8 * np.sin(bend))
    assert abs(near.spin[0, 1, 0] - near.spin[0, 0, 0]) == pytest.approx(expected, rel=1e-6)


def refused(kind, words, mechanism):
    with pytest.raises(kind, match=words):
        consistent_start(mechanism, 0.0)


def body(**changes):
    mechanism = simple_pendulum(0.3, 1.0)
    return dataclasses.replace(mechanism, bodies={"bob": dataclasses.replace(mechanism.bodies["bob"], **changes)})


@pytest.mark.parametrize(
    "gravity", [np.array([0.0, -9.81 + 1j]), [0.0, -9.81 + 1j], [0.0, np.nan], [0.0, 0.0, -9.81], -9.81]
)
def test_gravity_is_a_vector_of_the_space(gravity):
    mechanism = dataclasses.replace(simple_pendulum(0.3, 1.0), gravity=gravity)
    refused(jn.errors.MechanismError, "gravity: must be (a vector of 2 numbers|finite)", mechanism)


def test_a_parameter_is_a_real_number():
    mechanism = dataclasses.replace(simple_pendulum(0.3, 1.0), parameters={"a": np.complex128(1 + 1j)})
    refused(jn.errors.MechanismError, "parameters.a: a parameter must be one finite number, got", mechanism)


def test_masses_that_determine_no_motion():
    refused(jn.errors.MechanismError, "bodies: no body has a mass; the equations", body(mass=None))
    refused(
        jn.errors.MechanismError, "bodies.bob.inertia: the body can move but has no inertia", body(center_of_mass=None)
    )


def test_a_massless_body_that_can_move_is_named():
    mechanism = body()
    bodies = {**mechanism.bodies, "dust": jn.Body([0, 0])}
    pin = planar.Revolute(("ground", "dust"), [0, 0], [0, 0])
    loose = dataclasses.replace(mechanism, bodies=bodies, joints={**mechanism.joints, "pin": pin})
    refused(jn.errors.MechanismError, "bodies.dust.(mass|inertia): the body can move but has no", loose)


def machine(mass, inertia, size=1.0):
    """Return a heavy pendulum and, on its own pivot, a disc on a torsional spring of 10 rad/s."""
    return jn.Mechanism(
        space="planar",
        gravity=[0, -9.81 * size],
        bodies={
            "heavy": jn.Body([0, 0], angle=0.3, mass=mass, inertia=mass * size**2, center_of_mass=[size, 0]),
            "disc": jn.Body([2 * size, 0], mass=1e4 * inertia, inertia=inertia),
        },
        joints={
            "O": planar.Revolute(("ground", "heavy"), [0, 0], [0, 0]),
            "P": planar.Revolute(("ground", "disc"), [2 * size, 0], [0, 0]),
        },
        forces={"spring": forces.TorsionalSpring(("ground", "disc"), stiffness=100 * inertia, angle=1.0)},
        outputs={"disc": jn.outputs.AngleOutput("disc")},
    )


@pytest.mark.slow
@pytest.mark.parametrize("given", [(2e4, 1e-8), (2e10, 1e-10), (1.0, 1.0, 1e-6), (1.0, 1.0, 1e6)])
def test_a_small_inertia_beside_large_ones_is_not_none(given):
    found = jn.simulate(machine(*given), [0.0, 1.0], order=3).outputs["disc"][-1]
    exact = [1 - np.cos(10), 10 * np.sin(10), 100 * np.cos(10), -1000 * np.sin(10)]
    assert found == pytest.approx(exact, rel=1e-13)


@pytest.mark.slow
def test_a_wheel_of_which_only_the_inertia_is_known_turns():
    wheel = jn.Mechanism(
        space="planar",
        bodies={"wheel": jn.Body([0, 0], mass=0.0, inertia="J")},
        joints={"O": planar.Revolute(("ground", "wheel"), [0, 0], [0, 0])},
        forces={"motor": forces.Torque(("ground", "wheel"), "0.3*t")},
        outputs={"turn": jn.outputs.AngleOutput("wheel")},
        parameters={"J": 0.1},
    )
    exact = [4.0, 6.0, 6.0, 3.0]  # 0.3 t^3 / (6 J) at 2 s
    runs = jn.simulate_batch(wheel, {"J": [0.05, 0.1]}, [0.0, 2.0], order=3).outputs["turn"][:, -1]
    assert runs == pytest.approx(np.outer([2, 1], exact), rel=1e-14)
    refused(
        jn.errors.MechanismError,
        "bodies.wheel.mass: the body can move but has no",
        dataclasses.replace(wheel, joints={}),
    )


def turning(moments):
    """Return a body that turns about its own x axis."""
    inertia = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=moments, strict=False)
    links, pin = [jn.Link("base"), jn.Link("x", inertia)], jn.Joint("pin", "base", "x", axis=[1, 0, 0])
    return jn.Robot("axle", links, [pin]).mechanism()


def test_a_body_that_can_move_with_negative_kinetic_energy_is_named():
    refused(
        jn.errors.MechanismError, r"bodies\.x\.inertia: .* kinetic energy is negative", turning([-0.01, 0.02, 0.02])
    )
    assert consistent_start(turning([0.01, 0.02, 0.05]), 0.0).mobility  # no real body, but its motion is determined


@pytest.mark.slow
def test_a_massless_link_at_the_end_of_a_robot_has_to_be_driven_in_a_simulation():
    inertia = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0.01, 0.02, 0.02])
    links = [jn.Link("base"), jn.Link("arm", inertia), jn.Link("tip")]
    joints = [jn.Joint("b", "base", "arm", axis=[0, 1, 0]), jn.Joint("c", "arm", "tip", position=[0.5, 0, 0])]
    robot = jn.Robot("end", links, joints, strict=False)
    refused(jn.errors.MechanismError, r"bodies\.tip\.mass: the body can move but has no mass", robot.mechanism())
    assert consistent_start(robot.mechanism(drivers={"c": 0.3}), 0.0).mobility.startswith("1 degree of freedom")


def test_conditions_that_contradict_each_other_or_the_joints():
    refused(
        jn.errors.AssemblyError, "initial.a, initial.b stay open", with_initial(a=turn("bob", 0.3), b=turn("bob", 1.0))
    )
    shifted = drivers.CoordinateDriver(("ground", "bob"), "x", 1.0)
    refused(jn.errors.AssemblyError, "joints, drivers and initial conditions contradict", with_initial(a=shifted))


@pytest.mark.slow
def test_conditions_drivers_and_joints_that_say_the_same_twice_must_agree():
    begun = jn.simulate(with_initial(a=turn("bob", 0.3), b=turn("bob", "0.3")), [0.0], order=1)
    assert begun.mobility.startswith("1 degree of freedom")
    driven = dataclasses.replace(simple_pendulum(0.3, 1.0), drivers={"a": turn("bob", 0.3)})
    refused(jn.errors.AssemblyError, "redundant constraints contradict each other in their rates", driven)
    both = dataclasses.replace(driven, drivers={"a": turn("bob", 0.3), "b": turn("bob", 0.3)}, initial={})
    assert jn.simulate(both, [0.0], order=1).mobility.startswith("no degree of freedom")


def test_a_joint_is_no_initial_condition():
    with pytest.raises(jn.errors.MechanismError, match=r"initial\.pin: .*driver"):
        with_initial(pin=planar.Revolute(("ground", "bob"), [0, 0], [0, 0]))


@pytest.mark.parametrize(
    "keywords, words",
    [
        ({"tolerance": 0.0}, "tolerance: the tolerance must be a number from 1e-17 to 0.01, got 0"),
        ({"tolerance": np.nan}, "tolerance"),
        ({"longest_step": 0.0}, "longest_step: must be greater than zero"),
        ({"order": 31}, "order: the order of derivatives"),
        ({"time": [0.0, 0.0]}, r"time\[1\]: instants must increase strictly"),
        ({"time": [0.0, np.nan]}, r"time\[1\]: instants must be finite"),
        ({"time": [0.0, "1 s"]}, "time: must be real numbers"),
        ({"time": np.array([0.0, 1.0 + 1j])}, "time: must be real numbers"),
        ({"time": []}, "at least one instant"),
        ({"time": None}, "no time grid is given"),
    ],
)
def test_options_are_checked_before_any_computing(keywords, words, monkeypatch):
    monkeypatch.setattr(sys.modules[jn.simulate.__module__], "consistent_start", None)
    with pytest.raises(jn.errors.MechanismError, match=words):
        jn.simulate(simple_pendulum(), **{"time": [0.0, 1.0], **keywords})


@pytest.mark.slow
def test_gears_of_a_high_ratio_start_at_the_given_rates():
    pin, ratio = jn.planar.Revolute, 1e7
    mechanism = jn.Mechanism(
        space="planar",
        bodies={"a": jn.Body([0, 0], mass=1, inertia=1), "b": jn.Body([1, 0], mass=1, inertia=1)},
        joints={
            "A": pin(("ground", "a"), [0, 0], [0, 0]),
            "B": pin(("ground", "b"), [1, 0], [0, 0]),
            "gears": jn.planar.Gear(("a", "b", "ground"), ratio),
        },
        initial={"a": jn.drivers.CoordinateDriver(("ground", "a"), "angle", "2*t")},
    )
    spin = consistent_start(mechanism, 0.0).state.spin[0, :, 0]
    assert spin == pytest.approx([2.0, 2.0 * ratio], rel=1e-11)
