"""Simulations of designs whose laws break at instants of their own: in lots, so that these do not multiply."""

import dataclasses

import numpy as np
import pytest

import jounce as jn
from jounce.kinematics import Status
from jounce.sweeps import problems

CRANK = jn.Mechanism(
    space="planar",
    parameters={"begin": 0.25},
    bodies={"rod": jn.Body([0, 0], mass=1.0, inertia=1.0)},
    joints={"O": jn.planar.Revolute(("ground", "rod"), [0, 0], [0, 0])},
    drivers={"motor": jn.drivers.CoordinateDriver(("ground", "rod"), "angle", motion="abs(t - begin)")},
    outputs={"angle": jn.outputs.AngleOutput("rod")},
)


@dataclasses.dataclass
class Simulated:
    """What a batch of simulations returns."""

    outputs: dict
    status: np.ndarray


@pytest.mark.parametrize("sense", [1, -1])
def test_designs_with_breaks_of_their_own_are_simulated_in_lots(monkeypatch, sense):
    grids = []

    def simulated(_, designs, grid, order, **__):
        grids.append(len(grid))
        gap = np.asarray(grid) - designs["begin"][:, None]
        values = np.stack([np.abs(gap), np.sign(gap)], axis=-1)[..., None]
        return Simulated({"angle": values}, np.full(gap.shape, int(Status.OK)))

    monkeypatch.setattr(problems, "simulate_batch", simulated)
    begin, instants = np.linspace(0.1, 0.9, 14), np.linspace(0.0, 1.0, 5)[::sense]
    found = problems.Simulations(CRANK, time=instants, order=1).histories({"begin": begin}, threads=1)
    assert max(grids) <= (problems.MORE_INSTANTS + 1) * 5 < sum(grids)
    assert found.values["angle"][..., 0] == pytest.approx(np.abs(instants - begin[:, None]))
    assert found.status.shape == (14, 5)
    assert found.sides.instants == pytest.approx(np.repeat(begin[:, None], 2, axis=1), abs=1e-9)
    assert (found.sides.values["angle"][..., 1] == [-1.0, 1.0]).all()
