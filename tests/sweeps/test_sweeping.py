"""Sweeps: what is kept of every design, what is computed again and what is not, and that nothing foreign is touched."""

import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import xarray

import jounce as jn
from jounce.cli import main
from jounce.errors import JounceError, OutputError, UnsupportedError
from jounce.sweeps import cluster, manifest
from jounce.sweeps.fingerprints import fingerprint
from jounce.sweeps.problems import Torques

FILE = pathlib.Path("examples/four_bar.yaml").resolve()
TIME = np.linspace(0.0, 2.0, 9)
VARY = {"BC": "10cm:16cm:9", "AB": [0.03, 0.04, 0.05]}
COUNT = 27
SETTINGS = {"time": TIME, "order": 2, "workers": 0, "chunk": 16}


def swept(out, model=FILE, vary=VARY, **changed):
    return jn.sweep(model, vary, out, **SETTINGS | changed)


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A sweep in which a few designs cannot be assembled or lock."""
    folder = tmp_path_factory.mktemp("done") / "sweep.zarr"
    reports = []
    found = swept(folder, histories=True, progress=lambda *x: reports.append(x))
    assert reports == [(16, COUNT), (27, COUNT)]
    return folder, found


def marks(folder):
    return folder / "chunks" / "digest" / "c"


@pytest.mark.slow
def test_every_design_has_the_statistics_of_its_own_motion(done):
    _, found = done
    mechanism = jn.load(FILE)
    good = np.flatnonzero(found["first_status"].values == 0)
    for k in (good[0], good[-1]):
        values = {"AB": float(found["AB"][k]), "BC": float(found["BC"][k])}
        motion = jn.solve(mechanism.with_parameters(**values), TIME, 2)
        for name, history in motion.outputs.items():
            assert np.allclose(found[name][k].values, history, rtol=1e-11, atol=1e-11)
            size = np.abs(history).max(axis=0)
            assert np.allclose(found[f"{name}_peak"][k], size, rtol=1e-11)
            assert np.allclose(found[f"{name}_min"][k], history.min(axis=0), rtol=1e-10, atol=1e-12)
            assert np.allclose(found[f"{name}_max"][k], history.max(axis=0), rtol=1e-10, atol=1e-12)
            mean = np.trapezoid(history**2, TIME, axis=0) / 2.0
            assert np.allclose(found[f"{name}_rms"][k], np.sqrt(mean), rtol=1e-10, atol=1e-12)
            at = found[f"{name}_peak_time"][k].values
            there = np.take_along_axis(np.abs(history), np.searchsorted(TIME, at)[None], axis=0)[0]
            assert np.allclose(there, size, rtol=1e-10)
    assert found["BC"].values[::3].tolist() == np.linspace(0.10, 0.16, 9).tolist()
    assert found["psi_peak"].attrs["units"] == "rad"


@pytest.mark.slow
def test_a_design_that_fails_has_a_status_and_no_statistics(done):
    _, found = done
    bad = found["first_status"].values != 0
    assert 0 < bad.sum() < COUNT
    assert ((found["failed_instants"].values > 0) == bad).all()
    assert (np.isnan(found["psi_peak"].values).all(axis=1) == bad).all()
    assert np.isfinite(found["C_rms"].values[~bad]).all()
    status = found["status"].values
    assert ((status != 0).sum(axis=1) == found["failed_instants"].values).all()


@pytest.mark.slow
def test_it_opens_lazily_and_says_what_it_is(done):
    folder, _ = done
    found = xarray.open_zarr(folder)
    assert found["psi_peak"].chunks is not None
    assert dict(found["C"].sizes) == {"design": COUNT, "time": 9, "derivative": 3, "component": 2}
    record = json.loads(found.attrs["manifest"])
    assert record["checksum"] == found.attrs["checksum"]
    assert record["designs"] == COUNT
    assert list(record["files"]) == ["four_bar.yaml"]
    assert record["options"]["order"] == 2


def test_only_what_is_missing_is_computed_again_to_the_same_bits(done, tmp_path):
    whole = swept(tmp_path / "a.zarr").attrs["checksum"]
    assert whole != done[1].attrs["checksum"]  # which keeps histories, too
    (marks(tmp_path / "a.zarr") / "1").unlink()
    before = (tmp_path / "a.zarr" / "psi_peak" / "c" / "0" / "0").stat().st_mtime_ns
    reports = []
    again = swept(tmp_path / "a.zarr", progress=lambda *x: reports.append(x))
    assert reports == [(16, COUNT), (27, COUNT)]
    assert again.attrs["checksum"] == whole
    assert (tmp_path / "a.zarr" / "psi_peak" / "c" / "0" / "0").stat().st_mtime_ns == before
    reports.clear()
    assert swept(tmp_path / "a.zarr", progress=lambda *x: reports.append(x)).attrs["checksum"] == whole
    assert reports == [(27, COUNT)]


@pytest.mark.parametrize("damage", ["lost", "changed", "broken"])
def test_what_was_lost_or_changed_on_the_disk_is_reported_and_computed_again(done, tmp_path, damage):
    folder = tmp_path / "a.zarr"
    shutil.copytree(done[0], folder)
    part = folder / "psi_peak" / "c" / "1" / "0"
    if damage == "lost":
        part.unlink()
    elif damage == "changed":  # well formed, but of other numbers
        shutil.copy(folder / "psi_rms" / "c" / "1" / "0", part)
    else:
        part.write_bytes(part.read_bytes()[:30] + b"xx" + part.read_bytes()[32:])
    with pytest.warns(jn.errors.DamageWarning, match="files of 11 designs"):
        again = swept(folder, histories=True)
    assert again.attrs["checksum"] == done[1].attrs["checksum"]
    assert again["psi_peak"].identical(done[1]["psi_peak"])


def exchanged(one, other):
    kept = one.with_name("kept")
    for source, target in ((one, kept), (other, one), (kept, other)):
        shutil.move(source, target)


def exchange_two(folder, tmp_path):
    """Exchange two chunks that are whole, each with its digest."""
    for array in ("chunks/digest", "psi_peak", "psi_rms", "C_max", "BC", "AB"):
        zero, one = (next((folder / array / "c").glob(f"{k}*"), None) for k in (0, 1))
        if zero is not None and one is not None:
            exchanged(zero, one)


def take_from_another(folder, tmp_path):
    """Put a chunk of another sweep, with its digest, in the place of that of this one."""
    other = tmp_path / "other.zarr"
    swept(other, histories=True, vary={**VARY, "BC": "10cm:15.9cm:9"})
    for part in other.glob("**/c/0"):
        target = folder / part.relative_to(other)
        (shutil.rmtree if target.is_dir() else pathlib.Path.unlink)(target)
        shutil.move(part, target)


@pytest.mark.parametrize("change", [exchange_two, take_from_another])
def test_a_chunk_with_its_digest_is_whole_in_its_own_place_only(tmp_path, change):
    folder = tmp_path / "a.zarr"
    vary = {"BC": "10cm:16cm:8", "AB": [0.03, 0.04, 0.05, 0.045]}  # two chunks of one size
    first = swept(folder, vary=vary, histories=True)
    values, checksum = first["psi_peak"].values, first.attrs["checksum"]
    change(folder, tmp_path)
    with pytest.warns(jn.errors.DamageWarning, match=r"files of (16|32) designs"):
        again = swept(folder, vary=vary, histories=True)
    assert again.attrs["checksum"] == checksum
    assert np.array_equal(again["psi_peak"].values, values, equal_nan=True)


def edited(folder, before, after):
    path = folder / "zarr.json"
    assert before in path.read_text()
    path.write_text(path.read_text().replace(before, after))


def test_a_checksum_is_computed_whatever_stands_in_the_folder(done, tmp_path):
    folder, checksum = tmp_path / "a.zarr", done[1].attrs["checksum"]
    shutil.copytree(done[0], folder)
    edited(folder, checksum, "0" * 64)
    assert xarray.open_zarr(folder).attrs["checksum"] == "0" * 64
    again = swept(folder, histories=True)
    assert again.attrs["checksum"] == checksum
    assert json.loads(again.attrs["manifest"])["checksum"] == checksum


def test_coordinates_that_were_changed_are_written_again(done, tmp_path):
    folder = tmp_path / "a.zarr"
    shutil.copytree(done[0], folder)
    shutil.copy(folder / "BC" / "c" / "0", folder / "time" / "c" / "0")
    with pytest.warns(jn.errors.DamageWarning, match="files of time were lost or changed"):
        again = swept(folder, histories=True)
    assert np.array_equal(again["time"].values, TIME)
    assert again.attrs["checksum"] == done[1].attrs["checksum"]


def test_what_computes_is_part_of_a_sweep(done, tmp_path, monkeypatch):
    """XLA and machine code round otherwise: one does not go on with the sweep of the other."""
    folder, found = done
    arithmetic = json.loads(found.attrs["manifest"])["arithmetic"]
    assert arithmetic["device"] == "cpu"
    monkeypatch.setenv("JOUNCE_NATIVE", "1" if arithmetic["machine code"] == "not used" else "0")
    if arithmetic == manifest.arithmetic():
        pytest.skip("there is no compiler, so that all is computed by XLA")
    with pytest.raises(OutputError, match=r"machine code is (llvmlite .* there, and not used|not used there,.*) here"):
        swept(folder, histories=True)
    with pytest.raises(OutputError, match=r"a worker rounds otherwise .* machine code is .* same packages"):
        manifest.check_same_arithmetic({"arithmetic": arithmetic}, str(folder))


def test_another_sweep_is_refused_and_nothing_of_the_first_is_lost(done, tmp_path):
    folder, found = done
    changed = tmp_path / "four_bar.yaml"
    changed.write_text(FILE.read_text().replace("20.31 cm", "20.32 cm"))
    cases = [
        ({"order": 3}, "order is 2 there, and 3 here"),
        ({"time": TIME[:5]}, "time is 9 instants"),
        ({"chunk": 32}, "chunk is 16 there"),
        ({"histories": False}, "histories is True there"),
        ({"vary": {**VARY, "BC": "10cm:16cm:10"}}, "BC is 0.1:0.16:9 there, and 0.1:0.16:10 here"),
        ({"vary": {"BC": "10cm:16cm:9"}}, "AB is 3 values"),
        ({"vary": dict(reversed(VARY.items()))}, "the order of what varies is BC, AB there"),
        ({"model": changed}, "the file four_bar.yaml differs"),
        ({"model": jn.load(FILE).with_parameters(tau=3)}, "the file four_bar.yaml is not read"),
    ]
    for changes, message in cases:
        with pytest.raises(OutputError, match=message):
            swept(folder, **{"histories": True} | changes)
    assert swept(folder, histories=True).attrs["checksum"] == found.attrs["checksum"]


def test_a_folder_that_is_no_sweep_stays_as_it_is(tmp_path):
    foreign = tmp_path / "mine.zarr"
    foreign.mkdir()
    (foreign / "notes").write_text("mine")
    with pytest.raises(OutputError, match="not a sweep of jounce"):
        swept(foreign)
    assert [x.name for x in foreign.iterdir()] == ["notes"]
    for name, message in (("a.nc", "ends in .zarr"), ("no/a.zarr", "does not exist")):
        with pytest.raises(OutputError, match=message):
            swept(tmp_path / name)
    assert [x.name for x in tmp_path.iterdir()] == ["mine.zarr"]


@pytest.mark.slow
def test_two_processes_do_not_write_the_same_sweep(done):
    import fcntl

    folder, found = done
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        with pytest.raises(OutputError, match="another process"):
            swept(folder, histories=True)
    finally:
        os.close(descriptor)
    assert swept(folder, histories=True).attrs["checksum"] == found.attrs["checksum"]


def test_what_cannot_be_swept_is_refused_before_anything_is_written(tmp_path):
    out = tmp_path / "a.zarr"
    mechanism = jn.load(FILE)
    cases = [
        ({"vary": {"BX": "1:2:3"}}, "no parameter has this name"),
        ({"vary": {"BX": (1, 2, 3)}}, "no parameter has this name"),
        ({"vary": {"BC": "16cm:10cm:3"}}, "lower bound"),
        ({"vary": {"BC": (0.1, 0.2)}}, "LOW:HIGH:COUNT"),
        ({"chunk": 0}, "whole number"),
        ({"order": -1}, "order"),
        ({"tolerance": 2.0}, "tolerance"),
        ({"trajectory": "x.csv"}, "goes with a robot"),
        ({"method": jn.Taylor()}, "simulate=True"),
        ({"model": jn.load_robot("examples/robots/ur5.urdf")}, "on a trajectory"),
    ]
    for changes, message in cases:
        with pytest.raises(JounceError, match=message):
            swept(out, **{"model": mechanism} | changes)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_full_disk_loses_nothing(done, tmp_path, monkeypatch):
    from jounce.sweeps import store

    whole = swept(tmp_path / "whole.zarr").attrs["checksum"]
    synced, full = store._sync, [True]

    def sync(path):
        if full[0] and path.parts[-3:] == ("c", "1", "0"):
            raise OSError(28, "No space left on device")
        synced(path)

    monkeypatch.setattr(store, "_sync", sync)
    out = tmp_path / "full.zarr"
    with pytest.raises(OutputError, match=r"No space left.*16 of 27 designs .*kept") as caught:
        swept(out)
    assert caught.value.while_writing  # for which the command ends with 1
    assert [x.name for x in marks(out).iterdir()] == ["0"]
    assert np.isfinite(xarray.open_zarr(out)["psi_peak"].values[3:16]).any()
    full[0] = False
    assert swept(out).attrs["checksum"] == whole


@pytest.mark.slow
def test_an_attempt_of_which_nothing_was_computed_makes_way(tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "POLL", 0.2)
    out = tmp_path / "a.zarr"
    with pytest.raises(JounceError, match=r"no Dask scheduler .*0\.3 s.*0 of 27 designs"):
        swept(out, workers=None, scheduler="tcp://127.0.0.1:9", timeout=0.3)
    assert swept(out, vary={"BC": "12cm:14cm:27"})["BC"].size == 27


def test_missing_packages_are_named(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(UnsupportedError, match=r"zarr and distributed.*'jounce\[sweep\]'"):
        cluster.check_installed("zarr", "distributed")


def test_fingerprints_tell_values_apart():
    mechanism = jn.load(FILE)
    assert fingerprint(mechanism) == fingerprint(jn.load(FILE))
    others = [mechanism.with_parameters(BC=np.nextafter(0.1423, 1)), mechanism.with_parameters(tau="2"), [mechanism]]
    assert len({fingerprint(x) for x in (mechanism, *others)}) == 3  # "2" is the 2 s of the file
    assert fingerprint(np.zeros(2)) != fingerprint(np.zeros(2, int))
    assert fingerprint([1, [2, 3]]) != fingerprint([[1, 2], 3])
    assert fingerprint(lambda x: x + 1) != fingerprint(lambda x: x + 2)
    circle = []
    circle.append(circle)
    assert fingerprint(circle) == fingerprint([circle])[:0] + fingerprint(circle)


def test_the_command_prints_peaks_and_a_checksum(tmp_path, capsys):
    short = tmp_path / "short.yaml"
    short.write_text(FILE.read_text().replace("step: 0.01", "step: 0.25"))
    command = ["sweep", short, "--vary", "BC=13cm:15cm:9", "--vary", "AB=3cm:4cm:3", "--order", 2, "--workers", 0]
    command = [*map(str, command), "--chunk", "16", "--out", str(tmp_path / "a.zarr")]
    assert main(command) == 0
    text = capsys.readouterr().out
    assert "short.yaml: 27 designs (BC, AB) at 9 instants" in text
    assert "all were solved" in text
    found = xarray.open_zarr(tmp_path / "a.zarr")
    assert found.attrs["checksum"] in text
    assert main([*command, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    from jsonschema import Draft202012Validator

    from jounce.reporting.json.result_schema import result_schema

    Draft202012Validator(result_schema()).validate(result)
    peak = next(x for x in result["peaks"] if x["output"] == "C_y" and x["derivative"] == 2)
    values = found["C_peak"].sel(component="y", derivative=2).values
    assert peak["least"] == values.min()
    assert peak["least_at"] == {name: float(found[name][values.argmin()]) for name in ("BC", "AB")}
    assert main([*command, "--histories"]) == 2
    assert "another sweep is there" in capsys.readouterr().err


@pytest.mark.slow
def test_torques_are_linear_in_loads_and_drives_and_follow_the_speed(tmp_path):
    robot = jn.load_robot("examples/robots/planar_arm.xml")
    trajectory = jn.load_trajectory("examples/trajectories/planar_arm_lift.yaml")
    link, joint = list(robot.links)[-1], robot.joint_names[0]
    vary = {f"payload.{link}": [0.0, 2.0], f"damping.{joint}": [0.0, 0.3], "speed": [1.0, 2.0]}
    found = jn.sweep(robot, vary, tmp_path / "a.zarr", order=3, trajectory=trajectory, workers=0, histories=True)
    for k in range(8):
        load, damping, speed = (float(found[name][k]) for name in vary)
        loaded = robot.with_payload(link, jn.Inertia(load)) if load else robot
        joints = [
            jn.Joint(**vars(x) | {"damping": damping if x.name == joint else x.damping}) for x in loaded.joints.values()
        ]
        changed = jn.Robot(robot.name, list(loaded.links.values()), joints, robot.gravity)
        q = np.zeros((len(trajectory.times), 4, len(robot.joint_names)))
        columns = [robot.joint_names.index(name) for name in trajectory.names]
        q[:, :, columns] = trajectory.derivatives(trajectory.times, 3) * (speed ** np.arange(4))[:, None]
        expected = jn.inverse_dynamics(changed, q, drives=True)
        for n, name in enumerate(robot.joint_names):
            assert np.allclose(found[name][k], expected[..., n], rtol=1e-11, atol=1e-11 * np.abs(expected).max())
        start = trajectory.times[0]
        when = start + (trajectory.times[np.abs(expected[:, 0, 0]).argmax()] - start) / speed
        assert float(found[f"{joint}_peak_time"][k, 0]) == pytest.approx(when)
    with pytest.raises(JounceError, match="speed: must be above zero"):
        Torques(robot, trajectory).histories({"speed": np.array([1.0, 0.0])}, 1)
    with pytest.raises(JounceError, match="no parameter of a robot has this name"):
        jn.sweep(robot, {"payload.hnd": "0:1:2"}, tmp_path / "b.zarr", trajectory=trajectory, workers=0)


@pytest.mark.slow
def test_simulations_start_and_weigh_as_each_design_says(tmp_path):
    swing = jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        parameters={"lift": 0.1, "m": 2.0},
        bodies={"mass": jn.Body([0, 0], mass="m", inertia=1.0)},
        joints={"slide": jn.planar.Prismatic(("ground", "mass"), [0, 0], [0, 0], [0, 1], [0, 1])},
        initial={"rise": jn.drivers.CoordinateDriver(("ground", "mass"), "y", motion="lift")},
        outputs={"place": jn.outputs.PointOutput("mass", [0, 0])},
    )
    vary = {"lift": "0:1:3", "m": [1.0, 3.0]}
    settings = {"simulate": True, "method": jn.Taylor(8), "workers": 0, "histories": True}
    found = jn.sweep(swing, vary, tmp_path / "a.zarr", [0.0, 0.5, 1.0], 2, **settings)
    fall = found["lift"].values[:, None] - 9.81 / 2 * np.array([0.0, 0.5, 1.0]) ** 2
    assert np.allclose(found["place"].sel(component="y", derivative=0), fall, atol=1e-12)
    assert found["failed_instants"].values.tolist() == [0] * 6


SCRIPT = """
import sys
import numpy as np
import jounce as jn
if __name__ == "__main__":
    vary = {"BC": "10cm:16cm:9", "AB": [0.03, 0.04, 0.05]}
    found = jn.sweep(sys.argv[1], vary, sys.argv[2], np.linspace(0.0, 2.0, 9), 2, workers=2, chunk=4)
    print(found.attrs["checksum"])
