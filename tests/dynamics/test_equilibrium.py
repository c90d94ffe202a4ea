"""Positions of equilibrium and their stability, against closed forms and Lagrange's equation in mpmath."""

import dataclasses

import numpy as np
import pytest

import jounce as jn
from jounce import forces, planar, spatial
from jounce.errors import MechanismError, MobilityError, SolveError
from tests.oracles.mp_small_motions import SprungFourBar
from tests.problems.mechanisms import example
from tests.problems.small_motions import column, hanging_chain, sprung_four_bar


def slow(*values):
    return pytest.param(*values, marks=pytest.mark.slow)


def crank_angle(found, turn=0.0):
    return found.poses["crank"]["angle"] - turn


@pytest.mark.slow
@pytest.mark.parametrize("size, turn", [slow(1.0, 0.0), (1e-3, 0.7), slow(1e3, -1.1)])
def test_sprung_four_bar_stands_where_lagrange_says_in_any_unit_and_frame(size, turn):
    found = jn.equilibrium(sprung_four_bar(size, turn))
    expected, square = SprungFourBar().rest(crank_angle(found, turn))
    assert abs(crank_angle(found, turn) - expected) < 1e-12
    assert square > 0
    assert isinstance(found, jn.dynamics.Equilibrium)
    assert found.stable
    assert found.stability == "stable"
    assert found.cautions == ()


@pytest.mark.slow
def test_settling_goes_where_energy_falls_and_newton_to_any_equilibrium():
    upright = {"rod": jn.Body([0, 0], angle=np.pi / 2 - 0.05, mass=2.0, center_of_mass=[0.5, 0])}
    pins = {"pin": planar.Revolute(("ground", "rod"), [0, 0], [0, 0])}
    rod = jn.Mechanism(space="planar", gravity=[0, -9.81], bodies=upright, joints=pins)
    settled, near = jn.equilibrium(rod), jn.equilibrium(rod, method="newton")
    assert np.sin(settled.poses["rod"]["angle"]) == pytest.approx(-1.0, abs=1e-14)
    assert abs(near.poses["rod"]["angle"] - np.pi / 2) < 1e-14
    assert (settled.stability, near.stability) == ("stable", "unstable")
    assert near.stable is False
    assert near.reason == "energy falls in motions of rod"


@pytest.mark.slow
def test_all_equilibria_of_a_double_pendulum_are_found():
    found = jn.dynamics.equilibria(hanging_chain(2), starts=25, seed=3)
    places = {tuple(np.round(np.sin([p["angle"] for p in one.poses.values()]), 9)): one.stability for one in found}
    assert places == {(-1, -1): "stable", (1, -1): "unstable", (-1, 1): "unstable", (1, 1): "unstable"}
    assert found[0].stability == "stable"


@pytest.mark.slow
def test_a_rod_turned_over_in_its_hinge_is_no_equilibrium():
    rod = jn.Body([0, 0, 0], mass=1.0, center_of_mass=[0, 0, -1.0], inertia=[0.1, 0.1, 0.1])
    pin = spatial.Revolute(("ground", "rod"), [0, 0, 0], [0, 0, 0], [0, 1, 0], [0, 1, 0])
    tip = jn.outputs.PointOutput("rod", [1, 0, -1])
    pendulum = jn.Mechanism(
        space="spatial", bodies={"rod": rod}, joints={"pin": pin}, outputs={"tip": tip}, gravity=[0, 0, -9.81]
    )
    found = jn.dynamics.equilibria(pendulum, starts=12)
    assert [one.stability for one in found] == ["stable", "unstable"]
    np.testing.assert_allclose([one.outputs["tip"] for one in found], [[1, 0, -1], [-1, 0, 1]], atol=1e-12)


