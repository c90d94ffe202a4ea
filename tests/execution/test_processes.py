"""Threads and processes: what computes in several of them ends, and what cannot is refused and does not wait."""

import os
import pathlib
import subprocess
import sys

import pytest

NEEDS_FORK = pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
ROOT = pathlib.Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"

PREAMBLE = f"""
import multiprocessing, sys, threading, warnings
import numpy as np
import jounce as jn
warnings.simplefilter("ignore", RuntimeWarning)  # JAX warns at every fork
mechanism = jn.load({str(EXAMPLES / "four_bar.yaml")!r})

def job(_=None):
    return jn.solve(mechanism, [0.0, 0.1], order=1).outputs["psi"].tolist()

def result_or_error(_=None):
    try:
        return job()
    except jn.JounceError as error:
        return type(error).__name__
"""

THREADS = """
rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 0.1, 0.1])
links = [jn.Link("base"), jn.Link("arm", rod)]
robot = jn.Robot("arm", links, [jn.Joint("shoulder", "base", "arm", "revolute", axis=[0, 1, 0])])
pendulum = jn.Mechanism(
    space="planar",
    bodies={"rod": jn.Body([0, 0], mass=1.0, inertia=0.1, center_of_mass=[0.5, 0.0])},
    joints={"O": jn.planar.Revolute(("ground", "rod"), [0, 0], [0, 0])},
    outputs={"angle": jn.outputs.AngleOutput("rod")},
    gravity=[0, -9.81],
)
jobs = [
    job,
    lambda: jn.simulate(pendulum, [0.0, 0.1]).outputs["angle"].tolist(),
    lambda: jn.inverse_dynamics(robot, np.ones((300, 3, 1))).tolist(),
    lambda: jn.solve(mechanism, np.linspace(0, 0.1, 100), order=1).outputs["psi"].tolist(),
]
alone = [job() for job in jobs]
wrong = []

def repeat(k):
    for _ in range(10):
        if jobs[k % len(jobs)]() != alone[k % len(jobs)]:
            wrong.append(k)

for count in (2, 4):
    threads = [threading.Thread(target=repeat, args=(3 * k,), daemon=True) for k in range(count)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
print(len(wrong), "wrong")
"""


def ended(tmp_path, program, *arguments):
    """Run a program in a process of its own, which ends in any case, whatever it waits for."""
    file = tmp_path / "program.py"
    file.write_text(PREAMBLE + program)
    cache = {
        "JAX_COMPILATION_CACHE_DIR": os.environ.get("JAX_COMPILATION_CACHE_DIR", str(tmp_path / "cache")),
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.05",
    }
    done = subprocess.run(
        [sys.executable, file, *arguments],
        capture_output=True,
        text=True,
        env=os.environ | cache,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_threads_compute_at_once(tmp_path):
    assert ended(tmp_path, THREADS) == "0 wrong\n"


@pytest.mark.slow
@NEEDS_FORK
def test_a_fork_of_a_process_that_computed_is_refused(tmp_path):
    program = """
job()
with multiprocessing.get_context("fork").Pool(2) as pool:
    print(set(pool.map(result_or_error, range(4))))
print(result_or_error() == job())
"""
    assert ended(tmp_path, program) == "{'UnsupportedError'}\nTrue\n"


@pytest.mark.slow
@NEEDS_FORK
def test_a_fork_before_the_first_computation_computes(tmp_path):
    program = """
with multiprocessing.get_context("fork").Pool(2) as pool:
    found = pool.map(result_or_error, range(4))
print(all(one == job() for one in found))
"""
    assert ended(tmp_path, program) == "True\n"


@pytest.mark.slow
@pytest.mark.parametrize("method", ["spawn", pytest.param("forkserver", marks=NEEDS_FORK)])
def test_new_processes_compute_after_the_parent_has(tmp_path, method):
    program = """
if __name__ == "__main__":
    expected = job()
    with multiprocessing.get_context(sys.argv[1]).Pool(2) as pool:
        print(all(one == expected for one in pool.map(result_or_error, range(4))))
"""
    assert ended(tmp_path, program, method) == "True\n"


def test_no_module_calls_lapack_through_jax():
    """Batches of LAPACK wait for threads of XLA in a thread of XLA: two programs on two cores may wait for ever."""
    for file in sorted((ROOT / "src").rglob("*.py")):
        text = file.read_text()
        for name in ("jnp.linalg", "lax.linalg", "jax.scipy.linalg", "jnp.polyfit", "jnp.roots"):
            assert name not in text.replace("jnp.linalg.norm", ""), f"{file}: {name}"
