"""Figures of forces, energies and power, against numbers computed apart."""

import pathlib

import numpy as np
import pytest

import jounce as jn
from jounce.dynamics import stored_energy
from jounce.plot import draw_energy, draw_power, draw_reactions

ROOT = pathlib.Path(__file__).resolve().parents[2]
TIME = np.linspace(0.0, 1.0, 11)


@pytest.fixture(scope="module")
def lift():
    """A mass on a spring, lifted by a driver: all forces are known in closed form."""
    mechanism = jn.Mechanism(
        space="planar",
        gravity=[0, -10.0],
        bodies={"cage": jn.Body([0, 1], mass=3.0, inertia=1.0)},
        joints={"rail": jn.planar.Prismatic(("ground", "cage"), [0, 0], [0, 0], [0, 1], [0, 1])},
        drivers={"pull": jn.drivers.SlideDriver(("ground", "cage"), [0, 0], [0, 0], [0, 1], "1 + t**3")},
        forces={"spring": jn.forces.Spring(("ground", "cage"), [0, 0], [0, 0], stiffness=5.0, length=1.0)},
    )
    return jn.solve(mechanism, TIME, order=4)


def lines(axes):
    return {line.get_label(): line.get_ydata() for line in axes.lines if len(line.get_xdata()) == len(TIME)}


@pytest.mark.slow
def test_energies(lift):
    (axes,) = draw_energy(lift).axes
    kinetic, potential, springs = 1.5 * (3 * TIME**2) ** 2, 30 * (1 + TIME**3), 2.5 * TIME**6
    found = lines(axes)
    assert axes.get_ylabel() == "energy  (J)"
    for name, values in (("kinetic", kinetic), ("potential", potential), ("springs", springs)):
        np.testing.assert_allclose(found[name], values, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found["total"], kinetic + potential + springs, rtol=1e-14)
    np.testing.assert_allclose(stored_energy(lift), springs, rtol=0, atol=1e-12)


@pytest.mark.slow
def test_reactions_drivers_and_applied_forces(lift):
    figure = draw_reactions(lift)
    grid = np.array(figure.axes, dtype=object).reshape(3, -1)  # force, yank, second rate
    assert [axes.get_title(loc="left") for axes in grid[0]] == ["rail", "pull (driver)", "spring (applied)"]
    pull = 3 * 6 * TIME + 30 + 5 * TIME**3, 18 + 15 * TIME**2, 30 * TIME
    for axes, values in zip(grid[:, 1], pull, strict=True):
        (line,) = [line for line in axes.lines if len(line.get_xdata()) == len(TIME)]
        np.testing.assert_allclose(line.get_ydata(), values, rtol=0, atol=1e-10)
    assert grid[1, 1].get_ylabel() == "yank\n(N/s)"
    only = draw_reactions(lift, ["spring"])
    assert [axes.get_title(loc="left") for axes in only.axes[:1]] == ["spring (applied)"]


@pytest.mark.slow
def test_moments_are_drawn_where_a_joint_carries_one():
    mechanism = jn.Mechanism(
        space="planar",
        gravity=[0, -10.0],
        bodies={"block": jn.Body([0, 0], mass=2.0, inertia=1.0, center_of_mass=[0.5, 0])},
        joints={"rail": jn.planar.Prismatic(("ground", "block"), [0, 0], [0, 0], [1, 0], [1, 0])},
        drivers={"push": jn.drivers.SlideDriver(("ground", "block"), [0, 0], [0, 0], [1, 0], "t**2")},
    )
    figure = draw_reactions(jn.solve(mechanism, TIME, order=2), ["rail"])
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["rail", "rail (moment)"]
    (line,) = [line for line in figure.axes[1].lines if len(line.get_xdata()) == len(TIME)]
    np.testing.assert_allclose(line.get_ydata(), 10.0, rtol=1e-12)  # 20 N at half a metre


@pytest.mark.slow
def test_power_goes_where_it_should(lift):
    figure = draw_power(lift)
    found = lines(figure.axes[0])
    speed = 3 * TIME**2
    np.testing.assert_allclose(found["drivers"], (18 * TIME + 30 + 5 * TIME**3) * speed, rtol=0, atol=1e-10)
    np.testing.assert_allclose(found["forces"], -5 * TIME**3 * speed, rtol=0, atol=1e-10)
    np.testing.assert_allclose(found["potential"], 30 * speed, rtol=0, atol=1e-10)
    assert [axes.get_ylabel() for axes in figure.axes] == ["power  (W)", "rate  (W/s)", "second rate  (W/s$^2$)"]


@pytest.mark.slow
def test_power_that_friction_takes():
    """Of a block that is pushed along a level guide: the coefficient times the weight times the speed."""
    block = jn.Mechanism(
        space="planar",
        gravity=[0, -10.0],
        bodies={"block": jn.Body([0, 0], mass=2.0, inertia=1.0)},
        joints={
            "rail": jn.planar.Prismatic(
                ("ground", "block"), [0, 0], [0, 0], [1, 0], [1, 0], friction=jn.joints.Friction(0.3, 1e-6)
            )
        },
        drivers={"push": jn.drivers.SlideDriver(("ground", "block"), [0, 0], [0, 0], [1, 0], "t + t**2")},
    )
    figure = draw_power(jn.solve(block, TIME, order=3))
    speed = 1 + 2 * TIME
    taken, gained = 0.3 * 2 * 10 * speed, 2 * 2 * speed
    for name, values in (("friction", -taken), ("kinetic", gained), ("drivers", taken + gained)):
        np.testing.assert_allclose(lines(figure.axes[0])[name], values, rtol=0, atol=1e-9)
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert words == ["put in by drivers", "put in by friction", "gain of kinetic energy"]


@pytest.mark.slow
def test_what_has_no_forces_is_reported(lift):
    bare = jn.solve(jn.load(ROOT / "examples" / "four_bar.yaml"), [0.0, 0.1], order=2)
    for figure in (draw_reactions, draw_energy, draw_power):
        with pytest.raises(jn.errors.MechanismError, match="mass"):
            figure(bare)
    with pytest.raises(jn.errors.MechanismError, match="did you mean 'spring'"):
        draw_reactions(lift, ["sprin"])
    with pytest.raises(jn.errors.MechanismError, match="order 2 or more"):
        draw_reactions(jn.solve(lift.mechanism, TIME, order=1))


@pytest.mark.slow
def test_energy_of_a_simulation_is_that_it_keeps():
    pendulum = jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        bodies={"rod": jn.Body([0, 0], mass=2.0, inertia=0.5, center_of_mass=[1, 0])},
        joints={"O": jn.planar.Revolute(("ground", "rod"), [0, 0], [0, 0])},
        forces={"coil": jn.forces.TorsionalSpring(("ground", "rod"), stiffness=3.0, angle=0.5)},
    )
    motion = jn.simulate(pendulum, TIME, order=2, method=jn.Taylor(8))
    (axes,) = draw_energy(motion).axes
    np.testing.assert_allclose(lines(axes)["total"], motion.energy, rtol=1e-10)
