"""What a mechanism file says is what the mechanism holds."""

import json
import math
import pathlib
import subprocess
import sys

import numpy as np
import pytest

import jounce as jn
from jounce import spatial
from jounce.constraints import AbstractConstraint, Scalar, Vector, catalogue
from jounce.constraints.base import value_fields
from jounce.constraints.drivers import RotationDriver
from jounce.errors import MechanismFileError
from jounce.io import load
from jounce.io.files.source import read_source
from jounce.io.mechanisms.schema.keys import file_keys
from jounce.mechanism import build, time_grid
from jounce.trajectory import Expression, SplineMotion

ROOT = pathlib.Path(__file__).parents[3]
EXAMPLES = sorted((ROOT / "examples").glob("*.yaml"))

HEAD = "space: {space}\nparameters: {{AB: 4 cm, tau: 2 s, half: AB/2}}\nbodies:\n  a: {{}}\n  b: {{}}\n  c: {{}}\n"


def write(folder, text, name="file.yaml"):
    path = folder / name
    path.write_text(text)
    return path


def joint(folder, space, entry, role="joints"):
    text = HEAD.format(space=space) + f"{role}:\n  J: {entry}\n"
    return getattr(load(write(folder, text)), role)["J"]


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_examples_are_read(path):
    mechanism = load(path)
    assert mechanism.bodies
    assert mechanism.outputs
    assert time_grid(mechanism.time, mechanism.parameter_values).size > 1


def test_a_file_holds_what_it_says(tmp_path):
    mechanism = load(ROOT / "examples" / "four_bar.yaml")
    assert mechanism.space == "planar"
    assert mechanism.parameters["AD"] == 0.1321
    assert mechanism.bodies["rocker"].position == (Expression("AD"), 0.0)
    assert mechanism.joints["BC"].length == Expression("BC")
    assert mechanism.joints["BC"].bodies == ("crank", "rocker")
    assert mechanism.joints["BC"].point_j == (Expression("CD"), 0.0)
    assert mechanism.drivers["theta"].coordinate == "angle"


def test_toml_and_json_say_the_same(tmp_path):
    yaml = load(ROOT / "examples" / "four_bar.yaml")
    data = read_source(ROOT / "examples" / "four_bar.yaml").data
    as_json = load(write(tmp_path, json.dumps(data), "four_bar.json"))

    def toml(value):
        if isinstance(value, dict):
            return "{" + ", ".join(f"{key} = {toml(item)}" for key, item in value.items()) + "}"
        return json.dumps(value) if not isinstance(value, list) else "[" + ", ".join(map(toml, value)) + "]"

    as_toml = load(write(tmp_path, "".join(f"{key} = {toml(item)}\n" for key, item in data.items()), "four_bar.toml"))
    assert repr(yaml) == repr(as_json) == repr(as_toml)


PAIR = {"points": "[[1 cm, 0], [AB, 0]]", "vectors": "[[1, 0], [0, 3 mm]]", "vector": "[1, AB]", "point": "[0, 0]"}
TRIPLE = {"points": "[[1 cm, 0, 0], [AB, 0, 1]]", "vectors": "[[1, 0, 0], [0, 1, 0]]", "vector": "[1, 2, 3]"}
TRIPLE |= {"axes": "[[0, 0, 1], [0, 0, 1]]", "axis": "[0, 0, 1]", "normals": "[[1, 0, 0], [1, 0, 0]]"}
SCALARS = {
    "length": "14.23 cm",
    "ratio": "2",
    "radius": "AB",
    "radii": "[AB, 2 cm]",
    "lead": "5 mm",
    "coordinate": "angle",
    "motion": "t",
}
PAIR["curve"], TRIPLE["curve"], TRIPLE["surface"] = "[s, s**2 + s]", "[s, sin(s), 0.1*s]", "[u, v, u*v]"
TRIPLE["point"], TRIPLE["plane"] = "[0, 0, 0]", "{point: [0, 0, 1 mm], normal: [0, 0, 1]}"

