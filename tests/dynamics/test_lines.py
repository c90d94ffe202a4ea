"""Belts and ropes: how pulleys turn, what strands and ropes pull, where they are slack, and lengths that cannot be."""

import dataclasses
import math

import mpmath
import numpy as np
import pytest

import jounce as jn
from jounce import drivers, forces, planar, spatial
from jounce.dynamics import JointForceOutput, JointTorqueOutput
from jounce.mechanism.building.belts import belt_course
from jounce.mechanism.transmissions.gear_frames import check_distances
from jounce.plot.drawings.geometry import skeleton
from jounce.reporting.facts.mechanism.mechanism_facts import inspected
from jounce.reporting.facts.motion_facts import motion_facts
from jounce.reporting.text.summaries import start_summary

ZERO, X, Y, Z = [0.0, 0.0], [1, 0, 0], [0, 1, 0], [0, 0, 1]
ORDER = 6  # of motions: rates of forces to order 4
G = mpmath.mpf("9.81")


def rates(function, t, count=5):
    with mpmath.workdps(40):
        return np.array([float(mpmath.diff(function, mpmath.mpf(t), k)) for k in range(count)])


def same_rates(found, function, times, count=5):
    """Assert that derivatives, (time, order), are those of a function, each order to 1e-10 of its size."""
    expected = np.array([rates(function, t, count) for t in times])
    size = np.maximum(np.abs(expected).max(axis=0), 1e-3 * np.abs(expected).max())
    assert (np.abs(found[:, :count] - expected) <= 1e-10 * size).all(), np.abs(found[:, :count] - expected) / size


def arm(law="3*t + sin(2*t)", motor="20*t", radii=(0.06, 0.04), **belt):
    """A motor at the pivot of an arm turns a tool at its end by a belt."""
    return jn.Mechanism(
        space="planar",
        bodies={name: jn.Body(ZERO) for name in ("arm", "motor")} | {"tool": jn.Body([0.3, 0], mass=1.0, inertia=0.03)},
        joints={
            "A": planar.Revolute(("ground", "arm"), ZERO, ZERO),
            "M": planar.Revolute(("ground", "motor"), ZERO, ZERO),
            "T": planar.Revolute(("arm", "tool"), [0.3, 0], ZERO),
            "belt": planar.Belt(("motor", "tool"), ZERO, ZERO, *radii, **belt),
        },
        drivers={
            "swing": drivers.CoordinateDriver(("ground", "arm"), "angle", law),
            "turn": drivers.CoordinateDriver(("ground", "motor"), "angle", motor),
        },
        forces={"load": forces.Torque(("arm", "tool"), "-3 - 0.4*sin(5*t)")},
        outputs={
            "pull": JointForceOutput("belt"),
            "on_tool": JointForceOutput("belt", "tool"),
            "bearing": JointForceOutput("T", "tool"),
        },
    )


@pytest.mark.slow
@pytest.mark.parametrize("crossed", [False, True])
def test_a_belt_on_a_swinging_arm_turns_its_pulley_and_pulls_as_its_strands_say(crossed):
    """The pull is what turns the tool over its radius; what both strands do to it is along their tangents."""
    time = [0.1, 0.9, 2.8]
    motion = jn.solve(arm(crossed=crossed), time, 4)
    side = -1 if crossed else 1

    def swing(t):
        return 3 * t + mpmath.sin(2 * t)

    def tool(t):
        return swing(t) + side * mpmath.mpf("1.5") * (20 * t - swing(t))

    def pull(t):
        return side * (mpmath.mpf("0.03") * mpmath.diff(tool, t, 2) + 3 + mpmath.mpf("0.4") * mpmath.sin(5 * t)) / 0.04

    slope = (0.06 - side * 0.04) / 0.3  # sine of the angle of the strands to the line of centers
    same_rates(motion.angle("tool").values, tool, time)
    same_rates(motion.outputs["pull"], pull, time)
    for part, toward in enumerate((lambda t: -mpmath.sin(swing(t)), lambda t: mpmath.cos(swing(t)))):
        across = lambda t, toward=toward: pull(t) * slope * toward(t)  # noqa: E731
        same_rates(motion.outputs["on_tool"][..., part], across, time, 3)
    assert "not the tension with which it is put on" in motion.dataset["bearing"].attrs["comment"]


