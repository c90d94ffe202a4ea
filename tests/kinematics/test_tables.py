"""Results as datasets with a variable for each derivative, and as pandas tables, with units that pint reads."""

import numpy as np
import pint
import pytest

import jounce as jn


@pytest.fixture(scope="module")
def motion():
    return jn.solve(jn.load("examples/four_bar.yaml"), np.linspace(0.0, 2.0, 5), order=3)


def test_split_derivatives_have_their_own_units(motion):
    split = motion.to_dataset(derivatives="split")
    np.testing.assert_array_equal(split["psi_d3"], motion.outputs["psi"][:, 3])
    np.testing.assert_array_equal(split["C_d1"].transpose("time", "component"), motion.outputs["C"][:, 1])
    assert split["C_d1"].attrs == {"units": "m/s", "long_name": "derivative 1 of C"}
    assert "derivative" not in split.dims
    assert split.attrs == motion.dataset.attrs
    registry = pint.UnitRegistry()
    for name, variable in split.data_vars.items():
        order = int(name.rpartition("_d")[2]) if "_d" in name else 0
        base = registry.rad if name.startswith("psi") else registry.m
        assert registry.Unit(variable.attrs["units"]) == base / registry.s**order


def test_the_unit_of_a_derivative_goes_with_it(motion):
    chosen = motion.to_dataset()["psi"].sel(derivative=3)
    assert str(chosen["derivative_unit"].values) == "1/s^3"
    with pytest.raises(jn.errors.MechanismError, match="did you mean 'split'"):
        motion.to_dataset(derivatives="splitt")


def test_a_data_frame_has_the_columns_of_a_csv_file_and_units(motion, tmp_path):
    frame = motion.to_dataframe()
    jn.io.write(motion.dataset, tmp_path / "motion.csv")
    header = (tmp_path / "motion.csv").read_text().partition("\n")[0].strip().split(",")
    assert [frame.index.name, *frame.columns.get_level_values("quantity")] == header
    assert frame["C_y_d2"].columns.tolist() == ["m/s^2"]
    np.testing.assert_array_equal(frame["C_y_d2"]["m/s^2"], motion.outputs["C"][:, 2, 1])
    np.testing.assert_array_equal(frame.index, motion.time)


@pytest.mark.slow
def test_a_batch_of_simulations_has_the_dataset_of_a_family():
    pendulum = jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        parameters={"lift": 0.1},
        bodies={"rod": jn.Body([0, 0], mass=2.0, inertia=0.5, center_of_mass=[1, 0])},
        joints={"O": jn.planar.Revolute(("ground", "rod"), [0, 0], [0, 0])},
        initial={"rise": jn.drivers.CoordinateDriver(("ground", "rod"), "angle", motion="lift")},
        outputs={"angle": jn.outputs.AngleOutput("rod"), "tip": jn.outputs.PointOutput("rod", [1, 0])},
    )
    batch = jn.simulate_batch(pendulum, {"lift": [0.1, 0.2]}, [0.0, 0.5], order=2)
    family = jn.solve_batch(jn.load("examples/four_bar.yaml"), {"BC": [0.14, 0.15]}, [0.0, 0.1], order=2)
    assert batch.dataset["tip"].dims == ("run", "time", "derivative", "component")
    assert family["C"].dims == ("design", "time", "derivative", "component")
    assert batch.dataset["lift"].values.tolist() == [0.1, 0.2]
    assert batch.dataset["status"].attrs == family["status"].attrs
    np.testing.assert_array_equal(batch.dataset["angle"], batch.outputs["angle"])
