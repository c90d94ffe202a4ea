"""A sweep that takes no time, and what its folder holds."""

import json

import numpy as np

from jounce.kinematics import Status
from jounce.sweeps.problems import Histories, Problem, Quantity
from jounce.sweeps.sweeping import prepare, run

TIME = np.linspace(0.0, 1.0, 3)
ROOT = "zarr.json"
VARY = {"size": [1.0, 2.0, 3.0], "phase": [0.25]}


class Waves(Problem):
    """A size times a sine, and a pair of numbers: what takes no time, and needs no compilation."""

    instants, levels = TIME, 2
    nominal = {"size": 1.0, "phase": 0.0}

    def reader(self, name, text):
        raise AssertionError("values are given as numbers")

    def quantities(self):
        return (Quantity("wave", "m"), Quantity("pair", "m", (("component", ("x", "y")),)))

    def options(self):
        return {"order": 1}

    def histories(self, designs, threads):
        size, angle = designs["size"][:, None], TIME + designs["phase"][:, None]
        wave = np.stack([size * np.sin(angle), size * np.cos(angle)], axis=2)
        values = {"wave": wave, "pair": np.stack([wave, 2 * wave], axis=-1)}
        return Histories(values, np.full(wave.shape[:2], Status.OK))


def swept(folder, vary=VARY, **given):
    return run(prepare(Waves(), vary, folder, "waves", {}, **{"chunk": 2} | given), workers=0)


def contents(folder):
    """Return what the files of a sweep say; not their modes and places."""
    found = {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    return {str(name): json.loads(x) if name.name == ROOT else x for name, x in found.items()}
