"""Mechanisms written as files: what is read back is what was written."""

import dataclasses
import pathlib

import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce.constraints import AbstractConstraint, Vector
from jounce.errors import MechanismError, MechanismFileError, OutputError, UnitError
from jounce.io.files.dumping import dumped
from jounce.io.files.source import read_source
from jounce.io.mechanisms.writing.writer import mechanism_data

ROOT = pathlib.Path(__file__).resolve().parents[4]
EXAMPLES = sorted((ROOT / "examples").glob("*.yaml"))
PIN = {"A": jn.planar.Revolute(("ground", "bar"), point_i=[0, 0], point_j=[0, 0])}


def bar(motion, **parts):
    drivers = {"turn": jn.drivers.CoordinateDriver(("ground", "bar"), "angle", motion=motion)}
    outputs = {"angle": jn.outputs.AngleOutput("bar")}
    settings = {"bodies": {"bar": jn.Body([0, 0])}, "joints": PIN, "drivers": drivers, "outputs": outputs}
    return jn.Mechanism(space="planar", **{**settings, **parts})


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".yaml", ".toml", ".json"])
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_every_example_is_the_same_after_it_was_written(path, suffix, tmp_path):
    mechanism = jn.load(path)
    target = tmp_path / f"again{suffix}"
    jn.write_mechanism(mechanism, target)
    assert jn.load(target) == mechanism


@pytest.mark.slow
@pytest.mark.parametrize("name", ["six_bar_watt", "press"])
def test_results_are_the_same_to_the_last_digit(name, tmp_path):
    mechanism = jn.load(ROOT / "examples" / f"{name}.yaml")
    jn.write_mechanism(mechanism, tmp_path / "again.toml")
    first, second = jn.solve(mechanism), jn.solve(jn.load(tmp_path / "again.toml"))
    for output, values in first.outputs.items():
        np.testing.assert_array_equal(values, second.outputs[output])


@pytest.mark.parametrize("count", [6, 7, 30])
def test_a_spline_goes_to_a_file_of_samples(count, tmp_path):
    t = np.linspace(0.0, 2.0, count)
    t[1:-1] += np.random.default_rng(count).uniform(-0.2, 0.2, count - 2) * t[1]
    law = jn.laws.SplineMotion(t, np.sin(3 * t), degree=5)
    jn.write_mechanism(bar(law), tmp_path / "bar.yaml")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bar.yaml", "bar_drivers_turn_motion.csv"]
    again = jn.load(tmp_path / "bar.yaml").drivers["turn"].motion
    at = jn.Jet.variable(jnp.linspace(0.0, 2.0, 50)[None], 4)
    for here, there in zip(law(at).derivatives(), again(at).derivatives(), strict=True):
        scale = float(jnp.max(jnp.abs(here)))
        np.testing.assert_allclose(here, there, rtol=0, atol=1e-8 * scale)


def test_values_of_a_law_of_its_own_take_the_place_of_their_names(tmp_path):
    mechanism = bar(jn.laws.ExpressionMotion("a*t + a2*sin(t)", {"a": 2.0, "a2": -0.5}))
    jn.write_mechanism(mechanism, tmp_path / "bar.json")
    law = jn.load(tmp_path / "bar.json").drivers["turn"].motion
    assert law.text == "(2.0)*t + (-0.5)*sin(t)"


@pytest.mark.parametrize("suffix", [".yaml", ".toml", ".json"])
def test_a_parameter_keeps_its_unit(suffix, tmp_path):
    """Such as that of time within a law, which no other entry of the file says."""
    given = {"T": "500 ms", "rise": "30 deg", "bare": 0.1, "double": "2*T", "rate": "120 rpm", "M": "2 kNm/rad"}
    mechanism = bar("rise*sin(2*pi*t/T) + bare*t", parameters=given).with_parameters(rate=3.0)
    jn.write_mechanism(mechanism, tmp_path / f"bar{suffix}")
    again = jn.load(tmp_path / f"bar{suffix}")
    assert again.parameters == mechanism.parameters
    assert (again.parameters["T"], again.parameters["rate"]) == (0.5, 3.0)
    assert set(again.dimensions) == {"T", "rise", "rate", "M"}
    jn.write_mechanism(again, tmp_path / f"twice{suffix}")
    assert (tmp_path / f"twice{suffix}").read_text() == (tmp_path / f"bar{suffix}").read_text()
    for name in ("T", "rise", "rate", "M"):
        with pytest.raises(UnitError, match="this is a length, but the parameter is"):
            again.with_parameters(**{name: "300 mm"})
    assert again.with_parameters(bare="3 deg/s", T="3 min").parameters["T"] == 180.0


