"""What is no array of real numbers is refused at every door, and durations are seconds where times are meant."""

import datetime

import jax
import numpy as np
import pint
import pytest
import xarray

import jounce as jn
from jounce.base.shapes import real_numbers, seconds
from tests.problems.small import four_bar

MECHANISM = four_bar()
ROD = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 12, 1 / 12])
SLOW = jn.Limits(velocity=1.0, acceleration=1.0)
ROBOT = jn.Robot("two", [jn.Link("base"), jn.Link("rod", ROD), jn.Link("end", ROD)], [
    jn.Joint("a", "base", "rod", limits=SLOW), jn.Joint("b", "rod", "end", position=[1.0, 0, 0], limits=SLOW),
])  # fmt: skip
TRAJECTORY = jn.JointTrajectory({"a": "t", "b": "t**2"}, 0.0, 2.0)
TIMES = np.linspace(0.0, 1.0, 8)
STILL = jn.Jet([np.zeros(2)])
PLANAR = jn.rigid.PlanarPose.from_jets(STILL, STILL[0])
SPATIAL = jn.rigid.SpatialPose.at(np.zeros(3), np.array([1.0, 0, 0, 0]))
UNITS = pint.UnitRegistry()


def column(values):
    """Return values with a second column of zeros, as two joints need them."""
    if isinstance(values, list):
        return [[value, 0.0] for value in values]
    if isinstance(values, xarray.DataArray):
        return values.expand_dims({"joint": 2}, axis=1)
    return (np.ma if isinstance(values, np.ma.MaskedArray) else np).stack([values, values], axis=1)