@pytest.mark.slow
@pytest.mark.parametrize("crossed", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_no_strand_of_a_belt_on_an_arm_becomes_longer(crossed):
    """From a mark on one pulley to a mark on the other, along the arcs and the tangent, over turns of the arm."""
    motion = jn.solve(arm(crossed=crossed), np.linspace(0.0, 6.0, 13), 0)
    line, motor, tool = (motion.angle(body).values[:, 0] for body in ("arm", "motor", "tool"))
    apart = 0.1 if crossed else 0.02
    tangent, leaving = math.sqrt(0.3**2 - apart**2), math.acos(apart / 0.3)
    for strand in (1, -1):
        off = line + strand * leaving  # where it leaves the motor; a crossed one arrives on the other side of the tool
        on_motor = strand * 0.06 * (motor - off)
        on_tool = strand * 0.04 * (tool - off) * (1 if crossed else -1)
        length = on_motor + tangent + on_tool
        np.testing.assert_allclose(length, length[0], rtol=0, atol=1e-12)
    course = belt_course(np.zeros(2), np.array([0.3, 0.0]), (0.06, 0.04), crossed)
    assert course.length == pytest.approx(2 * tangent + 0.06 * course.wraps[0] + 0.04 * course.wraps[1], rel=1e-15)
    assert course.wraps[0] == pytest.approx(2 * (math.pi - leaving), rel=1e-15)


def sliding(first=0.06, second=0.02, place="0.3 + 0.05*sin(3*t)", **belt):
    """A wheel on a sled that slides away from its motor, as under a tensioner."""
    return jn.Mechanism(
        space="planar",
        bodies={"motor": jn.Body(ZERO), "sled": jn.Body([0.3, 0.1]), "wheel": jn.Body([0.3, 0.1])},
        joints={
            "M": planar.Revolute(("ground", "motor"), ZERO, ZERO),
            "guide": planar.Prismatic(("ground", "sled"), [0, 0.1], ZERO, [1, 0], [1, 0]),
            "W": planar.Revolute(("sled", "wheel"), ZERO, ZERO),
            "belt": planar.Belt(("motor", "wheel"), ZERO, ZERO, first, second, **belt),
        },
        drivers={
            "slide": drivers.CoordinateDriver(("ground", "sled"), "x", place),
            "turn": drivers.CoordinateDriver(("ground", "motor"), "angle", "7*t"),
        },
    )


@pytest.mark.slow
def test_strands_of_a_belt_give_alike_where_its_centers_part():
    time = [0.2, 1.4, 5.0]
    for second, crossed in ((0.02, False), (0.06, False), (0.02, True)):
        motion = jn.solve(sliding(second=second, crossed=crossed), time, 4)
        ratio = 0.06 / second * (-1 if crossed else 1)

        def line(t):
            return mpmath.atan2(mpmath.mpf("0.1"), mpmath.mpf("0.3") + mpmath.mpf("0.05") * mpmath.sin(3 * t))

        def wheel(t, ratio=ratio, line=line):
            return line(t) + ratio * (7 * t - line(t)) - (1 - ratio) * line(mpmath.mpf(0))

        same_rates(motion.angle("wheel").values, wheel, time)


def test_what_a_belt_cannot_do_is_reported():
    for mechanism, words in (
        (arm(radii=(0.2, 0.15)), r"0.3 m apart on 'arm', and the pulleys overlap below 0.35 m"),
        (sliding(second=0.0598), "nearly the same need one body that carries both"),
        (
            sliding(second=0.06, place="0.3 - 0.3*t"),
            r"at t = 1 s the centers are 0.1 m apart, and the pulleys overlap below 0.12 m",
        ),
        (arm(radii=(0.06, -0.04)), "must be greater than zero"),
    ):
        with pytest.raises(jn.errors.MechanismError, match=words):
            jn.solve(mechanism, [0.0, 0.5, 1.0], 1)


def atwood(**drive):
    return jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        bodies={"a": jn.Body([-0.1, -0.5], mass=2.0, inertia=1.0), "b": jn.Body([0.1, -0.5], mass=3.0, inertia=1.0)},
        joints={
            "left": planar.Prismatic(("ground", "a"), [-0.1, 0], ZERO, [0, 1], [0, 1]),
            "right": planar.Prismatic(("ground", "b"), [0.1, 0], ZERO, [0, 1], [0, 1]),
            "rope": jn.joints.Rope(("a", "ground", "ground", "b"), [ZERO, [-0.1, 0], [0.1, 0], ZERO], 1.2),
        },
        outputs={
            "tension": JointForceOutput("rope"),
            "on_b": JointForceOutput("rope", "b"),
            "on_ground": JointForceOutput("rope", "ground"),
            "moment": JointTorqueOutput("rope", "b"),
            "a": jn.outputs.PointOutput("a", ZERO),
        },
        **drive,
    )