KEYS = {  # the table of the documentation
    ("planar", "joint", "revolute"): "points friction?",
    ("planar", "joint", "double_revolute"): "points length",
    ("planar", "joint", "parallel1"): "vectors",
    ("planar", "joint", "parallel2"): "points vector friction?",
    ("planar", "joint", "prismatic"): "points vectors friction?",
    ("planar", "joint", "coordinate"): "coordinate ratio? offset?",
    ("planar", "joint", "gear"): "ratio? offset? points? radii? pressure_angle? friction?",
    ("planar", "joint", "rolling"): "points vector radius offset? pressure_angle? friction?",
    ("planar", "joint", "fixed"): "points offset?",
    ("planar", "joint", "belt"): "points radii crossed? offset? friction?",
    ("planar", "joint", "rope"): "points length",
    ("planar", "joint", "curve"): "curve point start?",
    ("planar", "driver", "coordinate"): "coordinate ratio? offset? motion",
    ("planar", "driver", "slide"): "points vector motion",
    ("planar", "driver", "distance"): "points motion",
    ("spatial", "joint", "spherical"): "points friction?",
    ("spatial", "joint", "double_spherical"): "points length",
    ("spatial", "joint", "dot1"): "vectors",
    ("spatial", "joint", "dot2"): "points vector",
    ("spatial", "joint", "universal"): "points vectors",
    ("spatial", "joint", "revolute"): "points axes friction?",
    ("spatial", "joint", "cylindrical"): "points axes friction?",
    ("spatial", "joint", "prismatic"): "points axes normals friction?",
    ("spatial", "joint", "screw"): "points axes lead offset? friction?",
    ("spatial", "joint", "fixed"): "points axes normals",
    ("spatial", "joint", "planar"): "points axes friction?",
    ("spatial", "joint", "constant_velocity"): "points axes offset?",
    ("spatial", "joint", "tripod"): "points axes normals radius",
    ("spatial", "joint", "oldham"): "points axes vectors",
    ("spatial", "joint", "curve"): "curve point start?",
    ("spatial", "joint", "surface"): "surface point start_u? start_v?",
    ("spatial", "joint", "gear"): "axes ratio offset? friction? points? pressure_angle? helix_angle?",
    ("spatial", "joint", "rolling"): "points vector axes radius offset? pressure_angle? friction?",
    ("spatial", "joint", "wheel"): "point axis radius plane",
    ("spatial", "joint", "rope"): "points length",
    ("spatial", "driver", "rotation"): "axis vectors? motion",
    ("spatial", "driver", "slide"): "points vector motion",
    ("spatial", "driver", "distance"): "points motion",
}


def test_the_table_of_keys_is_complete():
    found = {
        (space, role, name)
        for space in ("planar", "spatial")
        for role in ("joint", "driver")
        for name, kind in catalogue(space, role).items()
        if kind.__module__.startswith("jounce.constraints.")
    }
    assert found == KEYS.keys()  # those of robots are in test_writer.py


@pytest.mark.parametrize("space, role, name", KEYS, ids="-".join)
def test_every_type_takes_the_keys_of_the_table(tmp_path, space, role, name):
    kind = catalogue(space, role)[name]
    keys = {key.key + "?" * (not key.required) for key in file_keys(kind)}
    assert keys == set(KEYS[space, role, name].split())
    values = SCALARS | (PAIR if space == "planar" else TRIPLE)
    given = {key: values[key] for key in KEYS[space, role, name].split() if not key.endswith("?")}
    given |= {"ratio": 2} if name == "gear" else {}  # or points and radii
    bodies = "[ground, a, b]" if name == "gear" else "[a, b]"
    entry = ", ".join([f"{{type: {name}", f"bodies: {bodies}", *(f"{k}: {v}" for k, v in given.items())]) + "}"
    made = joint(tmp_path, space, entry, f"{role}s")
    assert type(made) is kind
    for key in file_keys(kind):
        if key.required:
            assert all(getattr(made, field) is not None for field in key.fields)
    assert {field for key in file_keys(kind) for field in key.fields} == value_fields(kind).keys()


