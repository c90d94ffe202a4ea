"""Equations of small motions against closed forms, mpmath, differences of forward dynamics, and simulations."""

import dataclasses

import numpy as np
import pytest
import scipy.linalg
import scipy.signal

import jounce as jn
from jounce import forces, planar
from jounce.errors import MechanismError, MobilityError
from tests.oracles.mp_small_motions import SprungFourBar
from tests.problems.massed import massed_example
from tests.problems.mechanisms import example
from tests.problems.small_motions import (
    chain,
    column,
    hanging_chain,
    spherical_pendulum,
    sprung_four_bar,
    whirling,
)


def slow(*values):
    return pytest.param(*values, marks=pytest.mark.slow)


@pytest.mark.slow
@pytest.mark.parametrize("size, turn", [slow(1.0, 0.0), (1e-3, 0.7), slow(1e3, -1.1)])
def test_sprung_four_bar_swings_as_its_lagrange_equation_in_mpmath(size, turn):
    small = jn.linearize(sprung_four_bar(size, turn))
    angle = small.equilibrium.poses["crank"]["angle"] - turn
    _, square = SprungFourBar().rest(angle)
    assert isinstance(small, jn.dynamics.Linearization)
    assert isinstance(small.modes, jn.dynamics.Modes)
    assert small.modes.angular_frequencies[0] ** 2 == pytest.approx(square, rel=1e-12)
    assert small.modes.frequencies[0] == pytest.approx(np.sqrt(square) / (2 * np.pi), rel=1e-12)
    assert small.modes.damping_ratios.tolist() == [0.0]


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 6])
def test_hanging_chain_has_the_frequencies_of_its_closed_form(count):
    small = jn.linearize(hanging_chain(count))
    mass, length, gravity = 0.7, 0.3, 9.81
    left = np.arange(count, 0, -1) * mass
    matrix = length**2 * np.array([[left[max(i, j)] for j in range(count)] for i in range(count)])
    squares = scipy.linalg.eigh(np.diag(gravity * length * left), matrix, eigvals_only=True)
    assert np.allclose(small.modes.angular_frequencies**2, squares, rtol=1e-11)
    assert np.allclose(small.mass, matrix, atol=1e-14)
    assert small.coordinates == tuple(f"rod{k}.angle" for k in range(count))


@pytest.mark.slow
def test_chain_of_masses_has_its_matrices_and_complex_modes():
    masses, springs, dampers = [1.0, 2.0, 3.0], [5.0, 7.0, 9.0, 4.0], [0.1, 0.4, 0.0, 0.3]
    small = jn.linearize(chain(masses, springs, dampers, right_wall=True))

    def tridiagonal(values):
        a, b, c, d = values
        return np.array([[a + b, -b, 0], [-b, b + c, -c], [0, -c, c + d]])

    assert small.coordinates == ("m0.x", "m1.x", "m2.x")
    assert small.units == ("m", "m", "m")
    for found, expected in zip(
        (small.mass, small.damping, small.stiffness),
        (np.diag(masses), *map(tridiagonal, (dampers, springs))),
        strict=True,
    ):
        assert np.allclose(found, expected, atol=1e-13)
    state = np.block(
        [
            [np.zeros((3, 3)), np.eye(3)],
            [-np.linalg.solve(np.diag(masses), x) for x in (tridiagonal(springs), tridiagonal(dampers))],
        ]
    )
    values = np.linalg.eigvals(state)
    values = values[values.imag > 0]
    assert np.allclose(np.sort_complex(small.modes.eigenvalues), np.sort_complex(values), rtol=1e-12)
    assert np.allclose(small.modes.damping_ratios, (-small.modes.eigenvalues.real / np.abs(small.modes.eigenvalues)))
    for value, shape in zip(small.modes.eigenvalues, small.modes.shapes.T, strict=True):
        left = (small.mass * value**2 + small.damping * value + small.stiffness) @ shape
        assert np.abs(left).max() < 1e-12
        assert shape.conj() @ small.mass @ shape == pytest.approx(1.0)


@pytest.mark.slow
def test_free_chain_keeps_its_rigid_motion_at_zero_with_and_without_damping():
    for dampers in ([0.0] * 3, [0.0, 0.5, 0.2]):
        small = jn.linearize(chain([1.0, 2.0, 3.0], [0.0, 9.0, 4.0], dampers))
        assert small.modes.kinds == ("rigid", "oscillation", "oscillation")
        assert small.modes.frequencies[0] == 0.0
        assert np.allclose(small.modes.shapes[:, 0], 1 / np.sqrt(6.0))
        assert small.equilibrium.stability == "indifferent"


