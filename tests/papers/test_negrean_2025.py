"""The arm of Negrean 2025, section 4: stand-ins, closed forms beside the library, the printed segment, the files."""

import csv
import itertools
import math
import subprocess
import sys

import numpy as np
import pytest

from jounce.errors import OutputError
from jounce.papers import negrean_2025
from jounce.papers.negrean_2025 import (
    CASES,
    case,
    closed_forms,
    comparison,
    figures,
    measured_data,
    reproduce,
    segment,
)
from jounce.papers.negrean_2025.measured_data import given_cases
from jounce.papers.negrean_2025.motion_history import difference, history
from tests.oracles import negrean_energies

ROUNDING = 1e-14  # of the largest value over time


@pytest.fixture(scope="module")
def histories():
    return {name: history(motion) for name, motion in CASES.items()}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_equations_141_to_146_beside_the_library(histories, name):
    found = histories[name]
    assert (difference(found.energies, found.closed_energies) <= ROUNDING).all()
    assert (difference(found.torques, found.closed_torques) <= ROUNDING).all()
    assert (difference(found.equation_torques, found.closed_torques) <= ROUNDING).all()
    right = negrean_energies.one_axis(case.STAND_IN.inertia_about_axis, *found.motion.T[1:5])
    np.testing.assert_allclose(found.closed_energies, np.stack(right, axis=1), rtol=1e-12, atol=1e-9)
    np.testing.assert_array_equal(
        negrean_2025.energies(case.STAND_IN.inertia_about_axis, found.motion), found.closed_energies
    )


def test_gravity_and_torques_in_closed_form():
    q, w, a = 0.7, 1.3, -2.1
    found = closed_forms.gravity_torques(2.0, (0.3, 0.1), 9.81, [q, w, a])
    slope = -0.3 * math.cos(q) - 0.1 * math.sin(q)
    change = 0.3 * math.sin(q) - 0.1 * math.cos(q)
    right = 2.0 * 9.81 * np.array([slope, change * w, change * a - slope * w**2])
    np.testing.assert_allclose(found, right, rtol=1e-14)
    torques = negrean_2025.torques(0.5, [q, w, a, 4.0, 5.0], found)
    np.testing.assert_allclose(torques, right + 0.5 * np.array([a, 4.0, 5.0]), rtol=1e-14)


@pytest.mark.slow
def test_equations_061_to_064_the_motions_keep_what_the_text_says(histories):
    assert (case.DURATION, case.SEGMENTS, case.CONTINUITY) == (1.7, 51, 4)
    assert np.diff(case.KNOTS) == pytest.approx(0.033, abs=5e-4)
    for name, found in histories.items():
        law = CASES[name].motion
        assert law.degree == 5
        assert len(law.knots) == 52
        at_knots = found.motion[:: found.time.size // 51]
        np.testing.assert_allclose(at_knots[:, 2], CASES[name].accelerations, rtol=0, atol=1e-12)
        jumps = comparison.jumps(found)
        assert (jumps[:5] <= 1e-12 * np.abs(found.motion[:, :5]).max(axis=0)).all()
        assert jumps[5] > 1.0
        np.testing.assert_allclose(found.motion[0, [0, 1, 3]], 0.0, atol=1e-12)
        np.testing.assert_allclose(found.motion[-1, [1, 3]], 0.0, atol=1e-11)
    assert histories["high_speed"].motion[-1, 0] == pytest.approx(np.pi, rel=1e-14)
    assert histories["sudden_stop"].motion[-1, 0] < np.pi


def test_samples_are_the_stated_ones():
    speed, acceleration = case.rest_to_rest(np.linspace(0, 1.7, 2001))
    turned = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2)]) * 1.7 / 2000
    assert turned[-1] == pytest.approx(np.pi, rel=1e-6)
    np.testing.assert_allclose(np.gradient(speed, 1.7 / 2000)[5:-5], acceleration[5:-5], atol=1e-4)
    assert np.abs(case.high_speed() - case.rest_to_rest(case.KNOTS)[1]).max() < 0.13
    stop = case.sudden_stop()
    np.testing.assert_array_equal(stop[case.KNOTS < 0.9], case.high_speed()[case.KNOTS < 0.9])
    assert stop.min() < -30
    for motion in CASES.values():
        assert np.abs(motion.accelerations - motion.samples()).max() < 0.2


