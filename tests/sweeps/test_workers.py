"""Workers that are not as the client is: of other releases, without its files or folder; clients that are killed."""

import json
import os
import pathlib
import pickle
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import jounce as jn
from jounce.errors import JounceError, MechanismFileError, OutputError
from jounce.sweeps import chunks, cluster, manifest
from jounce.sweeps.problems import Motions
from jounce.sweeps.sweeping import prepare

FILE = pathlib.Path("examples/four_bar.yaml").resolve()


@pytest.fixture
def plan(tmp_path):
    problem = Motions(jn.load(FILE), np.linspace(0.0, 1.0, 3), 1)
    return prepare(problem, {"BC": [0.14, 0.15]}, tmp_path / "a.zarr", "four-bar", {})


def content(plan, user_files=None):
    return pickle.dumps((None, user_files, pickle.dumps(plan)))


def test_a_worker_finds_out_by_itself_whether_it_sees_the_folder(plan):
    assert plan.store.folder == plan.folder  # which the client has looked at, and does not hand on
    sent = chunks._loaded(content(plan))
    shutil.move(plan.folder, plan.folder.with_name("b.zarr"))
    with pytest.raises(OutputError, match="a worker does not see this sweep there"):
        sent.compute(0)
    assert not plan.folder.exists()


@pytest.mark.slow
def test_a_worker_whose_client_was_followed_by_another_writes_nothing(plan):
    sent = chunks._loaded(content(plan))
    assert sent.store.folder == plan.folder
    before = plan.store.reread()
    other = prepare(plan.problem, {"BC": [0.13, 0.15]}, plan.folder, "four-bar", {})
    assert other.store.reread()["identity"] != before["identity"]
    with pytest.raises(OutputError, match="a worker does not see this sweep there"):
        sent.compute(0)
    assert not other.store.done(1).any()


def test_a_worker_of_another_release_computes_nothing(plan, monkeypatch):
    sent = chunks._loaded(content(plan))
    monkeypatch.setattr("jounce.version.__version__", "0.3.9")
    with pytest.raises(OutputError, match=r"a worker rounds otherwise .* jounce is .* there, and 0\.3\.9 here"):
        sent.compute(0)


def test_what_a_worker_cannot_load_is_reported():
    class Mine:
        pass

    Mine.__qualname__ = "Mine"
    Mine.__module__ = "my_own_module"
    sys.modules["my_own_module"] = type(sys)("my_own_module")
    sys.modules["my_own_module"].Mine = Mine
    sent = content(Mine())
    del sys.modules["my_own_module"]
    with pytest.raises(JounceError, match=r"cannot load .*No module named 'my_own_module'.*same release of jounce"):
        chunks._loaded(sent)
    with pytest.raises(JounceError, match="a worker cannot load what is to be computed"):
        chunks._loaded(b"written by another release")


def test_a_python_file_of_the_user_is_the_same_where_a_worker_is(plan, tmp_path):
    own = tmp_path / "own.py"
    with pytest.raises(MechanismFileError, match=r"own\.py: file not found .*seen from a worker"):
        chunks._loaded(content(plan, {str(own): "0" * 64}))
    own.write_text("x = 1\n")
    with pytest.raises(MechanismFileError, match=r"own\.py: is another file where a worker is"):
        chunks._loaded(content(plan, {str(own): "0" * 64}))


class Client:
    """What tells the releases of workers."""

    _get_versions = None

    def __init__(self, **workers):
        client = {"packages": dict.fromkeys(manifest.versions(), "1.0")}
        self.answer = {
            "client": client,
            "workers": {name: {"packages": packages} for name, packages in workers.items()},
        }

    def sync(self, *_, **__):
        return self.answer


@pytest.mark.parametrize("name", ["jounce", "jax", "numpy"])
def test_releases_are_compared_before_anything_is_sent(name):
    same = dict.fromkeys(manifest.versions(), "1.0")
    cluster._check_releases(Client(a=same), 1.0)
    cluster._check_releases(Client(), 1.0)
    with pytest.raises(JounceError, match=rf"the worker b has {name} 0\.9, the client has 1\.0; all must"):
        cluster._check_releases(Client(a=same, b=same | {name: "0.9"}), 1.0)
    with pytest.raises(JounceError, match=f"the worker b has no {name}, the client has"):
        cluster._check_releases(Client(a=same, b=same | {name: None}), 1.0)


@pytest.fixture
def scheduler(tmp_path):
    """A cluster of one worker, as others start one."""
    surroundings = os.environ | {"TMPDIR": str(tmp_path)}
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": surroundings}
    file = tmp_path / "scheduler.json"
    place = ["--no-dashboard", "--dashboard-address", "127.0.0.1:0"]
    command = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--port", "0", "--scheduler-file", str(file)]
    running = [subprocess.Popen([*command, *place], **quiet)]
    try:
        stop = time.monotonic() + 120
        while not file.exists():
            assert time.monotonic() < stop
            time.sleep(0.1)
        address = json.loads(file.read_text())["address"]
        command = [sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-dashboard"]
        running.append(subprocess.Popen([*command, "--local-directory", str(tmp_path / "worker")], **quiet))
        yield address
    finally:
        for process in running[::-1]:
            process.send_signal(signal.SIGTERM)
            process.wait(60)


@pytest.mark.slow
def test_a_killed_client_of_a_cluster_loses_nothing(scheduler, tmp_path):
    out = tmp_path / "a.zarr"
    options = "--vary BC=13cm:15cm:200 --vary AB=3cm:4cm:4 --order 1 --chunk 16 --timeout 100".split()
    command = [sys.executable, "-m", "jounce", "sweep", str(FILE), *options]
    client = subprocess.Popen([*command, "--out", str(out), "--scheduler", scheduler])
    stop = time.monotonic() + 200
    while not any(out.glob("chunks/digest/c/[0-9]*")):
        assert client.poll() is None
        assert time.monotonic() < stop
        time.sleep(0.02)
    client.kill()
    client.wait()
    subprocess.run([*command, "--out", str(out), "--scheduler", scheduler], check=True, timeout=200)
    subprocess.run([*command, "--out", str(tmp_path / "b.zarr"), "--workers", "0"], check=True, timeout=200)
    sums = [
        json.loads((tmp_path / name / "zarr.json").read_text())["attributes"]["checksum"]
        for name in ("a.zarr", "b.zarr")
    ]
    assert sums[0] == sums[1] != ""
    assert not any(out.glob(".scratch-*"))


def test_the_environment_is_as_before_when_workers_have_ended(monkeypatch):
    monkeypatch.setenv("PJRT_NPROC", "3")
    monkeypatch.delenv("PYTHONSAFEPATH", raising=False)
    before = dict(os.environ)
    with cluster._environment():
        assert os.environ["PJRT_NPROC"] == "3"
        os.environ["PJRT_NPROC"], inside = "7", dict(os.environ)  # Dask sets it, too
    assert inside["PYTHONSAFEPATH"] == "1"
    assert dict(os.environ) == before
