"""Modes in the view: a slider chooses one, parameters change it."""

import numpy as np
import pytest

import jounce as jn
from jounce.errors import JounceError
from jounce.viewer.server import ModesChoice, subject_of
from jounce.viewer.subjects.modes import ModesSubject
from tests.problems.mechanisms import example


@pytest.mark.slow
def test_a_mode_swings_about_the_equilibrium_with_its_joints_closed():
    subject = subject_of(example("double_pendulum"), modes=ModesChoice(True))
    assert isinstance(subject, ModesSubject)
    assert [(p.name, p.low, p.high) for p in subject.parameters[:2]] == [("mode", 1.0, 2.0), ("amplitude", 0.01, 0.5)]
    start = {p.name: p.value for p in subject.parameters}
    found = subject.solve(start | {"mode": 2.0, "amplitude": 0.2}, 4)
    assert found.time[[0, -1]].tolist() == [0.0, 2.0]
    assert "mode 2 of 2: 0.9211 Hz" in found.notice
    assert np.allclose(found.position[0], found.position[-1], atol=1e-12)
    upper, lower = (found.position[:, k, :2] for k in (1, 2))
    assert np.allclose(np.linalg.norm(lower - upper, axis=1), 1.0, atol=1e-12)
    longer = subject.solve(start | {"l": 4.0}, 4)
    assert "mode 1 of 2: 0.1908 Hz" in longer.notice


@pytest.mark.slow
def test_a_mode_of_a_robot_moves_its_own_shapes():
    subject = subject_of("examples/robots/planar_arm.xml", modes=ModesChoice(True, hold=["ram"]))
    found = subject.solve({p.name: p.value for p in subject.parameters}, 4)
    robot = subject.subject
    small = jn.linearize(jn.equilibrium(robot, hold=["ram"]))
    assert f"mode 1 of 2: {small.modes.frequencies[0]:.4g} Hz" in found.notice
    assert found.bodies[0] == robot.base
    assert subject.appearance is not None
    swung = found.position[:, found.bodies.index("ram")]
    assert np.ptp(swung, axis=0).max() > 0.01


def test_what_modes_are_not_of():
    with pytest.raises(JounceError, match="nothing can move"):
        subject_of(example("press"), modes=ModesChoice(True))
    with pytest.raises(JounceError, match="joints are held"):
        subject_of("examples/robots/panda.urdf", modes=ModesChoice(True, ("motor",)))
    with pytest.raises(JounceError, match="is for robots"):
        subject_of(example("press"), modes=ModesChoice(True, hold=["motor"]))
    with pytest.raises(JounceError, match="nothing can move"):
        ModesSubject(jn.load(example("press")), {})
