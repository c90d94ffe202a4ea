"""Families of designs, compared with the same designs solved one by one."""

import dataclasses

import numpy as np
import pandas
import pytest

import jounce as jn
from tests.problems.mechanisms import example

FOUR_BAR = jn.load(example("four_bar"))
TIME = np.linspace(0.0, 2.0, 9)


def check(mechanism, parameters, family, time, order, error=1e-12):
    """Compare a family with its designs one by one: every output, derivative and status."""
    for k in range(family.sizes["design"]):
        values = {name: float(given[k]) for name, given in parameters.items()}
        single = jn.solve(mechanism.with_parameters(**values), time, order=order, strict=False)
        np.testing.assert_array_equal(family["status"].values[k], single.status)
        for name, expected in single.outputs.items():
            found = family[name].values[k].reshape(expected.shape)
            others = tuple(k for k in range(expected.ndim) if k != 1)
            size = np.nan_to_num(np.abs(expected)).max(axis=others, keepdims=True)  # of each derivative
            np.testing.assert_allclose(found / (size + 1e-300), expected / (size + 1e-300), atol=error, rtol=0)


@pytest.mark.slow
def test_designs_are_those_solved_alone():
    parameters = {"BC": np.linspace(0.125, 0.16, 5), "tau": np.linspace(1.8, 2.2, 5)}
    family = jn.solve_batch(FOUR_BAR, parameters, TIME, order=2)
    check(FOUR_BAR, parameters, family, TIME, 2)
    assert dict(family["C"].sizes) == {"design": 5, "time": 9, "derivative": 3, "component": 2}
    np.testing.assert_array_equal(family["tau"], parameters["tau"])
    assert family["psi"].attrs["units"] == "rad"
    assert family["tau"].dims == ("design",)


@pytest.mark.slow
def test_no_array_takes_the_name_of_another():
    parameters = {**FOUR_BAR.parameters, "psi": 1.0, "time": 2.0}
    named = dataclasses.replace(FOUR_BAR, parameters=parameters)
    family = jn.solve_batch(named, {"psi": [1.0, 3.0], "time": [2.0, 4.0], "BC": [0.14, 0.15]}, [0.0], order=0)
    assert family["psi"].dims == ("design", "time", "derivative")
    np.testing.assert_array_equal(family["parameter_psi"], [1.0, 3.0])
    np.testing.assert_array_equal(family["parameter_time"], [2.0, 4.0])
    np.testing.assert_array_equal(family["time"], [0.0])
    for name in ("status", "design"):
        other = dataclasses.replace(FOUR_BAR, outputs={name: FOUR_BAR.outputs["psi"]})
        with pytest.raises(jn.errors.MechanismError, match=f"name '{name}' is that of an array of a family"):
            jn.solve_batch(other, {"BC": [0.14, 0.15]}, [0.0], order=0)


@pytest.mark.slow
def test_one_that_locks_or_cannot_be_assembled_stops_no_other():
    parameters = {"AB": np.array([0.04, 0.1, 0.05, 0.9])}
    family = jn.solve_batch(FOUR_BAR, parameters, TIME, order=2)
    check(FOUR_BAR, {"AB": parameters["AB"][:3]}, family.isel(design=slice(3)), TIME, 2)
    status = family["status"].values
    assert not status[[0, 2]].any()
    assert status[1].any()
    assert not status[1].all()
    assert (status[3] == jn.Status.NOT_ASSEMBLED).all()
    assert np.isnan(family["psi"].values[3]).all()


@pytest.mark.slow
def test_bad_designs_are_reported():
    with pytest.raises(jn.errors.MechanismError, match=r"greater than zero.*design 1: BC = -0\.14"):
        jn.solve_batch(FOUR_BAR, {"BC": [0.14, -0.14]}, TIME, order=2)
    with pytest.raises(jn.errors.MechanismError, match="one for each design"):
        jn.solve_batch(FOUR_BAR, {"BC": [0.14, np.nan]}, TIME)
    with pytest.raises(jn.errors.MechanismError, match="no parameter has this name"):
        jn.solve_batch(FOUR_BAR, {"BCD": [0.14]}, TIME)
    with pytest.raises(jn.errors.MechanismError, match="one value for each design, 2 as"):
        jn.solve_batch(FOUR_BAR, {"BC": [0.14, 0.15], "AB": [0.04]}, TIME)


def test_labels_of_values_in_another_order_are_refused():
    mechanism = jn.load(example("four_bar"))
    lengths = pandas.Series([0.2031, 0.21], index=["one", "two"])
    coupler = pandas.Series([0.15, 0.1423], index=["two", "one"])
    for values in (coupler, coupler.to_xarray()):
        with pytest.raises(jn.errors.MechanismError, match=r"parameters\.BC: has the labels .* in another order"):
            jn.solve_batch(mechanism, {"CD": lengths, "BC": values}, [0.0, 0.5], order=1)
    found = jn.solve_batch(mechanism, {"CD": lengths, "BC": coupler[["one", "two"]]}, [0.0, 0.5], order=1)
    plain = jn.solve_batch(mechanism, {"CD": [0.2031, 0.21], "BC": [0.1423, 0.15]}, [0.0, 0.5], order=1)
    np.testing.assert_array_equal(found["psi"], plain["psi"])


