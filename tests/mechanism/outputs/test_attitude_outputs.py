"""Attitudes as outputs: Euler parameters, rotation matrices and Euler angles, with all derivatives."""

import itertools
import math

import numpy as np
import pytest
from mpmath import mp
from scipy.spatial.transform import Rotation

import jounce as jn
from jounce.jet import Jet
from jounce.rigid import SpatialPose
from jounce.rigid.rotations import SEQUENCES

pytestmark = pytest.mark.long

ORDER = 4
SOLVED = 2  # of motions


def pose_of(sequence, angles):
    """Return a pose of shape (1, batch) that turns by jets of angles, (3, batch); by the matrix, not by the angles."""
    matrix = jn.rigid.rotation_matrix(sequence, angles)
    w = jn.rigid.angular_velocity(matrix, "body").map(lambda c: c[:, None])
    first = np.moveaxis(np.asarray(matrix.coefficients[0]), -1, 0)
    quaternion = Rotation.from_matrix(first).as_quat(scalar_first=True).T[:, None]
    place = Jet.constant(np.zeros((3, 1, quaternion.shape[-1])), ORDER).dense()
    return SpatialPose.from_coordinates({"position": place, "quaternion": Jet([quaternion]), "angular_velocity": w})


def coefficients(jet):
    return np.stack(jet.dense().coefficients)


@pytest.mark.parametrize("sequence", SEQUENCES)
def test_angles_of_every_sequence_come_back_with_their_derivatives(sequence):
    random = np.random.default_rng(0)
    values = random.uniform(-1, 1, size=(ORDER + 1, 3, 4))
    values[0] *= [[3.0], [1.2], [3.0]]
    if sequence[0] == sequence[2]:
        values[0, 1] += math.pi / 2
    pose = pose_of(sequence, Jet(list(values)))
    found = coefficients(jn.outputs.EulerAnglesOutput("b", sequence).evaluate(pose))[:, :, 0]
    np.testing.assert_allclose(found, values, rtol=0, atol=2e-12)
    first = Rotation.from_quat(np.asarray(pose.quaternion.coefficients[0])[:, 0].T, scalar_first=True)
    np.testing.assert_allclose(found[0].T, first.as_euler(sequence), rtol=0, atol=1e-14)


def test_relative_attitudes_are_those_of_the_frames():
    random = np.random.default_rng(1)
    one, two = (pose_of("ZYX", Jet(list(random.uniform(-1, 1, size=(ORDER + 1, 3, 4))))) for _ in range(2))
    A, B = (np.array([np.asarray(c) for c in pose.attitude.dense().coefficients])[..., 0, :] for pose in (one, two))
    expected = [sum(np.einsum("jib,jkb->ikb", A[m], B[k - m]) for m in range(k + 1)) for k in range(ORDER + 1)]
    pair = ("a", "b")
    matrix = coefficients(jn.outputs.RelativeRotationMatrixOutput(pair).evaluate(one, two))[:, :, 0]
    np.testing.assert_allclose(matrix.reshape(ORDER + 1, 3, 3, -1), expected, rtol=0, atol=1e-13)
    parameters = coefficients(jn.outputs.RelativeEulerParametersOutput(pair).evaluate(one, two))[:, :, 0]
    of = Rotation.from_quat(parameters[0].T, scalar_first=True).as_matrix()
    np.testing.assert_allclose(np.moveaxis(of, 0, -1), expected[0], rtol=0, atol=1e-14)
    angles = jn.outputs.RelativeEulerAnglesOutput(pair, "xzy").evaluate(one, two)
    again = jn.rigid.rotation_matrix("xzy", angles)
    np.testing.assert_allclose(coefficients(again)[..., 0, :], expected, rtol=0, atol=1e-12)
    single = coefficients(jn.outputs.RotationMatrixOutput("b").evaluate(two))[:, :, 0]
    np.testing.assert_allclose(single.reshape(B.shape), B, rtol=0, atol=1e-15)


LAWS = {"alpha": "0.3 + 7*t", "beta": "b0 + b1*t + b2*sin(2*t)", "gamma": "0.5 + c1*t + c2*t**2"}
SWINGING = {"b0": 1.2, "b1": 0.0, "b2": 0.4, "c1": -5.0, "c2": 0.2}
OUTPUTS = {
    "angles": jn.outputs.EulerAnglesOutput("rotor", "ZXZ"),
    "p": jn.outputs.EulerParametersOutput("rotor"),
    "A": jn.outputs.RotationMatrixOutput("rotor"),
    "by_pin": jn.outputs.RelativeEulerAnglesOutput(("outer", "rotor"), "XYZ"),
}


