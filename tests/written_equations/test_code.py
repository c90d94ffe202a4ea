"""Equations written as Python and C against the equations as numbers, by which nothing was written."""

import ctypes
import shutil
import subprocess

import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce.errors import MechanismError
from tests.dynamics.test_racks import rack
from tests.problems.bank import cases
from tests.problems.mechanisms import example
from tests.problems.own_types import taken_back
from tests.problems.written import at, between_free_bodies, coordinates, differences, from_one, random_states, run

pytestmark = pytest.mark.long

QUICK = "planar-joint-parallel2"
CASES = [
    pytest.param(case, id=str(case), marks=[] if str(case) == QUICK else pytest.mark.slow)
    for case in cases()
    if case.kind not in (jn.spatial.Gear, jn.spatial.Rolling)  # other joints hold their axes: see worm and rack below
]
ROUNDING = 1e-12
COMPILER = shutil.which("cc")
BY_ORDER = {"right_side", "forces", "outputs", "torque", "regressor"}


def compiled(text, folder, name="mechanism"):
    """Return the functions of a file of C, compiled without a warning, as those of Python are called."""
    source, library = folder / f"{name}.c", folder / f"{name}.so"
    source.write_text(text)
    strict = "-std=c99 -Wall -Wextra -Werror -pedantic".split()
    subprocess.run(["cc", *strict, "-O1", "-shared", "-fPIC", source, "-o", library, "-lm"], check=True)
    functions = ctypes.CDLL(str(library))

    def pointer(values):
        return np.ascontiguousarray(values, float).ctypes.data_as(ctypes.POINTER(ctypes.c_double))

    def call(what, shape, *given):
        out, kept = np.full(shape, np.nan), [np.asarray(x, float, order="C") for x in given]
        values = [pointer(x) if x.ndim else ctypes.c_double(float(x)) for x in kept]
        orders = [shape[0]] if what in BY_ORDER else []
        getattr(functions, f"{name}_{what}")(*values, *orders, pointer(out))
        return out

    return call


def assert_same_in_c(code, call, equations, tolerance=1e-14):
    """Compare C with Python, whose operations are the same, at the instants of equations."""
    q = coordinates(equations)
    for k, t in enumerate(equations.time.values.tolist()):
        velocities = np.nan_to_num(from_one(equations.velocities)[k])
        for what, *more in (("residual", q[k]), ("jacobian", q[k]), ("right_side", q[k], velocities)):
            expected = code[what](t, *more)
            size = np.max(np.abs(expected), initial=1.0)
            np.testing.assert_allclose(call(what, expected.shape, t, *more), expected, rtol=0, atol=tolerance * size)


@pytest.mark.parametrize("case", CASES)
def test_every_joint_and_driver_to_order_six(case, tmp_path):
    random = np.random.default_rng(7)
    mechanism = between_free_bodies(case.element(random), case.space)
    state = random_states(mechanism, 5, random)
    equations = jn.constraint_equations(mechanism, state, 0.3)
    motion = at(mechanism, state, 0.3)
    code = run(jn.equations(motion, order=6))
    assert list(code["ROWS"]) == equations.row.values.tolist()
    assert list(code["COLUMNS"]) == equations.column.values.tolist()
    assert differences(code, equations).max() < ROUNDING
    if COMPILER:
        assert_same_in_c(code, compiled(jn.equations(motion, format="c", order=6), tmp_path), equations)


def own_joints():
    """Return three joints as users write them: with a root and an angle, with a choice, in space with exponentials."""
    with taken_back():

        class Bearing(jn.joints.AbstractConstraint, type="own_bearing", space="planar"):
            point_j: jn.joints.Vector
            gain: jn.joints.Scalar

            def residual(self, body_i, body_j, time):
                d = body_j.point(self.point_j) - body_i.position
                return jn.jet.atan2(d[1], d[0]) - self.gain * jn.jet.sqrt(d.dot(d)) - body_i.angle

        class Stop(jn.joints.AbstractConstraint, type="own_stop", space="planar"):
            point_j: jn.joints.Vector

            def residual(self, body_i, body_j, time):
                d = body_j.point(self.point_j) - body_i.position
                side = d[0].coefficients[0] > 0.1
                return jn.jet.Jet(
                    jnp.where(side, 0.0 if a is None else a, 0.0 if b is None else b)
                    for a, b in zip((d[1] ** 3).coefficients, jn.jet.sin(d[0]).coefficients, strict=True)
                )

        class Decay(jn.joints.AbstractConstraint, type="own_decay", space="spatial"):
            point_i: jn.joints.Vector
            axis_i: jn.joints.Vector
            rate: jn.joints.Scalar

            def residual(self, body_i, body_j, time):
                d = body_j.position - body_i.point(self.point_i)
                along = body_i.direction(self.axis_i).dot(d)
                return jn.joints.rows(
                    jn.jet.exp(-self.rate * along) - d.dot(d), jn.jet.tanh(along) / (1.5 + along**2) - time
                )

        bodies = ("one", "two")
        return {
            "planar": [Bearing(bodies, [0.2, 0.1], 0.7), Stop(bodies, [0.3, -0.2])],
            "spatial": [Decay(bodies, [0.1, 0.2, 0.3], [1.0, 0.5, -0.2], 0.8)],
        }