PARAMETER = next(iter(MECHANISM.parameters))
TIME_DOORS = {
    "solve": lambda t: jn.solve(MECHANISM, t, order=1).time,
    "samples of a law": lambda t: jn.laws.SplineMotion(t, TIMES).samples.value[0],
    "knots": lambda t: jn.laws.HermiteMotion(t, np.zeros((8, 3))) and None,
    "instants of a trajectory": lambda t: jn.JointTrajectory({"a": "t"}, 0.0, 1.0, t).times,
    "samples of a trajectory": lambda t: jn.JointTrajectory.from_samples(t, column(TIMES), ["a", "b"]).times,
    "derivatives of a trajectory": lambda t: TRAJECTORY.derivatives(t, 1)[:, 0, 0],
    "torques of a trajectory": lambda t: jn.dynamics.trajectory_torques(ROBOT, TRAJECTORY, times=t)["time"].values,
    "limits": lambda t: jn.check_limits(ROBOT, TRAJECTORY, times=t) and None,
    "attitudes": lambda t: jn.rigid.AttitudeSamples(t, np.tile([1.0, 0, 0, 0], (8, 1))) and None,
    "simulation of a robot": lambda t: jn.simulate(ROBOT, t, order=2, state=np.zeros((2, 2))).time,
    "jet of time": lambda t: jn.Jet.variable(t, 2).coefficients[0],
    "tool path": lambda t: jn.planning.ToolPath.through(t, np.stack([TIMES, TIMES, TIMES], axis=1)) and None,
}
NUMBER_DOORS = {
    "parameters of a batch": lambda x: jn.solve_batch(MECHANISM, {PARAMETER: x}, [0.0], order=0),
    "samples of a law": lambda x: jn.laws.SplineMotion(TIMES, x),
    "samples of a trajectory": lambda x: jn.JointTrajectory.from_samples(TIMES, column(x), ["a", "b"]),
    "positions": lambda x: jn.mass_matrix(ROBOT, x[:2]),
    "coordinates": lambda x: jn.inverse_dynamics(ROBOT, column(x)[:3]),
    "bias": lambda x: jn.bias_forces(ROBOT, column(x)[:2]),
    "torques": lambda x: jn.forward_dynamics(ROBOT, np.zeros((2, 2)), column(x)[:1]),
    "state": lambda x: jn.forward_dynamics(ROBOT, column(x)[:2], np.zeros((1, 2))),
    "state of a simulation": lambda x: jn.simulate(ROBOT, [0.0, 0.1], state=column(x)[:2]),
    "energies": lambda x: jn.energy.kinetic_energy(ROBOT, column(x)[:2]),
    "waypoints": lambda x: jn.retime(ROBOT, column(x)),
    "point": lambda x: jn.forward_kinematics(ROBOT, np.zeros((1, 2)), "end", x[:3]),
    "mass": lambda x: jn.Inertia(1.0, center_of_mass=x[:3]),
    "origin of a joint": lambda x: jn.Joint("a", "base", "rod", position=x[:3]),
    "derivatives": lambda x: jn.Jet.from_derivatives(x),
    "goal": lambda x: jn.inverse_kinematics(ROBOT, "end", x[:3]),
    "constant": lambda x: jn.Jet.constant(x, 2),
    "turn": lambda x: jn.rigid.simple_rotation("z", x),
    "angles": lambda x: jn.rigid.rotation_matrix("XYZ", x[:3]),
    "one of three angles": lambda x: jn.rigid.rotation_matrix("XYZ", [x, jn.Jet.constant(TIMES, 1), TIMES]),
    "axis": lambda x: jn.rigid.rotation_about(x[:3], 0.1),
    "angle about an axis": lambda x: jn.rigid.rotation_about([0, 0, 1], x),
    "transfer matrix": lambda x: jn.rigid.transfer_matrix("XYZ", x[:3]),
    "angular velocity": lambda x: jn.rigid.angle_rates("XYZ", [0.1, 0.2, 0.3], x[:3]),
    "orientation": lambda x: jn.rigid.singularity_distance("XYZ", x[:3]),
    "attitude": lambda x: jn.rigid.euler_angles("XYZ", x[:3]),
    "point of a screw": lambda x: jn.rigid.ScrewAxis([0, 0, 1], x[:3]),
    "coordinate of a screw": lambda x: jn.rigid.ScrewAxis([0, 0, 1]).transform(x),
    "coordinates of screws": lambda x: jn.rigid.product_of_exponentials([jn.rigid.ScrewAxis([0, 0, 1])] * 2, x[:2]),
    "home": lambda x: jn.rigid.product_of_exponentials([jn.rigid.ScrewAxis([0, 0, 1])], [0.1], x[:4]),
    "vector of the plane": lambda x: jn.rigid.perpendicular(x[:2]),
    "vector of a planar pose": lambda x: PLANAR.to_body(x[:2]),
    "point of a planar body": lambda x: PLANAR.point(x[:2]),
    "point of a spatial body": lambda x: SPATIAL.point(x[:3]),
    "vector of a spatial pose": lambda x: SPATIAL.to_body(x[:3]),
    "pose": lambda x: jn.rigid.SpatialPose.at(x[:3], np.array([1.0, 0, 0, 0])),
    "attitude of a pose": lambda x: jn.rigid.SpatialPose.at(np.zeros(3), x[:4]),
    "axes of a body": lambda x: jn.rigid.body_axes(x[:4]),
    "point to point": lambda x: jn.JointTrajectory.point_to_point(["a", "b"], x[:2], [1.0, 1.0], duration=1.0),
}  # fmt: skip
SINGLE_DOORS = {
    "parameter": lambda x: MECHANISM.with_parameters(**{PARAMETER: x}).parameter_values,
    "coordinate": lambda x: ROBOT.coordinates(a=x),
    "limit": lambda x: jn.Limits(velocity=x),
    "law": lambda x: jn.JointTrajectory({"a": x}, 0.0, 1.0),
    "end of a profile": lambda x: jn.laws.motion_profile("cycloidal", 0.0, x, 1.0),
    "position of a body": lambda x: jn.solve(
        jn.Mechanism(space="planar", bodies={"a": jn.Body([x, 0.0])}, joints={}), [0.0], order=0
    ),
}  # fmt: skip
NO_NUMBERS = {
    "masked": np.ma.array(TIMES, mask=TIMES > 0.5),
    "text": list(map(str, TIMES)),
    "array of text": TIMES.astype(str),
    "truth values": TIMES > 0.5,
    "complex": TIMES + 0j,
    "dates": np.datetime64("2024-01-01") + np.arange(8),
    "records": np.array([(t, t) for t in TIMES], [("a", float), ("b", float)]),
    "objects": np.array([*TIMES[:-1], "1"], object),
    "degrees": xarray.DataArray(TIMES, attrs={"units": "deg"}),
}
DURATIONS = {
    "milliseconds": (1000 * TIMES * 7).round().astype("timedelta64[ms]"),
    "nanoseconds": (1e9 * TIMES * 7).round().astype("timedelta64[ns]"),
    "of Python": [datetime.timedelta(seconds=float(k)) for k in range(8)],
    "quantity": UNITS.Quantity(1000.0 * np.arange(8), "ms"),
}


