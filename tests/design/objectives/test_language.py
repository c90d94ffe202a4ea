"""What a designer may ask for, and what is said where it cannot be read."""

import numpy as np
import pytest

import jounce as jn
from jounce.design.objectives.language import parsed, parsed_relations
from jounce.errors import ExpressionError, JounceError, MechanismError, UnitError

FOUR_BAR = jn.load("examples/four_bar.yaml")
LENGTHS = {"BC": (0.12, 0.16), "CD": (0.15, 0.25)}


def test_an_expression_is_read_as_written():
    assert parsed("2*peak(psi, 4) - rms(C_x)").text == "((2 * peak(psi, 4)) - rms(C_x))"


@pytest.mark.parametrize(
    "text, sides",
    [
        ("span(psi) == 60 deg", [("span(psi)", np.pi / 3, True)]),
        ("peak(C_x, 3) <= 2 mm/s^3", [("peak(C_x, 3)", 0.002, False)]),
        ("1 cm <= span(C_x) <= 2*pi", [(0.01, "span(C_x)", False), ("span(C_x)", None, False)]),
    ],
)
def test_conditions_are_read_with_units(text, sides):
    found = parsed_relations(text)
    assert [relation.equal for relation in found] == [equal for *_, equal in sides]
    for relation, (left, right, _) in zip(found, sides, strict=True):
        for node, expected in ((relation.left, left), (relation.right, right)):
            if isinstance(expected, str):
                assert node.text == expected
            elif expected is not None:
                assert node.word == pytest.approx(expected, rel=1e-15)


def test_of_a_lower_bound_the_sides_are_turned():
    (relation,) = parsed_relations("span(psi) >= 0.5")
    assert (relation.left.text, relation.right.text) == ("0.5", "span(psi)")


@pytest.mark.parametrize(
    "minimize, subject_to, kind, words",
    [
        ("peak(phi, 4)", [], ExpressionError, "unknown name 'phi'.*quantities: psi, C_x, C_y"),
        ("peak(C, 4)", [], ExpressionError, "'C' has components; take C_x or C_y"),
        ("psi", [], MechanismError, r"changes in time.*peak\(psi\)"),
        ("peek(psi, 4)", [], ExpressionError, "did you mean 'peak'"),
        ("peak(psi, 1.5)", [], ExpressionError, "must be a whole number"),
        ("peak(psi, BC)", [], ExpressionError, "the same in all designs"),
        ("at(psi, 3)", [], ExpressionError, "not within the motion, which is from 0 to 2 s"),
        ("peak(psi, 4, 1, 0.5)", [], ExpressionError, "must end after it begins"),
        ("peak(psi - mean(psi))", [], ExpressionError, "is one number and cannot stand within another"),
        ("path_error(psi, target)", [], ExpressionError, "must be an output that is a point"),
        ("path_error(C, target)", [], ExpressionError, "no points have the name 'target'"),
        ("peak(torque(theta))", [], JounceError, "mass"),
        ("peak(force(A))", [], JounceError, "mass"),
        ("peak(torque(phi))", [], ExpressionError, "drivers: theta; joints: A, D, BC"),
        ("peak(psi)", ["span(psi) <= 5 mm"], UnitError, r"span\(psi\) is an angle, and is compared with a length"),
        ("peak(psi)", ["BC <= 13 deg"], UnitError, "BC is a length, and is compared with an angle, 0.226"),
        ("peak(psi)", ["2*span(C_x)/3 <= 13 deg"], UnitError, "is compared with an angle"),
        ("peak(psi)", ["span(psi)"], ExpressionError, "a condition is a comparison"),
        ("peak(psi)", ["span(psi) <= 5 mmm"], JounceError, "mmm"),
        ("__import__('os')", [], ExpressionError, "a string is not allowed|unknown function"),
    ],
)
def test_what_cannot_be_read_is_reported_before_anything_is_solved(minimize, subject_to, kind, words):
    with pytest.raises(kind, match=words):
        jn.optimize(FOUR_BAR, minimize, LENGTHS, subject_to)