@pytest.mark.parametrize("space", ["planar", pytest.param("spatial", marks=pytest.mark.slow)])
def test_joints_of_ones_own(space):
    random = np.random.default_rng(3)
    for element in own_joints()[space]:
        mechanism = between_free_bodies(element, space)
        state = random_states(mechanism, 5, random)
        equations = jn.constraint_equations(mechanism, state, 0.3)
        assert differences(run(jn.equations(at(mechanism, state, 0.3), order=6)), equations).max() < ROUNDING


LAWS = {
    "samples": jn.laws.SplineMotion(np.linspace(0, 2, 30), np.sin(3 * np.linspace(0, 2, 30))),
    "repeated": jn.laws.SplineMotion(np.linspace(0, 1, 30), np.sin(2 * np.pi * np.linspace(0, 1, 30)), 5, "repeat"),
    "pieces": jn.laws.PiecewiseMotion(["t**4", "2*t - 1", "0.4*cos(t)"], until=[0.5, 1.1]),
    "function": lambda t: jnp.where(t < 0.7, jnp.sin(t) ** 3, jnp.abs(t - 2) * jnp.exp(-t)),
    "formula": "0.3*atan2(sin(t), 2 + cos(t)) + abs(t - 1)**2.5 + sign(t - 1) - sqrt(1 + t)*tanh(t)",
}


@pytest.mark.slow
@pytest.mark.parametrize("law", [x if x == "samples" else pytest.param(x, marks=pytest.mark.slow) for x in LAWS])
@pytest.mark.filterwarnings("ignore::jounce.errors.SampleWarning")
def test_laws_with_tables_and_choices(law, tmp_path):
    crank = jn.planar.Revolute(("ground", "crank"), [0, 0], [0, 0])
    driver = jn.drivers.CoordinateDriver(("ground", "crank"), "angle", motion=LAWS[law])
    parts = {"bodies": {"crank": jn.Body([0, 0])}, "joints": {"O": crank}, "drivers": {"it": driver}}
    mechanism = jn.Mechanism(space="planar", **parts)
    code, in_c = run(jn.equations(mechanism)), jn.equations(mechanism, format="c")
    call = compiled(in_c, tmp_path) if COMPILER else None
    state = random_states(mechanism, 3, np.random.default_rng(0))
    for time in (0.0, 0.31, 0.69, 0.9, 1.3, 2.0):
        equations = jn.constraint_equations(mechanism, state, time)
        assert differences(code, equations).max() < ROUNDING
        if call:
            assert_same_in_c(code, call, equations)
    assert np.isnan(code["residual"](5.0, np.zeros(3))[2]) == (law == "samples")


