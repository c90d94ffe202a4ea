"""Whole turns follow from the guess and the laws of the drivers, not from the path of assembly or the grid."""

import dataclasses

import numpy as np
import pytest

import jounce as jn
from jounce import drivers, forces, planar, spatial
from jounce.dynamics import AppliedTorqueOutput, DriverTorqueOutput
from jounce.kinematics.assembly.assemble import assemble
from jounce.mechanism import build
from tests.problems.small import four_bar, law, spindle

X, Z, ORIGIN = [1, 0, 0], [0, 0, 1], [0, 0, 0]


def shafts(law):
    """Two collinear shafts with two Hooke joints between them, which agree after each turn."""
    slope = 0.3
    return jn.Mechanism(
        space="spatial",
        bodies={
            "first": jn.Body(ORIGIN),
            "second": jn.Body(ORIGIN, orientation=[np.cos(slope / 2), 0, 0, np.sin(slope / 2)]),
        },
        joints={
            "bearing": spatial.Revolute(("ground", "first"), ORIGIN, ORIGIN, X, X),
            "cross": spatial.Universal(("first", "second"), ORIGIN, ORIGIN, [0, 1, 0], Z),
            "level": spatial.Dot1(("ground", "second"), Z, X),
            "slope": spatial.Dot1(("ground", "second"), [-np.sin(slope), np.cos(slope), 0], X),
        },
        drivers={"turn": drivers.RotationDriver(("ground", "first"), X, law)},
        outputs={
            "first": jn.outputs.RelativeAngleOutput(("ground", "first"), X),
            "back": jn.outputs.RelativeAngleOutput(("first", "ground"), [-2, 0, 0], [0, 1, 0], [0, 1, 0.2]),
            "second": jn.outputs.RelativeAngleOutput(
                ("ground", "second"), [np.cos(slope), np.sin(slope), 0], [-np.sin(slope), np.cos(slope), 0], [0, 1, 0]
            ),
        },
    )


@pytest.mark.slow
@pytest.mark.parametrize("turn, rate", [(7.5, 1.0), (0.0, 1.0), (-100.0, 1.0), (4.0, -1.0)])
def test_angles_about_axes_have_the_turns_of_the_law(turn, rate):
    mechanism = shafts(law(turn, rate))
    whole = jn.solve(mechanism, [0.0, 5.0, 10.0], order=1).outputs
    last = jn.solve(mechanism, [10.0], order=1).outputs
    expected = turn + rate * np.array([0.0, 5.0, 10.0])
    np.testing.assert_allclose(whole["first"][:, 0], expected, rtol=0, atol=1e-12)
    # -x is the axis, and the ground turns back about it; the last vector is 0.2 rad, by its tangent, ahead
    np.testing.assert_allclose(whole["back"][:, 0], expected - np.arctan(0.2), rtol=0, atol=1e-12)
    # Hooke's joint: tan(second) cos(slope) = tan(first), within a quarter of a turn of it
    assert np.abs(whole["second"][:, 0] - expected).max() < 0.1
    for name in whole:
        np.testing.assert_allclose(last[name][0], whole[name][-1], rtol=0, atol=1e-12)


@pytest.mark.slow
def test_half_a_turn_is_pi_whatever_its_last_digit_says():
    for sign in (1, -1):
        mechanism = spindle(law(np.pi))
        body = dataclasses.replace(mechanism.bodies["spindle"], orientation=[sign * 1e-17, 0, 0, 1])
        mechanism = dataclasses.replace(mechanism, bodies={"spindle": body})
        found = jn.solve(mechanism, [0.0], order=0).outputs
        assert found["angle"][0, 0] == pytest.approx(np.pi, abs=1e-12)


def assembled_angles(mechanism, instant=0.0):
    """Return the angles of the moving bodies of a planar mechanism at its assembled position."""
    return assemble(build(mechanism), instant, 1e-12)[1]["angle"][1:, 0]


@pytest.mark.slow
def test_planar_bodies_end_at_the_turn_nearest_to_the_guess():
    """From random guesses of the rocker and of a massless link on it; the torsional spring is on the link."""
    base = four_bar()
    random = np.random.default_rng(4)
    kept = []
    for _ in range(200):
        guess = random.uniform(-12, 12)
        mechanism = dataclasses.replace(base, bodies=base.bodies | {"rocker": jn.Body(["AD", 0], float(guess))})
        try:
            angle = assembled_angles(mechanism)[1]
        except jn.errors.AssemblyError:
            continue
        kept.append(abs(angle - guess))
    assert len(kept) > 150
    assert max(kept) <= np.pi + 1e-12


@pytest.mark.slow
def test_a_torsional_spring_sees_the_angle_that_the_guess_says():
    torques = []
    for turns in (-1, 0, 1):
        base = four_bar(rocker_angle=f"{100 + 360 * turns}*deg")
        spring = forces.TorsionalSpring(("ground", "rocker"), 2.0, f"{360 * turns}*deg")
        output = {"torque": AppliedTorqueOutput("spring")}
        mechanism = dataclasses.replace(base, forces={"spring": spring}, outputs=output)
        torques.append(jn.solve(mechanism, [0.0], order=0).outputs["torque"][0, 0])
    np.testing.assert_allclose(torques, torques[1], rtol=0, atol=1e-12)