def gimbal(**parameters):
    """Return three bodies in a chain, whose pins turn by Euler angles of the sequence ZXZ."""
    axes = {"alpha": [0, 0, 1.0], "beta": [1.0, 0, 0], "gamma": [0, 0, 1.0]}
    bodies = ["ground", "outer", "inner", "rotor"]
    pairs = dict(zip(axes, itertools.pairwise(bodies), strict=True))
    pins = {
        name: jn.spatial.Revolute(pairs[name], [0, 0, 0], [0, 0, 0], axis_i=axis, axis_j=axis)
        for name, axis in axes.items()
    }
    return jn.Mechanism(
        space="spatial",
        bodies={name: jn.Body([0, 0, 0]) for name in bodies[1:]},
        joints={f"pin_{name}": pin for name, pin in pins.items()},
        drivers={n: jn.drivers.RotationDriver(pairs[n], axis, motion=LAWS[n]) for n, axis in axes.items()},
        outputs=OUTPUTS,
        parameters=SWINGING | parameters,
    )


def derivatives(name, t):
    """Return the derivatives of a law of `LAWS`, 0 to SOLVED."""
    a, b = [0.3 + 7 * t, 7, 0], [0.5 - 5 * t + 0.2 * t**2, -5 + 0.4 * t, 0.4]
    wave = [1.2 * (k == 0) + 0.4 * 2**k * np.sin(2 * t + k * np.pi / 2) for k in range(SOLVED + 1)]
    return np.array({"alpha": a, "beta": wave, "gamma": b}[name], float)


@pytest.fixture(scope="module")
def turning():
    return jn.solve(gimbal(), [0.0, 0.7, 1.0, 2.9, 3.1], order=SOLVED)


@pytest.mark.slow
def test_angles_are_the_laws_of_the_drivers_over_turns_between_instants(turning):
    """Steps of up to two turns: instants alone would not tell how many."""
    assert turning.outputs["angles"].shape == (5, SOLVED + 1, 3)
    for k, t in enumerate(turning.time):
        expected = np.stack([derivatives(name, t) for name in LAWS], axis=1)
        np.testing.assert_allclose(turning.outputs["angles"][k], expected, rtol=0, atol=1e-10)


@pytest.mark.slow
def test_euler_parameters_go_on_with_their_sign_and_have_their_derivatives(turning):
    def parameters(t):
        a, b, c = 0.3 + 7 * t, 1.2 + 0.4 * mp.sin(2 * t), 0.5 - 5 * t + 0.2 * t**2
        s, d = (a + c) / 2, (a - c) / 2
        return [
            mp.cos(b / 2) * mp.cos(s),
            mp.sin(b / 2) * mp.cos(d),
            mp.sin(b / 2) * mp.sin(d),
            mp.cos(b / 2) * mp.sin(s),
        ]

    found = turning.outputs["p"]
    with mp.workdps(40):
        for k, t in enumerate(turning.time):
            for n in range(SOLVED + 1):
                expected = [float(mp.diff(lambda x, i=i: parameters(x)[i], mp.mpf(float(t)), n)) for i in range(4)]
                np.testing.assert_allclose(found[k, n], expected, rtol=0, atol=1e-12 * 12.0**n)


@pytest.mark.slow
def test_dataset_has_axes_of_its_own_for_each_form(turning):
    dataset = turning.dataset
    assert dataset["A"].dims == ("time", "derivative", "row_axis", "column_axis")
    assert dataset["p"].dims == ("time", "derivative", "euler_parameter")
    assert dataset["angles"].dims == ("time", "derivative", "euler_angle")
    matrix = dataset["A"].sel(derivative=0).values
    of = Rotation.from_quat(dataset["p"].sel(derivative=0).values, scalar_first=True).as_matrix()
    np.testing.assert_allclose(matrix, of, rtol=0, atol=1e-14)
    rate = dataset["A"].sel(derivative=1).values
    w = turning.angular_velocity("rotor").sel(derivative=0).values
    np.testing.assert_allclose(rate, np.cross(w[:, :, None], matrix, axis=1), rtol=0, atol=1e-12)
    relative = Rotation.from_euler("ZXZ", turning.outputs["angles"][:, 0])
    outer = Rotation.from_euler("Z", [[derivatives("alpha", t)[0]] for t in turning.time])
    by_pin = Rotation.from_euler("XYZ", turning.outputs["by_pin"][:, 0])
    np.testing.assert_allclose((outer.inv() * relative).as_matrix(), by_pin.as_matrix(), rtol=0, atol=1e-13)


