"""Energies as outputs of files: read, solved, tabulated, written and read back; bad input."""

import json
import math
import re

import jsonschema
import mpmath
import numpy as np
import pytest

import jounce as jn
from jounce import io
from jounce.errors import MechanismFileError
from jounce.io.files.source import read_source
from jounce.reporting.peaks import peaks

FILE = """\
space: planar
gravity: [0, -9.81]
bodies:
  arm: {mass: 2 kg, inertia: 0.3 kg*m^2, center_of_mass: [50 cm, 0]}
  cart: {position: [1, 0], mass: 3 kg, inertia: 1 kg*m^2}
joints:
  pin: {type: revolute, bodies: [ground, arm], points: [[0, 0], [0, 0]]}
  rail: {type: prismatic, bodies: [ground, cart], points: [[0, 0], [0, 0]], vectors: [[1, 0], [1, 0]]}
drivers:
  turn: {type: coordinate, bodies: [ground, arm], coordinate: angle, motion: 0.4*sin(3*t)}
  push: {type: slide, bodies: [ground, cart], points: [[0, 0], [0, 0]], vector: [1, 0], motion: 1 + t**3}
outputs:
  T: {mechanism: true, quantity: kinetic_energy}
  Ta: {body: arm, quantity: kinetic_energy}
  E1: {body: arm, quantity: acceleration_energy}
  E2: {body: cart, quantity: acceleration_energy, order: 2}
  E: {mechanism: all, quantity: acceleration_energy, order: 1}
  V: {mechanism: true, quantity: potential_energy}
  Vc: {body: cart, quantity: potential_energy}
time: {start: 0, stop: 0.5, count: 4}
"""
ABOUT_PIN = 0.3 + 2 * 0.5**2


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("energies") / "arm.yaml"
    path.write_text(FILE)
    return path


@pytest.fixture(scope="module")
def motion(path):
    return jn.solve(jn.load(path), order=2)


def derivatives(function, t, count):
    """Return a function of mpmath numbers and its derivatives at instants, by Taylor's series in fifty digits."""
    with mpmath.workdps(50):
        rows = [mpmath.taylor(function, mpmath.mpf(float(x)), count - 1) for x in t]
        return np.array([[float(c * math.factorial(k)) for k, c in enumerate(row)] for row in rows])


@pytest.mark.slow
def test_closed_forms(motion):
    t, found = motion.time, motion.outputs
    w = lambda x: mpmath.mpf("1.2") * mpmath.cos(3 * x)  # noqa: E731
    a = lambda x: mpmath.mpf("-3.6") * mpmath.sin(3 * x)  # noqa: E731
    arm, cart = (lambda x: ABOUT_PIN / 2 * w(x) ** 2), (lambda x: 13.5 * x**4)
    first = lambda x: ABOUT_PIN / 2 * (a(x) ** 2 + w(x) ** 4)  # noqa: E731
    weight = lambda x: 2 * mpmath.mpf(9.81) * mpmath.sin(mpmath.mpf(0.4) * mpmath.sin(3 * x)) / 2  # noqa: E731
    expected = {
        "T": lambda x: arm(x) + cart(x),
        "Ta": arm,
        "E1": first,
        "E2": lambda x: mpmath.mpf(54) + 0 * x,
        "E": lambda x: first(x) + 54 * x**2,
        "V": weight,
        "Vc": lambda x: 0 * x,
    }
    for name, function in expected.items():
        right = derivatives(function, t, 3)
        np.testing.assert_allclose(found[name], right, rtol=0, atol=1e-12 * max(1.0, np.abs(right).max()), err_msg=name)


@pytest.mark.slow
def test_units_and_names_of_peaks(motion):
    assert motion.dataset["T"].attrs["units"] == "J"
    assert motion.dataset["E2"].attrs["units"] == "J/s^4"
    assert jn.energy.kinetic_energy(motion).total.attrs["units"] == "J"
    assert jn.energy.acceleration_energy(motion, order=1).total.attrs["units"] == "J/s^2"
    units = {(p.output, p.derivative): p.unit for p in peaks(motion)}
    assert units["T", "energy"] == "J"
    assert units["E1", "first rate"] == "J/s^3"