@pytest.mark.slow
def test_all_equilibria_of_a_robot():
    robot = jn.load_robot("examples/robots/planar_arm.xml")
    found = jn.dynamics.equilibria(robot, starts=10, hold="ram")  # each link straight up or down
    angles = np.array([[one.outputs[name] for name in ("shoulder", "elbow")] for one in found])
    directions = {tuple(np.round(np.sin(np.cumsum(row)), 9)) for row in angles}
    assert directions == {(-1, -1), (1, 1), (1, -1), (-1, 1)}
    assert [one.stability for one in found] == ["stable", *["unstable"] * 3]
    still = np.zeros((4, 3, 3))
    still[:, 0, :2] = angles
    assert np.abs(jn.inverse_dynamics(robot, still)[:, 0, :2]).max() < 1e-12  # the joints that are not held


@pytest.mark.slow
def test_all_equilibria_of_the_sprung_four_bar_are_zeros_of_the_slope_of_its_energy():
    found = jn.dynamics.equilibria(sprung_four_bar(), starts=12, seed=1)
    above = [one for one in found if one.outputs["C"][1] > 0 and abs(crank_angle(one) - 2.0) < 1.5]
    assert len(above) >= 1
    for one in above:
        expected, square = SprungFourBar().rest(crank_angle(one))
        assert abs(crank_angle(one) - expected) < 1e-11
        assert one.stable == (square > 0)


@pytest.mark.slow
def test_forces_of_joints_and_drivers_balance_weight_at_rest_though_the_driver_would_move():
    arm = jn.Mechanism(
        space="planar",
        gravity=[0, -10.0],
        bodies={"arm": jn.Body([0, 0], mass=2.0, center_of_mass=[0.5, 0])},
        joints={"O": planar.Revolute(("ground", "arm"), [0, 0], [0, 0])},
        drivers={"turn": jn.drivers.CoordinateDriver(("ground", "arm"), "angle", "3*t + 5*t**2")},
    )
    held = jn.equilibrium(arm)
    assert (held.stability, held.degrees_of_freedom, held.stable) == ("held", 0, True)
    assert float(jn.driver_force(held.motion, "turn")[0, 0]) == pytest.approx(10.0, rel=1e-14)
    assert np.allclose(jn.joint_reaction(held.motion, "O").force.sel(derivative=0), [0.0, 20.0], atol=1e-12)
    later = jn.equilibrium(arm, 0.1)
    assert float(later.poses["arm"]["angle"]) == pytest.approx(0.35, abs=1e-14)
    freed = jn.equilibrium(arm, without=["turn"])
    assert np.sin(freed.poses["arm"]["angle"]) == pytest.approx(-1.0, abs=1e-14)


@pytest.mark.slow
def test_bodies_need_no_mass_where_springs_alone_act():
    knot = jn.Mechanism(
        space="planar",
        bodies={"knot": jn.Body([0.3, 0.2])},
        joints={"upright": planar.Parallel1(("ground", "knot"), [1, 0], [1, 0])},
        forces={
            "a": forces.Spring(("ground", "knot"), [0, 0], [0, 0], stiffness=3.0, length=0.0),
            "b": forces.Spring(("ground", "knot"), [1, 0], [0, 0], stiffness=5.0, length=0.0),
            "c": forces.PointForce("knot", [0, 0], ["0.4 + t", -0.8]),
        },
    )
    found = jn.equilibrium(knot, 0.2)
    assert np.allclose(found.poses["knot"]["position"], [(5.0 + 0.6) / 8, -0.1], atol=1e-14)
    assert found.stability == "stable"


@pytest.mark.slow
@pytest.mark.parametrize("load, word", [(2.0, "undetermined"), (2.08, "undetermined"), (2.09, "unstable")])
def test_a_column_under_a_follower_force_flutters_at_the_load_of_ziegler(load, word):
    # (7/2 - sqrt 2) k / l = 2.0858 k / l; its stiffness is never singular
    found = jn.equilibrium(column(load * 2.0 / 0.5))
    assert found.stability == word
    assert np.allclose([p["angle"] for p in found.poses.values()], 0.0, atol=1e-14)


