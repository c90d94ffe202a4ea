"""Reactions on the ground: of what is measured there, of forces between bodies, and of all together; closed forms."""

import numpy as np
import pytest

import jounce as jn
from jounce import drivers, forces, planar
from jounce.errors import MechanismError, MechanismFileError

INSTANTS = [0.0, 0.4]
ORIGIN = [0.0, 0.0]


def lift(**elements):
    """2 kg that are held at x = 3 m, y = 0.1 t + t^3, with an inertia that does not turn."""
    return jn.Mechanism(
        space="planar", gravity=[0, -10.0], bodies={"lift": jn.Body([3.0, 0.0], mass=2.0, inertia=0.1)}, **elements
    )


def pushed():
    """What it takes to move the lift with its rates, N, N/s, N/s^2."""
    t = np.array(INSTANTS)
    return np.stack([2.0 * (10.0 + 6.0 * t), np.full(2, 12.0), np.zeros(2)], axis=1)


@pytest.mark.parametrize("kind", ["coordinate", "slide"])
def test_a_driver_takes_from_the_ground_what_it_gives_to_a_body(kind):
    law = "0.1*t + t**3"
    driver = {
        "coordinate": drivers.CoordinateDriver(("ground", "lift"), "y", law),
        "slide": drivers.SlideDriver(("ground", "lift"), ORIGIN, ORIGIN, [0, 1], law),
    }[kind]
    guide = planar.Prismatic(("ground", "lift"), [3.0, 0], ORIGIN, [0, 1], [0, 1])
    motion = jn.solve(lift(joints={"guide": guide}, drivers={"motor": driver}), INSTANTS, order=4)
    on_lift, on_ground = (jn.joint_reaction(motion, "motor", body, point=ORIGIN) for body in ("lift", "ground"))
    np.testing.assert_allclose(on_lift.force[..., 1], pushed(), atol=1e-12)
    np.testing.assert_allclose(on_ground.force[..., 1], -pushed(), atol=1e-12)
    np.testing.assert_allclose(on_ground.torque, -3.0 * pushed(), atol=1e-11)  # about the origin
    moved = jn.joint_reaction(motion, "motor", "ground", frame="ground", point=[2.0, 0.7])
    np.testing.assert_allclose(moved.torque, -pushed(), atol=1e-11)
    np.testing.assert_allclose(jn.dynamics.ground_reaction(motion).torque, -3.0 * pushed(), atol=1e-11)


def gears(load=10.0, cut=(-20.0, 0.0), **outputs):
    """A pinion that turns a wheel and pushes a rack by ratios, with a torque on the one and a force on the other."""
    return jn.Mechanism(
        space="planar",
        bodies={"pinion": jn.Body([0, 0]), "wheel": jn.Body([0.3, 0]), "rack": jn.Body([0, 0.1])},
        joints={
            "a": planar.Revolute(("ground", "pinion"), ORIGIN, ORIGIN),
            "b": planar.Revolute(("ground", "wheel"), [0.3, 0], ORIGIN),
            "guide": planar.Prismatic(("ground", "rack"), [0, 0.1], ORIGIN, [1, 0], [1, 0]),
            "mesh": planar.Coordinate(("pinion", "wheel"), "angle", -0.5),
            "teeth": planar.Coordinate(("pinion", "rack"), "x", -0.1),
        },
        drivers={"motor": drivers.CoordinateDriver(("ground", "pinion"), "angle", "t")},
        forces={
            "load": forces.Torque(("ground", "wheel"), load),
            "cut": forces.PointForce("rack", ORIGIN, list(cut)),
        },
        outputs=outputs,
    )