@pytest.mark.slow
def test_atwoods_machine():
    motion = jn.simulate(atwood(), [0.0, 0.2], order=4)
    np.testing.assert_allclose(motion.outputs["tension"][:, 0], 2 * 2 * 3 * 9.81 / 5, rtol=1e-13)
    assert np.abs(motion.outputs["tension"][:, 1:]).max() < 1e-10
    np.testing.assert_allclose(motion.outputs["a"][:, 2, 1], 9.81 / 5, rtol=1e-13)
    np.testing.assert_allclose(motion.outputs["a"][1, 0, 1], -0.5 + 0.02 * 9.81 / 5, rtol=1e-12)
    np.testing.assert_allclose(motion.outputs["on_b"][:, 0, 1], 2 * 2 * 3 * 9.81 / 5, rtol=1e-13)
    np.testing.assert_allclose(motion.outputs["on_ground"][:, 0, 1], -4 * 2 * 3 * 9.81 / 5, rtol=1e-13)
    assert np.abs(motion.outputs["moment"]).max() < 1e-12


@pytest.mark.slow
def test_a_rope_that_would_have_to_push_is_reported_as_slack_with_its_instants():
    """Weight a is thrown: where it goes down faster than weight b would fall up, the rope would have to push."""
    drive = {"throw": drivers.CoordinateDriver(("ground", "a"), "y", "-0.5 + 0.05*sin(20*t)")}
    time = np.linspace(0.0, 0.3, 31)
    motion = jn.solve(atwood(drivers=drive), time, 2)
    tension = 3 * (9.81 + 0.05 * 400 * np.sin(20 * time))
    np.testing.assert_allclose(motion.outputs["tension"][:, 0], tension, rtol=1e-11)
    assert (tension[19:29] < 0).all()
    assert (tension[29:] > 0).all()
    words = "below zero from t = 0.19 s to 0.28 s: the rope is slack there"
    assert any(words in remark for remark in motion_facts(motion)["remarks"])
    silent = jn.solve(dataclasses.replace(atwood(drivers=drive), outputs={}), time, 2)
    assert any(words in remark for remark in motion_facts(silent)["remarks"])
    assert motion_facts(jn.simulate(dataclasses.replace(atwood(), outputs={}), [0.0, 0.1], order=2))["remarks"] == []


def tackle(length=4.0):
    """A load that hangs in the bight of a rope between two rings 0.8 m apart, and is hauled up beyond the second."""
    return jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        parameters={"length": length},
        bodies={"load": jn.Body([0, -1.2], mass=5.0, inertia=1.0), "hand": jn.Body([0.4, -1.5])},
        joints={
            "rail": planar.Prismatic(("ground", "load"), ZERO, ZERO, [0, 1], [0, 1]),
            "post": planar.Prismatic(("ground", "hand"), [0.4, 0], ZERO, [0, 1], [0, 1]),
            "rope": jn.joints.Rope(("ground", "load", "ground", "hand"), [[-0.4, 0], ZERO, [0.4, 0], ZERO], "length"),
        },
        drivers={"haul": drivers.CoordinateDriver(("ground", "hand"), "y", "-1.5 - 0.3*sin(2*t)")},
        outputs={"tension": JointForceOutput("rope"), "load": jn.outputs.PointOutput("load", ZERO)},
    )


