"""Facts that classes state: inherited by entry, checked in words, and read where the library acts on them."""

import numpy as np
import pytest

import jounce as jn
from jounce import planar, spatial
from jounce.constraints.base import MotionLaw, catalogue
from jounce.constraints.facts import dimension_of_field, facts_of, symbols
from jounce.io.mechanisms.schema.keys import file_keys
from jounce.kinematics.transmission import recognized
from jounce.mechanism import build
from jounce.mechanism.laws.driver_outputs import is_turning
from jounce.plot.drawings.driver_symbols import DRIVERS_AND_FORCES
from jounce.plot.drawings.geometry import skeleton
from jounce.plot.drawings.joint_symbols import _PLANAR, _SPATIAL

BOTH = ("one", "two")


class Rail(jn.joints.AbstractConstraint, space="planar"):
    """A guide with field names different from the usual ones."""

    point_i: jn.joints.Vector
    point_j: jn.joints.Vector
    rail_i: jn.joints.Vector
    rail_j: jn.joints.Vector
    length: jn.joints.Scalar = 0.0

    dimensions = {"rail": "direction"}
    signs = {"rail": "not zero", "length": "any"}
    held_parallel = (("rail_i", "rail_j"),)
    symbol = "prismatic"

    def residual(self, body_i, body_j, time):
        del time
        d = body_j.point(self.point_j) - body_i.point(self.point_i)
        along = body_i.direction(self.rail_i)
        return jn.joints.rows(jn.jet.cross(along, body_j.direction(self.rail_j)), jn.jet.cross(along, d) - self.length)


class Pin(planar.Revolute):
    """The hinge of the library under another name."""


class OffsetPin(planar.Revolute):
    def residual(self, body_i, body_j, time):
        return super().residual(body_i, body_j, time) + 0.1


def test_facts_are_inherited_by_entry():
    class Long(Rail):
        dimensions = {"length": "mass"}

    facts = facts_of(Long)
    assert facts.dimensions == {
        **dict.fromkeys(("point_i", "point_j"), "length"),
        **dict.fromkeys(("rail_i", "rail_j"), "direction"),
        "length": "mass",
    }
    assert facts.signs["rail_j"] == "not zero"
    assert facts.signs["length"] == "any"
    assert facts.held_parallel == (("rail_i", "rail_j"),)


def test_facts_of_a_residual_go_with_it():
    assert facts_of(Pin).pair == "revolute"
    assert facts_of(OffsetPin).pair == ""
    assert facts_of(spatial.DoubleSpherical).squared_distance == "length"
    assert (facts_of(Pin).point_distance, facts_of(OffsetPin).point_distance) == ("zero", "")
    assert facts_of(planar.DoubleRevolute).point_distance == "length"


def test_space_and_role_hold_without_a_type():
    class Winch(jn.joints.AbstractConstraint, space="planar", role="driver"):
        def residual(self, body_i, body_j, time): ...

    assert (Rail.space, Rail.role, Winch.role) == ("planar", "joint", "driver")
    with pytest.raises(jn.errors.MechanismError, match="is planar, in a spatial mechanism"):
        jn.Mechanism(
            space="spatial", bodies={"a": jn.Body([0, 0, 0])}, joints={}, drivers={"w": Winch(("ground", "a"))}
        )


def test_fields_of_usual_names_have_usual_facts():
    class Own(jn.joints.AbstractConstraint, space="spatial"):
        axis_i: jn.joints.Vector
        radius: jn.joints.Scalar
        lead: jn.joints.Scalar
        other: jn.joints.Scalar

        def residual(self, body_i, body_j, time): ...

    facts = facts_of(Own)
    assert [*facts.dimensions.values()] == ["direction", "length", "length", "any"]
    assert [*facts.signs.values()] == ["not zero", "positive", "not zero", "any"]


def own(name, **stated):
    """Return a class that states a fact."""
    values = {
        "residual": lambda *_: None,
        "__annotations__": {"point_i": jn.joints.Vector, "size": jn.joints.Scalar},
        **stated,
    }
    return type(jn.joints.AbstractConstraint)(name, (jn.joints.AbstractConstraint,), values)


@pytest.mark.parametrize(
    "stated, words",
    [
        (
            {"signs": {"sise": "positive"}},
            "signs: the class Own: no field has this name, .*did you mean 'size'",
        ),
        (
            {"signs": {"size": "positiv"}},
            "signs.size: the class Own: no sign has .*did you mean 'positive'",
        ),
        ({"signs": "positive"}, "signs: the class Own must state this by field"),
        (
            {"dimensions": {"sise": "length"}},
            "dimensions: the class Own: no field has this name, .*did you mean 'size'",
        ),
        ({"held_parallel": ("point_i", "point_i")}, "held_parallel: the class Own must state pairs of fields"),
        ({"point_distance": "zero"}, "point_distance: the class Own: no field has this name, got 'point_j'"),
        ({"dimensions": {"size": "lenght"}}, "dimensions.size: .*did you mean 'length'"),
        ({"held_parallel": (("axis_i", "axis_j"),)}, "held_parallel: the class Own: no field has this name"),
        ({"squared_distance": "length"}, "squared_distance: the class Own: no field"),
        ({"rolls_along": ("point_i",)}, "rolls_along: the class Own: no field has this name.*'point_j'"),
        ({"pair": "rod"}, "pair rod: the class Own: no field has this name"),
        (
            {"symbol": "sphere"},
            "symbol: the class Own: no symbol has this name, .*'spherical'",
        ),
        ({"symbol": "rolling"}, "symbol rolling: the class Own: no field has this name.*'radius'"),
        ({"__annotations__": {"symbol": jn.joints.Scalar}}, "field: no field of Own may have this name"),
    ],
)
def test_a_fact_that_cannot_be_is_refused_in_words(stated, words):
    kind = own("Own", **stated)
    with pytest.raises(jn.errors.MechanismError, match=words):
        kind(BOTH, *[1.0] * len(kind.__annotations__))


