"""Simulations: derivatives at instants, dense output, results, and what is kept where a run cannot go on."""

import csv

import numpy as np
import pytest

import jounce as jn
from jounce import drivers, forces, planar, spatial
from jounce.execution.compilation import Compiled
from tests.problems.dynamics import GRAVITY, simple_pendulum

GRID = [0.0, 0.4, 1.1, 2.0]


@pytest.fixture(scope="module")
def swing():
    return jn.simulate(simple_pendulum(0.3, 1.0), GRID)


def pendulum_derivatives(angle, rate, w=GRAVITY):
    """Angle from the horizontal and its derivatives to jounce, from the law a'' = -w cos(a)."""
    second = -w * np.cos(angle)
    third = w * np.sin(angle) * rate
    return np.array([angle, rate, second, third, w * (np.cos(angle) * rate**2 + np.sin(angle) * second)]).T


def test_a_short_run_calls_few_programs(monkeypatch):
    called, call = [], Compiled.__call__

    def recorded(self, *arguments, **keywords):
        called.append(self.__name__)
        return call(self, *arguments, **keywords)

    pendulum = simple_pendulum(0.3, 0.0)
    jn.simulate(pendulum, [0.0, 1e-3], tolerance=1e-10)  # `expanded` is traced here, with `output_series` in it
    monkeypatch.setattr(Compiled, "__call__", recorded)
    jn.simulate(pendulum, [0.0, 1e-3], tolerance=1e-10)
    assert called == ["_moved", "_with_row_rates", "_computed_facts", "march"]


@pytest.mark.parametrize("time", [[], [[0.0, 1.0]]])
def test_instants_that_are_no_list_of_at_least_one_are_refused(time):
    slider = jn.Robot("r", [jn.Link("base"), jn.Link("a", jn.Inertia(1.0))], [jn.Joint("x", "base", "a", "prismatic")])
    for found in (jn.simulate(simple_pendulum(0.3, 0.0), [0.0, 1e-3]), jn.simulate(slider, [0.0, 1e-3])):
        with pytest.raises(jn.errors.JounceError, match="time: must be an instant, or a list of at least one"):
            found.at(time)


@pytest.mark.slow
def test_derivatives_obey_the_equation_of_motion(swing):
    found = swing.outputs["angle"]
    assert np.allclose(found, pendulum_derivatives(found[:, 0], found[:, 1]), rtol=1e-13, atol=1e-12)


def test_other_instants_of_a_simulation_are_those_of_another(swing):
    again = jn.simulate(swing.mechanism, [0.0, 0.17, 0.9, 1.999, 2.0])
    dense = swing.at(again.time)
    for name, values in again.outputs.items():
        assert np.allclose(dense.outputs[name], values, rtol=1e-12, atol=1e-11)
    assert dense.steps == swing.steps
    assert dense.drift.max() < 1e-14


def test_energy_is_kept_and_has_its_closed_form(swing):
    angle, rate = swing.outputs["angle"][:, 0], swing.outputs["angle"][:, 1]
    assert np.allclose(swing.energy, 0.5 * rate**2 + GRAVITY * np.sin(angle), rtol=0, atol=1e-13)
    assert np.ptp(swing.energy) < 5e-13  # rounding of up to 13 J in ten steps


def test_instants_outside_are_not_reached(swing):
    found = swing.at([-0.1, 1.0, 2.1])
    assert [jn.Status(s).name for s in found.status] == ["NOT_REACHED", "OK", "NOT_REACHED"]
    assert np.isnan(found.outputs["angle"][[0, 2]]).all()
    assert np.isnan(found.energy[[0, 2]]).all()


def test_backward_from_the_end_returns_to_the_start(swing):
    angle, rate = (float(x) for x in swing.outputs["angle"][-1, :2])
    # the condition "angle + rate*t" gives both at t = 2
    mechanism = swing.mechanism.with_parameters(angle=angle - 2 * rate, rate=rate)
    back = jn.simulate(mechanism, GRID[::-1])
    assert back.ended_at == 0.0
    assert np.allclose(back.outputs["angle"][::-1, :2], swing.outputs["angle"][:, :2], rtol=0, atol=1e-12)