def test_masses_and_instants(tmp_path):
    wheel = jn.Inertia.solid("cylinder", radius=0.1, length=0.02, mass=1.5)
    tilted = jn.Body(
        [0, 0, 1], orientation=[1, 1, 0, 0], mass=1.0, inertia=np.array([[2, 0.1, 0], [0.1, 2, 0], [0, 0, 2.0]])
    )
    bodies = {"wheel": jn.Body([0, 0, 0], inertia=wheel), "tilted": tilted}
    mechanism = jn.Mechanism(
        space="spatial", bodies=bodies, joints={}, time=np.linspace(0, 1, 11), gravity=[0, 0, -9.81]
    )
    data, samples = mechanism_data(mechanism)
    assert samples == {}
    assert data["time"] == {"start": 0, "stop": 1, "count": 11}
    assert data["bodies"]["wheel"]["inertia"] == np.diag(wheel.tensor).tolist()
    assert data["bodies"]["tilted"]["inertia"] == [[2, 0.1, 0], [0.1, 2, 0], [0, 0, 2]]
    jn.write_mechanism(mechanism, tmp_path / "a.yaml")
    again = jn.load(tmp_path / "a.yaml")
    assert again.bodies["wheel"].mass == 1.5
    assert again.bodies["tilted"].orientation == pytest.approx((0.5**0.5, 0.5**0.5, 0, 0), rel=1e-15)


class Unnamed(AbstractConstraint, space="planar"):
    """Has no type."""

    point_i: Vector

    def residual(self, body_i, body_j, time):
        return (body_j.position - body_i.position)[0]


@pytest.mark.parametrize(
    "mechanism, words",
    [
        (lambda: bar(lambda t: jnp.sin(t)), "drivers.turn.motion: a function has no form in a file"),
        (lambda: bar(jn.laws.SplineMotion([0, 1, 2, 3, 4], [0, 1, 0, 1, 0], degree=2)), "even degree"),
        (lambda: bar("t", joints=PIN | {"B": Unnamed(("ground", "bar"), [0, 0])}), "joints.B: the class Unnamed"),
        (lambda: bar("t", time=[0.0, 0.1, 0.5]), "not evenly spaced"),
    ],
)
def test_what_has_no_form_in_files_is_refused_and_nothing_written(mechanism, words, tmp_path):
    with pytest.raises(MechanismError, match=words):
        jn.write_mechanism(mechanism(), tmp_path / "bar.yaml")
    assert not list(tmp_path.iterdir())


def test_a_target_that_cannot_be_is_refused(tmp_path):
    for name in ("bar.txt", "no/bar.yaml"):
        with pytest.raises(OutputError):
            jn.write_mechanism(bar("t"), tmp_path / name)


@pytest.mark.parametrize("suffix", [".yaml", ".json", ".toml"])
def test_texts_are_read_as_they_were(suffix, tmp_path):
    titles = [
        "yes",
        "null",
        "1e3",
        " 2 ",
        "a: b # c",
        'say "no"',
        "it's",
        "[1]",
        "\u00e9t\u00e9",
        "~",
        "0x10",
        "- a",
        "t\\n",
    ]
    for title in titles:
        data = {"title": title, "space": "planar", "bodies": {"a": {"position": [0, 0.1]}}}
        path = tmp_path / f"a{suffix}"
        path.write_text(dumped(data, suffix), encoding="utf-8")
        assert read_source(path).data == data


