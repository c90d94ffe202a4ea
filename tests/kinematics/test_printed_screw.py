"""The screw as composed by Sommer 2024 (section 5), compared with the screw of the library."""

import numpy as np
import pytest

import jounce as jn
from jounce import drivers, spatial
from tests.problems import small

X, Y, Z, ORIGIN = [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0]
BODIES = ("ground", "nut")
TIME = np.linspace(0.0, 5.0, 11)  # more than two turns


def printed_screw(distance_driver):
    """Two dot-1, two dot-2 and a distance driver with f = 0 between nut and ground, and the nut turned by 3 t."""
    return jn.Mechanism(
        space="spatial",
        bodies={"nut": jn.Body(ORIGIN)},
        joints={
            "parallel_x": spatial.Dot1(BODIES, X, Z),
            "parallel_y": spatial.Dot1(BODIES, Y, Z),
            "on_axis_x": spatial.Dot2(BODIES, ORIGIN, ORIGIN, X),
            "on_axis_y": spatial.Dot2(BODIES, ORIGIN, ORIGIN, Y),
            "advance": distance_driver,
        },
        drivers={"turn": drivers.RotationDriver(BODIES, Z, "3*t")},
        outputs={"p": jn.outputs.PointOutput("nut", ORIGIN), "angle": jn.outputs.RelativeAngleOutput(BODIES, Z)},
    )


@pytest.mark.slow
def test_screw_as_printed_turns_without_advancing():
    motion = jn.solve(printed_screw(drivers.SpatialSlideDriver(BODIES, ORIGIN, ORIGIN, Z, 0.0)), TIME, order=4)
    np.testing.assert_allclose(motion.outputs["angle"][:, 0], 3 * TIME, atol=1e-12)
    np.testing.assert_allclose(motion.outputs["p"], 0.0, atol=1e-12)


def test_screw_as_printed_with_the_driver_of_equation_104_has_a_row_of_zeros():
    with pytest.raises(jn.errors.MobilityError, match=r"6 coordinates; .* 6 equations, 5 of them"):
        jn.solve(printed_screw(drivers.SpatialDistanceDriver(BODIES, ORIGIN, ORIGIN, 0.0)), TIME, order=1)


@pytest.mark.slow
def test_screw_advances_by_its_lead_a_turn():
    motion = jn.solve(small.screw(0.02, "3*t + t**3/40"), TIME, order=4)
    angle = np.stack([3 * TIME + TIME**3 / 40, 3 + 3 * TIME**2 / 40, 6 * TIME / 40, 6 / 40 + 0 * TIME, 0 * TIME], 1)
    np.testing.assert_allclose(motion.outputs["p"][:, :, 2], 0.02 / (2 * np.pi) * angle, rtol=1e-13, atol=1e-15)