def mechanism(**joints):
    bodies = {"one": jn.Body([0.1, 0.0]), "two": jn.Body([0.5, 0.0], angle=3.0)}
    return jn.Mechanism(space="planar", bodies=bodies, joints=joints)


@pytest.mark.parametrize(
    "kind, values, words",
    [
        (Rail, ([0, 0], [0, 0], [0, 0], [1, 0]), r"joints\.J\.rail_i: must not be of zero length"),
        (planar.DoubleRevolute, ([0, 0], [0, 0], -1.0), r"joints\.J\.length: must be greater than zero"),
    ],
)
def test_signs_are_those_of_the_class(kind, values, words):
    with pytest.raises(jn.errors.MechanismError, match=words):
        build(mechanism(J=kind(BOTH, *values)))
    build(mechanism(J=Rail(BOTH, [0, 0], [0, 0], [1, 0], [1, 0], -2.0)))


class Unsaid(Rail):
    held_parallel = ()


@pytest.mark.parametrize("kind, turned", [(planar.Prismatic, 0.0), (Rail, 0.0), (Unsaid, np.pi)])
def test_a_part_is_not_put_together_turned_over_where_a_class_says_what_is_parallel(kind, turned):
    """Body two is drawn two radians away from lying along body one: nearer to lying the other way round."""
    guide = kind(("ground", "two"), [0, 0], [0, 0], [1, 0], [1, 0])
    mechanism = jn.Mechanism(
        space="planar",
        bodies={"two": jn.Body([0.5, 0.0], angle=2.0)},
        joints={"guide": guide},
        drivers={"push": jn.drivers.SlideDriver(("ground", "two"), [0, 0], [0, 0], [1, 0], "0.5")},
        outputs={"angle": jn.outputs.AngleOutput("two")},
    )
    angle = float(jn.solve(mechanism, [0.0], order=0).dataset["angle"].values[0, 0])
    assert angle == pytest.approx(turned, abs=1e-12)


def test_linkages_are_recognized_by_their_pairs():
    def four_bar(pin):
        ends = {"A": [0, 0], "D": [3, 0]}
        bodies = {"crank": jn.Body([0, 0], 1.0), "rocker": jn.Body([3, 0], 1.5)}
        joints = {n: pin(("ground", b), at, [0, 0]) for (n, at), b in zip(ends.items(), bodies, strict=True)}
        joints["rod"] = planar.DoubleRevolute(("crank", "rocker"), [1, 0], [2, 0], 2.5)
        return jn.Mechanism(
            space="planar",
            bodies=bodies,
            joints=joints,
            drivers={"turn": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", "t")},
        )

    known = recognized(four_bar(planar.Revolute), "turn")
    assert known is not None
    assert recognized(four_bar(Pin), "turn") == known
    assert recognized(four_bar(OffsetPin), "turn") is None


def test_each_symbol_of_the_catalogue_can_be_drawn():
    for space, drawn in (("planar", _PLANAR), ("spatial", _SPATIAL)):
        for role, known in (("joint", drawn), ("driver", DRIVERS_AND_FORCES), ("force", DRIVERS_AND_FORCES)):
            for kind in catalogue(space, role).values():
                either = {} if kind.space else {**_PLANAR, **_SPATIAL}
                assert {*symbols(kind), "none"} <= {*known, *either}
                assert kind.symbol in ("", "none", *symbols(kind))
    (symbol,) = skeleton(mechanism(J=Rail(BOTH, [0, 0], [0, 0], [1, 0], [0, 2]))).symbols
    assert symbol.kind == "prismatic"
    np.testing.assert_array_equal(symbol.axes, [[1, 0], [0, 2]])


def test_dimensions_of_laws_and_keys_are_those_of_the_class():
    class Winch(jn.joints.AbstractConstraint, space="planar", role="driver"):
        drum: jn.joints.Scalar
        motion: MotionLaw

        dimensions = {"drum": "length", "motion": "length"}

        def residual(self, body_i, body_j, time): ...

    winch = Winch(BOTH, 0.1, "t")
    assert not is_turning(winch)
    assert [(key.key, key.quantity) for key in file_keys(Winch)] == [("drum", "length"), ("motion", "length")]
    angle, height = (jn.drivers.CoordinateDriver(BOTH, word, "t") for word in ("angle", "y"))
    assert (dimension_of_field(angle, "motion"), dimension_of_field(height, "motion")) == ("angle", "length")
    assert (dimension_of_field(angle, "ratio"), dimension_of_field(height, "ratio")) == ("ratio", "length per angle")