@pytest.mark.slow
def test_damping_makes_a_column_flutter_sooner():
    # both springs damped alike: the load of flutter falls to 41/28 k / l as damping goes to zero
    small = 1e-4 * np.sqrt(2.0 * 0.4 * 0.5**2)
    words = [jn.equilibrium(column(load * 2.0 / 0.5, damping=small)).stability for load in (1.45, 1.48)]
    assert words == ["stable", "unstable"]


@pytest.mark.slow
def test_what_no_force_resists_is_indifferent_and_what_flies_off_has_no_equilibrium():
    wheel = jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        bodies={"wheel": jn.Body([0, 0], mass=2.0, inertia=0.5)},
        joints={"O": planar.Revolute(("ground", "wheel"), [0, 0], [0, 0])},
    )
    found = jn.equilibrium(wheel)
    assert (found.stability, found.stable) == ("indifferent", None)
    assert "wheel" in found.reason
    driven = dataclasses.replace(wheel, forces={"T": forces.Torque(("ground", "wheel"), law="0.7 + 0*x")})
    with pytest.raises(SolveError, match=r"no equilibrium .* 0\.7 N m on wheel is balanced by nothing; .* a driver"):
        jn.equilibrium(driven)
    falling = dataclasses.replace(wheel, joints={})
    with pytest.raises(SolveError, match=r"a force of \(0, -19.62\) N on wheel"):
        jn.equilibrium(falling)


@pytest.mark.slow
@pytest.mark.parametrize("half, free, stiffness", [slow(1.0, 1.2, 1e3), (0.7, 0.9, 3e5)])
def test_at_its_limit_load_a_shallow_truss_has_no_stiffness(half, free, stiffness):
    # two springs of length l and free length f, feet 2 a apart: 2 k y (f/l - 1) is largest where l^3 = f a^2
    length = (free * half**2) ** (1 / 3)
    height = np.sqrt(length**2 - half**2)

    def stability(place, load):
        feet = {f"{side:+}": [side * half, 0] for side in (-1, 1)}
        truss = jn.Mechanism(
            space="planar",
            bodies={"pin": jn.Body([0, place], mass=1.0, inertia=0.1)},
            joints={"guide": planar.Prismatic(("ground", "pin"), [0, 0], [0, 0], [0, 1], [0, 1])},
            forces={
                **{n: forces.Spring(("ground", "pin"), x, [0, 0], stiffness, free) for n, x in feet.items()},
                "load": forces.PointForce("pin", [0, 0], law=[0.0, -load]),
            },
        )
        return jn.equilibrium(truss, method="newton").stability

    def carried(y):
        return float(2 * stiffness * y * (free / np.hypot(half, y) - 1))

    words = [stability(y, carried(y)) for y in (height, height + 1e-3, height - 1e-3)]
    assert words == ["indifferent", "stable", "unstable"]


def test_bad_input_is_named_before_anything_is_computed():
    pendulum = jn.load(example("simple_pendulum"))
    for call, place in (
        (lambda: jn.equilibrium(pendulum, "soon"), "time"),
        (lambda: jn.equilibrium(pendulum, np.inf), "time"),
        (lambda: jn.equilibrium(pendulum, method="fall"), "method"),
        (lambda: jn.equilibrium(pendulum, without=["motor"]), "without"),
        (lambda: jn.dynamics.equilibria(pendulum, starts=-1), "starts"),
        (lambda: jn.dynamics.equilibria(pendulum, seed=0.5), "seed"),
    ):
        with pytest.raises(MechanismError) as caught:
            call()
        assert place in caught.value.name