def test_the_columns_of_a_table_are_parameters():
    mechanism = jn.load(example("four_bar"))
    table = pandas.DataFrame({"CD": [0.2031, 0.21], "BC": [0.1423, 0.15]}, index=["one", "two"])
    found, plain = (jn.solve_batch(mechanism, x, [0.0, 0.5], order=1) for x in (table, table.to_dict("list")))
    np.testing.assert_array_equal(found["psi"], plain["psi"])
    for given in ([{"BC": 0.14}], table.to_numpy(), None):
        with pytest.raises(jn.errors.MechanismError, match="parameters: must be a dict of lists by the name"):
            jn.solve_batch(mechanism, given, [0.0, 0.5])
    with pytest.raises(jn.errors.MechanismError, match=r"parameters: the table has a column twice, got 'BC, BC'"):
        jn.solve_batch(mechanism, table[["BC", "BC"]], [0.0, 0.5])


@pytest.mark.slow
def test_one_instant_and_one_design():
    family = jn.solve_batch(FOUR_BAR, {"BC": [0.14]}, [0.3], order=2)
    check(FOUR_BAR, {"BC": [0.14]}, family, [0.3], 2)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name, parameter",
    [
        ("gear_pair", "AB"),  # offsets that follow from a guess that differs
        ("six_bar_watt", None),
        ("rsur", "BC"),  # angles about axes
    ],
)
def test_kinds_of_mechanisms(name, parameter):
    mechanism = jn.load(example(name))
    numbers = {key: value for key, value in mechanism.parameters.items() if not isinstance(value, str)}
    key = parameter or next(iter(numbers))
    parameters = {key: mechanism.parameter_values[key] * np.linspace(0.995, 1.005, 4)}
    time = np.linspace(0.0, 1.5, 7)
    check(mechanism, parameters, jn.solve_batch(mechanism, parameters, time, order=2), time, 2, 1e-11)


@pytest.mark.slow
def test_a_change_point_on_the_way_is_passed_as_alone():
    mechanism = jn.load(example("four_bar"))
    parameters = {"AB": np.array([0.04, 0.0713])}  # AB + CD = AD + BC: the bars come to lie in one line
    time = np.linspace(0.0, 2.0, 41)
    check(mechanism, parameters, jn.solve_batch(mechanism, parameters, time, order=2), time, 2, 1e-9)


@pytest.mark.slow
def test_more_designs_than_go_side_by_side(monkeypatch):
    monkeypatch.setattr("jounce.kinematics.families.design_paths.MOST_TOGETHER", 16)
    parameters = {"BC": np.linspace(0.125, 0.16, 37)}
    family = jn.solve_batch(FOUR_BAR, parameters, TIME, order=1, threads=1)
    check(FOUR_BAR, parameters, family, TIME, 1)
    again = jn.solve_batch(FOUR_BAR, parameters, TIME, order=1, threads=2)
    assert family.identical(again)


@pytest.mark.slow
@pytest.mark.parametrize("native", ["0", "1"])
def test_either_back_end_solves_designs_as_alone(monkeypatch, native):
    """A parameter on which nothing depends gives lanes without individual values."""
    monkeypatch.setenv("JOUNCE_NATIVE", native)
    named = dataclasses.replace(FOUR_BAR, parameters={**FOUR_BAR.parameters, "unused": 1.0})
    time = np.linspace(0.0, 2.0, 41)
    for parameters in ({"AB": np.linspace(0.03, 0.05, 11)}, {"unused": np.array([1.0, 2.0])}):
        family = jn.solve_batch(named, parameters, time, order=3)
        assert family.attrs["backend"] == ("xla" if native == "0" else "llvm")
        check(named, parameters, family, time, 3)


@pytest.mark.slow
def test_forces_and_energies_are_those_of_designs_alone():
    arm = jn.Mechanism(
        space="planar",
        gravity=[0, -10.0],
        parameters={"m": 2.0, "c": 0.5},
        bodies={"arm": jn.Body([0, 0], mass="m", center_of_mass=["c", 0])},
        joints={"O": jn.planar.Revolute(("ground", "arm"), [0, 0], [0, 0])},
        drivers={"turn": jn.drivers.CoordinateDriver(("ground", "arm"), "angle", motion="3*t")},
        outputs={"torque": jn.outputs.DriverTorqueOutput("turn"), "angle": jn.outputs.AngleOutput("arm")},
    )
    family = jn.solve_batch(arm, {"m": [1.0, 2.0, 3.0], "c": [0.1, 0.2, 0.3]}, [0.0, 0.2], order=1)
    m, c = family["m"].values[:, None], family["c"].values[:, None]
    expected = m * c * 10.0 * np.cos(3 * family["time"].values)
    np.testing.assert_allclose(family["torque"].values[..., 0], expected, rtol=1e-12)


@pytest.mark.slow
def test_redundant_constraints_and_assemblies_are_those_of_designs_alone():
    bennett = jn.load(example("bennett"))
    bennett = dataclasses.replace(bennett, outputs={"C": bennett.outputs["C"]})  # none of forces
    crossed = dataclasses.replace(FOUR_BAR, assembly=2)
    for mechanism, parameters in ((bennett, {"a": np.array([0.1, 0.12])}), (crossed, {"BC": np.array([0.14, 0.15])})):
        family = jn.solve_batch(mechanism, parameters, TIME[:3], order=1)
        assert not family["status"].values.any()
        check(mechanism, parameters, family, TIME[:3], 1)