def test_the_reaction_of_the_pivot_in_closed_form(swing):
    angle, rate = swing.outputs["angle"][:, 0], swing.outputs["angle"][:, 1]
    force = swing.evaluate(jn.outputs.JointForceOutput("pivot", "bob")).values[:, 0]
    along = -(rate**2) + GRAVITY * np.sin(angle)  # N, on 1 kg at 1 m: toward the pivot less weight
    expected = along[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    assert np.allclose(force, expected, rtol=0, atol=1e-12)


def test_power_balances(swing):
    balance = jn.energy.power_balance(swing)
    assert (abs(balance["residual"]) <= 1e-11 * balance["scale"].max()).all()


def test_results_as_dataset_and_file(swing, tmp_path):
    assert swing.dataset["angle"].attrs["units"] == "rad"
    assert swing.dataset["place"].dims == ("time", "derivative", "component")
    path = tmp_path / "swing.csv"
    jn.io.write(swing.dataset, path)
    with path.open(newline="") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    assert [float(row["angle"]) for row in rows] == list(swing.outputs["angle"][:, 0])


def test_progress_ends_with_all_instants():
    calls = []
    jn.simulate(simple_pendulum(0.3, 1.0), GRID, progress=lambda *call: calls.append(call))
    assert calls[-1] == (4, 4)
    assert [done for done, _ in calls] == sorted(done for done, _ in calls)


def test_one_instant_and_a_longest_step():
    single = jn.simulate(simple_pendulum(0.3, 1.0), [5.0])
    assert single.outputs["angle"].shape == (1, 5)
    # the law of the initial condition holds at the start: 0.3 + 1.0 * 5
    assert np.allclose(single.outputs["angle"], pendulum_derivatives(np.array([5.3]), np.array([1.0])), rtol=1e-13)
    fine = jn.simulate(simple_pendulum(0.3, 1.0), GRID, longest_step=0.05)
    assert fine.steps == 40


@pytest.mark.slow
def test_an_even_spin_in_space_keeps_its_turns():
    # of an evenly spinning body the angular velocity has one term, the Euler parameters have all
    top = jn.Mechanism(
        space="spatial",
        bodies={"top": jn.Body([0, 0, 0], mass=1.0, inertia=[1.0, 1.0, 2.0])},
        joints={"pin": spatial.Spherical(("ground", "top"), [0, 0, 0], [0, 0, 0])},
        initial={"spin": drivers.RotationDriver(("ground", "top"), [0, 0, 1], "20*t", [1, 0, 0], [1, 0, 0])},
        outputs={"tip": jn.outputs.PointOutput("top", [1, 0, 0])},
    )
    time = np.linspace(0, 10, 6)
    tip = jn.simulate(top, time, 1).outputs["tip"]
    phase = 20 * time
    assert np.allclose(tip[:, 0], np.stack([np.cos(phase), np.sin(phase), 0 * time], axis=1), rtol=0, atol=1e-11)


def block(law):
    """A block of 1 kg on a line, 1 m from the origin at rest, under a force along it."""
    x = [1, 0]
    return jn.Mechanism(
        space="planar",
        bodies={"block": jn.Body([1, 0], mass=1.0)},
        joints={"guide": planar.Prismatic(("ground", "block"), [0, 0], [0, 0], x, x)},
        forces={"pull": forces.SlideForce(("ground", "block"), [0, 0], [0, 0], x, law)},
        initial={"rest": drivers.CoordinateDriver(("ground", "block"), "x", 1.0)},
        outputs={"x": jn.outputs.PointOutput("block", [0, 0])},
    )


@pytest.mark.slow
def test_what_was_computed_before_a_singularity_is_kept():
    # x'' = -x^-3 from rest at 1: x = sqrt(1 - t^2), which ends at t = 1
    time = [0.0, 0.6, 0.8, 1.5, 2.0]
    motion = jn.simulate(block("-x**-3"), time, 1, strict=False)
    assert [jn.Status(s).name for s in motion.status] == ["OK"] * 3 + ["COLLAPSED", "NOT_REACHED"]
    assert motion.faults == {3: "forces.pull at t = 1 s"}
    assert motion.ended_at == pytest.approx(1.0, abs=1e-9)
    assert np.allclose(motion.outputs["x"][:3, 0, 0], [1.0, 0.8, 0.6], rtol=0, atol=1e-13)
    with pytest.raises(jn.errors.SolveError, match=r"t = 1\.5 s, forces.pull at t = 1 s: collapsed.*3 of 5") as e:
        jn.simulate(block("-x**-3"), time, 1)
    assert e.value.motion.ended_at == motion.ended_at


@pytest.mark.slow
def test_a_force_that_is_not_finite_at_the_start_is_named():
    with pytest.raises(jn.errors.SolveError, match=r"t = 0 s, forces.pull: the force is not finite"):
        jn.simulate(block("1/t"), [0.0, 1.0])
