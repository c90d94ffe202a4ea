"""Commands in fresh processes: with an empty folder of compiled programs, and with the one that this left."""

import compileall
import sys
import tempfile
from collections.abc import Callable
from typing import Any

from benchmarks.cases import ROOT, Case, Cases, Contestant, Reported
from benchmarks.processes import command

FILES = {
    "run": ("four_bar.yaml", "rsur.yaml", "stewart_platform.yaml", "delta_robot.yaml", "delta_pick.yaml"),
    "simulate": ("double_pendulum.yaml", "flyball_governor.yaml", "spatial_slider_crank_free.yaml", "sarrus.yaml"),
}
AIM = 2.5  # s, of the second time


def emptied(words: list[str]) -> Callable[[], Any]:
    """Return what runs a command with an empty folder."""

    def run() -> Reported:
        with tempfile.TemporaryDirectory() as folder:
            return Reported(command(words, {"JOUNCE_CACHE_DIR": folder}).wall)

    return run


def filled(words: list[str]) -> Callable[[], Any]:
    """Return what runs a command with the folder that it left before."""
    folder = tempfile.TemporaryDirectory()
    command(words, {"JOUNCE_CACHE_DIR": folder.name})
    return lambda: Reported(command(words, {"JOUNCE_CACHE_DIR": folder.name}).wall)


def cases(quick: bool) -> Cases:
    """Yield `jounce run` and `jounce simulate` of examples, and `jounce check` of a robot."""
    compileall.compile_dir(ROOT / "src", quiet=1)  # what an installation has, and some settings forbid to write
    commands = [[name, f"examples/{file}"] for name, files in FILES.items() for file in files]
    commands.append(["check", "examples/robots/panda.urdf", "examples/trajectories/panda_good.csv"])
    for words in commands[:1] if quick else commands:
        whole = [sys.executable, "-m", "jounce", *words]
        yield Case(
            f"`jounce {' '.join(words[:2])}`",
            [
                Contestant("second time", lambda whole=whole: filled(whole)),
                Contestant("first time", lambda whole=whole: emptied(whole)),
            ],
            clock="wall time",  # two threads compile
            rounds=3,
        )
