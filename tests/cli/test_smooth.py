"""The command that smooths logs."""

import numpy as np

import jounce as jn
from jounce.cli import main


def test_a_log_is_smoothed_written_and_read(tmp_path, capsys):
    times = np.linspace(0, 2, 401)
    clean = np.sin(2 * times)
    values = clean + 1e-5 * np.random.default_rng(0).normal(size=401)
    log, out = tmp_path / "log.csv", tmp_path / "smooth.csv"
    rows = [f"{t:.9g},{q:.12g}" for t, q in zip(times, values, strict=True)]
    log.write_text("\n".join(["time,elbow_joint", *rows]) + "\n")
    robot = "examples/robots/ur5.urdf"
    assert main(["smooth", robot, str(log), "--deviation", "6e-5", "--out", str(out), "--rate", "200Hz"]) == 0
    said = capsys.readouterr().out
    assert "401 rows from 0 s to 2 s, within 6e-05 rad or m of each sample" in said
    again = jn.load_trajectory(out)
    jerk = again.derivatives(np.linspace(0, 2, 201), 3)[:, 3, 0]
    assert abs(np.abs(jerk).max() / 8 - 1) < 0.2
    assert np.abs(again.derivatives(times, 0)[:, 0, 0] - values).max() <= 6e-5
    assert main(["torques", robot, str(log), "--deviation", "6e-5", "--rates", "1"]) == 0
    assert main(["smooth", robot, str(log), "--deviation", "-1", "--out", str(tmp_path / "none.csv")]) == 2
    assert not (tmp_path / "none.csv").exists()