def test_equations_136_to_140_the_printed_segment():
    checks = segment.check()
    assert len(checks) == 14
    cut = [c for c in checks if not c.rounded]
    assert [(c.order, c.power, str(c.residual)) for c in cut] == [(1, 4, "0.004")]
    assert all(abs(float(c.residual)) <= 0.001 * (c.power + 2) for c in checks), "or digits are cut off"
    ends = segment.evaluated(np.array(segment.INTERVAL))
    np.testing.assert_allclose(ends[:3], [[1.3734, 1.6332], [6.7474, 6.2192], [-11.852, -15.498]], rtol=1e-4)
    for k in range(4):  # each is the derivative of the one before, to the rounding of the coefficients
        t, h = 0.585, 1e-3
        values = segment.evaluated(np.array([t - h, t + h]))[k]
        slope = float(np.diff(values)[0]) / (2 * h)
        assert slope == pytest.approx(float(segment.evaluated(np.array([t]))[k + 1][0]), abs=0.2)


def test_the_signs_of_the_printed_segment_are_the_only_ones_that_keep_the_arm_between_0_and_pi():
    sizes = [abs(float(c)) for c in segment.POLYNOMIALS[0]]
    fitting = []
    for signs in itertools.product((1, -1), repeat=6):
        values = [
            np.polyval([s * c for s, c in zip(signs, sizes, strict=True)], t) for t in np.linspace(0.565, 0.605, 9)
        ]
        if min(values) >= 0 and max(values) <= np.pi:
            fitting.append(signs)
    assert fitting == [(1, -1, 1, -1, 1, -1)]


@pytest.mark.slow
def test_reproduction_writes_its_files(histories, tmp_path, monkeypatch):
    module = sys.modules["jounce.papers.negrean_2025.reproduction"]
    monkeypatch.setattr(module, "history", lambda motion: histories[motion.name])
    calls = []
    paths = reproduce(tmp_path / "made" / "here", lambda done, total: calls.append((done, total)))
    figures = [f"{name}.{kind}" for name in (*FIGURES, "energies") for kind in ("png", "svg")]
    names = ["comparison.md", "energies.csv", "torques.csv", *figures]
    assert [path.name for path in paths] == names
    assert sorted(path.name for path in (tmp_path / "made" / "here").iterdir()) == sorted(names)
    assert calls == [(k, 8) for k in range(1, 9)]
    for path in paths:
        content = path.read_bytes()
        assert path.suffix != ".png" or (content.startswith(b"\x89PNG") and len(content) > 20_000)
        assert path.suffix != ".svg" or b"</svg>" in content
    text = paths[0].read_text()
    assert "not those of the" in text
    assert "M_3 = 6.5 kg" in text
    rows = list(csv.DictReader(paths[1].read_text().splitlines()))
    assert len(rows) == 2 * 1021
    energies = np.array([[float(row[f"E_{p}"]) for p in (1, 2, 3)] for row in rows])
    np.testing.assert_array_equal(energies, np.concatenate([h.energies for h in histories.values()]))
    rows = list(csv.DictReader(paths[2].read_text().splitlines()))
    torques = np.array([[float(row[c]) for c in ("torque", "torque_d1", "torque_d2")] for row in rows])
    np.testing.assert_array_equal(torques, np.concatenate([h.torques for h in histories.values()]))


LINK = "mass: 4 kg\ncenter_x: 200 mm\ncenter_z: 0\ninertia_y: 0.05 kg*m^2\n"


