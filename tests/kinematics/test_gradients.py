"""Derivatives of motions with respect to the design, against differences of an independent solver in fifty digits."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from mpmath import mp

import jounce as jn
from tests.oracles.mp_files import read, value
from tests.oracles.mpmath_kinematics import solve_file
from tests.problems.mechanisms import example
from tests.problems.small import screw

SPAN = 40  # steps of the grid that the judge follows
STEP = "1e-13"  # of a parameter; an even difference of it in fifty digits is exact to 1e-24


def differences(name, parameter, order, count):
    """Return instants and the derivative of each output by a parameter, (time, component, derivative)."""
    description = read(example(name))
    time = description["time"]
    description["time"] = time | {"stop": time["start"] + SPAN * time["step"]}
    given = description["parameters"]
    with mp.workdps(50):
        nominal = mp.nstr(value(given[parameter], {}), 40)
        times, after = solve_file(
            {**description, "parameters": {**given, parameter: f"{nominal} + {STEP}"}}, order, 50, count
        )
        _, before = solve_file(
            {**description, "parameters": {**given, parameter: f"{nominal} - {STEP}"}}, order, 50, count
        )

        def slope(b, a):
            return (
                [slope(x, y) for x, y in zip(b, a, strict=True)]
                if isinstance(b, list)
                else float((b - a) / (2 * mp.mpf(STEP)))
            )

        return np.array(times), {output: np.array(slope(after[output], before[output])) for output in after}


def errors(name, parameters, order, count=3):
    """Return the largest error of derivatives by parameters, for each order, over the size of that derivative."""
    mechanism = jn.load(example(name))
    references = {parameter: differences(name, parameter, order, count) for parameter in parameters}
    times = references[parameters[0]][0]

    def outputs(values):
        changed = mechanism.with_parameters(**dict(zip(parameters, values, strict=True)))
        return jn.solve(changed, times, order=order).outputs

    point = jnp.array([mechanism.parameter_values[parameter] for parameter in parameters])
    found, worst = jax.jit(jax.jacfwd(outputs))(point), np.zeros(order + 1)
    for k, parameter in enumerate(parameters):
        for output, truth in references[parameter][1].items():
            got = np.asarray(found[output])[..., k]
            got = got[:, None] if got.ndim == 2 else np.moveaxis(got, -1, 1)
            size = np.abs(truth).max(axis=(0, 1))
            whole = size.max() if size.max() > 1e-9 else 1.0  # 1: what is driven does not depend on it at all
            error = np.abs(got - truth).max(axis=(0, 1))
            worst = np.maximum(worst, error / np.where(size > 1e-9 * whole, size, whole))
    return worst


@pytest.mark.slow
def test_a_four_bar_in_fifty_digits():
    assert errors("four_bar", ["BC"], 4, 2).max() < 1e-11


@pytest.mark.slow
@pytest.mark.parametrize(
    "name, parameters, order",
    [
        ("four_bar", ["AD", "AB", "BC", "CD", "tau"], 8),
        ("gear_pair", ["R1", "AB", "BC"], 4),  # offsets that follow from the starting guess
        ("rolling_disc", ["R", "rod"], 4),
        ("rsur", ["BC"], 1),  # angles about axes
    ],
)
def test_high_orders_in_fifty_digits(name, parameters, order):
    found = errors(name, parameters, order)
    assert found[:5].max() < 1e-11, found
    assert found.max() < 1e-9, found


@pytest.mark.slow
def test_the_travel_of_a_nut_by_the_lead_of_its_screw():
    """The advance is the lead times the turns, so that its derivative by the lead is the turns, and their rates."""
    time = np.array([0.0, 0.3, 0.8])

    def travel(lead):
        return jn.solve(screw(lead, "3*t + sin(2*t)"), time, order=1).outputs["p"][..., 2]

    turns = np.stack([3 * time + np.sin(2 * time), 3 + 2 * np.cos(2 * time)], axis=1) / (2 * np.pi)
    np.testing.assert_allclose(jax.jacfwd(travel)(0.01), turns, rtol=1e-11, atol=1e-13)


FOUR_BAR = jn.load(example("four_bar"))
TIME = [0.0, 0.4, 0.9]
BC = 0.1423


def jounce(BC, time=TIME, **options):
    return jn.solve(FOUR_BAR.with_parameters(BC=BC), time, order=2, **options).outputs["psi"][-1, 2]


@pytest.fixture(scope="module")
def slope():
    return jax.grad(jounce)(BC)


@pytest.mark.slow
def test_the_value_is_that_of_a_solution():
    value, _ = jax.value_and_grad(jounce)(BC)
    assert float(value) == pytest.approx(jounce(BC), rel=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize(
    "derivative",
    [
        lambda x: jax.jvp(jounce, (x,), (1.0,))[1],
        lambda x: jax.jacfwd(jounce)(x),
        lambda x: jax.jacrev(jounce)(x),
        lambda x: jax.vmap(jax.grad(jounce))(jnp.array([x, 0.143]))[0],
        lambda x: jax.jit(jax.vmap(jax.grad(jounce)))(jnp.array([x, 0.143]))[0],
        lambda x: jax.linearize(jounce, x)[1](1.0),
    ],
)
def test_all_transformations_tell_the_same(derivative, slope):
    assert float(derivative(BC)) == pytest.approx(float(slope), rel=1e-11)


@pytest.mark.slow
def test_second_derivatives():
    h = 1e-4
    slopes = [float(jax.grad(jounce)(BC + k * h)) for k in (-2, -1, 1, 2)]
    expected = np.dot(slopes, [1, -8, 8, -1]) / (12 * h)
    assert float(jax.hessian(jounce)(BC)) == pytest.approx(expected, rel=1e-8)


@pytest.mark.slow
def test_values_within_compiled_and_mapped_functions():
    assert float(jax.jit(jounce)(BC)) == pytest.approx(jounce(BC), rel=1e-14)
    found = jax.vmap(jounce)(jnp.array([BC, 0.143]))
    np.testing.assert_allclose(found, [jounce(BC), jounce(0.143)], rtol=1e-14)


@pytest.mark.slow
def test_points_and_lengths_that_are_no_parameters():
    def from_fields(values):
        rod = jn.planar.DoubleRevolute(("crank", "rocker"), [values[0], 0.0], [values[1], 0.0], values[2])
        changed = jn.Mechanism(
            space="planar",
            bodies=FOUR_BAR.bodies,
            joints={**FOUR_BAR.joints, "BC": rod},
            drivers=FOUR_BAR.drivers,
            outputs=FOUR_BAR.outputs,
            parameters=FOUR_BAR.parameters,
        )
        return jn.solve(changed, TIME, order=2).outputs["psi"][-1, 2]

    def from_parameters(values):
        return jn.solve(
            FOUR_BAR.with_parameters(**dict(zip(("AB", "CD", "BC"), values, strict=True))), TIME, order=2
        ).outputs["psi"][-1, 2]

    values = jnp.array([0.04, 0.2031, BC])
    np.testing.assert_allclose(jax.grad(from_fields)(values), jax.grad(from_parameters)(values), rtol=1e-11)


@pytest.mark.slow
def test_points_asked_for_later():
    def path(BC):
        motion = jn.solve(FOUR_BAR.with_parameters(BC=BC), TIME, order=2)
        return motion.point("rocker", [0.2031, 0.0]).data, motion.outputs["C"]

    later, output = jax.jacrev(path)(BC)
    assert later.shape == (3, 3, 2)
    np.testing.assert_allclose(later, output, rtol=1e-11, atol=1e-11)


@pytest.mark.slow
def test_a_design_that_cannot_be_assembled():
    with pytest.raises(jn.errors.AssemblyError, match=r"joints\.BC stays open"):
        jax.grad(jounce)(0.5)
    values, slopes = jax.vmap(jax.value_and_grad(jounce))(jnp.array([0.5, BC]))
    assert np.isnan(values).tolist() == [True, False]
    assert np.isfinite(slopes[1])


@pytest.mark.slow
def test_a_design_that_locks_on_the_way_is_not_a_number_from_there_on():
    def angles(AB):
        return jn.solve(FOUR_BAR.with_parameters(AB=AB), order=1, strict=False).outputs["psi"][:, 0]

    locked = np.isnan(jn.solve(FOUR_BAR.with_parameters(AB=0.1), order=1, strict=False).outputs["psi"][:, 0])
    values, slopes = jax.jvp(angles, (0.1,), (1.0,))
    assert 0 < locked.sum() < len(locked)
    assert (np.isnan(values) == locked).all()
    assert np.isfinite(slopes).all()
    assert (slopes[locked] == 0).all()
    total = jax.grad(lambda AB: jnp.nansum(angles(AB)))(0.1)
    assert float(total) == pytest.approx(float(slopes[~locked].sum()), rel=1e-10)


def test_what_is_not_traced_is_reported():
    with pytest.raises(jn.errors.UnsupportedError, match="next time derivative") as caught:
        jax.grad(lambda t: jounce(BC, [0.0, t]))(0.4)
    assert caught.value.name == "time[1]"
    grid = jn.TimeGrid(start=0, stop="tau", count=3)
    with pytest.raises(jn.errors.UnsupportedError, match="instants depend on values") as caught:
        jax.grad(lambda tau: jn.solve(FOUR_BAR.with_parameters(tau=tau), grid).outputs["psi"][-1, 1])(2.0)
    assert caught.value.name == "time"
    with pytest.raises(
        jn.errors.UnsupportedError, match=r"jn\.equations cannot yet be used with values that"
    ) as caught:
        jax.grad(lambda length: len(jn.equations(FOUR_BAR.with_parameters(BC=length))) * length)(BC)
    assert caught.value.name == "model.parameters.BC"
    with pytest.raises(jn.errors.UnsupportedError, match=r"jn\.retime cannot yet be used"):
        jax.grad(lambda length: jn.retime(FOUR_BAR.with_parameters(BC=length), limits={}).stop)(BC)


@pytest.mark.slow
def test_equations_along_a_traced_motion_are_refused():
    def right_side(length):
        motion = jn.solve(FOUR_BAR.with_parameters(BC=length), TIME, order=4)
        return jnp.sum(jn.constraint_equations(motion)["right_side"].data)

    with pytest.raises(jn.errors.UnsupportedError, match=r"jn\.constraint_equations cannot yet be used") as caught:
        jax.grad(right_side)(BC)
    assert caught.value.name == "motion.mechanism.parameters.BC"


@pytest.mark.slow
@pytest.mark.parametrize("transformed", [jax.grad, jax.jit])
def test_redundant_constraints_are_refused(transformed):
    twice = jn.Mechanism(
        space="planar",
        bodies={"crank": jn.Body([0, 0])},
        joints={name: jn.planar.Revolute(("ground", "crank"), ["a", 0], ["a", 0]) for name in ("one", "two")},
        drivers={"turn": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", "t")},
        outputs={"angle": jn.outputs.AngleOutput("crank")},
        parameters={"a": 0.1},
    )

    def angle(length):
        return jn.solve(twice.with_parameters(a=length), [0.0, 0.2], order=1).outputs["angle"][1, 1]

    with pytest.raises(jn.errors.MechanismError, match="gradients of mechanisms with redundant constraints"):
        transformed(angle)(0.1)


@pytest.mark.slow
@pytest.mark.parametrize("assembly", [1, 2])
def test_the_assembly_asked_for_is_differentiated(assembly):
    four_bar = dataclasses.replace(jn.load(example("four_bar")), assembly=assembly)

    def acceleration(length):
        return jn.solve(four_bar.with_parameters(BC=length), [0.0, 0.3], order=2).outputs["psi"][1, 2]

    step = 1e-5
    expected = (acceleration(0.1423 + step) - acceleration(0.1423 - step)) / (2 * step)
    np.testing.assert_allclose(jax.grad(acceleration)(0.1423), expected, rtol=1e-7)
