"""Batches: every run is what it is alone; a run that fails leaves the others as they are."""

import functools

import numpy as np
import pytest

import jounce as jn
from jounce.execution.backends import VARIABLE

TIME = [0.0, 0.4, 1.0]


def pendulum(**changes):
    """Two rods; angle and rate at the start, a mass, a length, a spring and when a torque has no value follow."""
    values = {"rise": 0.3, "rate": 0.0, "mass": 1.0, "length": 1.0, "stiffness": 5.0, "end": 3.0} | changes
    return jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        parameters=values,
        bodies={
            "upper": jn.Body([0, 0], mass=1.0, inertia="length**2/12", center_of_mass=["length/2", 0]),
            "lower": jn.Body(["length", 0], mass="mass", inertia=0.1, center_of_mass=[0.5, 0]),
        },
        joints={
            "A": jn.planar.Revolute(("ground", "upper"), [0, 0], [0, 0]),
            "B": jn.planar.Revolute(("upper", "lower"), ["length", 0], [0, 0]),
        },
        forces={
            "spring": jn.forces.TorsionalSpring(("upper", "lower"), stiffness="stiffness", angle=0.2),
            "push": jn.forces.Torque(("ground", "upper"), law="1/(end - t)**2"),
        },
        initial={
            "rise": jn.drivers.CoordinateDriver(("ground", "upper"), "angle", motion="rise + rate*t"),
            "hang": jn.drivers.CoordinateDriver(("ground", "lower"), "angle", motion="0.1"),
        },
        outputs={"tip": jn.outputs.PointOutput("lower", ["length", 0]), "angle": jn.outputs.AngleOutput("upper")},
    )


def spread(count):
    generator = np.random.default_rng(4)
    return {
        "rise": generator.uniform(-2, 2, count),
        "rate": generator.normal(size=count),
        "mass": generator.uniform(0.5, 2, count),
        "length": generator.uniform(0.8, 1.2, count),
        "stiffness": generator.uniform(0, 10, count),
    }


@functools.cache
def six():
    """Return six runs, of which the torque of the second has no finite value from a time on, and their values."""
    values = spread(6) | {"end": np.array([3.0, 0.7, 2.0, 3.0, 4.0, 5.0])}
    return values, jn.simulate_batch(pendulum(), values, TIME, order=3)


@pytest.mark.slow
def test_every_run_is_what_it_is_alone():
    values, batch = six()
    assert batch.outputs["tip"].shape == (6, 3, 4, 2)
    assert batch.outputs["angle"].shape == (6, 3, 4)
    for run in (0, 2, 3, 4, 5):
        assert (batch.status[run] == jn.Status.OK).all()
        single = jn.simulate(pendulum(**{name: float(v[run]) for name, v in values.items()}), TIME, order=3)
        assert single.steps == batch.steps[run]
        for name, expected in single.outputs.items():
            scale = np.abs(expected).max(axis=0)
            # the runs meet the same numbers in another order; a double pendulum multiplies what rounding differs by
            assert np.all(np.abs(batch.outputs[name][run] - expected) <= 1e-10 * scale)


@pytest.mark.slow
def test_a_run_that_fails_leaves_the_others():
    """They are what they are alone, as the test before says."""
    _, batch = six()
    assert batch.status[1].tolist() == [jn.Status.OK, jn.Status.OK, jn.Status.COLLAPSED]
    assert np.isfinite(batch.outputs["tip"][1, :2]).all()
    assert np.isnan(batch.outputs["tip"][1, 2]).all()


@pytest.mark.slow
def test_runs_in_several_chunks_by_either_backend(monkeypatch):
    values = spread(140)
    batch = jn.simulate_batch(pendulum(), values, TIME, order=1)
    monkeypatch.setenv(VARIABLE, "0")
    again = jn.simulate_batch(pendulum(), {name: v[::-1] for name, v in values.items()}, TIME, order=1)
    assert (batch.backend, again.backend) == ("llvm", "xla")
    np.testing.assert_allclose(again.outputs["tip"][::-1], batch.outputs["tip"], rtol=0, atol=1e-10)


@pytest.mark.parametrize(
    "values, words",
    [
        ({}, "at least one parameter"),
        ({"raise": [1.0]}, "did you mean 'rise'"),
        ({"rise": [1.0, np.nan]}, "finite"),
        ({"rise": 1.0}, "one for each run"),
        ({"rise": [1.0, 2.0], "rate": [1.0]}, "2 as those before"),
    ],
)
def test_bad_parameters(values, words):
    with pytest.raises(jn.errors.MechanismError, match=words):
        jn.simulate_batch(pendulum(), values, TIME)


@pytest.mark.slow
def test_a_run_whose_initial_conditions_cannot_be_met_says_so():
    """Two rods reach 1.8 m: 2.5 m and a speed at 1.8 m are out of reach, and just below it Newton's steps are slow."""
    reach = jn.drivers.DistanceDriver(("ground", "lower"), [0, 0], [0.8, 0], "r + 0.3*t")
    rods = jn.Mechanism(
        space="planar",
        parameters={"r": 1.5},
        bodies={
            "upper": jn.Body([0, 0], angle=0.3, mass=2.0, inertia=0.5),
            "lower": jn.Body([1, 0.3], angle=-0.4, mass=1.0, inertia=0.2),
        },
        joints={
            "A": jn.planar.Revolute(("ground", "upper"), [0, 0], [0, 0]),
            "B": jn.planar.Revolute(("upper", "lower"), [1, 0], [0, 0]),
        },
        initial={"reach": reach},
        outputs={"away": jn.outputs.DistanceOutput(("ground", "lower"), [0, 0], [0.8, 0])},
    )
    found = jn.simulate_batch(rods, {"r": [1.5, 2.5, 1.8, 1.799999]}, [0.0, 1e-6], order=1)
    assert found.status[:, 0].tolist() == [0, jn.Status.NOT_ASSEMBLED, jn.Status.SINGULAR, 0]
    assert np.isnan(found.outputs["away"][[1, 2]]).all()
    assert found.outputs["away"][[0, 3], 0] == pytest.approx(np.array([[1.5, 0.3], [1.799999, 0.3]]), rel=1e-12)