@pytest.mark.slow
def test_measurements_of_ones_own(tmp_path, run):
    """A constant acceleration: the angle, torques and energies in closed form."""
    t = np.linspace(0.2, 1.2, 11)
    samples, link, out = tmp_path / "mine.csv", tmp_path / "link.yaml", tmp_path / "out"
    samples.write_text("time,slow\n" + "".join(f"{x!r},1.5\n" for x in t.tolist()))
    link.write_text(LINK)
    status, _, _ = run("reproduce", "negrean-2025", "--out", out, "--samples", samples, "--masses", link)
    assert status == 0
    rows = list(csv.DictReader((out / "torques.csv").read_text().splitlines()))
    since = np.array([float(row["time"]) for row in rows]) - 0.2
    q, w = 0.75 * since**2, 1.5 * since
    torque = (4 * 0.2**2 + 0.05) * 1.5 - 4 * 9.81 * 0.2 * np.cos(q)
    np.testing.assert_allclose([float(row["torque"]) for row in rows], torque, rtol=0, atol=1e-10)
    rows = list(csv.DictReader((out / "energies.csv").read_text().splitlines()))
    energy = (4 * 0.2**2 + 0.05) / 2 * (1.5**2 + w**4)
    np.testing.assert_allclose([float(row["E_1"]) for row in rows], energy, rtol=0, atol=1e-9)
    text = (out / "comparison.md").read_text()
    assert all(word in text for word in ("mine.csv", "link.yaml", "M = 4 kg"))
    assert "not those of the" not in text


@pytest.mark.slow
def test_two_samples_make_one_segment_without_jumps(tmp_path):
    samples = tmp_path / "mine.csv"
    samples.write_text("time,slow\n0,0\n0.5,2\n")
    assert not comparison.jumps(history(given_cases(samples, None)["slow"])).any()


def test_measurements_say_their_unit(tmp_path):
    samples = tmp_path / "mine.csv"
    samples.write_text("time [ms],slow [deg/s^2]\n" + "".join(f"{100 * k},90\n" for k in range(9)))
    case = given_cases(samples, None)["slow"]
    np.testing.assert_allclose(case.samples(), np.pi / 2, rtol=1e-15)
    np.testing.assert_allclose(case.knots, 0.1 * np.arange(9), rtol=1e-15)


def rest_to_rest(t):
    """Return angle and angular acceleration from 0 to 1.2 rad in 0.8 s, at rest to the third derivative at the ends."""
    s = t / 0.8
    angle = 1.2 * (35 * s**4 - 84 * s**5 + 70 * s**6 - 20 * s**7)
    return angle, 1.2 * 420 * s**2 * (1 - s) ** 2 * (1 - 2 * s) / 0.8**2


@pytest.mark.parametrize("gravity", [False, True])
@pytest.mark.parametrize("even", [True, False])
def test_tangential_readings_with_a_radius(tmp_path, gravity, even):
    """What an accelerometer at 0.25 m, 30 degrees on the link, reads of a motion in closed form."""
    t = np.linspace(0.0, 0.8, 161)
    if not even:
        t[1:-1] += np.random.default_rng(0).uniform(-1e-3, 1e-3, 159)  # stamps of a logger, 5 ms apart
    angle, acceleration = rest_to_rest(t)
    reading = 0.25 * acceleration - (9.81 * np.cos(angle + np.pi / 6) if gravity else 0.0)
    samples, link = tmp_path / "mine.csv", tmp_path / "link.yaml"
    rows = zip((1e3 * t).tolist(), (1e2 * reading).tolist(), strict=True)
    samples.write_text("time [ms],fast [cm/s^2]\n" + "".join(f"{x!r},{y!r}\n" for x, y in rows))
    link.write_text(LINK + "radius: 250 mm\nsensor_angle: 30 deg\n")
    found = given_cases(samples, link, remove_gravity=gravity)["fast"]
    np.testing.assert_allclose(found.knots, t, rtol=0, atol=1e-15)
    size = np.abs(acceleration).max()
    np.testing.assert_allclose(found.accelerations, acceleration, rtol=0, atol=(1e-6 if gravity else 1e-13) * size)
    np.testing.assert_allclose(found.motion.coefficients[0], angle[:-1], rtol=0, atol=1e-6)
    words = measured_data.summary({"fast": found}, samples, link, remove_gravity=gravity)
    assert ("Gravity is taken off" in words) == gravity
    assert ("--remove-gravity" in words) != gravity