@pytest.mark.slow
def test_files_written_and_read(path, motion, tmp_path):
    io.write(motion.dataset, tmp_path / "motion.csv")
    back = io.read(tmp_path / "motion.csv")
    np.testing.assert_array_equal(back["E2"].values, motion.outputs["E2"])
    jn.write_mechanism(motion.mechanism, tmp_path / "again.yaml")
    again = jn.load(tmp_path / "again.yaml")
    for name, output in motion.mechanism.outputs.items():
        assert type(again.outputs[name]) is type(output)
        assert (again.outputs[name].single_body, again.outputs[name].unit) == (output.single_body, output.unit)


def test_inspection_tells_of_what_they_are(path, run):
    status, printed, _ = run("inspect", path, "--json")
    assert status == 0
    found = {row["name"]: (row["quantity"], row["unit"], row["of"]) for row in json.loads(printed)["outputs"]}
    assert found["T"] == ("kinetic_energy", "J", ["mechanism"])
    assert found["E2"] == ("acceleration_energy", "J/s^4", ["cart"])


def test_orders_that_no_motion_has_are_refused_before_computing(path, run):
    text = path.read_text()
    path.write_text(text.replace("order: 2", "order: 99"))
    status, _, complaint = run("inspect", path)
    assert status == 2
    assert all(word in complaint for word in ("order", "99", "30", "line")), complaint
    path.write_text(text.replace("order: 2", "order: 30"))
    status, _, complaint = run("run", path, "--order", "10")
    assert status == 2
    assert all(word in complaint for word in ("outputs.E2", "41", "32")), complaint


@pytest.mark.slow
def test_a_simulation_has_them_too(tmp_path):
    path = tmp_path / "falling.yaml"
    text = re.sub(r"drivers:.*?outputs:", "outputs:", FILE, flags=re.DOTALL)
    path.write_text(text.replace("order: 2}", "order: 1}"))
    motion = jn.simulate(jn.load(path), order=1, method=jn.Taylor(8))
    found = motion.outputs
    assert np.abs(found["T"][:, 1] + found["V"][:, 1]).max() <= 1e-12 * np.abs(found["T"][:, 1]).max()


def test_the_json_schema_has_them(path):
    data = read_source(str(path)).data
    validator = jsonschema.Draft202012Validator(io.json_schema())
    validator.validate(data)
    data["outputs"]["E2"]["order"] = -1
    assert not validator.is_valid(data)


@pytest.mark.parametrize(
    "old, new, words",
    [
        (
            "{body: arm, quantity: kinetic_energy}",
            "{body: amr, quantity: kinetic_energy}",
            ("outputs.Ta", "amr", "arm"),
        ),
        ("order: 2}", "order: 1.5}", ("outputs.E2.order", "1.5", "whole")),
        ("order: 2}", "order: -1}", ("outputs.E2.order", "-1")),
        ("quantity: potential_energy}\ntime", "quantity: potental_energy}\ntime", ("outputs.Vc", "potential_energy")),
        ("{mechanism: true, quantity: potential", "{mechanism: arm, quantity: potential", ("outputs.V", "arm")),
        ("mass: 3 kg, inertia: 1 kg*m^2", "angle: 0", ("outputs.E2", "mass")),
        ("{body: arm, quantity: kinetic_energy}", "{body: arm, quantity: kinetic_energy, order: 1}", ("Ta", "order")),
    ],
)
def test_bad_files(tmp_path, old, new, words):
    assert old in FILE
    path = tmp_path / "bad.yaml"
    path.write_text(FILE.replace(old, new))
    with pytest.raises(MechanismFileError) as raised:
        jn.load(path)
    assert all(word in str(raised.value) for word in words), str(raised.value)
    assert raised.value.line is not None
