"""Laws whose derivative was measured: in Python, in mechanism files and in those of trajectories."""

import math

import jax
import numpy as np
import pytest

import jounce as jn
from jounce.errors import MechanismFileError
from jounce.io.mechanisms.overrides import override

T = np.linspace(0.5, 2.0, 13)


def polynomial(t, order):
    """Return a derivative of t^5 - 2 t^3 + 4 t - 1."""
    terms = {5: 1.0, 3: -2.0, 1: 4.0, 0: -1.0}
    powers = [(p, c) for p, c in terms.items() if p >= order]
    return sum(c * math.perm(p, order) * np.asarray(t, float) ** (p - order) for p, c in powers)


@pytest.mark.parametrize("derivative", [1, 2, 3])
def test_polynomials_come_back(derivative):
    initial = [polynomial(T[0], k) for k in range(derivative)]
    law = jn.laws.MeasuredMotion(T, polynomial(T, derivative), derivative, initial, degree=5)
    t = np.linspace(0.5, 2.0, 31)
    found = law(jn.Jet.variable(t, order=5)).derivatives()
    for order in range(6):
        right = polynomial(t, order)
        np.testing.assert_allclose(found[order], right, rtol=0, atol=1e-9 * np.abs(right).max(), err_msg=str(order))


def test_a_long_record_is_integrated_at_once_and_loses_no_digits():
    """Over three minutes at 1 kHz, of which sums of all samples before each would take ten."""
    t = np.linspace(0.0, 200.0, 200_001)
    law = jn.laws.MeasuredMotion(t, -np.sin(t), 2, [0.0, 1.0])
    late = np.array([3.3, 123.4567, 199.99])
    found = law(jn.Jet.variable(late, order=2)).derivatives()
    np.testing.assert_allclose(found, [np.sin(late), np.cos(late), -np.sin(late)], rtol=0, atol=2e-13)


def test_zero_at_the_start_unless_given_and_what_is_beyond():
    law = jn.laws.MeasuredMotion([0.0, 1.0, 2.0], [2.0, 2.0, 2.0], degree=1, beyond="hold")
    assert law(jn.Jet.variable(2.0, order=1)).derivatives().tolist() == [4.0, 4.0]
    assert law(jn.Jet.variable(5.0, order=1)).derivatives().tolist() == [4.0, 0.0]
    refused = jn.laws.MeasuredMotion([0.0, 1.0], [2.0, 2.0], degree=1)
    with pytest.raises(jn.errors.MechanismError, match="samples go from 0 to 1"):
        refused(jn.Jet.variable(2.0, order=1))


def test_it_is_the_law_of_accelerations_of_negrean():
    rates = polynomial(T, 2) + np.sin(9 * T)
    law = jn.laws.MeasuredMotion(T, rates, degree=3)
    theirs = jn.laws.PolynomialMotion.from_accelerations(T, rates, continuity=4)
    t = jn.Jet.variable(np.linspace(0.6, 1.9, 9), order=4)
    np.testing.assert_allclose(law(t).derivatives(), theirs(t).derivatives(), rtol=0, atol=1e-10)


@pytest.mark.parametrize(
    "change, words",
    [
        ({"derivative": 0}, "derivative"),
        ({"derivative": 5}, "derivative"),
        ({"initial": [0.0, 1.0, 2.0]}, "initial"),
        ({"initial": [np.nan]}, "initial"),
        ({"beyond": "repeat"}, "repeat"),
        ({"degree": 0}, "degree"),
    ],
)
def test_bad_laws(change, words):
    with pytest.raises(jn.errors.MechanismError, match=words):
        jn.laws.MeasuredMotion(T, T, **change)


SLED = """\
space: planar
bodies: {{sled: {{mass: 1}}}}
joints:
  rail: {{type: prismatic, bodies: [ground, sled], points: [[0, 0], [0, 0]], vectors: [[1, 0], [1, 0]]}}
drivers:
  push: {{type: slide, bodies: [ground, sled], points: [[0, 0], [0, 0]], vector: [1, 0], motion: {motion}}}
outputs: {{x: {{bodies: [ground, sled], quantity: slide, points: [[0, 0], [0, 0]], vector: [1, 0]}}}}
time: {{start: 0.5, stop: 2, count: 7}}
"""
MOTION = "{samples: a.csv, derivative: 2, initial: [-75.0 mm, 0.5 m/s]}"