def height(t, length=4.0):
    """Of the load: both parts of the bight are as long."""
    part = (length - mpmath.mpf("1.5") - mpmath.mpf("0.3") * mpmath.sin(2 * t)) / 2
    return -mpmath.sqrt(part**2 - mpmath.mpf("0.16"))


def tension(t, length=4.0):
    part = (length - mpmath.mpf("1.5") - mpmath.mpf("0.3") * mpmath.sin(2 * t)) / 2
    lifted = mpmath.diff(lambda s: height(s, length), t, 2)
    return 5 * (G + lifted) * part / (2 * -height(t, length))


@pytest.mark.slow
def test_a_load_in_the_bight_of_a_rope_is_lifted_and_its_tension_has_its_rates():
    time = [0.1, 0.8]
    motion = jn.solve(tackle(), time, 4)
    same_rates(motion.outputs["load"][..., 1], height, time)
    same_rates(motion.outputs["tension"], tension, time)


@pytest.mark.slow
def test_families_and_gradients_by_the_length_of_a_rope():
    import jax

    batch = jn.solve_batch(tackle(), {"length": [3.8, 4.0, 4.3]}, [0.3], order=2)
    for k, length in enumerate((3.8, 4.0, 4.3)):
        same_rates(batch["tension"].values[k].reshape(1, -1), lambda t, x=length: tension(t, x), [0.3], 3)

    def pulled(length):
        return jn.solve(tackle().with_parameters(length=length), [0.3], 1).outputs["tension"][0, 0]

    slope = mpmath.diff(lambda x: tension(mpmath.mpf("0.3"), x), 4)
    assert float(jax.grad(pulled)(4.0)) == pytest.approx(float(slope), rel=1e-9)


@pytest.mark.slow
def test_a_block_and_tackle_of_four_parts():
    motion = jn.solve(jn.load("examples/block_and_tackle.yaml"), [0.0, 0.4, 2.0], 4)
    turn, size = mpmath.pi / 3, mpmath.mpf("0.4")

    def load(t):
        return -mpmath.mpf("1.2") + size * (1 - mpmath.cos(turn * t)) / 4

    def pull(t):
        return 30 * (G + mpmath.diff(load, t, 2))

    same_rates(motion.outputs["load"][..., 1], load, motion.time)
    same_rates(motion.outputs["tension"], pull, motion.time)
    same_rates(motion.outputs["beam"][..., 1], lambda t: -5 * pull(t), motion.time)


@pytest.mark.slow
def test_the_belt_drive_of_the_gallery():
    drive = jn.load("examples/belt_drive.yaml")
    motion = jn.solve(drive, [0.0, 1.3], 4)

    def swing(t):
        return mpmath.pi / 9 + 2 * mpmath.pi / 9 * mpmath.sin(2 * t)

    same_rates(motion.outputs["tool"], lambda t: 7.5 * t + swing(t) / 2, motion.time)
    pull = (mpmath.mpf("6e-4") * -8 * mpmath.pi / 9 * mpmath.sin(2.6) / 2 + mpmath.mpf("0.6")) / (0.1 / mpmath.pi)
    assert motion.outputs["pull"][1, 0] == pytest.approx(float(pull), rel=1e-10)


def hung():
    """A weight in space that slides on a post, on a rope through a ring at the tip of a lever and one of the ground."""
    still = [0, 0, 0]
    return jn.Mechanism(
        space="spatial",
        gravity=[0, 0, -9.81],
        bodies={"lever": jn.Body(still), "weight": jn.Body([0, 0, -1], mass=2.0, inertia=[1.0] * 3)},
        joints={
            "A": spatial.Revolute(("ground", "lever"), still, still, Z, Z),
            "post": spatial.Prismatic(("ground", "weight"), still, still, Z, Z, X, X),
            "rope": jn.joints.Rope(
                ("ground", "lever", "ground", "weight"), [[0.9, 0.2, 0.3], [0.5, 0, 0], still, still], 2.2
            ),
        },
        drivers={"turn": drivers.RotationDriver(("ground", "lever"), Z, "0.4 + 1.3*t")},
        outputs={"tension": JointForceOutput("rope"), "weight": jn.outputs.PointOutput("weight", still)},
    )


