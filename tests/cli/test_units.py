"""Units of results: tables, files, figures and the view; and what reads such files back."""

import csv
import dataclasses
import json
import math
import pathlib

import numpy as np
import pytest

import jounce as jn
from jounce import io
from jounce.cli import main
from jounce.execution.backends import uses_machine_code

FOUR_BAR = "examples/four_bar.yaml"


@pytest.fixture(scope="module")
def four_bar():
    mechanism = dataclasses.replace(jn.load(FOUR_BAR), units={"angle": "deg", "C": "mm"})
    return mechanism, jn.solve(mechanism, np.linspace(0.0, 2.0, 41), order=2)


def test_inside_is_si_and_what_is_shown_says_its_units(four_bar, tmp_path):
    mechanism, motion = four_bar
    plain = motion.dataset
    assert plain["psi"].attrs["units"] == "rad"
    shown = io.in_units(plain, mechanism.shown_units)
    assert (shown["psi"].attrs["units"], shown["C"].attrs["units"]) == ("deg", "mm")
    np.testing.assert_allclose(shown["psi"], np.degrees(plain["psi"]), rtol=1e-15)
    np.testing.assert_allclose(shown["C"], 1e3 * plain["C"], rtol=1e-15)
    assert plain["psi"].attrs["units"] == "rad"  # not changed
    for ending in ("nc", "csv"):
        io.write(shown, tmp_path / f"motion.{ending}")
        again = io.read(tmp_path / f"motion.{ending}")
        np.testing.assert_array_equal(again["C"], shown["C"])
        assert again["C"].attrs["units"] == "mm"
        assert again["psi"].attrs["units"] == "deg"
    with pytest.raises(jn.errors.UnitError, match="measures a length"):
        io.in_units(plain, {"psi": "mm"})


def test_figures_peaks_and_the_view_are_in_the_units_of_the_file(four_bar):
    from jounce.plot import draw, hodograph, phase_portrait
    from jounce.reporting.peaks import peaks, shown_peaks
    from jounce.viewer.subjects.mechanisms import recorded

    mechanism, motion = four_bar
    labels = [axes.get_ylabel() for axes in draw(motion).axes]
    assert any("(deg/s$^2$)" in label for label in labels)
    assert any("mm" in label for label in labels)
    assert "mm" in hodograph(motion, "C", 1).axes[0].get_xlabel()
    assert "(deg)" in phase_portrait(motion, "psi").axes[0].get_xlabel()
    by_name = {(x.output, x.derivative): x for x in shown_peaks(peaks(motion, refine=False), mechanism.shown_units)}
    assert by_name["C_x", "velocity"].unit == "mm/s"
    assert by_name["C_x", "velocity"].maximum == pytest.approx(1e3 * motion.outputs["C"][:, 1, 0].max())
    seen = recorded(motion).quantities()
    assert (seen["psi"].unit, seen["C"].unit) == ("deg", "mm")
    np.testing.assert_allclose(seen["psi"].values[:, 0, 0], np.degrees(motion.outputs["psi"][:, 0]), rtol=1e-15)


def heading(path):
    with path.open(newline="") as stream:
        return next(csv.reader(stream))


def test_headings_say_units_where_they_are_not_si(four_bar, tmp_path):
    mechanism, motion = four_bar
    shown = io.in_units(motion.dataset, mechanism.shown_units)
    names = ["time", "psi", "psi_d1", "psi_d2", "C_x", "C_x_d1", "C_x_d2", "C_y", "C_y_d1", "C_y_d2"]
    si = ["s", "rad", "rad/s", "rad/s^2", *["m", "m/s", "m/s^2"] * 2]
    other = ["s", "deg", "deg/s", "deg/s^2", *["mm", "mm/s", "mm/s^2"] * 2]
    path = tmp_path / "motion.csv"
    for dataset, asked, units in (
        (motion.dataset, None, None),
        (motion.dataset, True, si),
        (shown, None, other),
        (shown, False, None),
    ):
        io.write(dataset, path, header_units=asked)
        expected = names if units is None else [f"{name} [{unit}]" for name, unit in zip(names, units, strict=True)]
        assert heading(path) == expected