@pytest.mark.slow
def test_overdamped_and_toppling_motions_are_reported():
    slow = jn.linearize(chain([2.0], [3.0], [50.0]))
    roots = np.roots([2.0, 50.0, 3.0])
    assert np.allclose(np.sort(slow.modes.eigenvalues.real), np.sort(roots), rtol=1e-12)
    assert slow.modes.kinds == ("creeping", "creeping")
    assert slow.modes.damping_ratios.tolist() == [1.0, 1.0]
    top = jn.linearize(jn.equilibrium(hanging_chain(1), method="newton").mechanism)
    assert top.modes.kinds == ("oscillation",)
    upright = dataclasses.replace(hanging_chain(1), gravity=[0, 9.81])
    toppling = jn.linearize(jn.equilibrium(upright, method="newton"))
    assert toppling.modes.kinds == ("growing",)
    assert toppling.modes.eigenvalues[0] == pytest.approx(np.sqrt(9.81 / 0.3), rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [None, 4])
def test_spherical_pendulum_swings_alike_both_ways_in_any_frame(seed):
    axes = np.eye(3) if seed is None else np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    axes = axes * np.sign(np.linalg.det(axes))
    small = jn.linearize(spherical_pendulum(axes))
    expected = np.sqrt(1.3 * 9.81 * 0.8 / (1.3 * 0.8**2 + 0.05))
    assert small.modes.kinds == ("rigid", "oscillation", "oscillation")
    assert np.allclose(small.modes.angular_frequencies[1:], expected, rtol=1e-11)
    assert small.equilibrium.stability == "indifferent"


