"""Mechanisms written in Python: names, parameters, values and time grids are checked, and errors say where."""

import dataclasses
from fractions import Fraction

import jax
import numpy as np
import pytest

import jounce as jn
from jounce import planar, spatial
from jounce.mechanism import build, time_grid
from jounce.mechanism.building.builder import grouped_elements
from jounce.mechanism.time import instants_of, last_step_words
from tests.problems.small import crank, four_bar

PIN = planar.Revolute(("ground", "crank"), [0, 0], [0, 0])
TURN = {"theta": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", "t")}


def mechanism(**changes):
    given = {"space": "planar", "bodies": {"crank": jn.Body([0, 0])}, "joints": {"O": PIN}}
    return jn.Mechanism(**(given | changes))


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"space": "plane"}, r"^space: unknown space, got 'plane'; did you mean 'planar'"),
        ({"bodies": {}}, "at least one moving body"),
        ({"bodies": {"ground": jn.Body([0, 0])}}, r"bodies\.ground"),
        (
            {"joints": {"O": planar.Revolute(("ground", "cranc"), [0, 0], [0, 0])}},
            r"joints\.O\.bodies.*did you mean 'crank'",
        ),
        ({"joints": {"O": spatial.Spherical(("ground", "crank"), [0, 0, 0], [0, 0, 0])}}, r"joints\.O.*spatial"),
        ({"parameters": {"t": 1.0}}, r"parameters\.t.*reserved"),
        ({"parameters": {"pi": 3.0}}, r"parameters\.pi.*reserved"),
        ({"parameters": {"sin": 3.0}}, r"parameters\.sin.*reserved"),
        ({"outputs": {"a": jn.outputs.AngleOutput("crunk")}}, r"outputs\.a\.bodies.*did you mean 'crank'"),
        ({"outputs": {"a": jn.outputs.RelativeAngleOutput(("ground", "crank"), [0, 0, 1])}}, r"outputs\.a.*spatial"),
        ({"drivers": {"O": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", "t")}}, r"drivers\.O.*same name"),
    ],
    ids=[
        "space",
        "no_body",
        "ground",
        "missing_body",
        "joint_space",
        "reserved_t",
        "reserved_pi",
        "reserved_function",
        "output_body",
        "output_space",
        "same_name",
    ],
)
def test_structure(changes, message):
    with pytest.raises(jn.errors.MechanismError, match=message):
        mechanism(**changes)


@pytest.mark.parametrize("name", ["time", "derivative", "component", "psi_d1"])
def test_output_named_like_an_axis_of_the_dataset_or_a_rate(name):
    with pytest.raises(jn.errors.MechanismError, match=rf"outputs\.{name}: the name '{name}' is reserved for columns"):
        mechanism(outputs={name: jn.outputs.AngleOutput("crank")})


def test_the_name_of_a_rate_is_refused_with_the_reason():
    with pytest.raises(
        jn.errors.MechanismError, match=r"where '_d' and a number mean a derivative of 'DF'; give another one"
    ):
        mechanism(outputs={"DF_d0": jn.outputs.AngleOutput("crank")})


def test_output_named_like_a_component_of_another():
    outputs = {"C": jn.outputs.PointOutput("crank", [0.1, 0]), "C_x": jn.outputs.AngleOutput("crank")}
    with pytest.raises(
        jn.errors.MechanismError, match=r"outputs\.C_x: this name is taken by a component of the output 'C'"
    ):
        mechanism(outputs=outputs)
    assert mechanism(outputs={**outputs, "C": jn.outputs.AngleOutput("crank")}).outputs.keys() == outputs.keys()


@pytest.mark.parametrize("name", ["a b", 'a "b", c', "a [deg]", "a/b", "C_z", "psi_d"])
def test_unusual_names_of_outputs(name):
    outputs = {"C": jn.outputs.PointOutput("crank", [0.1, 0]), name: jn.outputs.AngleOutput("crank")}
    assert name in jn.solve(mechanism(outputs=outputs, drivers=TURN), [0.0]).dataset


@pytest.mark.parametrize("name", ["lambda", "1a", "a-b", "a b", "", "\u00e4", "a" * 101])
def test_parameters_have_names_that_expressions_can_use(name):
    with pytest.raises(jn.errors.MechanismError, match=r"parameters\..*a name (is up to|in expressions)"):
        mechanism(parameters={name: 1.0})


def test_an_output_of_two_bodies_is_of_different_ones():
    with pytest.raises(jn.errors.MechanismError, match="not a body with itself"):
        jn.outputs.DistanceOutput(("crank", "crank"), [0, 0], [1, 0])


def joint(kind, *values, space="planar", bodies=("ground", "crank")):
    position = [0, 0] if space == "planar" else [0, 0, 0]
    return mechanism(space=space, bodies={"crank": jn.Body(position)}, joints={"J": kind(bodies, *values)})


ORIGIN = [0, 0, 0]


class Misread(jn.laws.SplineMotion):
    """A law of one's own that cannot be evaluated."""

    def __call__(self, time):
        return self.coefficients.no_such_thing(time)


@pytest.mark.parametrize(
    "wrong, message",
    [
        (lambda: crank(lambda t: t.no_such_thing), r"drivers\.turn.*law cannot be used.*no_such_thing"),
        (lambda: crank(Misread(np.arange(6.0), np.zeros(6))), r"drivers\.turn.*law cannot be used.*no_such_thing"),
        (lambda: joint(planar.Revolute, [0, 0, 0], [0, 0]), r"joints\.J\.point_i.*vector of 2 numbers"),
        (lambda: joint(planar.Revolute, [0, 0], 1.0), r"joints\.J\.point_j.*vector of 2 numbers"),
        (lambda: joint(planar.Revolute, [0, np.nan], [0, 0]), r"joints\.J\.point_i.*finite"),
        (lambda: joint(planar.Revolute, [0, "1e308*10"], [0, 0]), r"joints\.J\.point_i"),
        (lambda: joint(planar.DoubleRevolute, [0, 0], [0, 0], 0.0), r"joints\.J\.length.*greater than zero"),
        (
            lambda: joint(planar.DoubleRevolute, [0, 0], [0, 0], -0.1423),
            r"joints\.J\.length.*greater than zero, got -0.1423",
        ),
        (lambda: joint(planar.DoubleRevolute, [0, 0], [0, 0], [1.0]), r"joints\.J\.length.*one number"),
        (lambda: joint(planar.DoubleRevolute, [0, 0], [0, 0], "BC"), r"joints\.J\.length.*'?BC"),
        (lambda: joint(planar.DoubleRevolute, [0, 0], [0, 0], None), r"joints\.J\.length"),
        (lambda: joint(planar.Parallel1, [0, 0], [1, 0]), r"joints\.J\.vector_i.*zero length"),
        (lambda: joint(planar.Rolling, [0, 0], [0, 0], [1, 0], -1.0), r"joints\.J\.radius.*greater than zero"),
        (lambda: joint(spatial.Revolute, ORIGIN, ORIGIN, ORIGIN, [0, 0, 1], space="spatial"), r"axis_i.*zero length"),
        (lambda: joint(spatial.Screw, ORIGIN, ORIGIN, [0, 0, 1], [0, 0, 1], 0.0, space="spatial"), r"lead.*zero"),
        (
            lambda: joint(
                spatial.Prismatic, ORIGIN, ORIGIN, [0, 0, 1], [0, 0, 1], [0, 0, 2], [1, 0, 0], space="spatial"
            ),
            r"joints\.J.*parallel",
        ),
        (lambda: mechanism(bodies={"crank": jn.Body([0, 0, 0])}), r"bodies\.crank\.position.*vector of 2"),
        (lambda: mechanism(bodies={"crank": jn.Body([0, 0], angle="x")}), r"bodies\.crank\.angle"),
        (lambda: joint(spatial.Dot1, [0, 0, 1], [1, 0, 0], space="planar"), "spatial"),
    ],
)
def test_values_are_checked_with_their_place(wrong, message):
    with pytest.raises(jn.JounceError, match=message):
        build(wrong())


@pytest.mark.parametrize(
    "zeros", [np.zeros(2, int), np.zeros(2), np.zeros(2, np.float32), (0, 0), [np.int32(0), "0*2"]]
)
def test_vectors_of_any_kind_of_numbers(zeros):
    """Integers and single precision become doubles, and compile nothing of their own."""
    given = jax.tree.leaves(build(joint(planar.Revolute, zeros, zeros)).system.groups)
    plain = jax.tree.leaves(build(joint(planar.Revolute, [0.0, 0.0], [0.0, 0.0])).system.groups)
    assert [(x.shape, x.dtype) for x in given] == [(x.shape, x.dtype) for x in plain]


@pytest.mark.parametrize("vector", [[None, 0], [0j, 0], [[0], [0]], "0", {"x": 0}, [0], []], ids=str)
def test_what_is_no_vector_of_numbers(vector):
    with pytest.raises(jn.JounceError, match=r"joints\.J\.point_i"):
        build(joint(planar.Revolute, vector, [0, 0]))


@pytest.mark.parametrize(
    "name, value, message",
    [
        ("joints", [PIN], r"^joints: must be a dictionary, with a name for each entry, got \[Revolute\("),
        ("outputs", None, r"^outputs: must be a dictionary.*got nothing"),
        ("space", np.array(["planar"]), r"^space: unknown space, got array\(.*valid: planar, spatial"),
        ("title", ["Press"], r"^title: must be text, got \['Press'\]"),
        ("assembly", np.array([1, 2]), r"^assembly: must be a number from 1, nearest, .*got array\(\[1, 2\]\)"),
        ("redundant_reactions", np.array([1, 2]), r"^redundant_reactions: must be one of .*got array\(\[1, 2\]\)"),
        ("initial", {"a": "t"}, r"^initial\.a: must be one of the classes of drivers, got 't'"),
    ],
)
def test_fields_of_other_kinds_are_refused_by_their_names(name, value, message):
    given = mechanism()
    object.__setattr__(given, name, value)  # past the checks of types, which users do not have
    with pytest.raises(jn.errors.MechanismError, match=message):
        given.__post_init__()


@pytest.mark.parametrize(
    "space, body, message",
    [
        ("planar", jn.Body([0, 0], orientation=[0, 0, 0, 1]), r"^bodies\.crank\.orientation: .* has an angle instead"),
        ("spatial", jn.Body([0, 0, 0], 0.5), r"^bodies\.crank\.angle: .* has an orientation instead, got 0\.5$"),
    ],
)
def test_an_attitude_in_the_form_of_the_other_space_is_refused(space, body, message):
    with pytest.raises(jn.errors.MechanismError, match=message):
        build(mechanism(space=space, bodies={"crank": body}, joints={}))


def test_euler_parameters_that_are_all_zero():
    body = jn.Body(ORIGIN, orientation=[0, 0, 0, 0])
    ball = spatial.Spherical(("ground", "crank"), ORIGIN, ORIGIN)
    with pytest.raises(jn.errors.MechanismError, match=r"bodies\.crank\.orientation"):
        build(mechanism(space="spatial", bodies={"crank": body}, joints={"J": ball}))


class TestParameters:
    def test_given_by_each_other_in_any_order(self):
        found = mechanism(parameters={"c": "a + b", "b": "2*a", "a": 3.0, "n": 2}).parameter_values
        assert found == {"a": 3.0, "b": 6.0, "c": 9.0, "n": 2}

    @pytest.mark.parametrize("value", [2, np.int64(2), np.float32(2), Fraction(2), np.asarray(2.0)], ids=repr)
    def test_of_any_real_kind_become_floats(self, value):
        found = mechanism(parameters={"a": value}).parameter_values["a"]
        assert found == 2.0
        assert np.asarray(jn.solve(crank("a*t", parameters={"a": value}), [1.0]).outputs["angle"])[0, 1] == 2.0

    def test_in_a_circle(self):
        with pytest.raises(jn.errors.MechanismError, match="circle: a, b"):
            _ = mechanism(parameters={"a": "b", "b": "a"}).parameter_values

    def test_unknown_name(self):
        with pytest.raises(jn.JounceError, match=r"parameters\.a.*bb"):
            _ = mechanism(parameters={"a": "bb", "b": 1.0}).parameter_values

    @pytest.mark.parametrize("value", [np.nan, np.inf, np.ones(2)], ids=["nan", "inf", "array"])
    def test_not_one_finite_number(self, value):
        with pytest.raises(jn.errors.MechanismError, match=r"parameters\.a"):
            jn.solve(crank("a*t", parameters={"a": value}), [0.0])

    def test_units_are_those_of_files(self):
        given = mechanism(parameters={"a": "80 mm", "b": "2*a", "n": "60 rpm"})
        assert given.parameters["a"] == 0.08
        assert given.parameter_values["b"] == 0.16
        assert given.parameter_values["n"] == pytest.approx(2 * np.pi, rel=1e-15)
        with pytest.raises(jn.errors.UnitError, match=r"parameters\.a: unknown unit 'mmm'"):
            mechanism(parameters={"a": "80 mmm"})

    def test_units_elsewhere_are_refused_with_what_to_do(self):
        tip = {"tip": jn.outputs.PointOutput("crank", point=["80 mm", 0])}
        with pytest.raises(jn.errors.UnitError, match=r"outputs\.tip\.point: units .*'80 mm'; .* or a parameter"):
            jn.solve(crank("t", outputs=tip), [0.0])

    def test_with_other_values(self):
        first = four_bar()
        second = first.with_parameters(AB=0.05)
        assert second.parameters["AB"] == 0.05
        assert first.parameters["AB"] == 0.04
        assert second.joints is first.joints

    def test_other_value_of_a_parameter_that_others_follow(self):
        changed = mechanism(parameters={"a": 1.0, "b": "2*a"}).with_parameters(a=5.0)
        assert changed.parameter_values["b"] == 10.0

    def test_that_does_not_exist(self):
        with pytest.raises(jn.errors.MechanismError, match="did you mean 'AB'"):
            four_bar().with_parameters(ab=0.05)

    @pytest.mark.parametrize("value", [True, np.True_, None, np.nan, 1j, [0.05]])
    def test_that_is_no_number(self, value):
        with pytest.raises(jn.errors.MechanismError, match=r"parameters\.AB.*number"):
            jn.solve(four_bar().with_parameters(AB=value), [0.0])


def test_offset_that_is_not_given_follows_from_the_starting_guess():
    def pair(offset):
        return jn.Mechanism(
            space="planar",
            bodies={"a": jn.Body([0, 0], 0.2), "b": jn.Body([3, 0], 0.7)},
            joints={
                "A": planar.Revolute(("ground", "a"), [0, 0], [0, 0]),
                "B": planar.Revolute(("ground", "b"), [3, 0], [0, 0]),
                "mesh": planar.Coordinate(("a", "b"), "angle", ratio=-0.5, offset=offset),
            },
            drivers={"turn": jn.drivers.CoordinateDriver(("ground", "a"), "angle", "0.2 + t")},
            outputs={"b": jn.outputs.AngleOutput("b")},
        )

    for offset in (None, 0.8):
        np.testing.assert_allclose(jn.solve(pair(offset), [0.0, 1.0], order=1).outputs["b"], [[0.7, -0.5], [0.2, -0.5]])


class TestTimeGrid:
    @pytest.mark.parametrize(
        "grid, expected",
        [
            (jn.TimeGrid(0, 1, 0.25), [0, 0.25, 0.5, 0.75, 1]),
            (jn.TimeGrid(0, 1, count=3), [0, 0.5, 1]),
            (jn.TimeGrid(0, 0, count=1), [0]),
            (jn.TimeGrid(-1, 0.99, 0.5), [-1, -0.5, 0, 0.5, 0.99]),
            (jn.TimeGrid(0, 1, 0.3), [0, 0.3, 0.6, 0.9, 1]),
            (jn.TimeGrid(0, 1, 2.0), [0, 1]),
            (jn.TimeGrid(0, 1, 0.25 * (1 + 1e-9)), [0, 0.25, 0.5, 0.75, 1]),
            (jn.TimeGrid(0, 1, 0.25 * (1 - 1e-9)), [0, 0.25, 0.5, 0.75, 1]),
            (jn.TimeGrid("tau", "2*tau", "tau/2"), [2, 3, 4]),
            ([0, 1, 4], [0, 1, 4]),
            (np.array([5.0]), [5]),
        ],
    )
    def test_instants(self, grid, expected):
        np.testing.assert_allclose(time_grid(grid, {"tau": 2.0}), expected, atol=1e-15)

    @pytest.mark.parametrize("start, stop, count", [(0, 2, 10_001), (0.1, 7.3, 1237), (-3, 1e-3, 99), (5, 5, 1)])
    def test_instants_that_are_spaced_evenly_need_no_place(self, start, stop, count):
        whole, spaced = np.linspace(start, stop, count), instants_of(jn.TimeGrid(start, stop, count=count), {})
        np.testing.assert_array_equal(np.asarray(spaced), whole)
        np.testing.assert_array_equal(spaced[3:57], whole[3:57])
        np.testing.assert_array_equal(spaced[-5:], whole[-5:])
        assert (spaced[0], spaced[-1], len(spaced)) == (whole[0], whole[-1], count)

    @pytest.mark.parametrize("step", [0.1, 0.01, 1e-3, 1 / 3, 0.7 / 7])
    def test_stop_is_reached_though_the_step_is_rounded(self, step):
        instants = time_grid(jn.TimeGrid(0, 1, step), {})
        assert len(instants) == round(1 / step) + 1
        assert instants[-1] == 1.0

    @pytest.mark.parametrize("step", [0.03, 0.3, 1 / 3.5, 1.7e-3, 0.0999])
    def test_stop_is_reached_though_the_step_does_not_divide_the_time(self, step):
        instants = time_grid(jn.TimeGrid(0.2, 1.2, step), {})
        assert instants[-1] == 1.2
        np.testing.assert_allclose(np.diff(instants)[:-1], step, rtol=1e-12)
        assert 0 < instants[-1] - instants[-2] < step
        assert "last one" in last_step_words(instants)

    @pytest.mark.parametrize("step", [0.1, 1e-3, 1 / 3, 0.7 / 7, 5.0, 1.0])
    def test_nothing_is_reported_steps_that_are_alike(self, step):
        assert last_step_words(time_grid(jn.TimeGrid(0, 1, step), {})) == ""

    @pytest.mark.parametrize(
        "grid, message",
        [
            (None, "no time grid"),
            ([], "at least one instant"),
            ([[0.0, 1.0]], "list of at least one"),
            (5.0, "list of at least one"),
            ("abc", "must be real numbers"),
            ([0, 0], r"time\[1\].*increase strictly"),
            ([0, 2, 1], r"time\[2\].*increase strictly"),
            ([0, np.nan], r"time\[1\].*finite"),
            ([0, np.inf], r"time\[1\].*finite"),
            (jn.TimeGrid(0, 1), "either step or count"),
            (jn.TimeGrid(0, 1, 0.1, 3), "either step or count"),
            (jn.TimeGrid(0, 1, -0.1), r"time\.step.*greater than zero"),
            (jn.TimeGrid(0, 1, 0), r"time\.step.*greater than zero"),
            (jn.TimeGrid(1, 0, 0.1), r"time\.stop.*before start"),
            (jn.TimeGrid(0, np.inf, 0.1), r"time\.stop.*finite"),
            (jn.TimeGrid(0, 1, 1e-12), "at most 10000000 instants.*got 10000000000"),
            (jn.TimeGrid(0, 1, count=0), r"time\.count"),
            (jn.TimeGrid(0, 1, count=2.5), r"time\.count"),
            (jn.TimeGrid(0, "tau", 0.1), "tau"),
        ],
    )
    def test_wrong_grids(self, grid, message):
        with pytest.raises(jn.JounceError, match=message):
            time_grid(grid, {})

    def test_of_the_mechanism_is_used_when_none_is_given(self):
        timed = dataclasses.replace(crank("t"), time=jn.TimeGrid(0, 1, count=3))
        np.testing.assert_allclose(jn.solve(timed).time, [0, 0.5, 1])


@pytest.mark.slow
def test_gears_of_a_carrier_in_any_order_with_the_ground_among_them():
    """A held ring of 60 teeth, a sun of 24: the carrier makes 24/84 of the sun's turns (Willis)."""
    pins = {name: jn.planar.Revolute(("ground", name), [0, 0], [0, 0]) for name in ("sun", "carrier")}
    train = jn.Mechanism(
        space="planar",
        bodies={"sun": jn.Body([0, 0]), "carrier": jn.Body([0, 0]), "planet": jn.Body([0.042, 0])},
        joints={
            **pins,
            "pin": jn.planar.Revolute(("carrier", "planet"), [0.042, 0], [0, 0]),
            "inner": jn.planar.Gear(("sun", "planet", "carrier"), ratio=-24 / 18),
            "outer": jn.planar.Gear(("planet", "ground", "carrier"), ratio=18 / 60),
        },
        drivers={"motor": jn.drivers.CoordinateDriver(("ground", "sun"), "angle", motion="3*t**2")},
        outputs={"carrier": jn.outputs.AngleOutput("carrier")},
    )
    found = jn.solve(train, [0.0, 1.0, 2.0], order=2).outputs["carrier"]
    expected = [[3 * t**2, 6 * t, 6] for t in (0.0, 1.0, 2.0)]
    np.testing.assert_allclose(found, np.array(expected) * 24 / 84, rtol=0, atol=1e-14)


def test_what_is_changed_in_place_is_seen_and_what_was_built_stays():
    point, lengths = np.array([0.1, 0.2]), np.array([0.5, 0.0])
    hinge = planar.Revolute(("ground", "crank"), point, [0, 0])
    given = mechanism(joints={"O": hinge}, bodies={"crank": jn.Body(lengths)})
    before = build(given)
    point[0], lengths[1] = 0.3, 0.4
    after = build(given)
    points = [model.system.groups[0].element.point_i[:, 0, 0].tolist() for model in (before, after)]
    guesses = [model.guess["position"][:, 1, 0].tolist() for model in (before, after)]
    assert points == [[0.1, 0.2], [0.3, 0.2]]
    assert guesses == [[0.5, 0.0], [0.5, 0.4]]


def test_what_models_of_one_structure_share_cannot_be_written():
    first, second = build(four_bar()), build(four_bar(BC=0.15))
    assert first.system.pattern is second.system.pattern
    with pytest.raises(ValueError, match="read-only"):
        first.system.pattern.entry_indices[0] = 0


def test_elements_of_which_some_values_are_traced_are_grouped_as_those_of_numbers():
    mechanism = jn.Mechanism(
        space="planar",
        parameters={"L": 0.3},
        bodies={"one": jn.Body([0, 0]), "two": jn.Body(["L", 0])},
        joints={
            "A": jn.planar.Revolute(("ground", "one"), [0, 0], [0, 0]),
            "B": jn.planar.Revolute(("one", "two"), ["L", 0], [0, 0]),
            "rod": jn.planar.DoubleRevolute(("ground", "two"), [0, 0], [0, 0], "L"),
            "stay": jn.planar.DoubleRevolute(("one", "two"), [0, 0], [0, 0], 0.3),
        },
    )

    def bodies(mechanism):
        return [group.bodies for group in grouped_elements(mechanism)[0][0]]

    traced = []
    jax.eval_shape(lambda length: traced.append(bodies(mechanism.with_parameters(L=length))) or length, 0.3)
    assert traced == [bodies(mechanism)]
    assert [len(slots[0]) for slots in bodies(mechanism)] == [2, 2]


class Rolls(jn.joints.AbstractConstraint, space="planar"):
    """A condition on velocities, which is no function of how bodies lie."""

    radius: jn.joints.Scalar

    def residual(self, body_i, body_j, time):
        return body_j.position.differentiate()[0] - self.radius * body_j.angle.differentiate()


class Spins(jn.joints.AbstractConstraint, space="spatial"):
    """The same of the angular velocity in space."""

    def residual(self, body_i, body_j, time):
        return body_j.angular_velocity[2]


@pytest.mark.parametrize("space, joint", [("planar", Rolls(("ground", "a"), 0.3)), ("spatial", Spins(("ground", "a")))])
def test_a_residual_that_uses_velocities_is_refused_by_name(space, joint):
    body = jn.Body([0.0] * (2 if space == "planar" else 3))
    mechanism = jn.Mechanism(space=space, bodies={"a": body}, joints={"roll": joint})
    with pytest.raises(
        jn.errors.UnsupportedError, match=rf"joints\.roll: the residual of {type(joint).__name__} uses velocities"
    ):
        jn.solve(mechanism, [0.0, 1.0], 1)