def drag_link(law, gear=False):
    """Two cranks that make full turns together, a coupler, and a wheel geared to the second crank."""
    joints = {
        "A": planar.Revolute(("ground", "first"), [0, 0], [0, 0]),
        "D": planar.Revolute(("ground", "second"), [0.5, 0], [0, 0]),
        "B": planar.Revolute(("first", "coupler"), [1, 0], [0, 0]),
        "C": planar.Revolute(("coupler", "second"), [0.9, 0], [1.1, 0]),
    }
    bodies = {"first": jn.Body([0, 0], 0.5), "coupler": jn.Body([0.9, 0.5], 2.4), "second": jn.Body([0.5, 0], 1.8)}
    if gear:
        joints["wheel"] = planar.Revolute(("ground", "wheel"), [3, 0], [0, 0])
        joints["pair"] = planar.Coordinate(("second", "wheel"), "angle", -2.0)
        bodies["wheel"] = jn.Body([3, 0], 0.2)
    return jn.Mechanism(
        space="planar",
        bodies=bodies,
        joints=joints,
        drivers={"turn": drivers.CoordinateDriver(("ground", "first"), "angle", law)},
        outputs={name: jn.outputs.AngleOutput(name) for name in bodies},
    )


@pytest.mark.slow
@pytest.mark.parametrize("law, start", [("0.5 + t", 0.5), ("7.5 + t", 7.5), ("-200.3 + t", -200.3)])
def test_planar_bodies_turn_with_the_driver(law, start):
    mechanism = drag_link(law, gear=True)
    for instant in (0.0, 5.0, 10.0):
        first, coupler, second, wheel = assembled_angles(mechanism, instant)
        assert first == pytest.approx(start + instant, abs=1e-12)
        assert abs(coupler - first - 1.9) < np.pi / 2  # the coupler leads by up to a quarter of a turn more or less
        assert abs(second - first - 1.3) < np.pi / 2
        assert wheel - 0.2 == pytest.approx(-2 * (second - 1.8), abs=1e-11)


def test_bodies_that_a_gear_couples_go_back_by_whole_turns_together():
    """The shortest way to close the loop turns the crank beyond half a turn; crank and wheel are shifted together."""
    mechanism = drag_link("0.5 + t", gear=True)
    wheel = dataclasses.replace(mechanism.joints["pair"], offset=3.8)
    mechanism = dataclasses.replace(mechanism, joints=mechanism.joints | {"pair": wheel})
    for turns in (-2, 1):
        bodies = {
            "second": jn.Body([0.5, 0], 1.8 + 2 * np.pi * turns),
            "wheel": jn.Body([3, 0], 0.2 - 4 * np.pi * turns),
        }
        found = assembled_angles(dataclasses.replace(mechanism, bodies=mechanism.bodies | bodies))
        assert abs(found[2] - bodies["second"].angle) < np.pi
        assert found[3] == pytest.approx(3.8 - 2 * found[2], abs=1e-11)


GRIDS = [[0, 5, 10], np.linspace(0, 10, 41), [10]]
LAWS = {"from within half a turn": (0.5, 1.0), "from the second turn": (7.5, 1.0), "back": (-7.5, -3.0)}
SPRING = {"stiffness": 2.0, "angle": 0.3, "damping": 0.1}


def wound(start, rate, space="spatial"):
    """A driven rotor on a torsional spring, in space or in the plane, and one that turns twice as fast backward."""
    motions = {"first": law(start, rate, wave=0.4), "second": law(0.2, -2 * rate, wave=0.1)}
    pairs = {"first": ("ground", "first"), "second": ("ground", "second"), "between": ("first", "second")}
    inertia = {"mass": 1.0, "inertia": 0.7 if space == "planar" else [0.7, 0.7, 0.7]}
    if space == "planar":
        bodies = {name: jn.Body([0, 0], **inertia) for name in motions}
        joints = {name: planar.Revolute(pairs[name], [0, 0], [0, 0]) for name in motions}
        motors = {f"motor_{k}": drivers.CoordinateDriver(pairs[k], "angle", motion) for k, motion in motions.items()}
        springs = {name: forces.TorsionalSpring(pair, **SPRING) for name, pair in pairs.items()}
    else:
        bodies = {name: jn.Body(ORIGIN, **inertia) for name in motions}
        joints = {name: spatial.Revolute(pairs[name], ORIGIN, ORIGIN, Z, Z) for name in motions}
        motors = {f"motor_{k}": drivers.RotationDriver(pairs[k], Z, motion) for k, motion in motions.items()}
        springs = {name: forces.SpatialTorsionalSpring(pair, Z, **SPRING) for name, pair in pairs.items()}
    outputs = {f"{name}_spring": AppliedTorqueOutput(name) for name in pairs}
    outputs |= {f"{name}_motor": DriverTorqueOutput(f"motor_{name}") for name in motions}
    return jn.Mechanism(space=space, bodies=bodies, joints=joints, drivers=motors, forces=springs, outputs=outputs)