@pytest.mark.slow
def test_a_rope_in_space_has_its_tension_and_rates():
    time = [0.0, 0.7]
    motion = jn.solve(hung(), time, 4)

    def place(t):
        x, y = mpmath.cos(0.4 + 1.3 * t) / 2, mpmath.sin(0.4 + 1.3 * t) / 2
        first = mpmath.sqrt((x - mpmath.mpf(0.9)) ** 2 + (y - mpmath.mpf(0.2)) ** 2 + mpmath.mpf(0.3) ** 2)
        return -(mpmath.mpf(2.2) - first - mpmath.mpf("0.5"))

    same_rates(motion.outputs["weight"][..., 2], place, time)
    same_rates(motion.outputs["tension"], lambda t: 2 * (G + mpmath.diff(place, t, 2)), time)


@pytest.mark.slow
def test_a_ring_that_runs_on_a_rope_rests_where_both_parts_are_as_steep():
    """Of a rope of 2 m between supports 1.2 m apart, both parts are off the plumb line by the angle of sine 0.6."""
    ring = jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        bodies={"ring": jn.Body([0.5, -0.6], mass=1.5, inertia=0.01, center_of_mass=[0, -0.1])},
        joints={"rope": jn.joints.Rope(("ground", "ring", "ground"), [ZERO, ZERO, [1.2, 0.4]], 2.0)},
        outputs={"ring": jn.outputs.PointOutput("ring", ZERO), "tension": JointForceOutput("rope")},
    )
    rest = jn.equilibrium(ring)
    down = (2.0 * 0.8 - 0.4) / 2  # of 1.6 in all, the right part goes down by 0.4 more
    np.testing.assert_allclose(rest.outputs["ring"], [down * 0.75, -down], atol=1e-9)
    np.testing.assert_allclose(rest.outputs["tension"], 1.5 * 9.81 / 1.6, rtol=1e-9)


def crank(length, points=((1, 0), (0.2, 0)), bodies=("ground", "crank"), **joints):
    return jn.Mechanism(
        space="planar",
        bodies={"crank": jn.Body(ZERO, angle=0.3), "rod": jn.Body([0.2, 0])},
        joints={
            "A": planar.Revolute(("ground", "crank"), ZERO, ZERO),
            "B": planar.Revolute(("crank", "rod"), [0.2, 0], ZERO),
            "rope": jn.joints.Rope(bodies, points, length),
            **joints,
        },
    )


@pytest.mark.parametrize(
    "mechanism, words",
    [
        (crank(0.7), r"rope.length: the rope is too short: along its points it is 0.8 m at least"),
        (crank(1.3), r"rope.length: the rope is too long: along its points it is 1.2 m at most"),
        (crank(1.55, ((1, 0), (0.3, 0)), ("ground", "rod")), "1.5 m at most"),
        (crank(0.45, ((1, 0), (0.3, 0)), ("ground", "rod")), "0.5 m at least"),
        (crank(1.0, ((0, 0), (0, 0), (1, 0)), ("ground", "crank", "ground")), "coincides with the point before it"),
        (crank(1.0, ((0, 0), (0, 0, 0))), "2 points of 2 numbers"),
        (crank(1.0, ((0, 0),)), "2 points of 2 numbers"),
        (crank(-1.0), "must be greater than zero"),
        (crank(math.nan), "must be finite"),
    ],
)
def test_ropes_that_cannot_be_are_reported_before_anything_is_solved(mechanism, words):
    with pytest.raises(jn.errors.MechanismError, match=words):
        jn.solve(mechanism, [0.0], 1)


def test_a_rope_within_its_bounds_is_taken():
    """Its bounds are reached in a position each: a crank in line with it, and one that points away."""
    for length in (0.8, 0.9, 1.2):
        check_distances(crank(length))
    rod = planar.DoubleRevolute(("ground", "rod"), [1.0, 0.0], [0.3, 0.0], 0.7)
    with pytest.raises(jn.errors.MechanismError, match=r"0.7 m at most"):
        jn.solve(crank(0.8, ((1, 0), (0.3, 0)), ("ground", "rod"), rod=rod), [0.0], 1)


class OwnPin(jn.joints.AbstractConstraint, space="planar"):
    point_i: jn.joints.Vector
    point_j: jn.joints.Vector

    point_distance = "zero"

    def residual(self, body_i, body_j, time):
        del time
        return body_j.point(self.point_j) - body_i.point(self.point_i)


