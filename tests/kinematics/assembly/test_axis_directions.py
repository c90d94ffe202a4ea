"""Properties: from a rough guess, every mechanism that can be assembled is, with no part turned over in its joint."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import jounce as jn
from jounce.constraints import AbstractConstraint, Vector
from jounce.errors import AssemblyWarning
from jounce.kinematics.assembly.assemble import find_assembly
from jounce.kinematics.assembly.axis_directions import drawn_axis_signs
from jounce.mechanism import build
from jounce.mechanism.resolve import resolve

TOLERANCE = 1e-12
HINGED = ("revolute", "cylindrical", "prismatic", "screw")


def tilted(model, coordinates, random, size):
    """Return a guess with every body rotated, by up to an angle, and shifted from its assembled pose."""
    guess = {name: np.array(x) for name, x in coordinates.items()}
    guess["position"][:, 1:] += random.uniform(-0.3, 0.3, guess["position"][:, 1:].shape) * model.length
    if "angle" in guess:
        guess["angle"][1:] += random.uniform(-size, size, guess["angle"][1:].shape)
        return guess
    for body in range(1, len(model.bodies) + 1):
        axis = random.standard_normal(3)
        turn = Rotation.from_rotvec(axis / np.linalg.norm(axis) * random.uniform(0, size))
        guess["quaternion"][:, body, 0] = (turn * attitude(guess, body)).as_quat(scalar_first=True)
    return guess


def attitude(coordinates, body):
    return Rotation.from_quat(np.asarray(coordinates["quaternion"])[:, body, 0], scalar_first=True)


def cosines(mechanism, coordinates):
    """Return the cosine of the angle between the two axes of each hinge and guide, with SciPy's rotations."""
    numbers = {name: k for k, name in enumerate(["ground", *mechanism.bodies])}
    found = {}
    for name, joint in mechanism.joints.items():
        if joint.type_name in HINGED:
            axes = [np.array(resolve(list(axis), mechanism.parameter_values)) for axis in (joint.axis_i, joint.axis_j)]
            i, j = (attitude(coordinates, numbers[body]).apply(x) for x, body in zip(axes, joint.bodies, strict=True))
            found[name] = float(i @ j / np.linalg.norm(i) / np.linalg.norm(j))
    return found


def assembled(name):
    mechanism = jn.load(f"examples/{name}.yaml")
    model, attempt = find_assembly(build(mechanism), 0.0, TOLERANCE)
    assert attempt.closed
    return mechanism, model, attempt.coordinates


# from some of these guesses a hinge was assembled turned over before, and from others nothing was
@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "four_bar_in_space",
        *(pytest.param(x, marks=pytest.mark.slow) for x in ("rccc", "rsur", "rspu_slide", "sarrus", "swash_plate")),
    ],
)
def test_no_hinge_is_turned_over_from_rough_guesses(name):
    mechanism, model, start = assembled(name)
    random, closed = np.random.default_rng(1), 0
    for _ in range(12):
        guess = tilted(model, start, random, 2.0)
        _, attempt = find_assembly(dataclasses.replace(model, guess=guess), 0.0, TOLERANCE)
        if min(cosines(mechanism, guess).values()) < -0.8:
            continue  # drawn the other way round
        assert attempt.closed
        closed += 1
        assert min(cosines(mechanism, attempt.coordinates).values()) == pytest.approx(1.0, abs=1e-9)
    assert closed >= 6


def test_no_block_is_turned_over_in_its_guide():
    mechanism, model, start = assembled("slider_crank")
    number = ["ground", *mechanism.bodies].index("slider")
    for away in (-2.0, -1.7, 1.7, 2.0):  # half a turn is nearer than none to all but one of the first steps
        guess = {**start, "angle": start["angle"].copy()}
        guess["angle"][number] += away
        _, attempt = find_assembly(dataclasses.replace(model, guess=guess), 0.0, TOLERANCE)
        assert attempt.closed
        assert attempt.coordinates["angle"][number] == pytest.approx(start["angle"][number], abs=1e-9)


def test_a_hinge_drawn_with_opposite_axes_stays_so():
    mechanism, _, start = assembled("bennett")
    assert [round(x, 9) for x in cosines(mechanism, start).values()] == [-1, 1, -1, 1]