EXAMPLES = (
    "four_bar rsur rssr camshaft epicyclic gear_pair hooke_joint inverted_slider_crank_distance wolfrom_train rccc"
    " screw_press"
).split()


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_mechanisms_along_their_motions(name, tmp_path):
    mechanism = jn.load(example(name))
    motion = jn.solve(mechanism, order=6)
    motion_equations = jn.constraint_equations(motion).isel(time=slice(None, None, max(1, len(motion.time) // 4)))
    code = run(jn.equations(mechanism, order=6))
    # a row of RCCC vanishes by terms that cancel: 1e-11 of 1 is rounding of these, and is no more than 1e-12 of them
    assert differences(code, motion_equations, by_terms=name == "rccc").max() < ROUNDING
    whole = code["right_side"](
        motion_equations.time.values,
        coordinates(motion_equations).T,
        np.moveaxis(from_one(motion_equations.velocities), 0, -1),
    )
    expected = from_one(motion_equations.right_side)
    np.testing.assert_allclose(np.moveaxis(whole, -1, 0), expected, rtol=1e-9, atol=1e-9 * abs(whole).max())
    if COMPILER:
        assert_same_in_c(code, compiled(jn.equations(mechanism, format="c", order=6), tmp_path), motion_equations)


def worm():
    """Return a worm and its wheel on crossed axes, whose angles are counted as along a motion, or as assembled."""
    bodies = {"worm": jn.Body([0, 0, 0]), "wheel": jn.Body([0, 0, 0.1])}
    joints = {
        "a": jn.spatial.Revolute(("ground", "worm"), [0, 0, 0], [0, 0, 0], [1, 0, 0], [1, 0, 0]),
        "b": jn.spatial.Revolute(("ground", "wheel"), [0, 0, 0.1], [0, 0, 0], [0, 1, 0], [0, 1, 0]),
        "mesh": jn.spatial.Gear(("worm", "wheel", "ground"), [1, 0, 0], [0, 1, 0], ratio="-1/40"),
    }
    motor = jn.drivers.RotationDriver(("ground", "worm"), [1, 0, 0], motion="100*t + 300*t**2")
    return jn.Mechanism(space="spatial", bodies=bodies, joints=joints, drivers={"motor": motor})


@pytest.mark.slow
def test_a_worm_on_crossed_axes():
    mechanism = worm()
    motion = jn.solve(mechanism, np.linspace(0, 0.5, 4), order=6)
    equations = jn.constraint_equations(motion)
    for given in (motion, mechanism):
        assert differences(run(jn.equations(given, order=6)), equations).max() < ROUNDING


@pytest.mark.slow
def test_a_rack_and_its_pinion_in_space(tmp_path):
    """In a frame that is drawn at random, with a pressure angle; the travel counts turns."""
    mechanism = rack(law="0.6*t + 0.3*sin(t)")  # slow, so that terms which cancel are of the size of the others
    motion = jn.solve(mechanism, np.linspace(0, 0.5, 4), order=6)
    equations = jn.constraint_equations(motion)
    for given in (motion, mechanism):
        code = run(jn.equations(given, order=6))
        assert differences(code, equations).max() < ROUNDING
        if COMPILER:
            assert_same_in_c(code, compiled(jn.equations(given, format="c", order=6), tmp_path), equations)


def test_fewer_velocities_give_fewer_right_sides():
    code = run(jn.equations(jn.load(example("four_bar")), order=3))
    q, velocities = np.arange(6.0), np.arange(18.0).reshape(3, 6)
    whole = code["right_side"](0.3, q, velocities)
    assert whole.shape == (3, 6)
    for n in range(3):
        np.testing.assert_array_equal(code["right_side"](0.3, q, velocities[:n]), whole[: n + 1])


def test_names_that_no_language_allows():
    bodies = {"a b": jn.Body([0, 0]), "a-b": jn.Body([1, 0]), "1*/": jn.Body([2, 0])}
    pins = {
        "if": jn.planar.Revolute(("ground", "a b"), [0, 0], [0, 0]),
        '"""': jn.planar.Revolute(("a b", "a-b"), [0.1, 0], [0, 0]),
        "\n*/": jn.planar.Revolute(("a-b", "1*/"), [0.1, 0], [0, 0]),
    }
    mechanism = jn.Mechanism(space="planar", bodies=bodies, joints=pins, title='the "end" */ \\')
    state = random_states(mechanism, 2, np.random.default_rng(1))
    equations = jn.constraint_equations(mechanism, state)
    code = run(jn.equations(mechanism, order=3))
    assert code["ROWS"][2] == '""".1'
    assert differences(code, equations).max() < ROUNDING


class Endless(jn.joints.AbstractConstraint):
    def residual(self, body_i, body_j, time):
        import jax

        start = body_j.angle.coefficients[0]
        x = jax.lax.while_loop(lambda x: (x > 1).all(), lambda x: x / 2, start)
        return body_j.angle - x


@pytest.mark.parametrize(
    "arguments, words",
    [
        ({"joint": "XY"}, "no joint or driver has this name, got 'XY'"),
        ({"order": 0}, "whole number from 1 to 12"),
        ({"order": 40}, "whole number from 1 to 12"),
        ({"format": "pdf"}, "python"),
        ({"name": "2 b"}, "name of C"),
    ],
)
def test_arguments_that_are_wrong(arguments, words):
    with pytest.raises(MechanismError, match=words):
        jn.equations(jn.load(example("four_bar")), **arguments)


def test_what_cannot_be_written_is_named():
    joint = Endless(("ground", "arm"))
    pin = jn.planar.Revolute(("ground", "arm"), [0, 0], [0, 0])
    mechanism = jn.Mechanism(space="planar", bodies={"arm": jn.Body([0, 0])}, joints={"pin": pin, "own": joint})
    with pytest.raises(MechanismError, match=r"^own: cannot be written out: it has the operation 'while'"):
        jn.equations(mechanism)
    assert run(jn.equations(mechanism, "pin"))["ROWS"] == ("pin.1", "pin.2")


def test_orders_beyond_what_a_file_holds(monkeypatch):
    from jounce.written_equations import write

    monkeypatch.setitem(write.LANGUAGES, "python", write.LANGUAGES["python"]._replace(most=100))
    with pytest.raises(MechanismError, match=r"order: takes \d+ operations, more than the 100 of a file of python"):
        jn.equations(jn.load(example("four_bar")))