def test_pairs_go_to_the_fields_of_their_bodies(tmp_path):
    made = joint(
        tmp_path, "planar", "{type: prismatic, bodies: [a, b], points: [[1, 2], [3, 4]], vectors: [[5, 6], [7, 8]]}"
    )
    assert (made.point_i, made.point_j) == ((1.0, 2.0), (3.0, 4.0))
    assert (made.vector_i, made.vector_j) == ((5.0, 6.0), (7.0, 8.0))


def test_optional_pairs_may_be_left_out(tmp_path):
    made = joint(tmp_path, "spatial", "{type: rotation, bodies: [a, b], axis: [0, 0, 1], motion: t}", "drivers")
    assert isinstance(made, RotationDriver)
    assert made.vector_i is None
    assert made.vector_j is None


@pytest.mark.parametrize(
    "entry, role, values",
    [
        ("{type: coordinate, bodies: [a, b], coordinate: x, ratio: 3 cm, offset: 2 mm}", "joints", (0.03, 0.002)),
        (
            "{type: coordinate, bodies: [a, b], coordinate: angle, ratio: -2, offset: 90 deg}",
            "joints",
            (-2.0, math.pi / 2),
        ),
        ("{type: gear, bodies: [a, b, c], ratio: -2, offset: 90 deg}", "joints", (-2.0, math.pi / 2)),
        ("{type: coordinate, bodies: [ground, b], coordinate: y, motion: 3 cm}", "drivers", (None, 0.0)),
    ],
)
def test_units_follow_what_is_measured(tmp_path, entry, role, values):
    made = joint(tmp_path, "planar", entry, role)
    assert (made.ratio, made.offset) == values


@pytest.mark.parametrize(
    "entry",
    [
        "{type: coordinate, bodies: [a, b], coordinate: x, ratio: 3 deg}",
        "{type: coordinate, bodies: [a, b], coordinate: angle, offset: 3 cm}",
        "{type: coordinate, bodies: [a, b], offset: 3 deg, coordinate: y}",
        "{type: gear, bodies: [a, b, c], ratio: 2 cm}",
        "{type: rolling, bodies: [a, b], points: [[0, 0], [0, 0]], vector: [1, 0], radius: 1, offset: 30 deg}",
    ],
)
def test_units_of_another_measure_are_refused(tmp_path, entry):
    with pytest.raises(MechanismFileError, match=r"line 8, joints.J.(ratio|offset): expected a"):
        joint(tmp_path, "planar", entry)


@pytest.mark.parametrize(
    "orientation, quaternion",
    [
        ("{quaternion: [0, 0, 0, 2]}", (0, 0, 0, 1)),
        ("{axis: [0, 0, 3 cm], angle: 180 deg}", (0, 0, 0, 1)),
        ("{axis: [0, 0, 1], angle: 60*deg + 0*AB}", (math.cos(math.pi / 6), 0, 0, 0.5)),
        ("{euler: zxz, angles: [180 deg, 0, 0]}", (0, 0, 0, 1)),
        ("{euler: ZXZ, angles: [90 deg, 90 deg, 0]}", (0.5, 0.5, 0.5, 0.5)),
    ],
)
def test_orientations_become_unit_quaternions(tmp_path, orientation, quaternion):
    text = HEAD.format(space="spatial").replace("a: {}", f"a: {{orientation: {orientation}}}")
    guess = build(load(write(tmp_path, text))).guess["quaternion"][:, 1, 0]
    np.testing.assert_allclose(guess, quaternion, atol=1e-15)


