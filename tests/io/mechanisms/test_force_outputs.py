"""Forces as outputs of files: read, solved, tabulated, written and read back."""

import json

import numpy as np
import pytest

import jounce as jn
from jounce import cli, io
from jounce.errors import MechanismFileError
from jounce.io.mechanisms.schema.output_types import output_types
from jounce.plot import draw
from jounce.reporting.peaks import peaks

FILE = """\
space: planar
gravity: [0, -9.81]
parameters: {r: 20 cm}
bodies:
  arm: {mass: 2 kg, inertia: 0.3 kg*m^2, center_of_mass: [50 cm, 0]}
joints:
  pin: {type: revolute, bodies: [ground, arm], points: [[0, 0], [0, 0]]}
drivers:
  turn: {type: coordinate, bodies: [ground, arm], coordinate: angle, motion: 0.4*sin(3*t)}
forces:
  spring: {type: torsional_spring, bodies: [ground, arm], stiffness: 3 N*m/rad}
outputs:
  angle: {body: arm, quantity: angle}
  T: {driver: turn, quantity: torque}
  R: {joint: pin, quantity: reaction, frame: arm}
  F: {joint: pin, quantity: force, body: ground}
  M: {joint: pin, quantity: torque, point: [r, 0]}
  S: {force: spring, quantity: torque}
time: {start: 0, stop: 0.5, count: 4}
"""


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("forces") / "arm.yaml"
    path.write_text(FILE)
    return path


@pytest.fixture(scope="module")
def motion(path):
    return jn.solve(jn.load(path), order=2)


@pytest.mark.slow
def test_outputs_are_what_the_functions_return(motion):
    longer = jn.solve(motion.mechanism, order=4)
    pairs = {
        "T": jn.driver_force(longer, "turn"),
        "R": jn.joint_reaction(longer, "pin", frame="body").force,
        "F": jn.joint_reaction(longer, "pin", "ground").force,
        "M": jn.joint_reaction(longer, "pin", point=[0.2, 0.0]).torque,
        "S": jn.dynamics.applied_force(longer, "spring"),
    }
    for name, expected in pairs.items():
        np.testing.assert_allclose(motion.dataset[name], expected[:, :3], rtol=1e-12, atol=1e-11)
    assert [motion.dataset[name].attrs["units"] for name in ("T", "R", "M", "S")] == ["N*m", "N", "N*m", "N*m"]


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".csv", ".nc"])
def test_files_of_results(motion, tmp_path, suffix):
    io.write(motion.dataset, tmp_path / f"arm{suffix}")
    back = io.read(tmp_path / f"arm{suffix}")
    for name in motion.outputs:
        np.testing.assert_array_equal(back[name], motion.dataset[name])


@pytest.mark.slow
def test_peaks_are_named_torque_yank_and_second_rate(motion):
    named = [(p.output, p.derivative, p.unit) for p in peaks(motion)]
    torque = [("T", "torque", "N*m"), ("T", "yank", "N*m/s"), ("T", "second rate", "N*m/s^2")]
    assert [entry for entry in named if entry[0] == "T"] == torque
    assert [entry[1] for entry in named if entry[0] == "R_x"] == ["force", "yank", "second rate"]
    assert [entry[1] for entry in named if entry[0] == "angle"] == ["position", "velocity", "acceleration"]


@pytest.mark.slow
def test_figures_stack_short_columns(motion):
    axes = draw(motion, ["angle", "T"]).axes
    assert [a.get_visible() and a.axison for a in axes] == [True] * 4
    assert [a.get_title(loc="left") for a in axes] == ["angle", "", "", "T"]
    assert axes[3].get_ylabel() == "torque\n$T$  (N m)"


@pytest.mark.slow
def test_the_command_shows_them(path, capsys):
    assert cli.main(["run", str(path), "--order", "1"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any(line.split()[:3] == ["T", "yank", "N*m/s"] for line in lines)


def test_every_form_is_in_the_schema_and_other_formats():
    schema = json.dumps(jn.io.json_schema())
    for space in ("planar", "spatial"):
        for tag in output_types(space):
            assert f"{space}_{tag.replace(' ', '_')}" in schema


@pytest.mark.parametrize(
    "replaced, by, line, name, says",
    [
        (
            "driver: turn, q",
            "driver: trn, q",
            14,
            "outputs.T.driver",
            "no driver has this name, got 'trn'; did you mean",
        ),
        (
            "driver: turn, quantity: torque",
            "driver: turn, quantity: force",
            14,
            "outputs.T.quantity",
            "prescribes an angle",
        ),
        ("frame: arm", "frame: amr", 15, "outputs.R.frame", "unknown frame, got 'amr'; did you mean 'arm'?"),
        ("body: ground", "body: leg", 16, "outputs.F.body", "is not joined by 'pin', got 'leg'"),
        ("point: [r, 0]", "point: [r, 0, 0]", 17, "outputs.M.point", "must be a list of 2 values"),
        ("point: [r, 0]", "pont: [r, 0]", 17, "outputs.M.pont", "unknown key 'pont'; did you mean 'point'?"),
        ("force: spring", "force: sprng", 18, "outputs.S.force", "no force has this name, got 'sprng'; did you mean"),
        ("spring, quantity: torque", "spring, quantity: force", 18, "outputs.S.quantity", "is a torque, not a force"),
        ("  S:", "  F_x:", 18, "outputs.F_x", "this name is taken by a component of the output 'F'"),
    ],
)
def test_mistakes_have_their_line(tmp_path, replaced, by, line, name, says):
    assert replaced in FILE
    path = tmp_path / "file.yaml"
    path.write_text(FILE.replace(replaced, by, 1))
    with pytest.raises(MechanismFileError) as caught:
        jn.load(path)
    assert str(caught.value).startswith(f"{path}, line {line}, {name}: ")
    assert says in str(caught.value)