@pytest.mark.slow
def test_a_ratio_acts_on_the_housing():
    motion = jn.solve(gears(bearing=jn.outputs.JointForceOutput("a")), INSTANTS, order=2)

    def reaction(name, body):
        found = jn.joint_reaction(motion, name, body, point=ORIGIN)
        return [*found.force.values[0, 0], found.torque.values[0, 0]]

    np.testing.assert_allclose(reaction("mesh", "wheel"), [0, 0, -10], atol=1e-12)
    np.testing.assert_allclose(reaction("mesh", "pinion"), [0, 0, -5], atol=1e-12)
    np.testing.assert_allclose(reaction("mesh", "ground"), [0, 0, 15], atol=1e-12)
    np.testing.assert_allclose(reaction("teeth", "rack"), [20, 0, 0], atol=1e-12)
    np.testing.assert_allclose(reaction("teeth", "pinion"), [0, 0, 2], atol=1e-12)
    np.testing.assert_allclose(reaction("teeth", "ground"), [-20, 0, 0], atol=1e-12)  # 0.1 m * 20 N - 2 N m about O
    np.testing.assert_allclose(reaction("load", "ground"), [0, 0, -10], atol=1e-12)
    np.testing.assert_allclose(jn.dynamics.ground_reaction(motion).force.values[0, 0], [-20, 0], atol=1e-12)
    np.testing.assert_allclose(
        jn.dynamics.ground_reaction(motion).torque.values[:, 0], [2, 2], atol=1e-12
    )  # 20 N at y = 0.1 m
    assert motion.dataset["bearing"].attrs["comment"] == (
        "mesh, teeth are given by a ratio alone: bearings show no tooth forces"
    )
    with pytest.raises(MechanismError, match="body: is not joined by 'cut', got 'ground'"):
        jn.joint_reaction(motion, "cut", "ground")


@pytest.mark.slow
def test_gears_without_load_are_not_reported():
    idle = gears(0.0, (0.0, -3.0), bearing=jn.outputs.JointForceOutput("a"))
    assert "comment" not in jn.solve(idle, INSTANTS, order=2).dataset["bearing"].attrs


@pytest.mark.slow
def test_the_total_is_unique_where_its_parts_are_not():
    pins = {f"pin_{x}": planar.Revolute(("ground", "lift"), [3.0 + x, 0], [float(x), 0]) for x in (0, 1)}
    motion = jn.solve(lift(joints=pins), [0.0], order=2)
    assert np.isnan(jn.joint_reaction(motion, "pin_0", "ground").force.values).any()
    total = jn.dynamics.ground_reaction(motion)
    np.testing.assert_allclose(total.force.values[0, 0], [0, -20.0], atol=1e-12)
    np.testing.assert_allclose(total.torque.values[0, 0], -60.0, atol=1e-11)


def test_the_ground_carries_all_weight_at_rest():
    held = lift(
        joints={"level": planar.Coordinate(("ground", "lift"), "angle", offset=0.0)},
        forces={
            "spring": forces.Spring(("ground", "lift"), [3.0, 1.0], ORIGIN, 100.0, 0.5),
            "rail": forces.SlideSpring(("ground", "lift"), [3.0, 0], ORIGIN, [1, 0], 5.0),
        },
    )
    motion = jn.equilibrium(held).motion
    np.testing.assert_allclose(jn.joint_reaction(motion, "spring", "ground").force.values[0, 0], [0, -20.0], atol=1e-9)
    total = jn.dynamics.ground_reaction(motion, [1.0, 5.0])
    np.testing.assert_allclose(total.force.values[0, 0], [0, -20.0], atol=1e-9)
    np.testing.assert_allclose(total.torque.values[0, 0], -40.0, atol=1e-9)


FILE = """\
space: planar
gravity: [0, -10]
bodies:
  lift: {position: [3, 0], mass: 2 kg, inertia: 0.1 kg*m^2}
joints:
  guide: {type: prismatic, bodies: [ground, lift], points: [[3, 0], [0, 0]], vectors: [[0, 1], [0, 1]]}
drivers:
  motor: {type: coordinate, bodies: [ground, lift], coordinate: y, motion: 0.1*t + t**3}
outputs:
  on_ground: {joint: motor, quantity: reaction, body: ground}
  total: {mechanism: true, quantity: reaction}
  moment: {mechanism: true, quantity: torque, point: [1 m, 0]}
time: {start: 0, stop: 0.4, count: 2}
"""


def test_files_have_the_total(tmp_path):
    path, copy = tmp_path / "lift.yaml", tmp_path / "copy.json"
    path.write_text(FILE)
    jn.write_mechanism(jn.load(path), copy)
    motion = jn.solve(jn.load(copy), order=2)
    for name in ("on_ground", "total"):
        np.testing.assert_allclose(motion.dataset[name][..., 1], -pushed(), atol=1e-12)
    np.testing.assert_allclose(motion.dataset["moment"], -2.0 * pushed(), atol=1e-11)
    path.write_text(FILE.replace("{mechanism: true, quantity: reaction}", "{body: lift, quantity: reaction}"))
    with pytest.raises(MechanismFileError, match=r"outputs\.total"):
        jn.load(path)