def test_gravity_is_taken_off_tangential_readings_alone(tmp_path, run):
    samples, link = tmp_path / "mine.csv", tmp_path / "link.yaml"
    samples.write_text("time,slow\n" + "".join(f"{0.1 * k},1\n" for k in range(9)))
    link.write_text(LINK + "radius: 250 mm\n")
    for given, words in (
        (("--samples", samples, "--masses", link), ("mine.csv", "slow", "tangential")),
        ((), ("remove_gravity", "samples")),
    ):
        status, _, complaint = run("reproduce", "negrean-2025", "--out", tmp_path / "out", *given, "--remove-gravity")
        assert status == 2
        assert all(word in complaint for word in words), complaint
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "samples, masses, said, unsaid",
    [
        (False, False, ["samples", "masses", "lengths"], []),
        (True, False, ["masses", "lengths"], ["samples"]),
        (False, True, ["samples"], ["masses", "lengths"]),
        (True, True, [], ["stand-in"]),
    ],
)
def test_pictures_say_which_data_are_stand_ins(tmp_path, samples, masses, said, unsaid):
    measured, link = tmp_path / "mine.csv", tmp_path / "link.yaml"
    measured.write_text("time,slow\n" + "".join(f"{0.1 * k},1\n" for k in range(9)))
    link.write_text(LINK)
    cases = given_cases(measured if samples else None, link if masses else None)
    for note in map(figures.note_on_substitutes, cases.values()):
        assert all(word in note for word in said)
        assert not any(word in note for word in unsaid)


@pytest.mark.parametrize(
    "samples, link, words",
    [
        ("time,a\n0,1\n1,x\n", None, ("mine.csv", "line 3", "a", "x")),
        ("time,a\n0,1\n", None, ("mine.csv", "a")),
        ("t,a\n0,1\n1,2\n", None, ("mine.csv", "time")),
        ("time,a [deg]\n0,1\n1,2\n", None, ("mine.csv", "a", "deg")),
        ("time,a [m/s^2]\n0,1\n1,2\n", None, ("mine.csv", "a", "radius")),
        ("time,a [m/s^2]\n0,1\n1,2\n", LINK, ("mine.csv", "a", "radius")),
        ("time,a [m/s^3]\n0,1\n1,2\n", LINK, ("mine.csv", "a", "m/s^3")),
        (None, LINK + "radius: 0 m\n", ("link.yaml", "line 5", "radius", "0")),
        (None, LINK.replace("mass: 4 kg\n", ""), ("link.yaml", "mass", "missing")),
        (None, LINK.replace("4 kg", "4 m"), ("link.yaml", "line 1", "mass", "4 m")),
        (None, LINK.replace("4 kg", "-4 kg"), ("link.yaml", "mass", "-4")),
        (None, LINK + "center_y: 0\n", ("link.yaml", "line 5", "center_y", "center_x")),
    ],
)
def test_bad_measurements(tmp_path, run, monkeypatch, samples, link, words):
    monkeypatch.setattr(
        sys.modules["jounce.papers.negrean_2025.reproduction"], "history", lambda *_: pytest.fail("computed")
    )
    given = []
    for option, name, text in (("--samples", "mine.csv", samples), ("--masses", "link.yaml", link)):
        if text is not None:
            (tmp_path / name).write_text(text)
            given += [option, tmp_path / name]
    status, _, complaint = run("reproduce", "negrean-2025", "--out", tmp_path / "out", *given)
    assert status == 2
    assert all(word in complaint for word in words), complaint
    assert not (tmp_path / "out").exists()


def test_the_other_paper_takes_no_measurements(tmp_path, run):
    status, _, complaint = run("reproduce", "sommer-2024", "--out", tmp_path, "--masses", tmp_path / "link.yaml")
    assert status == 2
    assert "--masses" in complaint


FIGURES = tuple(f"figure_{k:02d}" for k in (4, 5, 7, 8, 9))


def test_a_directory_that_cannot_be_made_is_refused_before_any_computing(tmp_path, monkeypatch):
    module = sys.modules["jounce.papers.negrean_2025.reproduction"]
    monkeypatch.setattr(module, "history", lambda *_: pytest.fail("computed"))
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="files cannot be written there"):
        reproduce(tmp_path / "file" / "out")


@pytest.mark.slow
def test_drawing_is_imported_late_and_leaves_pyplot_alone():
    code = (
        "import sys, jounce.papers.negrean_2025 as n; assert 'matplotlib' not in sys.modules\n"
        "import jounce.papers.negrean_2025.figures; assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
