"""Retimed drivers of a mechanism against closed forms of a wheel."""

import numpy as np
import pytest

import jounce as jn
from jounce.errors import TrajectoryError

LIMITS = {"turn": jn.Limits(effort=1.0, effort_rate=5.0), "rim": jn.Limits(velocity=1.0)}
LEAST = 4.4 / 2 + 2 / 2 + 2 / 10  # d/v + v/a + a/j


@pytest.fixture(scope="module")
def wheel():
    """Return a wheel of 0.5 kg m^2 whose rim must not be faster than 1 m/s: torque 0.5 a, yank 0.5 j."""
    return jn.Mechanism(
        space="planar",
        bodies={"wheel": jn.Body([0, 0], mass=2.0, inertia=0.5)},
        joints={"O": jn.planar.Revolute(("ground", "wheel"), [0, 0], [0, 0])},
        drivers={"turn": jn.drivers.CoordinateDriver(("ground", "wheel"), "angle", motion="2*t + 0.1*t**2")},
        outputs={"rim": jn.outputs.PointOutput("wheel", [0.5, 0])},
        time=jn.TimeGrid(0.0, 2.0, 0.01),
    )


@pytest.mark.slow
def test_the_drivers_of_a_mechanism_keep_force_yank_and_the_speed_of_an_output(wheel):
    found = jn.retime(wheel, None, LIMITS)
    assert LEAST * (1 - 1e-6) < found.stop < LEAST * 1.005
    q, v, a, j = found.derivatives(np.linspace(0, found.stop, 5001), 3)[:, :, 0].T
    assert q[-1] == pytest.approx(4.4, abs=1e-9)
    for values, limit in ((v, 2.0), (a, 2.0), (j, 10.0)):
        assert np.abs(values).max() <= limit * (1 + 1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    "limits", [LIMITS, {"turn": jn.Limits(velocity=2.0, acceleration=2.0)}], ids=["force", "motion"]
)
def test_a_duration_holds_whether_forces_are_limited_or_not(wheel, limits):
    found = jn.retime(wheel, None, limits, duration=6.0)
    assert found.stop == pytest.approx(6.0, rel=1e-9)
    assert found.report.kept
    q, v = found.derivatives(np.array([0.0, 6.0]), 1)[:, :, 0].T
    np.testing.assert_allclose(q, [0.0, 4.4], atol=1e-9)
    np.testing.assert_allclose(v, 0.0, atol=1e-9)
    with pytest.raises(TrajectoryError, match=r"duration: the least time .* is 3\.\d* s, which is longer.*2\.5"):
        jn.retime(wheel, None, limits, duration=2.5)