def test_masses_are_kept(tmp_path):
    text = HEAD.format(space="spatial").replace(
        "a: {}", "a: {mass: 500 g, inertia: [1, 2, 3 kg*m^2], center_of_mass: [AB, 0, 0]}"
    )
    body = load(write(tmp_path, text + "gravity: [0, 0, -9.81 m/s^2]\n")).bodies["a"]
    assert (body.mass, body.inertia) == (0.5, (1.0, 2.0, 3.0))
    assert body.center_of_mass == (Expression("AB"), 0.0, 0.0)
    assert load(tmp_path / "file.yaml").gravity == (0.0, 0.0, -9.81)


@pytest.mark.parametrize(
    "space, entry, kind",
    [
        ("planar", "{body: a, point: [0, 0]}", jn.outputs.PointOutput),
        ("planar", "{body: a, quantity: angle}", jn.outputs.AngleOutput),
        ("planar", "{bodies: [a, b], quantity: angle}", jn.outputs.PlanarRelativeAngleOutput),
        ("planar", "{body: a, quantity: angular_velocity}", jn.outputs.AngularVelocityOutput),
        ("planar", "{bodies: [a, b], points: [[0, 0], [1, 0]], quantity: distance}", jn.outputs.DistanceOutput),
        ("spatial", "{body: a, point: [0, 0, 0]}", jn.outputs.PointOutput),
        ("spatial", "{body: a, quantity: angular_velocity, frame: body}", jn.outputs.AngularVelocityOutput),
        (
            "spatial",
            "{bodies: [ground, b], points: [[0, 0, 0], [1, 0, 0]], quantity: distance}",
            jn.outputs.DistanceOutput,
        ),
        (
            "spatial",
            "{bodies: [a, b], quantity: angle, axis: [0, 0, 1], vectors: [[1, 0, 0], [0, 1, 0]]}",
            jn.outputs.RelativeAngleOutput,
        ),
    ],
)
def test_every_form_of_output(tmp_path, space, entry, kind):
    mechanism = load(write(tmp_path, HEAD.format(space=space) + f"outputs:\n  o: {entry}\n"))
    assert type(mechanism.outputs["o"]) is kind


def test_derived_parameters_follow_when_one_is_changed(tmp_path):
    mechanism = load(write(tmp_path, HEAD.format(space="planar")))
    assert mechanism.parameter_values["half"] == 0.02
    assert mechanism.with_parameters(AB=0.1).parameter_values["half"] == 0.05


@pytest.mark.parametrize(
    "grid, instants",
    [
        ("{start: 0, stop: 2, step: 0.5}", [0, 0.5, 1, 1.5, 2]),
        ("{stop: 0.3, step: 0.1}", [0, 0.1, 0.2, 0.3]),
        ("{start: 1 s, stop: tau, count: 3}", [1, 1.5, 2]),
        ("{stop: 1, step: 400 ms}", [0, 0.4, 0.8, 1]),
        ("{start: 1, stop: 1, step: 1}", [1]),
    ],
)
def test_time_grids(tmp_path, grid, instants):
    mechanism = load(write(tmp_path, HEAD.format(space="planar") + f"time: {grid}\n"))
    np.testing.assert_allclose(time_grid(mechanism.time, mechanism.parameter_values), instants, rtol=1e-15)


def test_sections_left_empty_count_as_absent(tmp_path):
    text = HEAD.format(space="planar") + "joints:\ndrivers:\noutputs:\ntime:\ngravity:\n"
    mechanism = load(write(tmp_path, text))
    assert (mechanism.joints, mechanism.drivers, mechanism.time) == ({}, {}, None)


@pytest.mark.parametrize("motion", ["t/tau", "{expression: t/tau}", "0.5*t"])
def test_motion_by_expression(tmp_path, motion):
    entry = f"{{type: coordinate, bodies: [ground, b], coordinate: angle, motion: '{motion}'}}"
    if motion.startswith("{"):
        entry = entry.replace("'", "")
    made = joint(tmp_path, "planar", entry, "drivers")
    assert isinstance(made.motion, Expression)