@pytest.mark.slow
def test_tables_and_files_keep_every_number(turning, tmp_path):
    for suffix in ("csv", "nc"):
        path = tmp_path / f"motion.{suffix}"
        jn.io.write(turning.dataset, path)
        found = jn.io.read(path)
        for name, variable in turning.dataset.items():
            assert found[name].dims == variable.dims
            np.testing.assert_array_equal(found[name].values, variable.values)
    header = (tmp_path / "motion.csv").read_text().partition("\n")[0].split(",")
    assert header[1:3] == ["angles_alpha", "angles_alpha_d1"]
    assert {"p_e0", "p_e3_d2", "A_xx", "A_zy_d2", "by_pin_gamma"} <= set(header)


@pytest.mark.slow
def test_parallel_axes_are_undefined_and_near_them_derivatives_hold():
    """The middle angle passes zero at t = 0.5: there the outer two are not determined, and from there on the principal
    middle angle grows again, the others shifted by half a turn."""
    mechanism = gimbal(b0=0.5, b1=-1.0, b2=0.0, c1=1.0, c2=0.0)
    instants = [0.0, 0.499, 0.5, 0.501, 0.9]
    with pytest.raises(jn.errors.SolveError, match="angles"):
        jn.solve(mechanism, instants, order=SOLVED)
    motion = jn.solve(mechanism, instants, order=SOLVED, strict=False)
    assert list(motion.status) == [0, 0, jn.Status.UNDEFINED, 0, 0]
    found = motion.outputs["angles"]
    assert np.isnan(found[2]).all()
    for k in (0, 1):
        t = instants[k]
        expected = [[0.3 + 7 * t, 0.5 - t, 0.5 + t], [7, -1, 1], [0, 0, 0]]
        np.testing.assert_allclose(found[k], expected, rtol=0, atol=1e-4 if k else 1e-12)
        np.testing.assert_allclose(found[k, :2], expected[:2], rtol=0, atol=1e-11)
    for k in (3, 4):
        t = instants[k]
        away = found[k, 0] - [0.3 + 7 * t, t - 0.5, 0.5 + t]
        np.testing.assert_allclose(np.abs(away), [np.pi, 0, np.pi], rtol=0, atol=1e-12)
        np.testing.assert_allclose(found[k, 1], [7, 1, 1], rtol=0, atol=1e-11)


@pytest.mark.slow
def test_angles_without_a_value_are_refused_afterwards_too(turning):
    """The outer ring turns about z only, where the first and the last axis of ZXZ are one."""
    with pytest.raises(jn.errors.MechanismError, match="t = 0 s"):
        turning.evaluate(jn.outputs.EulerAnglesOutput("outer", "ZXZ"))
    fixed = turning.evaluate(jn.outputs.EulerAnglesOutput("outer", "xyz")).sel(derivative=[0, 1], euler_angle="gamma")
    np.testing.assert_allclose(fixed, [derivatives("alpha", t)[:2] for t in turning.time], rtol=0, atol=1e-11)


@pytest.mark.slow  # to compile
def test_simulated_angles_are_continuous_over_turns():
    """A rotor that flies freely, spun about an axis of symmetry, looked at twice in many turns."""
    mechanism = jn.Mechanism(
        space="spatial",
        bodies={"rotor": jn.Body([0, 0, 0], mass=1.0, inertia=[1.0, 1.0, 2.0])},
        joints={},
        initial={"spin": jn.drivers.RotationDriver(("ground", "rotor"), [0, 0, 1.0], motion="0.2 + 11*t")},
        outputs={"turn": jn.outputs.EulerAnglesOutput("rotor", "ZYX"), "p": jn.outputs.EulerParametersOutput("rotor")},
    )
    motion = jn.simulate(mechanism, [0.0, 2.0, 5.0], order=1, method=jn.Taylor(8))
    np.testing.assert_allclose(motion.outputs["turn"][:, 0, 0], [0.2, 22.2, 55.2], rtol=0, atol=1e-9)
    np.testing.assert_allclose(motion.outputs["turn"][:, 1], [[11.0, 0, 0]] * 3, rtol=0, atol=1e-9)
    half = np.array([0.1, 11.1, 27.6])
    np.testing.assert_allclose(motion.outputs["p"][:, 0, [0, 3]].T, [np.cos(half), np.sin(half)], rtol=0, atol=1e-9)
    with pytest.raises(jn.errors.MechanismError, match="EulerAnglesOutput"):
        jn.Event(jn.outputs.EulerAnglesOutput("rotor", "ZYX"))
    fixed = motion.evaluate(jn.outputs.EulerAnglesOutput("rotor", "xyz"))
    np.testing.assert_allclose(fixed.sel(derivative=0, euler_angle="gamma"), [0.2, 22.2, 55.2], rtol=0, atol=1e-9)


