"""Driven mechanisms that people asked about in public, with values that do not come from this library.

Each test names its source, and says what is right and how that is known.
"""

import numpy as np
import pytest

import jounce as jn
from jounce.mechanism.time import time_grid
from jounce.reporting.peaks import peaks

pytestmark = pytest.mark.slow  # `.ci/run` runs them all, as users do


def pin(body_i, body_j, point_i, point_j):
    """Return a revolute joint."""
    return jn.planar.Revolute((body_i, body_j), point_i, point_j)


def turning(body, motion, other="ground"):
    """Return a driver of the angle of a body."""
    return jn.drivers.CoordinateDriver((other, body), "angle", motion=motion)


def four_bar(base, crank, coupler, rocker, motion, guess):
    """Return a four-bar linkage whose crank is driven; `guess` holds the angles of the three bodies."""
    end = [crank * np.cos(guess[0]), crank * np.sin(guess[0])]
    return jn.Mechanism(
        space="planar",
        bodies={
            "crank": jn.Body([0, 0], guess[0]),
            "coupler": jn.Body(end, guess[1]),
            "rocker": jn.Body([base, 0], guess[2]),
        },
        joints={
            "A": pin("ground", "crank", [0, 0], [0, 0]),
            "B": pin("crank", "coupler", [crank, 0], [0, 0]),
            "C": pin("coupler", "rocker", [coupler, 0], [rocker, 0]),
            "D": pin("ground", "rocker", [base, 0], [0, 0]),
        },
        drivers={"motor": turning("crank", motion)},
        outputs={"rocker": jn.outputs.AngleOutput("rocker")},
    )


def geared(ratio, load, **more):
    """Return two shafts coupled by a ratio of turns relative to a housing, which a driver holds to the ground."""
    return jn.Mechanism(
        space="planar",
        bodies={name: jn.Body([0, 0]) for name in ("housing", "input", "output")},
        joints={
            "feet": pin("ground", "housing", [0, 0], [0, 0]),
            "a": pin("housing", "input", [0, 0], [0, 0]),
            "b": pin("housing", "output", [0, 0], [0, 0]),
            "gear": jn.planar.Gear(("input", "output", "housing"), ratio=ratio),
        },
        drivers={
            "motor": turning("input", "3*t", "housing"),
            "brake": turning("housing", "0*t"),
        },
        forces={"load": jn.forces.Torque(("ground", "output"), law=load)},
        outputs={
            "motor": jn.outputs.DriverTorqueOutput("motor"),
            "brake": jn.outputs.DriverTorqueOutput("brake"),
            "gear_on_housing": jn.outputs.JointTorqueOutput("gear", "housing"),
            "gear_on_input": jn.outputs.JointTorqueOutput("gear", "input"),
            "gear_on_output": jn.outputs.JointTorqueOutput("gear", "output"),
        },
        **more,
    )


@pytest.mark.parametrize("ratio", [-0.5, 0.25, 1 / 3])
def test_the_housing_of_a_gearbox_takes_the_difference_of_the_torques(ratio):
    """Modelica Standard Library issues 951 and 1606: is the housing of a gear implicitly grounded?

    Torques on a gear train: T1 + T2 + T3 = 0 and T1 w1 + T2 w2 = 0 (any textbook). With a load of 10 N m on the output
    the motor, between housing and input, gives -10 ratio, and the brake of the housing -10 in all.
    """
    found = {k: v[0, 0] for k, v in jn.solve(geared(ratio, "10"), [0.0, 1.0], order=1).outputs.items()}
    assert found["motor"] == pytest.approx(-10 * ratio, abs=1e-12)
    assert found["brake"] == pytest.approx(-10, abs=1e-12)
    assert found["gear_on_output"] == pytest.approx(-10, abs=1e-12)
    assert found["gear_on_input"] == pytest.approx(10 * ratio, abs=1e-12)
    assert found["gear_on_housing"] == pytest.approx(10 - 10 * ratio, abs=1e-12)