def table(path, **columns):
    rows = zip(*columns.values(), strict=True)
    path.write_text("\n".join([",".join(columns), *(",".join(f"{x:.17g}" for x in row) for row in rows)]) + "\n")


def sled(folder, motion=MOTION):
    table(folder / "a.csv", time=T, a=polynomial(T, 2))
    path = folder / "sled.yaml"
    path.write_text(SLED.format(motion=motion))
    return path


@pytest.mark.slow
def test_a_driver_of_a_mechanism_file(tmp_path):
    motion = jn.solve(jn.load(sled(tmp_path)), order=3)
    change = np.array([-0.075, 0.5]) - [polynomial(T[0], 0), polynomial(T[0], 1)]
    right = np.stack([polynomial(motion.time, k) for k in range(4)], axis=1)
    right[:, 0] += change[0] + change[1] * (motion.time - T[0])
    right[:, 1] += change[1]
    np.testing.assert_allclose(motion.outputs["x"], right, rtol=0, atol=1e-9 * np.abs(right).max())
    jn.write_mechanism(motion.mechanism, tmp_path / "again.yaml")
    again = jn.solve(jn.load(tmp_path / "again.yaml"), order=3)
    np.testing.assert_allclose(again.outputs["x"], motion.outputs["x"], rtol=0, atol=1e-12 * np.abs(right).max())


@pytest.mark.parametrize(
    "motion, words",
    [
        ("{samples: a.csv, derivative: 1.5}", ("derivative", "1.5")),
        ("{samples: a.csv, derivative: 7}", ("derivative", "7")),
        ("{samples: a.csv, derivative: 2, initial: 3}", ("initial", "3")),
        ("{samples: a.csv, initial: [1]}", ("initial",)),
        ("{samples: a.csv, derivative: 2, initial: [1 s]}", ("initial", "1 s")),
        ("{samples: a.csv, derivative: 2, initial: [1, 2 rad/s]}", ("initial", "2 rad/s")),
        ("{samples: a.csv, derivative: 2, beyond: repeat}", ("beyond", "repeat")),
        ("{samples: a.csv, derivativ: 2}", ("derivativ", "derivative")),
    ],
)
def test_bad_drivers(tmp_path, motion, words):
    with pytest.raises(MechanismFileError) as raised:
        jn.load(sled(tmp_path, motion))
    assert all(word in str(raised.value) for word in words), str(raised.value)
    assert raised.value.line == 6


@pytest.mark.parametrize(
    "text",
    [
        "motion: {samples: a.csv, derivative: 2, initial: {b: [1.0, 2 rad/s]}}",
        "joints:\n  a: {samples: a.csv, value: a, derivative: 2}\n"
        "  b: {samples: a.csv, value: b, derivative: 2, initial: [1.0, 2 rad/s]}\n"
        "time: {start: 0.5, stop: 2, count: 13}",
    ],
)
def test_a_trajectory_file(tmp_path, text):
    table(tmp_path / "a.csv", time=T, a=polynomial(T, 2), b=polynomial(T, 3))
    (tmp_path / "law.yaml").write_text(text)
    trajectory = jn.load_trajectory(tmp_path / "law.yaml")
    assert trajectory.names == ("a", "b")
    np.testing.assert_allclose(trajectory.times, T, rtol=0, atol=1e-12)
    found = trajectory.derivatives(T, 2)
    since = T - T[0]
    first = polynomial(T, 0) - polynomial(T[0], 0) - polynomial(T[0], 1) * since
    second = polynomial(T, 1) - polynomial(T[0], 1) - polynomial(T[0], 2) * since + 1 + 2 * since
    np.testing.assert_allclose(found[:, 0], np.stack([first, second], axis=1), rtol=0, atol=1e-9)
    np.testing.assert_allclose(found[:, 2, 0], polynomial(T, 2), rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    "text, words",
    [
        ("motion: {derivative: 2}", ("motion.samples", "missing")),
        ("motion: {samples: b.csv, derivative: 2}", ("b.csv",)),
        ("motion: {samples: a.csv, derivative: 2, initial: {c: [1]}}", ("motion.initial.c",)),
        ("motion: {samples: a.csv, derivative: 2, initial: {a: [1, 2, 3]}}", ("motion.initial.a", "2")),
        ("motion: {samples: a.csv, derivative: two}", ("motion.derivative", "two")),
        ("motion: {samples: a.csv}\njoints: {a: 1}", ("either",)),
        ("joints: {a: {samples: a.csv, value: c}}\ntime: {start: 1, stop: 2, step: 0.1}", ("joints.a", "c")),
    ],
)
def test_bad_trajectory_files(tmp_path, text, words):
    table(tmp_path / "a.csv", time=T, a=T, b=T)
    (tmp_path / "law.yaml").write_text(text)
    with pytest.raises(jn.errors.TrajectoryError) as raised:
        jn.load_trajectory(tmp_path / "law.yaml")
    assert all(word in str(raised.value) for word in words), str(raised.value)