def test_closures_and_joints_that_follow_have_a_form(tmp_path):
    arm = jn.load_robot(ROOT / "examples" / "robots" / "five_bar.xml").mechanism()
    jn.write_mechanism(arm, tmp_path / "a.yaml")
    again = jn.load(tmp_path / "a.yaml")
    assert type(again.joints["tip"]) is type(arm.joints["tip"])
    np.testing.assert_array_equal(np.array(again.joints["tip"].wrenches), arm.joints["tip"].wrenches)
    hand = jn.load_robot(ROOT / "examples" / "robots" / "panda.urdf").mechanism()
    jn.write_mechanism(hand, tmp_path / "b.yaml")
    follower = jn.load(tmp_path / "b.yaml").joints["panda_finger_joint2_mimic"]
    assert (follower.roles, follower.kinds, follower.weight_1) == ("ijim", "slide-slide", 1.0)
    assert follower.bodies == hand.joints["panda_finger_joint2_mimic"].bodies


COUPLED = """\
space: spatial
bodies: {{a: {{}}, b: {{}}}}
joints:
  J: {{type: coupled, bodies: [ground, a, b], roles: {roles}, kinds: {kinds}, point_1: [0, 0, 0], axis_1: [0, 0, 1],
    vector_1: [1, 0, 0], opposite_1: [1, 0, 0], point_2: [0, 0, 0], axis_2: [0, 0, 1], vector_2: [1, 0, 0],
    opposite_2: [1, 0, 0], weight_1: 2, weight_2: 1, offset: 0}}
"""
CLOSED = "{{type: closure, bodies: [ground, a], points: [[0, 0, 0], [0, 0, 0]], wrenches: {wrenches}}}"


@pytest.mark.parametrize(
    "roles, kinds, words",
    [
        ("ijik", "turn-turn", "line 4, joints.J.roles: must name two bodies of each joint by i, j, m"),
        ("iijm", "turn-turn", "joints.J.roles"),
        ("ijim", "turn-swing", "joints.J.kinds: unknown kinds"),
    ],
)
def test_words_of_coupled_joints_are_checked(roles, kinds, words, tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text(COUPLED.format(roles=roles, kinds=kinds))
    with pytest.raises(MechanismFileError, match=words):
        jn.load(path)
    path.write_text(COUPLED.format(roles="ijim", kinds="turn-turn"))
    assert dataclasses.asdict(jn.load(path).joints["J"])["roles"] == "ijim"


@pytest.mark.slow
@pytest.mark.parametrize("weights", ["weight_1: -3, weight_2: 40, offset: 0.5"])
def test_coupled_joints_keep_count_of_turns_without_a_period(weights, tmp_path):
    path = tmp_path / "a.yaml"
    text = COUPLED.format(roles="ijim", kinds="turn-turn").replace("weight_1: 2, weight_2: 1, offset: 0", weights)
    hinge = "{{type: revolute, bodies: [ground, {0}], points: [[0, 0, 0], [0, 0, 0]], axes: [[0, 0, 1], [0, 0, 1]]}}"
    path.write_text(
        text + "".join(f"  {x}_hinge: {hinge.format(x)}\n" for x in "ab") + "drivers:\n"
        "  motor: {type: rotation, bodies: [ground, a], axis: [0, 0, 1], motion: 40*t + 30*t**2}\n"
    )
    of = jn.outputs.RelativeAngleOutput(("ground", "b"), axis=[0, 0, 1])
    mechanism = dataclasses.replace(jn.load(path), outputs={"turn": of})
    turn = jn.solve(mechanism, np.linspace(0, 2, 5), order=2).outputs["turn"]
    given = mechanism.joints["J"]
    speed = given.weight_1 / given.weight_2
    time = np.linspace(0, 2, 5)
    expected = np.stack([speed * (40 * time + 30 * time**2) + given.offset / given.weight_2, speed * (40 + 60 * time)])
    np.testing.assert_allclose(turn[:, :2].T, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    "wrenches, words",
    [
        ("[]", "must be rows of six values"),
        ("[[1, 0, 0]]", r"wrenches\[0\]: must be a list of 6 values"),
        ("[[0, 0, 0, 0, 0, 0]]", "a row must not vanish"),
        ("[[1, 0, 0, 0, 0, 1]]", "needs vector_part and scalar_part"),
    ],
)
def test_wrenches_of_closures_are_checked(wrenches, words, tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text("space: spatial\nbodies: {a: {}}\njoints:\n  J: " + CLOSED.format(wrenches=wrenches))
    with pytest.raises(MechanismFileError, match=words):
        jn.load(path)