@pytest.mark.slow
def test_small_oscillation_of_a_simulation_has_the_frequency_and_shape_of_the_mode():
    mechanism = sprung_four_bar()
    small = jn.linearize(mechanism)
    period = 1 / small.modes.frequencies[0]
    rest = small.equilibrium.poses["crank"]["angle"]
    start = {"q": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", f"{float(rest + 1e-5)!r}")}
    motion = jn.simulate(small.equilibrium.placed, [0.0, period / 4, period / 2, period], order=1, initial=start)
    moved = (motion.angle("crank").values[:, 0] - rest) / 1e-5
    assert np.allclose(moved, [1, 0, -1, 1], atol=1e-4)
    rocker, crank = (small.modes.body_shapes[0, k, 2].real for k in (2, 0))
    swung = motion.outputs["psi"][0, 0] - small.equilibrium.outputs["psi"]
    assert swung / 1e-5 == pytest.approx(rocker / crank, abs=1e-4)
    assert small.modes.participation.sum() == pytest.approx(1.0)


@pytest.mark.slow
def test_a_steady_cone_precesses_as_its_closed_form_wherever_it_is():
    # about the steady cone of half angle c the fall swings with W sqrt(1 + 3 cos^2 c) on a shaft without inertia; the
    # light shaft here has j = 1e-9 kg m^2 over m l^2
    mechanism, rate = whirling(0.6)
    sine, cosine = np.sin(0.6), np.cos(0.6)
    motion = jn.simulate(mechanism, [0.0, 0.5], order=2)
    for instant, names in ((0.0, None), (0.31, ["turn", "fall"])):
        small = jn.linearize(motion, instant, coordinates=names)
        assert small.modes.kinds == ("rigid", "oscillation")
        expected = rate * np.sqrt(sine**2 + (2 * cosine * sine) ** 2 / (sine**2 + 1e-9 / (1.3 * 0.8**2)))
        assert small.modes.angular_frequencies[1] == pytest.approx(expected, rel=1e-9)
        assert abs(small.damping[0, 1] + small.damping[1, 0]) < 1e-12  # gyroscopic
        assert small.equilibrium is None


FOUR_BAR = {"crank": lambda law: jn.drivers.CoordinateDriver(("ground", "crank"), "angle", law)}


def accelerations(mechanism, makers, place, rates):
    """Second derivatives of outputs at a state that is prescribed by them, and the simulation."""
    initial = {  # values apart from the law, so that all states are compiled once
        f"start_{name}": make(jn.laws.ExpressionMotion("place + rate*t", {"place": float(y), "rate": float(v)}))
        for (name, make), y, v in zip(makers.items(), place, rates, strict=True)
    }
    motion = jn.simulate(dataclasses.replace(mechanism, initial=initial), [0.0], order=2)
    return np.array([motion.outputs[name][0, 2] for name in makers]), motion


@pytest.mark.slow
def test_derivatives_of_the_acceleration_are_those_of_differences_of_forward_dynamics():
    mechanism = dataclasses.replace(sprung_four_bar(), outputs={"crank": jn.outputs.AngleOutput("crank")})
    makers, place, rates, step = FOUR_BAR, np.array([2.1]), np.array([3.3]), 1e-5
    _, motion = accelerations(mechanism, makers, place, rates)
    small = jn.linearize(motion, 0.0, coordinates=list(makers))
    count = len(place)
    for part, found in ((0, small.A[count:, :count]), (1, small.A[count:, count:])):
        for k in range(count):
            moved = [step * np.eye(count)[k] * (part == which) for which in (0, 1)]
            ahead, behind = (
                accelerations(mechanism, makers, place + s * moved[0], rates + s * moved[1])[0] for s in (1, -1)
            )
            assert np.abs((ahead - behind) / (2 * step) - found[:, k]).max() < 1e-7 * np.abs(found).max()


@pytest.mark.slow
def test_other_coordinates_give_the_same_motions():
    mechanism = sprung_four_bar()
    chosen = [jn.linearize(mechanism, coordinates=[name]) for name in ("crank.angle", "psi", "C_x", "coupler.y")]
    assert [small.units for small in chosen] == [("rad",), ("rad",), ("m",), ("m",)]
    assert np.ptp([small.modes.frequencies[0] for small in chosen]) < 1e-12
    crank, rocker = chosen[:2]
    ratio = crank.state_space(outputs=["psi"]).C[0, 0]
    assert crank.mass[0, 0] == pytest.approx(rocker.mass[0, 0] * ratio**2, rel=1e-12)


@pytest.mark.slow
def test_released_driver_is_a_coordinate_and_its_torque_an_input():
    driven = sprung_four_bar(driven=True)
    held = jn.equilibrium(driven)
    assert held.degrees_of_freedom == 0
    small = jn.linearize(held, release="drive")
    assert (small.coordinates, small.inputs, small.held) == (("drive",), ("drive", "spring", "turn"), ())
    step = 1e-4

    def torque(angle):
        law = jn.drivers.CoordinateDriver(("ground", "crank"), "angle", f"{angle!r}")
        moved = jn.equilibrium(dataclasses.replace(driven, drivers={"drive": law}))
        return float(jn.driver_force(moved.motion, "drive")[0, 0])

    slope = (torque(2.0 + step) - torque(2.0 - step)) / (2 * step)
    assert small.stiffness[0, 0] == pytest.approx(slope, rel=1e-6)
    assert small.input_matrix[0, 0] == 1.0
    motion = jn.solve(driven, [0.0], order=2)
    assert jn.linearize(motion, release=["drive"]).mass[0, 0] == pytest.approx(small.mass[0, 0], rel=1e-13)


@pytest.mark.slow
def test_a_shaken_support_passes_on_what_the_closed_form_says():
    # a mass on a spring and a damper, whose other end a driver moves: H = (k + c s) / (m s^2 + c s + k)
    k, c, m = 40.0, 3.0, 2.0
    rail = {"planes": ([0, 0], [0, 0], [1, 0], [1, 0])}["planes"]
    shaker = jn.Mechanism(
        space="planar",
        bodies={"table": jn.Body([0, 0], mass=1.0), "load": jn.Body([1, 0], mass=m)},
        joints={name: planar.Prismatic(("ground", name), *rail) for name in ("table", "load")},
        drivers={"shake": jn.drivers.SlideDriver(("ground", "table"), [0, 0], [0, 0], [1, 0], "0.1*sin(t)")},
        forces={"mount": forces.SlideSpring(("table", "load"), [0, 0], [0, 0], [1, 0], k, 1.0, c)},
        outputs={"x": jn.outputs.PointOutput("load", [0, 0])},
    )
    small = jn.linearize(shaker)
    space = small.state_space(inputs=["shake"], outputs=["x_x"])
    assert space.states == ("load.x", "shake", "load.x_d1", "shake_d1")
    system = scipy.signal.StateSpace(*space[:4])
    for frequency in (0.5, 4.0, 30.0):
        s = 1j * frequency
        transfer = system.C @ np.linalg.solve(s * np.eye(4) - system.A, system.B) + system.D
        expected = (k + c * s) / (m * s**2 + c * s + k) / s**2  # of the acceleration
        assert transfer[0, 0] == pytest.approx(expected, rel=1e-12)
        assert transfer[1, 0] == pytest.approx(expected * s, rel=1e-12)


@pytest.mark.slow
def test_forces_are_inputs_by_component_and_rates_of_outputs_feed_through():
    shoved = dataclasses.replace(
        column(1.0),
        outputs={"w": jn.outputs.AngularVelocityOutput("upper"), "tip": jn.outputs.PointOutput("upper", [0.5, 0])},
    )
    small = jn.linearize(shoved)
    space = small.state_space(inputs=["push_y", "b"])
    assert small.inputs == ("a", "b", "push_x", "push_y")
    assert space.outputs == ("w", "w_d1", "tip_x", "tip_x_d1", "tip_y", "tip_y_d1")
    assert isinstance(space, jn.dynamics.StateSpace)
    reach = small.input_matrix[:, small.inputs.index("push_y")]
    assert np.allclose(reach, [0.5, 0.5])
    assert np.allclose(space.D[1], np.linalg.solve(small.mass, np.array([reach, [-1.0, 1.0]]).T)[1])
    assert np.allclose([small.A, small.B[:, [3, 1]]][0], space.A)
    assert np.allclose(small.B[:, [3, 1]], space.B)
    assert small.C.shape == (6, 4)
    assert small.D.shape == (6, 4)


@pytest.mark.slow
def test_bad_input_is_named():
    pendulum = jn.load(example("double_pendulum"))
    four_bar = sprung_four_bar(driven=True)
    motion = jn.solve(four_bar, [0.0, 0.1], order=2)
    for call, kind, place in (
        (lambda: jn.linearize(3), MechanismError, "subject"),
        (lambda: jn.linearize(pendulum, coordinates=["a"]), MechanismError, "coordinates"),
        (lambda: jn.linearize(pendulum, coordinates=["a", "lowre.angle"]), MechanismError, "coordinates"),
        (lambda: jn.linearize(pendulum, coordinates=["a", "upper.angle"]), MechanismError, "coordinates"),
        (lambda: jn.linearize(pendulum, coordinates=["a", "tip_y"]), MechanismError, "coordinates"),
        (lambda: jn.linearize(pendulum, release=["a"]), MechanismError, "release"),
        (lambda: jn.linearize(motion), MechanismError, "time"),
        (lambda: jn.linearize(motion, 0.05, release="drive"), MechanismError, "time"),
        (lambda: jn.linearize(jn.equilibrium(pendulum), 1.0), MechanismError, "time"),
        (lambda: jn.linearize(pendulum).state_space(inputs=["a"]), MechanismError, "inputs"),
        (lambda: jn.linearize(pendulum).state_space(outputs=["c"]), MechanismError, "outputs"),
    ):
        with pytest.raises(kind) as caught:
            call()
        assert place in caught.value.name
    with pytest.raises(MobilityError, match=r"nothing can move; .*release"):
        jn.linearize(motion, 0.1)


@pytest.mark.slow
def test_massless_bodies_are_named():
    springs = {"s": forces.TorsionalSpring(("ground", "b"), 2.0)}
    pins = {
        "A": planar.Revolute(("ground", "a"), [0, 0], [0, 0]),
        "B": planar.Revolute(("a", "b"), [1, 0], [0, 0]),
    }
    bodies = {"a": jn.Body([0, 0], mass=1.0, inertia=0.2), "b": jn.Body([1, 0])}
    mechanism = jn.Mechanism(space="planar", bodies=bodies, joints=pins, forces=springs)
    with pytest.raises(MechanismError, match="b can move without moving a mass") as caught:
        jn.linearize(mechanism)
    assert caught.value.name == "bodies.b.mass"
    bare = dataclasses.replace(mechanism, bodies={"a": jn.Body([0, 0]), "b": jn.Body([1, 0])})
    with pytest.raises(MechanismError, match="no body has a mass; small motions need some"):
        jn.linearize(bare)
    assert jn.equilibrium(bare).stability == "indifferent"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["four_bar", "six_bar_watt"])
def test_stiffness_and_mass_of_a_linkage_are_the_slopes_of_its_energies_along_its_driver(name):
    mechanism = massed_example(name)
    rest = jn.equilibrium(mechanism, without=list(mechanism.drivers))
    small = jn.linearize(rest, coordinates=["crank.angle"])
    angle = float(rest.poses["crank"]["angle"])
    drive = jn.drivers.CoordinateDriver(("ground", "crank"), "angle", f"{angle!r} + t")
    driven = dataclasses.replace(rest.placed, drivers={"drive": drive}, outputs={}, time=None)
    motion = jn.solve(driven, [0.0], order=4)
    potential = jn.energy.potential_energy(motion).values.ravel()
    kinetic = float(jn.energy.kinetic_energy(motion).total[0, 0])
    assert abs(potential[1]) < 1e-12 * abs(potential[2])
    assert small.stiffness[0, 0] == pytest.approx(potential[2], rel=1e-11)
    assert small.mass[0, 0] == pytest.approx(2 * kinetic, rel=1e-12)
    assert rest.stability == ("stable" if potential[2] > 0 else "unstable")