def test_a_rack_pushes_the_bearing_of_its_pinion():
    """Rack and pinion of a textbook: 100 N on the rack, radius 50 mm: motor 5 N m, pinion bearing 100 N along the rack.

    The guide takes no couple, since the tooth force acts on the line of the rack.
    """
    made = jn.Mechanism(
        space="planar",
        bodies={"pinion": jn.Body([0, 0]), "rack": jn.Body([0, 0.05])},
        joints={
            "A": pin("ground", "pinion", [0, 0], [0, 0]),
            "guide": jn.planar.Prismatic(("ground", "rack"), [0, 0.05], [0, 0], [1, 0], [1, 0]),
            "mesh": jn.planar.Rolling(("rack", "pinion"), [0, 0], [0, 0], [1, 0], radius=0.05),
        },
        drivers={"motor": turning("pinion", "0.1*t")},
        forces={"load": jn.forces.PointForce("rack", [0, 0], law=["-100", "0"])},
        outputs={
            "motor": jn.outputs.DriverTorqueOutput("motor"),
            "bearing": jn.outputs.JointForceOutput("A", "ground"),
            "guide": jn.outputs.JointTorqueOutput("guide", "ground"),
            "rack": jn.outputs.PointOutput("rack", [0, 0]),
        },
    )
    motion = jn.solve(made, [0.0, 1.0], order=1)
    assert abs(motion.outputs["motor"][0, 0]) == pytest.approx(5.0, abs=1e-12)
    assert abs(motion.outputs["bearing"][0, 0, 0]) == pytest.approx(100.0, abs=1e-11)
    assert motion.outputs["motor"][0, 0] * 0.1 == pytest.approx(100 * motion.outputs["rack"][0, 1, 0], abs=1e-12)
    assert motion.outputs["guide"][0, 0] == pytest.approx(0.0, abs=1e-11)


def test_a_hoist_stands_on_the_ground():
    """A lift of 2 kg moved by its height: the ground carries its weight (statics of any textbook), without a couple."""
    made = jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        bodies={"lift": jn.Body([0.7, 0], mass=2.0, inertia=0.1)},
        joints={"guide": jn.planar.Prismatic(("ground", "lift"), [0.7, 0], [0, 0], [0, 1], [0, 1])},
        drivers={"rope": jn.drivers.CoordinateDriver(("ground", "lift"), "y", motion="0.1 + 0.1*t + 0.2*t**3")},
        outputs={
            "up": jn.outputs.JointForceOutput("rope", "lift"),
            "down": jn.outputs.JointForceOutput("rope", "ground"),
        },
    )
    found = jn.solve(made, [0.0, 0.5], order=2).outputs
    t = np.array([0.0, 0.5])
    expected = np.stack([2 * (9.81 + 1.2 * t), np.full(2, 2.4), np.zeros(2)], axis=1)  # m (g + y''), and rates
    np.testing.assert_allclose(found["up"][..., 1], expected, atol=1e-11)
    np.testing.assert_allclose(found["down"], -found["up"], atol=1e-12)


def test_a_crank_rocker_keeps_its_branch_over_two_turns():
    """Articraft issue 127: bars 1.0, 0.5, 1.2, 0.8; a loop solver returned the mirrored assembly over part of a turn.

    The rocker's angle is the closed form of the loop: theta = atan2 of the diagonal plus the angle in the triangle.
    """
    made = four_bar(1.0, 0.5, 1.2, 0.8, "2*pi*t", (0.0, 0.6, 1.7))
    t = np.linspace(0.0, 2.0, 181)
    crank = 0.5 * np.exp(2j * np.pi * t)
    diagonal = crank - 1.0
    size = abs(diagonal)
    inner = np.arccos((size**2 + 0.8**2 - 1.2**2) / (2 * size * 0.8))
    expected = np.unwrap(np.angle(diagonal)) - inner
    found = jn.solve(made, t, order=1).outputs["rocker"][:, 0]
    turns = np.round((found[0] - expected[0]) / (2 * np.pi))
    np.testing.assert_allclose(found, expected + 2 * np.pi * turns, atol=1e-13)