"""


def workers_of(process):
    found = []
    for entry in pathlib.Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = int(entry.read_text().rpartition(")")[2].split()[1])
            command = entry.with_name("cmdline").read_bytes()
        except OSError:
            continue
        if parent == process.pid and b"spawn_main" in command:
            found.append(int(entry.parent.name))
    return found


@pytest.mark.slow
@pytest.mark.skipif(not pathlib.Path("/proc/self/stat").exists(), reason="processes are found in /proc")
def test_a_killed_worker_and_a_killed_client_lose_nothing(tmp_path):
    script, out = tmp_path / "sweeping.py", tmp_path / "killed.zarr"
    script.write_text(SCRIPT)

    def started():
        command = [sys.executable, str(script), str(FILE), str(out)]
        programs = {"JAX_COMPILATION_CACHE_DIR": str(tmp_path), "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.05"}
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        return subprocess.Popen(command, **pipes, text=True, env=os.environ | programs)

    def wait_for(count):
        stop = time.monotonic() + 200
        while not marks(out).is_dir() or len(list(marks(out).glob("[0-9]*"))) < count:
            assert time.monotonic() < stop
            time.sleep(0.005)

    client = started()
    wait_for(1)
    workers = workers_of(client)
    assert len(workers) == 2
    os.kill(workers[0], signal.SIGKILL)
    client.kill()
    client.communicate()
    kept = {x.name for x in marks(out).glob("[0-9]*")}
    client = started()
    wait_for(len(kept) + 1)
    os.kill(workers_of(client)[-1], signal.SIGKILL)
    text, errors = client.communicate(timeout=300)
    assert client.returncode == 0, errors
    assert kept
    assert text.strip() == swept(tmp_path / "whole.zarr", chunk=4).attrs["checksum"]


@pytest.mark.slow
def test_peaks_at_the_knots_of_a_law_are_kept_of_every_design(tmp_path):
    """A 3-4-5 profile, whose jerk is 60 by way and duration at both ends, at instants that depend on the design."""
    law = jn.laws.SegmentedMotion(
        [jn.laws.Segment("dwell", "T/3"), jn.laws.Segment("polynomial_3_4_5", "T", by=0.1)], beyond="hold"
    )
    crank = jn.Mechanism(
        space="planar",
        parameters={"T": 0.5},
        bodies={"crank": jn.Body([0, 0])},
        joints={"O": jn.planar.Revolute(("ground", "crank"), [0, 0], [0, 0])},
        drivers={"turn": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", motion=law)},
        outputs={"angle": jn.outputs.AngleOutput("crank")},
    )
    durations = np.array([0.4, 0.5, 0.7])
    settings = {"time": np.linspace(0.0, 1.0, 8), "order": 3, "workers": 0}
    found = jn.sweep(crank, {"T": durations.tolist()}, tmp_path / "sweep.zarr", **settings)
    np.testing.assert_allclose(found["angle_peak"].values[:, 3], 6 / durations**3, rtol=1e-8)
    np.testing.assert_allclose(found["angle_max"].values[:, 3], 6 / durations**3, rtol=1e-8)
    at = found["angle_peak_time"].values[:, 3]
    assert np.minimum(np.abs(at - durations / 3), np.abs(at - durations * 4 / 3)).max() < 1e-12


def test_torque_rates_at_the_knots_of_a_law_are_kept(tmp_path):
    """A rod about a vertical axis: its torque is the acceleration by its inertia, whose rate jumps at the knot."""
    rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 12, 1 / 12])
    pin = jn.Joint("pin", "base", "rod", axis=[0, 0, 1])
    robot = jn.Robot("arm", [jn.Link("base"), jn.Link("rod", rod)], [pin])
    knot = 0.337
    law = jn.laws.PiecewiseMotion(
        ["t**4", f"{knot}**4 + 4*{knot}**3*(t-{knot}) + 6*{knot}**2*(t-{knot})**2"], until=[knot]
    )
    trajectory = jn.JointTrajectory({"pin": law}, start=0.0, stop=0.5, times=np.linspace(0.0, 0.5, 6))
    swept_torques = Torques(robot, trajectory, rates=1)
    from jounce.sweeps.statistics import statistics

    histories = swept_torques.histories({"speed": np.array([1.0, 2.0])}, 1)
    beside = histories.sides.values["pin"], histories.sides.instants
    result = statistics(histories.values["pin"], swept_torques.instants, histories.pace, beside)
    np.testing.assert_allclose(result["peak"][:, 1], 24 * knot / 3 * np.array([1.0, 2.0**3]), rtol=1e-9)
    np.testing.assert_allclose(result["peak_time"][:, 1], [knot, knot / 2], rtol=1e-12)
