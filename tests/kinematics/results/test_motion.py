"""Results of a solved motion: outputs, dataset, points, angles and angular velocities of any body."""

import dataclasses

import numpy as np
import pytest

import jounce as jn
from jounce.kinematics.results.pose_outputs import output_series
from tests.problems.small import crank, four_bar, law, spindle

TIME = np.linspace(0.0, 1.0, 4)


@pytest.fixture(scope="module")
def planar():
    outputs = {
        "psi": jn.outputs.AngleOutput("rocker"),
        "C": jn.outputs.PointOutput("rocker", ["CD", 0]),
        "rate": jn.outputs.AngularVelocityOutput("rocker"),
        "rod": jn.outputs.DistanceOutput(("crank", "rocker"), ["AB", 0], ["CD", 0]),
        "between": jn.outputs.PlanarRelativeAngleOutput(("crank", "rocker")),
    }
    return jn.solve(dataclasses.replace(four_bar(), outputs=outputs), TIME)


@pytest.fixture(scope="module")
def spatial():
    return jn.solve(spindle(law(0.4, wave=1.0), axis=(1.0, 2.0, 2.0)), TIME)


@pytest.mark.slow
def test_dataset_has_names_dimensions_and_units(planar):
    dataset = planar.dataset
    assert dataset["psi"].dims == ("time", "derivative")
    assert dataset["C"].dims == ("time", "derivative", "component")
    assert dataset["component"].values.tolist() == ["x", "y"]
    assert [dataset[name].attrs["units"] for name in ("psi", "C", "rate", "rod")] == ["rad", "m", "rad/s", "m"]
    assert dataset["time"].attrs["units"] == "s"
    np.testing.assert_array_equal(dataset["time"], TIME)
    np.testing.assert_array_equal(dataset["C"].values, planar.outputs["C"])
    assert list(dataset["derivative"].values) == [0, 1, 2, 3, 4]


@pytest.mark.slow
def test_points_and_angles_asked_for_later_are_the_outputs(planar):
    np.testing.assert_allclose(planar.point("rocker", [0.2031, 0.0]).values, planar.outputs["C"], rtol=1e-13)
    np.testing.assert_allclose(planar.angle("rocker").values, planar.outputs["psi"], rtol=1e-13)
    np.testing.assert_allclose(planar.outputs["rate"][:, :4], planar.outputs["psi"][:, 1:], rtol=1e-12)
    np.testing.assert_allclose(
        planar.angular_velocity("rocker").values[:, :4], planar.outputs["psi"][:, 1:], rtol=1e-12
    )
    difference = planar.angle("rocker") - planar.angle("crank")
    np.testing.assert_allclose(planar.outputs["between"], difference, rtol=1e-12)
    assert planar.point("rocker", [0.0, 0.0]).dims == ("time", "derivative", "component")


def test_what_is_asked_later_of_another_body_and_at_more_instants_compiles_nothing(planar):
    """A program serves an output and an order, and treats the ground differently from moving bodies."""

    def count():
        return len(output_series.machine_code) + output_series.on_xla.jitted._cache_size()

    planar.point("crank", [0.04, 0.0])
    known, longer = count(), jn.solve(planar.mechanism, np.linspace(0.0, 1.0, 1100))
    found = longer.point("rocker", [0.2031, 0.0]).values
    assert count() == known
    np.testing.assert_allclose(found, longer.outputs["C"], rtol=1e-13, atol=1e-13)


def test_distance_of_the_ends_of_a_rod_stays(planar):
    scale = np.abs(planar.outputs["C"]).max(axis=(0, 2))
    assert (np.abs(planar.outputs["rod"] - [[0.1423, 0, 0, 0, 0]]).max(axis=0) < 1e-14 * (1 + scale)).all()


def test_a_point_of_the_ground_stands_still(planar):
    np.testing.assert_array_equal(planar.point("ground", [1.0, 2.0]).values[:, 0], np.tile([1.0, 2.0], (4, 1)))
    np.testing.assert_array_equal(planar.point("ground", [1.0, 2.0]).values[:, 1:], 0)