@pytest.mark.parametrize(
    "vary, words",
    [
        ({}, "at least one parameter"),
        ({"EF": (0.1, 0.2)}, "no parameter has this name"),
        ({"BC": (0.2, 0.1)}, "the lower one first"),
        ({"BC": 0.2}, "a lower and an upper bound"),
        ({"BC": (-0.1, 0.2)}, "no mechanism can have this bound: joints.BC.length"),
        ({"BC": "16cm:12cm"}, "the lower one first"),
        ({"BC": ("1 s", "2 s")}, r"no mechanism can have this bound: parameters\.BC: [^']*, got '1 s'$"),
        ({"BC": (0.1, float("nan"))}, "finite"),
    ],
)
def test_bounds_are_checked(vary, words):
    with pytest.raises(JounceError, match=words):
        jn.optimize(FOUR_BAR, "peak(psi)", vary)


LIKE_NAMED = jn.Mechanism(
    space="planar",
    parameters={"angle": 0.3, "tip_x": 0.1, "rate": 2.0, "other_d2": 1.0, "L": 0.2},
    bodies={"crank": jn.Body([0.0, 0.0])},
    joints={"O": jn.planar.Revolute(("ground", "crank"), [0, 0], [0, 0])},
    drivers={"theta": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", motion="angle + rate*t")},
    outputs={
        "angle": jn.outputs.AngleOutput("crank"),
        "other": jn.outputs.AngleOutput("crank"),
        "tip": jn.outputs.PointOutput("crank", ["L", 0]),
    },
    time=jn.TimeGrid(0.0, 1.0, count=5),
)


@pytest.mark.parametrize(
    "minimize, words",
    [
        ("peak(angle, 1)", "'angle' is a parameter and an output of this mechanism; give one of them another name"),
        ("rate*angle", "'angle' is a parameter and an output"),
        ("mean(rate*tip_x)", "'tip_x' is a parameter and a component of tip"),
        ("peak(other_d2)", "'other_d2' is a parameter and a derivative of other"),
        ("peak(other_d29)", "derivatives go up to the order 28, got 29 of 'other_d29'"),
        ("peak(other_d20 + t, 9)", "got 29 of"),
        ("peak(other_d9999)", "unknown name 'other_d9999'"),
    ],
)
def test_names_that_mean_two_things_and_derivatives_that_are_too_high_are_refused(minimize, words):
    with pytest.raises(ExpressionError, match=words):
        jn.optimize(LIKE_NAMED, minimize, {"rate": (1.0, 3.0)})


@pytest.mark.parametrize(
    "text, bound_left",
    [
        ("span(psi) >= 0.5", True),
        ("span(psi) >= 2*3", True),
        ("span(psi) <= limit/2", False),
        ("peak(psi) >= limit", True),
        ("BC <= 0.5", False),
        ("BC >= 0.5", True),
        ("peak(psi) <= 2*peak(phi)", False),
    ],
)
def test_the_side_without_a_measure_is_the_bound(text, bound_left):
    (relation,) = parsed_relations(text)
    assert relation.bound_left is bound_left


def test_bounds_may_be_one_text_as_on_the_command_line():
    with pytest.raises(ExpressionError, match="unknown name 'psii'"):
        jn.optimize(FOUR_BAR, "peak(psii)", {"BC": "12cm:16cm"})


def test_instants_must_be_the_same_in_all_designs():
    crank = jn.Mechanism(
        space="planar",
        parameters={"tau": 1.0},
        bodies={"crank": jn.Body([0.0, 0.0])},
        joints={"O": jn.planar.Revolute(("ground", "crank"), [0, 0], [0, 0])},
        drivers={"theta": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", motion="t/tau")},
        outputs={"angle": jn.outputs.AngleOutput("crank")},
        time=jn.TimeGrid(0.0, "tau", count=11),
    )
    with pytest.raises(MechanismError, match="must be the same in all designs"):
        jn.optimize(crank, "peak(angle)", {"tau": (1.0, 2.0)})