@pytest.mark.slow  # to compile
def test_simulated_angles_without_a_value_are_reported():
    """A rotor that turns about z only has no angles of the sequence ZXZ; of a batch the other numbers stay."""
    outputs = {"turn": jn.outputs.EulerAnglesOutput("rotor", "ZXZ"), "p": jn.outputs.EulerParametersOutput("rotor")}
    mechanism = jn.Mechanism(
        space="spatial",
        parameters={"speed": 11.0, "tilt": 0.0},
        bodies={"rotor": jn.Body([0, 0, 0], orientation=[1, "tilt", 0, 0], mass=1.0, inertia=[1.0, 1.0, 2.0])},
        joints={},
        initial={"spin": jn.drivers.RotationDriver(("ground", "rotor"), [0, 0, 1.0], motion="0.2 + speed*t")},
        outputs=outputs,
    )
    with pytest.raises(jn.errors.SolveError, match="output turn") as caught:
        jn.simulate(mechanism, [0.0, 2.0], order=1, method=jn.Taylor(8))
    assert (caught.value.motion.status == jn.Status.UNDEFINED).all()
    batch = jn.simulate_batch(mechanism, {"tilt": [0.0, 0.1]}, [0.0, 0.1], order=1, method=jn.Taylor(8))
    assert (batch.status[0] == jn.Status.UNDEFINED).all()
    assert (batch.status[1] == jn.Status.OK).all()
    assert np.isfinite(batch.outputs["turn"][1]).all()


FILE = """\
space: spatial
bodies:
  rotor: {position: [0, 0, 0]}
joints:
  pin: {type: revolute, bodies: [ground, rotor], points: [[0, 0, 0], [0, 0, 0]], axes: [[0, 0, 1], [0, 0, 1]]}
drivers:
  turn: {type: rotation, bodies: [ground, rotor], axis: [0, 0, 1], motion: 2*t}
outputs:
  p: {body: rotor, quantity: euler_parameters}
  q: {bodies: [ground, rotor], quantity: euler_parameters}
  A: {body: rotor, quantity: rotation_matrix}
  B: {bodies: [rotor, ground], quantity: rotation_matrix}
  angles: {body: rotor, quantity: euler_angles, sequence: ZXY}
  back: {bodies: [rotor, ground], quantity: euler_angles, sequence: zxy}
"""


@pytest.mark.slow
def test_files_hold_every_form(tmp_path):
    path = tmp_path / "rotor.yaml"
    path.write_text(FILE)
    mechanism = jn.load(path)
    for suffix in ("yaml", "toml", "json"):
        jn.write_mechanism(mechanism, tmp_path / f"again.{suffix}")
        assert jn.load(tmp_path / f"again.{suffix}").outputs == mechanism.outputs
    outputs = jn.solve(mechanism, [0.25], order=1).outputs
    np.testing.assert_array_equal(outputs["p"], outputs["q"])
    c, s = np.cos(0.5), np.sin(0.5)
    np.testing.assert_allclose(outputs["A"][0, 0], [c, -s, 0, s, c, 0, 0, 0, 1], rtol=0, atol=1e-15)
    np.testing.assert_allclose(outputs["A"][0, 1, :5], np.array([-s, -c, 0, c, -s]) * 2, rtol=0, atol=1e-14)
    np.testing.assert_allclose(outputs["B"][0, 1, :5], np.array([-s, c, 0, -c, -s]) * 2, rtol=0, atol=1e-14)
    np.testing.assert_allclose(outputs["angles"][0], [[0.5, 0, 0], [2, 0, 0]], rtol=0, atol=1e-14)
    np.testing.assert_allclose(outputs["back"][0], [[-0.5, 0, 0], [-2, 0, 0]], rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    "old, new, named",
    [
        ("sequence: ZXY", "sequence: ZXx", "line 13, .*sequence"),
        ("sequence: ZXY", "sequence: ZZX", "line 13, .*sequence"),
        (", sequence: ZXY", "", "line 13, .*sequence"),
        ("  q: {bodies: [ground, rotor]", "  p_e2: {bodies: [ground, rotor]", "line 10, .*p_e2"),
        ("  back:", "  euler_angle:", "euler_angle"),
    ],
)
def test_files_that_are_wrong_say_where(tmp_path, old, new, named):
    path = tmp_path / "rotor.yaml"
    path.write_text(FILE.replace(old, new))
    with pytest.raises(jn.errors.MechanismFileError, match=named):
        jn.load(path)


def test_bodies_of_the_plane_have_an_angle_only():
    motion = jn.solve(jn.load("examples/four_bar.yaml"), [0.0], order=0)
    with pytest.raises(jn.errors.MechanismError, match="spatial"):
        motion.evaluate(jn.outputs.RotationMatrixOutput("crank"))
