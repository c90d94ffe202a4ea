"""Breaks of laws of designs: searched once if they are the same for all designs, else for each design."""

import dataclasses

import numpy as np
import pytest

import jounce as jn
from jounce.kinematics.families import design_sides
from jounce.mechanism.laws.law_breaks import breaks_depend_on, breaks_of_laws

CRANK = jn.Mechanism(
    space="planar",
    parameters={"length": 1.0, "rise": 0.5, "begin": 0.25},
    bodies={"rod": jn.Body([0, 0])},
    joints={"O": jn.planar.Revolute(("ground", "rod"), [0, 0], [0, 0])},
    drivers={
        "motor": jn.drivers.CoordinateDriver(("ground", "rod"), "angle", motion="rise*abs(t - begin)"),
    },
    outputs={"tip": jn.outputs.PointOutput("rod", ["length", 0])},
)


@pytest.mark.parametrize("name, expected", [("length", False), ("begin", True)])
def test_breaks_are_looked_for_as_often_as_they_differ(monkeypatch, name, expected):
    assert breaks_depend_on(CRANK, [name]) is expected
    looked = []
    monkeypatch.setattr(design_sides, "breaks_of_laws", lambda *x, **how: looked.append(1) or breaks_of_laws(*x, **how))
    values = np.array([0.3, 0.4, 0.6])
    breaks, sides = design_sides.sides_of_designs(CRANK, {name: values}, 0.0, 1.0, 2)
    exact = np.repeat(values if expected else [0.25] * 3, 2).reshape(3, 2)
    assert breaks == pytest.approx(exact, abs=1e-9)
    assert sides == pytest.approx(exact + np.array([-2e-11, 2e-11]), abs=1e-11)
    assert len(looked) == (3 if expected else 1)


def test_laws_of_forces_count_where_they_move_the_mechanism():
    pushed = dataclasses.replace(
        CRANK, forces={"push": jn.forces.Torque(("ground", "rod"), "abs(t - begin)")}, drivers={}
    )
    values = {"begin": np.array([0.3, 0.4])}
    assert design_sides.sides_of_designs(pushed, values, 0.0, 1.0, 3)[0].shape == (2, 0)
    breaks, _ = design_sides.sides_of_designs(pushed, values, 0.0, 1.0, 3, forces=True)
    assert breaks == pytest.approx(np.array([[0.3, 0.3], [0.4, 0.4]]), abs=1e-9)