def angles_of_law(start, rate, wave, time):
    """The law of `wound` and its derivatives to the second, (time, derivative)."""
    k = np.arange(3)
    even = np.stack([start + rate * time, 0 * time + rate, 0 * time], axis=-1)
    return even + wave * np.pi**k * np.sin(np.pi * time[:, None] + k * np.pi / 2)


@pytest.mark.slow
def test_springs_in_space_count_turns_on_any_grid_as_in_the_plane():
    for start, rate in LAWS.values():
        count_turns_on_any_grid_as_in_the_plane(start, rate)


def count_turns_on_any_grid_as_in_the_plane(start, rate):
    plane = jn.solve(wound(start, rate, "planar"), GRIDS[1], order=1).outputs
    for grid in GRIDS:
        motion = jn.solve(wound(start, rate), grid, order=1)
        found, time = motion.outputs, np.array(grid, float)
        first, second = angles_of_law(start, rate, 0.4, time), angles_of_law(0.2, -2 * rate, 0.1, time)
        for name, angle in (("first", first), ("second", second), ("between", second - first)):
            expected = -2.0 * angle[:, :2] - 0.1 * angle[:, 1:]
            expected[:, 0] += 2.0 * 0.3
            size = np.abs(expected).max(axis=0)
            assert (np.abs(found[f"{name}_spring"] - expected) <= 1e-13 * size).all()
        both = np.searchsorted(GRIDS[1], time)
        for name, values in plane.items():
            size = np.abs(values).max(axis=0)
            assert (np.abs(found[name] - values[both]) <= 1e-11 * size).all()


@pytest.mark.slow
def test_energies_and_powers_have_the_turns_of_the_forces():
    start, rate = LAWS["from the second turn"]
    motion = jn.solve(wound(start, rate), GRIDS[0], order=2)
    time = np.array(GRIDS[0], float)
    first, second = angles_of_law(start, rate, 0.4, time)[:, 0], angles_of_law(0.2, -2 * rate, 0.1, time)[:, 0]
    expected = sum((angle - 0.3) ** 2 for angle in (first, second, second - first))
    np.testing.assert_allclose(jn.dynamics.stored_energy(motion), expected, rtol=1e-13)
    balance = jn.energy.power_balance(motion)
    assert float((abs(balance["residual"]) / balance["scale"]).max()) < 1e-13


@pytest.mark.slow
def test_about_axes_that_tilt_too_and_for_outputs_asked_for_later():
    for turn in (0.0, 7.5, -100.0):
        hold_about_axes_that_tilt_too_and_for_outputs_asked_for_later(turn)


def hold_about_axes_that_tilt_too_and_for_outputs_asked_for_later(turn):
    mechanism = shafts(law(turn, 1.0))
    slope, twist = 0.3, {}
    about = [np.cos(slope), np.sin(slope), 0], [-np.sin(slope), np.cos(slope), 0], [0, 1, 0]
    twist["second"] = forces.SpatialTorsionalSpring(("ground", "second"), about[0], 1.0, 0.0, 0.0, *about[1:])
    twist["back"] = forces.SpatialTorque(("first", "ground"), [-2, 0, 0], "-x", [0, 1, 0], [0, 1, 0.2])
    mechanism = dataclasses.replace(mechanism, forces=twist)
    for grid in ([0.0, 5.0, 10.0], [0.0, 0.4, 10.0], [10.0]):
        motion = jn.solve(mechanism, grid, order=1)
        for name, output in mechanism.outputs.items():
            np.testing.assert_allclose(motion.evaluate(output).values, motion.outputs[name], rtol=0, atol=1e-12)
            if name in twist:
                torque = jn.dynamics.applied_force(motion, name).values[:, 0]
                np.testing.assert_allclose(torque, -motion.outputs[name][:, 0], rtol=0, atol=1e-12)
        assert np.abs(motion.outputs["second"][:, 0] - turn - np.array(grid)).max() < 0.1


@pytest.mark.slow
def test_instants_that_failed_have_no_torque():
    mechanism = wound(0.5, 1.0, "planar")
    driver = drivers.CoordinateDriver(("ground", "first"), "angle", "7*t + sqrt(4 - t)")
    motors = {**mechanism.drivers, "motor_first": driver}
    motion = jn.solve(dataclasses.replace(mechanism, drivers=motors), [0.0, 3.0, 5.0], order=1, strict=False)
    assert motion.status[-1] != 0
    torque = motion.outputs["first_spring"]
    assert np.isnan(torque[-1]).all()
    assert torque[1, 0] == pytest.approx(-2 * (22 - 0.3) - 0.1 * (7 - 0.5), abs=1e-11)