@pytest.mark.parametrize("kind", NO_NUMBERS)
@pytest.mark.parametrize("door", [*TIME_DOORS, *NUMBER_DOORS])
def test_what_is_no_array_of_numbers_is_refused(door, kind):
    enter = TIME_DOORS.get(door) or NUMBER_DOORS[door]
    values = NO_NUMBERS[kind]
    if door in NUMBER_DOORS and kind in ("masked", "objects"):
        values = values[::-1]  # some doors take the first few
    with pytest.raises((jn.JounceError, ValueError), match=r"must be|durations"):
        enter(values)


@pytest.mark.parametrize("door", NUMBER_DOORS)
def test_durations_are_no_other_numbers(door):
    with pytest.raises((jn.JounceError, ValueError), match="durations"):
        NUMBER_DOORS[door](DURATIONS["milliseconds"])


@pytest.mark.parametrize("given", DURATIONS)
@pytest.mark.parametrize("door", TIME_DOORS)
def test_durations_are_seconds_where_times_are_meant(door, given):
    if door in ("torques of a trajectory", "derivatives of a trajectory", "limits", "instants of a trajectory"):
        values = DURATIONS[given] / 7 if given != "of Python" else [x / 7 for x in DURATIONS[given]]
        scale = 1 / 7
    else:
        values, scale = DURATIONS[given], 1.0
    found = TIME_DOORS[door](values)
    if found is not None:
        np.testing.assert_allclose(found, scale * np.arange(8), rtol=0, atol=1e-3 if scale < 1 else 1e-15)


@pytest.mark.parametrize("value", [np.timedelta64(5, "ms"), True, np.True_, "a", 1j, np.ma.masked, [1.0]], ids=repr)
@pytest.mark.parametrize("door", SINGLE_DOORS)
def test_what_is_no_number_is_refused(door, value):
    with pytest.raises((jn.JounceError, TypeError)):  # the second by the check of types while tests run
        SINGLE_DOORS[door](value)


def test_a_grid_may_be_given_by_durations():
    grid = jn.TimeGrid(np.timedelta64(0, "ms"), datetime.timedelta(seconds=1), step=np.timedelta64(250, "ms"))
    assert jn.solve(MECHANISM, grid, order=0).time.tolist() == [0.0, 0.25, 0.5, 0.75, 1.0]


@pytest.mark.parametrize("read", [real_numbers, seconds])
def test_numbers_of_every_kind_are_taken(read):
    for given in ([1, 2.0], (np.float32(1), 2), np.array([1, 2]), np.ma.array([1, 2]), np.array([1, 2.0], object),
                  xarray.DataArray([1.0, 2.0], attrs={"units": "m s-1"}), range(1, 3)):  # fmt: skip
        found = read("x", given, ValueError)
        assert found.dtype == float
        assert found.tolist() == [1.0, 2.0]


def test_a_missing_duration_is_reported():
    with pytest.raises(jn.errors.MechanismError, match="or is missing"):
        jn.solve(MECHANISM, np.array([0, "NaT"], "timedelta64[s]"), order=0)


def test_a_quantity_that_is_no_time_is_refused():
    with pytest.raises(jn.errors.MechanismError, match="have the unit meter, which is not a unit of time"):
        jn.solve(MECHANISM, UNITS.Quantity([0.0, 1.0], "m"), order=0)


def test_jets_and_rotations_take_what_jax_traces():
    def tip(angle):
        turn = jn.rigid.rotation_about([0.0, 0.0, angle], angle) @ np.array([1.0, 0.0, 0.0])
        return turn[1] + jn.rigid.rotation_matrix("XYZ", [angle, 0.0, 0.0])[2, 1] + jn.Jet.constant(angle, 1)

    slope = jax.jit(jax.grad(lambda angle: tip(angle).coefficients[0]))(0.3)
    assert slope == pytest.approx(1 + 2 * np.cos(0.3), abs=1e-14)