def test_bounds_follow_from_what_a_joint_of_the_user_states():
    long = crank(1.55, ((1, 0), (0.3, 0)), ("ground", "rod"), B=OwnPin(("crank", "rod"), [0.2, 0], ZERO))
    with pytest.raises(jn.errors.MechanismError, match=r"1.5 m at most"):
        jn.solve(long, [0.0], 1)


@pytest.mark.parametrize("bodies", [("a", "a"), ("a",)])
def test_a_rope_joins_bodies(bodies):
    with pytest.raises(jn.errors.MechanismError, match="joins two or more bodies, but all its points are on one"):
        jn.joints.Rope(bodies, [ZERO] * len(bodies), 1.0)


def test_lines_are_reported_and_drawn():
    facts = inspected(arm())
    (belt,) = facts["lines"]
    assert belt["carrier"] == "arm"
    words = start_summary(facts)
    assert (
        f"belt: {belt['length']:.6g} m long, on 187.6 deg of motor and 172.4 deg of tool, both carried by arm" in words
    )
    assert "a tensioner takes it up" in start_summary(inspected(sliding()))
    assert "rope: 1.2 m long, of spans of 0.5, 0.2, 0.5 m" in start_summary(inspected(atwood()))
    (belt,) = (symbol for symbol in skeleton(arm(crossed=True)).symbols if symbol.kind == "belt")
    assert belt.crossed
    assert belt.radii == (0.06, 0.04)
    (rope,) = (symbol for symbol in skeleton(atwood()).symbols if symbol.kind == "rope")
    np.testing.assert_array_equal(rope.points, [ZERO, [-0.1, 0], [0.1, 0], ZERO])


@pytest.mark.slow
def test_the_view_shows_strands_where_they_are():
    from jounce.viewer.shapes.mechanism_appearance import mechanism_appearance

    motion = jn.solve(arm(), [0.0, 1.0], 0)
    strands = [each for each in mechanism_appearance(motion).connectors if each.name.startswith("belt")]
    swing = motion.angle("arm").values[:, 0]
    assert len(strands) == 2
    for strand in strands:
        start, end = (np.asarray(x)[:, :2] for x in strand.ends)
        np.testing.assert_allclose(np.linalg.norm(end - start, axis=1), math.sqrt(0.3**2 - 0.02**2), rtol=1e-12)
        tool = 0.3 * np.stack([np.cos(swing), np.sin(swing)], axis=1)
        on_motor, on_tool = (start, end) if np.linalg.norm(start[0]) < 0.1 else (end, start)
        np.testing.assert_allclose(np.linalg.norm(on_motor, axis=1), 0.06, rtol=1e-12)
        np.testing.assert_allclose(np.linalg.norm(on_tool - tool, axis=1), 0.04, rtol=1e-12)
    ropes = mechanism_appearance(jn.simulate(atwood(), [0.0, 0.1], order=2)).connectors
    assert [each.bodies for each in ropes] == [("a", "ground"), ("ground", "ground"), ("ground", "b")]


@pytest.mark.parametrize("push, word", [(30.0, "undetermined"), (10.0, "held")])
def test_an_equilibrium_on_a_rope_that_would_have_to_push_is_reported(push, word):
    """2 kg weigh 19.62 N: pushed up with 30 N they do not hang on the rope."""
    joints = {
        "guide": planar.Prismatic(("ground", "load"), [0, 0], [0, 0], [0, 1], [0, 1]),
        "rope": jn.joints.Rope(("ground", "load"), [[0, 0], [0, 0]], 1.0),
    }
    hung = jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        bodies={"load": jn.Body([0, -1], mass=2.0, inertia=0.1)},
        joints=joints,
        forces={"push": jn.forces.PointForce("load", [0, 0], [0, push])},
    )
    found = jn.equilibrium(hung)
    assert (found.stability, found.stable) == (word, None if word == "undetermined" else True)
    assert ("joints.rope is slack, as it would have to push with 10.38 N" in found.reason) == (push > 19.62)
    assert len(found.cautions) == (push > 19.62)