@pytest.mark.slow
def test_a_hinge_that_can_only_be_turned_over_is_named():
    mechanism = jn.load("examples/four_bar_in_space.yaml")
    odd = dataclasses.replace(mechanism.joints["C"], axis_j=(0.0, 0.0, -1.0))  # with the others along z
    turn = Rotation.from_euler("x", 0.8) * Rotation.from_euler("z", 1.9)
    rocker = dataclasses.replace(
        mechanism.bodies["rocker"], orientation={"quaternion": turn.as_quat(scalar_first=True)}
    )
    joints, bodies = {**mechanism.joints, "C": odd}, {**mechanism.bodies, "rocker": rocker}
    rough = dataclasses.replace(mechanism, joints=joints, bodies=bodies, outputs={})
    with pytest.warns(AssemblyWarning, match=r"joints\.C: .*turned over"):
        motion = jn.solve(rough, [0.0, 0.1], order=0)
    assert (motion.status == 0).all()


def disc(line, *, on=0.1, heading=0.4):
    """A disc on a tilted line, with its center to the left of the line if `on` is positive."""
    c, s = np.cos(heading), np.sin(heading)
    return jn.Mechanism(
        space="planar",
        bodies={"disc": jn.Body([-on * s, on * c])},
        joints={
            "on": jn.planar.Parallel2(("ground", "disc"), [-on * s, on * c], [0, 0], [c, s]),
            "roll": jn.planar.Rolling(("ground", "disc"), [0, 0], [0, 0], [line * c, line * s], 0.1),
        },
        drivers={"go": jn.drivers.SlideDriver(("ground", "disc"), [0, 0], [0, 0], [c, s], "0.3*t")},
        outputs={"turn": jn.outputs.AngleOutput("disc")},
    )


@pytest.mark.parametrize("line, on", [(-2.0, 0.1), (1.0, -0.1)])
def test_a_disc_above_its_line_turns_backwards_as_it_rolls_along(line, on):
    turn = np.asarray(jn.solve(disc(line, on=on), [0.0, 1.0], order=1).outputs["turn"])
    np.testing.assert_allclose(turn, np.sign(on) * np.array([[0, -3], [-3, -3]]), atol=1e-14)


@pytest.mark.parametrize("line, on", [(2.0, 0.1), (-1.0, -0.1)])
def test_a_disc_on_the_other_side_of_its_line_is_reported(line, on):
    with pytest.warns(AssemblyWarning, match=r"joints\.roll: the center of the disc .* reverse the vector"):
        jn.solve(disc(line, on=on), [0.0, 1.0], order=1)


@pytest.mark.slow
def test_a_pinion_on_the_other_side_of_its_rack_in_space_is_reported():
    def pinion(side):
        return jn.Mechanism(
            space="spatial",
            bodies={"pinion": jn.Body([0, 0, side]), "rack": jn.Body([0, 0, 0])},
            joints={
                "hinge": jn.spatial.Revolute(("ground", "pinion"), [0, 0, side], [0, 0, 0], [1, 0, 0], [1, 0, 0]),
                "guide": jn.spatial.Prismatic(
                    ("ground", "rack"), [0, 0, 0], [0, 0, 0], [0, 1, 0], [0, 1, 0], [0, 0, 1], [0, 0, 1]
                ),
                "mesh": jn.spatial.Rolling(
                    ("rack", "pinion"), [0, 0, 0], [0, 0, 0], [0, 3, 0], [1, 0, 0], [1, 0, 0], 0.02
                ),
            },
            drivers={"push": jn.drivers.SpatialSlideDriver(("ground", "rack"), [0, 0, 0], [0, 0, 0], [0, 1, 0], "t")},
        )

    jn.solve(pinion(-0.02), [0.0], order=0)
    with pytest.warns(AssemblyWarning, match=r"joints\.mesh: the center of the disc"):
        jn.solve(pinion(0.02), [0.0], order=0)


def test_axes_of_a_joint_of_ones_own_need_not_be_parallel():
    class Inclined(AbstractConstraint, type="inclined", space="spatial"):
        axis_i: Vector
        axis_j: Vector

        def residual(self, body_i, body_j, _time):
            return body_i.direction(self.axis_i).dot(body_j.direction(self.axis_j)) + 0.5

    ends = ("ground", "rod")
    joints = {
        "ball": jn.spatial.Spherical(ends, [0, 0, 0], [0, 0, 0]),
        "bevel": Inclined(ends, [0, 0, 1], [0, 0, 1]),
    }
    rod = jn.Body([0, 0, 0], orientation={"axis": [1, 0, 0], "angle": 2.0})
    mechanism = jn.Mechanism(space="spatial", bodies={"rod": rod}, joints=joints)
    assert drawn_axis_signs(build(mechanism)).size == 0