def test_dry_friction_that_has_no_value_at_rest_is_refused_by_name():
    pendulum = jn.load(example("simple_pendulum"))
    rubbing = {"brake": forces.Torque(("ground", "bob"), law="-0.1*v/abs(v)")}
    with pytest.raises(SolveError, match=r"forces\.brake: .*no finite value at rest"):
        jn.equilibrium(dataclasses.replace(pendulum, forces=rubbing))


@pytest.mark.slow
def test_a_spring_that_only_pushes_is_reported_where_it_just_touches():
    block = jn.Mechanism(
        space="planar",
        bodies={"block": jn.Body([1.0, 0.0], mass=1.0, inertia=1.0)},
        joints={"rail": planar.Prismatic(("ground", "block"), [0, 0], [0, 0], [1, 0], [1, 0])},
        forces={
            "bumper": forces.SlideForce(("ground", "block"), [0, 0], [0, 0], [1, 0], law="200*(abs(1 - x) + 1 - x)"),
            "spring": forces.SlideSpring(("ground", "block"), [0, 0], [0, 0], [1, 0], 50.0, 1.0),
        },
    )
    found = jn.equilibrium(block)
    assert any("forces.bumper has a kink" in caution for caution in found.cautions)
    with pytest.raises(MechanismError, match="kink") as caught:
        jn.linearize(found)
    assert caught.value.name == "forces.bumper"


@pytest.mark.slow
def test_a_simulation_from_the_placed_mechanism_stays_there():
    found = jn.equilibrium(sprung_four_bar())
    still = jn.simulate(found.placed, [0.0, 0.5], order=2)
    assert np.abs(still.outputs["psi"][:, 0] - found.outputs["psi"]).max() < 1e-11


@pytest.mark.slow
def test_a_change_point_is_reported_as_singular_and_not_linearized():
    # a parallelogram that hangs along its base, where it may turn into its crossed form
    body = {"mass": 1.0, "inertia": 0.1}
    place = [np.cos(0.7), np.sin(0.7)]
    parallelogram = jn.Mechanism(
        space="planar",
        gravity=[9.81, 0],
        bodies={
            "a": jn.Body([0, 0], angle=0.7, center_of_mass=[0.5, 0], **body),
            "b": jn.Body(place, center_of_mass=[1, 0], **body),
            "c": jn.Body([2, 0], angle=0.7, center_of_mass=[0.5, 0], **body),
        },
        joints={
            "A": planar.Revolute(("ground", "a"), [0, 0], [0, 0]),
            "B": planar.Revolute(("a", "b"), [1, 0], [0, 0]),
            "C": planar.Revolute(("b", "c"), [2, 0], [1, 0]),
            "D": planar.Revolute(("ground", "c"), [2, 0], [0, 0]),
        },
    )
    found = jn.equilibrium(parallelogram)
    assert found.singular
    assert (found.stability, found.stable) == ("undetermined", None)
    assert np.allclose([pose["angle"] for pose in found.poses.values()], 0.0, atol=1e-9)
    with pytest.raises(MobilityError, match="the position is singular"):
        jn.linearize(found)


def test_an_equilibrium_of_a_spring_alone_is_listed_once_where_nothing_loads_it():
    """A slider on the y axis and a spring of length 1.2 to (1, 0): 0 is unstable, sqrt(0.44) free of all load."""
    slider = jn.Mechanism(
        space="planar",
        bodies={"slider": jn.Body([0, 0.3], mass=2.0, inertia=0.1)},
        joints={"guide": planar.Prismatic(("ground", "slider"), [0, 0], [0, 0], [0, 1], [0, 1])},
        forces={"spring": forces.Spring(("ground", "slider"), [1, 0], [0, 0], stiffness=1000.0, length=1.2)},
    )
    found = jn.dynamics.equilibria(slider, starts=5, seed=1)
    assert [one.stability for one in found] == ["stable", "unstable"]
    heights = [one.poses["slider"]["position"][1] for one in found]
    np.testing.assert_allclose(heights, [np.sqrt(0.44), 0.0], atol=1e-12)