def test_noisy_accelerations_are_reported():
    noisy = polynomial(T, 2) + np.random.default_rng(1).normal(scale=5.0, size=len(T))
    trajectory = jn.JointTrajectory({"a": jn.laws.MeasuredMotion(T, noisy)}, T[0], T[-1])
    with pytest.warns(jn.errors.SampleWarning, match="'a'"):
        trajectory.derivatives(T, 4)


def follower(folder, initial="[x0, v0/2]", x0=-0.075, v0=1.0):
    path = sled(folder, f"{{samples: a.csv, derivative: 2, initial: {initial}}}")
    path.write_text(f"parameters: {{x0: {x0} m, v0: {v0} m/s}}\n" + path.read_text())
    return path


@pytest.mark.slow
def test_what_is_known_at_the_first_sample_follows_the_parameters(tmp_path):
    first = jn.load(follower(tmp_path))
    np.testing.assert_allclose(
        jn.solve(first, order=3).outputs["x"],
        jn.solve(jn.load(sled(tmp_path)), order=3).outputs["x"],
        rtol=0,
        atol=1e-14,
    )
    for changed in (first.with_parameters(x0=0.5, v0="-3 m/s"), override(first, ["x0=500 mm", "v0=-3"])):
        fresh = jn.load(follower(tmp_path, x0=0.5, v0=-3.0))
        assert np.array_equal(jn.solve(changed, order=3).outputs["x"], jn.solve(fresh, order=3).outputs["x"])
    jn.write_mechanism(first, tmp_path / "again.yaml")
    again = jn.load(tmp_path / "again.yaml").with_parameters(x0=0.5, v0=-3.0)
    assert np.array_equal(jn.solve(again, order=3).outputs["x"], jn.solve(fresh, order=3).outputs["x"])


@pytest.mark.slow
def test_gradients_with_respect_to_what_is_known_at_the_first_sample():
    law = jn.laws.MeasuredMotion(T, polynomial(T, 2), initial=["x0", "v0/2"])
    time = jn.Jet.variable(np.array([0.5, 1.25]), order=2)
    slopes = jax.jacobian(lambda v0: law.resolved({"x0": 0.1, "v0": v0})(time).derivatives())(1.0)
    np.testing.assert_allclose(slopes, [[0.0, 0.375], [0.5, 0.5], [0.0, 0.0]], rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    "initial, words", [("[x0, x0]", "length"), ("[y0]", "y0"), ("[log(-x0*0 - 1)]", "not defined")]
)
def test_bad_expressions_of_what_is_known_at_the_first_sample(tmp_path, initial, words):
    with pytest.raises(MechanismFileError, match=words) as raised:
        jn.load(follower(tmp_path, initial))
    assert raised.value.line == 7


def test_a_law_that_waits_for_parameters_gives_no_numbers():
    law = jn.laws.MeasuredMotion(T, T, initial=["x0", "2*pi/3"])
    with pytest.raises(jn.errors.MechanismError, match="x0"):
        law(jn.Jet.variable(1.0, order=1))
    known = law.resolved({"x0": 0.25})(jn.Jet.variable(T[0], order=1)).derivatives()
    np.testing.assert_allclose(known, [0.25, 2 * math.pi / 3], rtol=1e-15)