@pytest.mark.parametrize("crank", [0.0, np.pi])
def test_a_flat_parallelogram_is_singular(crank):
    """Pyslvs issue 35, PMKS+ issue 91 and others: at a change point a linkage can go on in two ways.

    Two pairs of equal bars, flat: the rocker's rate is not unique, so that no rate may be called right.
    """
    made = four_bar(0.2, 0.05, 0.2, 0.05, f"2*pi*t + {crank}", (crank, 0.0, crank))
    with pytest.raises(jn.JounceError, match=r"singular|change point"):
        jn.solve(made, np.linspace(0.0, 0.1, 5))


def test_a_crank_driven_past_its_dead_point_is_reported():
    """solidworks_urdf_exporter2 pull request 96: past the toggle the loop has no solution, and a solver diverges.

    Non-Grashof bars 1, 0.9, 0.4, 0.6: the crank reaches its limit where coupler and rocker are in line:
    cos = (1 + 0.81 - 1) / 1.8, at 63.26 degrees.
    """
    limit = np.arccos((1 + 0.81 - 1.0) / 1.8)
    made = four_bar(1.0, 0.9, 0.4, 0.6, "0.9 + 0.4*t", (0.9, -0.6, 1.9))
    t = np.linspace(0.0, 1.0, 101)
    motion = jn.solve(made, t, order=1, strict=False)
    reached = 0.9 + 0.4 * t < limit
    assert (motion.status[~reached] != jn.Status.OK).all()
    assert (motion.status[reached][:-2] == jn.Status.OK).all()
    assert np.isnan(motion.outputs["rocker"][~reached]).all()


FACTORS = {
    "polynomial_3_4_5": (15 / 8, 10 / np.sqrt(3), 60.0),
    "polynomial_4_5_6_7": (35 / 16, 84 * np.sqrt(5) / 25, 52.5),
}


@pytest.mark.parametrize("profile", FACTORS)
def test_peaks_of_cam_profiles_lie_at_their_ends(profile):
    """Peaks of a rise of 1 in a time of 1 (R. L. Norton, Cam Design and Manufacturing Handbook, table of factors).

    The jerk of the 3-4-5 polynomial is largest at its ends, which the grid does not contain, between two dwells.
    """
    law = jn.laws.SegmentedMotion(
        [jn.laws.Segment("dwell", 0.2301), jn.laws.Segment(profile, 1.0, to=1.0), jn.laws.Segment("dwell", 0.3)]
    )
    made = jn.Mechanism(
        space="planar",
        bodies={"f": jn.Body([0, 0])},
        joints={"guide": jn.planar.Prismatic(("ground", "f"), [0, 0], [0, 0], [1, 0], [1, 0])},
        drivers={"cam": jn.drivers.SlideDriver(("ground", "f"), [0, 0], [0, 0], [1, 0], motion=law)},
        outputs={"lift": jn.outputs.DriverDisplacementOutput("cam")},
    )
    motion = jn.solve(made, np.linspace(0.0, 1.5, 151), order=3)
    found = {p.derivative: max(abs(p.minimum), abs(p.maximum)) for p in peaks(motion)}
    for name, factor in zip(("velocity", "acceleration", "jerk"), FACTORS[profile], strict=True):
        assert found[name] == pytest.approx(factor, rel=1e-9), name


@pytest.mark.parametrize(
    "start, stop, step, count",
    [
        (0.69, 0.99, 0.01, 31),
        (0.0, 60e-6, 1e-6, 61),
        (0.0, 10.005, 0.005, 2002),
        (0.0, 1.0, 0.03, 35),
        (20.0, 25.1, 0.1, 52),
    ],
)
def test_the_end_of_a_time_grid_is_its_last_instant(start, stop, step, count):
    """NumPy issues 21371, 24301, 14358 and others: arange sometimes holds its end; Exopy 78: sometimes it is left out.

    Steps of 0.03 s to 1 s are 33 whole ones and a shorter one.
    """
    grid = time_grid(jn.TimeGrid(start, stop, step), {})
    assert grid[0] == start
    assert grid[-1] == pytest.approx(stop, rel=1e-15)
    assert grid.size == count
    assert np.diff(grid).min() > 0