SAMPLED = """
space: planar
bodies: {a: {position: [0, 0]}}
joints: {O: {type: revolute, bodies: [ground, a], points: [[0, 0], [0, 0]]}}
drivers: {d: {type: coordinate, bodies: [ground, a], coordinate: angle, motion: {samples: motion.csv, value: COLUMN}}}
outputs: {angle: {body: a, quantity: angle}}
"""


def test_a_file_in_degrees_is_never_taken_for_radians(four_bar, tmp_path):
    mechanism, motion = four_bar
    io.write(io.in_units(motion.dataset, mechanism.shown_units), tmp_path / "motion.csv")

    def law(column):
        (tmp_path / "again.yaml").write_text(SAMPLED.replace("COLUMN", column))
        return jn.load(tmp_path / "again.yaml").drivers["d"].motion

    for column in ("psi", "'psi [deg]'"):
        values = np.asarray(law(column)(jn.Jet([motion.time])).coefficients[0])
        np.testing.assert_allclose(values, motion.outputs["psi"][:, 0], rtol=1e-13)
    for column, words in (("C_x", "measures a length, not an angle"), ("psi_d1", "angle/time, not an angle")):
        with pytest.raises(jn.errors.MechanismFileError, match=words) as caught:
            law(column)
        assert "motion.csv" in str(caught.value)
    text = (tmp_path / "motion.csv").read_text().replace("[deg]", "[degx]", 1)
    (tmp_path / "motion.csv").write_text(text)
    with pytest.raises(jn.errors.MechanismFileError, match="unknown unit"):
        law("psi")


def test_trajectories_of_robots_read_units(tmp_path):
    path = tmp_path / "swing.csv"
    rows = "".join(f"{t},{30 * t},{500 * t},30\n" for t in range(8))
    path.write_text("time [s],elbow [deg],slide [mm],elbow_d1 [deg/s]\n" + rows)
    found = jn.load_trajectory(path, degree=3)
    assert found.names == ("elbow", "slide")
    elbow, slide = (np.asarray(found.laws[name](jn.Jet([np.array([2.0])])).coefficients[0]) for name in found.names)
    np.testing.assert_allclose([elbow[0], slide[0]], [math.radians(60), 1.0], rtol=1e-12)
    path.write_text("time,elbow [deg/s]\n" + "".join(f"{t},30\n" for t in range(8)))
    with pytest.raises(jn.errors.TrajectoryError, match="angle/time, not an angle or a length"):
        jn.load_trajectory(path, degree=3)
    path.write_text("time [mm],elbow\n" + "".join(f"{t},30\n" for t in range(8)))
    with pytest.raises(jn.errors.TrajectoryError, match="measures a length, not a time"):
        jn.load_trajectory(path, degree=3)


def test_the_option_goes_before_the_file_and_json_stays_in_si(tmp_path, capsys):
    text = f"units: {{angle: rev, length: cm}}\n{pathlib.Path(FOUR_BAR).read_text()}"
    file = tmp_path / "four_bar.yaml"
    file.write_text(text)
    assert main(["run", str(file), "--order", "1", "--units", "angle=deg", "--no-refine"]) == 0
    printed = capsys.readouterr().out
    assert " deg/s " in printed
    assert " cm/s " in printed
    assert main(["run", str(file), "--order", "1", "--json", "--no-refine"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {peak["unit"] for peak in found["peaks"]} == {"rad", "rad/s", "m", "m/s"}
    assert found["backend"] == ("llvm" if uses_machine_code() else "xla")
    assert main(["inspect", "examples/robots/scara.urdf", "--units", "angle=deg"]) == 2
    assert "--units: is for mechanism files" in capsys.readouterr().err
    file.write_text(text.replace("rev", "mm", 1))
    assert main(["run", str(file)]) == 2
    assert "line 1, units.angle: measures a length, not an angle" in capsys.readouterr().err
