"""Arms that the tests of planning share."""

import pytest

import jounce as jn


@pytest.fixture(scope="session")
def arm():
    """Return two rods in a vertical plane."""
    rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 12, 1 / 12])
    joints = [
        jn.Joint("shoulder", "base", "upper", axis=[0, -1, 0], damping=0.1),
        jn.Joint("elbow", "upper", "lower", position=[1, 0, 0], axis=[0, -1, 0], damping=0.2),
    ]
    return jn.Robot("arm", [jn.Link("base"), jn.Link("upper", rod), jn.Link("lower", rod)], joints)


@pytest.fixture(scope="session")
def swing():
    """Return a law of both joints of the arm, and the laws as text of their names."""
    laws = {"shoulder": "-1.2 + 0.5*sin(3*t)", "elbow": "0.4*cos(2*t)"}
    return jn.JointTrajectory(laws, 0.0, 2.0)