@pytest.mark.slow
def test_spatial_angular_velocity_in_both_frames(spatial):
    axis = np.array([1.0, 2.0, 2.0]) / 3
    rate = np.pi * np.cos(np.pi * TIME)
    for name, frame in (("spin", "global"), ("body_spin", "body")):
        np.testing.assert_allclose(spatial.outputs[name][:, 0], rate[:, None] * axis, atol=1e-13)
        asked = spatial.angular_velocity("spindle", frame).values
        np.testing.assert_allclose(asked[:, :4], spatial.outputs[name][:, :4], atol=1e-13)
    np.testing.assert_allclose(
        spatial.outputs["spin"][:, 1], -(np.pi**2) * np.sin(np.pi * TIME)[:, None] * axis, atol=1e-12
    )


@pytest.mark.slow
def test_relative_angle_asked_for_later(spatial):
    asked = spatial.evaluate(jn.outputs.RelativeAngleOutput(("ground", "spindle"), [1.0, 2.0, 2.0]))
    np.testing.assert_allclose(asked.values, spatial.outputs["angle"], atol=1e-12)


@pytest.mark.slow
def test_points_are_consistent_with_the_angular_velocity(spatial):
    """v = w x r for a body on a fixed axis through the origin."""
    point, spin = spatial.point("spindle", [0.3, -0.2, 0.5]).values, spatial.outputs["spin"]
    np.testing.assert_allclose(point[:, 1], np.cross(spin[:, 0], point[:, 0]), atol=1e-13)
    acceleration = np.cross(spin[:, 1], point[:, 0]) + np.cross(spin[:, 0], point[:, 1])
    np.testing.assert_allclose(point[:, 2], acceleration, atol=1e-12)


@pytest.mark.slow
def test_no_outputs_at_all():
    motion = jn.solve(crank("t", outputs={}), [0.0, 1.0])
    assert motion.outputs == {}
    assert list(motion.dataset.data_vars) == []
    assert motion.point("crank", [1.0, 0.0]).shape == (2, 5, 2)


def test_order_zero_has_positions_only():
    motion = jn.solve(crank("t"), [0.0, 1.0], order=0)
    assert motion.outputs["tip"].shape == (2, 1, 2)
    assert motion.outputs["angle"].shape == (2, 1)
    assert motion.order == 0


@pytest.mark.parametrize(
    "ask, message",
    [
        (lambda m: m.point("rocket", [0.0, 0.0]), "did you mean 'rocker'"),
        (lambda m: m.point("rocker", [0.0, 0.0, 0.0]), "vector of 2 numbers"),
        (lambda m: m.point("rocker", [0.0, np.nan]), "finite"),
        (lambda m: m.angle("nobody"), "no body has this name"),
        (lambda m: m.angular_velocity("rocker", "globe"), "unknown frame"),
        (lambda m: m.evaluate(jn.outputs.RelativeAngleOutput(("crank", "rocker"), [0, 0, 1])), "spatial"),
    ],
)
def test_what_cannot_be_asked_for(planar, ask, message):
    with pytest.raises(jn.errors.MechanismError, match=message):
        ask(planar)


@pytest.mark.slow
def test_planar_angle_of_a_spatial_body(spatial):
    with pytest.raises(jn.errors.MechanismError, match="planar"):
        spatial.angle("spindle")


def test_outputs_are_read_only_as_the_motion_uses_them():
    motion = jn.solve(four_bar(), np.linspace(0.0, 0.2, 3), order=1)
    before = {name: values.copy() for name, values in motion.outputs.items()}
    for name, values in motion.outputs.items():
        with pytest.raises(ValueError, match="read-only"):
            values[1] = 7.0
        with pytest.raises(ValueError, match="read-only"):
            values *= 1000.0
        np.testing.assert_array_equal(motion.outputs[name], before[name])
        np.testing.assert_array_equal(motion.dataset[name].values, before[name])
        with pytest.raises(ValueError, match=r"read-only|is a view"):
            motion.dataset[name][1] = 7.0
        assert np.array(values).flags.writeable
    again = jn.solve(four_bar(), np.linspace(0.0, 0.2, 3), order=1)
    assert all(np.array_equal(motion.outputs[name], again.outputs[name]) for name in before)