def test_motion_by_samples_beside_the_file(tmp_path):
    times = np.linspace(0, 1, 30)
    rows = "".join(f"{t:.17g},{0.1 + t**2:.17g}\n" for t in times)
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "lift.csv").write_text("time,lift\n" + rows)
    entry = (
        "{type: slide, bodies: [ground, b], points: [[0, 0], [0, 0]], vector: [1, 0], motion: {samples: data/lift.csv}}"
    )
    motion = joint(tmp_path, "planar", entry, "drivers").motion
    assert isinstance(motion, SplineMotion)
    derivatives = motion(jn.Jet.variable(np.array([0.5]), order=2)).derivatives()
    np.testing.assert_allclose(np.ravel(derivatives), [0.35, 1.0, 2.0], rtol=1e-10)


def test_samples_of_a_spline_that_does_not_work_name_both_files(tmp_path):
    (tmp_path / "lift.csv").write_text("0,1\n1,2\n")
    entry = "{type: slide, bodies: [ground, b], points: [[0, 0], [0, 0]], vector: [1, 0], motion: {samples: lift.csv}}"
    with pytest.raises(MechanismFileError, match=r"line 8, drivers\.J\.motion: .*degree 5 .*least 6"):
        joint(tmp_path, "planar", entry, "drivers")


def test_a_joint_of_ones_own_is_read_at_once(tmp_path):
    class PointOnCircle(AbstractConstraint, type="test_point_on_circle", space="planar"):
        """A point of body j stays on a circle of body i."""

        point_i: Vector
        point_j: Vector
        radius: Scalar
        stiffness_ratio: Scalar = 1.0
        copy: str = "plain"  # a name that pydantic uses for itself

        def residual(self, body_i, body_j, time):
            d = body_j.point(self.point_j) - body_i.point(self.point_i)
            return d.dot(d) - self.radius**2

    entry = "{type: test_point_on_circle, bodies: [a, b], points: [[0, 0], [AB, 0]], radius: 2 cm, copy: other}"
    made = joint(tmp_path, "planar", entry)
    assert isinstance(made, PointOnCircle)
    assert (made.radius, made.point_j, made.copy) == (0.02, (Expression("AB"), 0.0), "other")
    with pytest.raises(MechanismFileError, match=r"joints\.J\.radius: .*zero, got -0\.02"):
        joint(tmp_path, "planar", entry.replace("2 cm", "-2 cm"))
    with pytest.raises(MechanismFileError, match=r"unknown key 'radios'; did you mean 'radius'"):
        joint(tmp_path, "planar", entry.replace("radius", "radios"))


def test_a_class_may_state_its_units(tmp_path):
    class Spring(AbstractConstraint, type="test_spring", space="spatial"):
        gain: Scalar
        rest: Scalar

        dimensions = {"gain": "angle", "rest": "time"}

        def residual(self, body_i, body_j, time):
            return body_i.position

    assert joint(tmp_path, "spatial", "{type: test_spring, bodies: [a, b], gain: 180 deg, rest: 1 s}").gain == math.pi
    with pytest.raises(MechanismFileError, match="expected an angle"):
        joint(tmp_path, "spatial", "{type: test_spring, bodies: [a, b], gain: 1 cm, rest: 1 s}")


@pytest.mark.parametrize("module", ["pydantic", "ruamel", "pint", "scipy", "h5netcdf", "h5py"])
def test_importing_the_package_leaves_the_heavy_libraries_alone(module):
    code = f"import sys, jounce, jounce.io; assert '{module}' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.slow
def test_reading_a_file_needs_no_pint_and_no_scipy():
    path = ROOT / "examples" / "four_bar.yaml"
    check = "assert not {'pint', 'scipy'} & sys.modules.keys()"
    code = f"import sys; from jounce.io import load; load({str(path)!r}); {check}"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_spatial_joints_are_those_of_the_catalogue(tmp_path):
    entry = "{type: universal, bodies: [a, b], points: [[0, 0, 0], [0, 0, 0]], vectors: [[1, 0, 0], [0, 1, 0]]}"
    assert isinstance(joint(tmp_path, "spatial", entry), spatial.Universal)
