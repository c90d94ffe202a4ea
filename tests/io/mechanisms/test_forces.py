"""Forces, initial conditions and inertia in mechanism files: every key of every type, units, and all three formats."""

import json
import pathlib

import numpy as np
import pytest

import jounce as jn
from jounce.forces import force_catalogue
from jounce.io import load
from jounce.io.files.source import read_source
from jounce.io.mechanisms.schema.keys import file_keys
from jounce.mechanism import build
from jounce.mechanism.masses import body_mass

ROOT = pathlib.Path(__file__).parents[3]

KEYS = {  # the table of the documentation
    ("planar", "spring"): "points stiffness length damping?",
    ("planar", "slide_spring"): "points vector stiffness length? damping?",
    ("planar", "torsional_spring"): "stiffness angle? damping?",
    ("planar", "distance_force"): "points law",
    ("planar", "slide_force"): "points vector law",
    ("planar", "torque"): "law",
    ("planar", "point_force"): "point law frame?",
    ("planar", "moment"): "law",
    ("spatial", "spring"): "points stiffness length damping?",
    ("spatial", "slide_spring"): "points vector stiffness length? damping?",
    ("spatial", "torsional_spring"): "axis vectors? stiffness angle? damping?",
    ("spatial", "distance_force"): "points law",
    ("spatial", "slide_force"): "points vector law",
    ("spatial", "torque"): "axis vectors? law",
    ("spatial", "point_force"): "point law frame?",
    ("spatial", "moment"): "law frame?",
}
ONE_BODY = ("point_force", "moment")
VALUES = {"length": "5 cm", "angle": "30 deg", "frame": "body"}
PLANE = VALUES | {"points": "[[1 cm, 0], [L, 0]]", "point": "[L, 0]", "vector": "[1, 0]"}
SPACE = VALUES | {"points": "[[1 cm, 0, 0], [L, 0, 0]]", "point": "[L, 0, 0]", "vector": "[1, 0, 1]"}
SPACE |= {"axis": "[0, 0, 1]", "vectors": "[[1, 0, 0], [0, 1, 0]]"}


def value_of(space, name, key):
    turning = name in ("torsional_spring", "torque", "moment")
    if key == "law":
        if name == "point_force" or (name == "moment" and space == "spatial"):
            names = ["x*vx", "-c*vy", "t"] if name == "point_force" else ["wx", "-c*wy", "t"]
            return f"[{', '.join(names[: 2 if space == 'planar' else 3])}]"
        return "-c*v + x*t"
    if key == "stiffness":
        return "3 N*m/rad" if turning else "500 N/m"
    if key == "damping":
        return "0.2 N*m*s/rad" if turning else "2 N*s/m"
    return (PLANE if space == "planar" else SPACE)[key]


def written(tmp_path, space, entry, name="file.yaml", bodies="{a: {}, b: {}}", section="forces"):
    path = tmp_path / name
    path.write_text(
        f"space: {space}\nparameters: {{L: 10 cm, c: 0.5, m: 2 kg}}\nbodies: {bodies}\n{section}: {entry}\n"
    )
    return load(path)


def test_the_table_of_keys_is_complete():
    found = {(space, name) for space in ("planar", "spatial") for name in force_catalogue(space)}
    assert found == KEYS.keys()


@pytest.mark.parametrize("space, name", KEYS)
def test_every_type_takes_the_keys_of_the_table(tmp_path, space, name):
    kind = force_catalogue(space)[name]
    assert {key.key + "?" * (not key.required) for key in file_keys(kind)} == set(KEYS[space, name].split())
    given = {key.rstrip("?"): value_of(space, name, key.rstrip("?")) for key in KEYS[space, name].split()}
    bodies = "body: b" if name in ONE_BODY else "bodies: [a, b]"
    entry = ", ".join([f"{{F: {{type: {name}", bodies, *(f"{k}: {v}" for k, v in given.items())]) + "}}"
    mechanism = written(tmp_path, space, entry)
    made = mechanism.forces["F"]
    assert type(made) is kind
    assert made.bodies == (("b",) if name in ONE_BODY else ("a", "b"))
    if "stiffness" in given:
        assert (made.stiffness, made.damping) in ((500.0, 2.0), (3.0, 0.2))
    assert build(mechanism).forces == (("F",),)


def test_values_are_in_si_units_and_laws_may_be_numbers_with_units(tmp_path):
    entry = "{T: {type: torque, bodies: [ground, a], law: 250 N*cm}, F: {type: point_force, body: a, point: [1 mm, 0],"
    forces = written(tmp_path, "planar", entry + " law: [2 kN, {expression: 3*t}]}}").forces
    assert forces["T"].law == 2.5
    assert forces["F"].point == (0.001, 0.0)
    assert forces["F"].law == (2000.0, jn.laws.Expression("3*t"))


def test_law_of_time_through_samples(tmp_path):
    times = np.linspace(0, 1, 11)
    table = "\n".join(f"{t},{t**2}" for t in times)
    (tmp_path / "pull.csv").write_text(f"time,force\n{table}\n")
    entry = "{F: {type: slide_force, bodies: [ground, a], points: [[0, 0], [0, 0]], vector: [1, 0],"
    force = written(tmp_path, "planar", entry + " law: {samples: pull.csv, degree: 3}}}").forces["F"]
    assert isinstance(force.law, jn.laws.SplineMotion)
    entry = "{F: {type: point_force, body: a, point: [0, 0], law: [{samples: pull.csv}, 0]}}"
    first, second = written(tmp_path, "planar", entry).forces["F"].law
    assert isinstance(first, jn.laws.SplineMotion)
    assert second == 0.0
    with pytest.raises(jn.errors.MechanismFileError, match=r"line 4, forces\.F\.law\[0\].*none\.csv"):
        written(tmp_path, "planar", entry.replace("pull", "none"))


@pytest.mark.parametrize(
    "law, expected",
    [
        ("{piecewise: [{until: 0.5 s, expression: 2*t}, {expression: 3*t**2}]}", [1.47, 4.2, 6.0]),
        ("{piecewise: [{until: 0.6 s, expression: 8 N}], beyond: hold}", [8.0, 0.0, 0.0]),
        ("{expression: 6*t, of: turn}", [12.6, 18.0, 0.0]),
        ("{piecewise: [{until: 2 rad, expression: 1}, {expression: t**2}], of: turn}", [4.41, 12.6, 18.0]),
        ("{expression: 4 N/s, derivative: 1, initial: [5 N]}", [7.8, 4.0, 0.0]),
        ("{samples: rate.csv, value: F, derivative: 1, initial: [5 N]}", [1405.0, 2000.0, 0.0]),
    ],
)
def test_laws_of_time_alone_have_every_form_and_may_follow_a_driver(tmp_path, law, expected):
    """At 0.7 s, with the first two derivatives; the driver turns by 3 t."""
    (tmp_path / "rate.csv").write_text("time,F [kN/s],x [mm]\n" + "\n".join(f"{t},2,1" for t in range(7)))
    entry = f"{{F: {{type: slide_force, bodies: [ground, a], points: [[0, 0], [0, 0]], vector: [1, 0], law: {law}}}}}"
    turn = "{turn: {type: coordinate, bodies: [ground, a], coordinate: angle, motion: 3*t}}"
    mechanism = written(tmp_path, "planar", f"{entry}\ndrivers: {turn}")
    found = jn.forces.TimeLaw(mechanism.forces["F"].law)
    instants = jn.Jet.variable(0.7, order=2)
    np.testing.assert_allclose(found(instants, instants, instants).derivatives(), expected, rtol=1e-12, atol=1e-12)
    jn.write_mechanism(mechanism, tmp_path / "again.yaml")
    again = jn.forces.TimeLaw(jn.load(tmp_path / "again.yaml").forces["F"].law)
    np.testing.assert_allclose(again(instants, instants, instants).derivatives(), expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    "law, words",
    [
        (
            "{piecewise: [{until: 1, expression: t}, {expression: -2*v}]}",
            r"law\.piecewise\[1\].*depends on v, got '-2\*v'",
        ),
        ("{expression: 2*x*t, derivative: 1}", r"law\.expression: depends on x"),
        ("{expression: 4 N, derivative: 1}", "must be force per s, got '4 N'"),
        ("{samples: rate.csv, value: x}", "line 1, x: the unit measures a length, not a force, got 'mm'"),
        ("{samples: rate.csv, value: F}", "line 1, F: .*not a force, got 'kN/s'"),
    ],
)
def test_laws_of_time_alone_that_are_none_are_refused(tmp_path, law, words):
    (tmp_path / "rate.csv").write_text("time,F [kN/s],x [mm]\n" + "\n".join(f"{t},2,1" for t in range(7)))
    entry = f"{{F: {{type: slide_force, bodies: [ground, a], points: [[0, 0], [0, 0]], vector: [1, 0], law: {law}}}}}"
    with pytest.raises(jn.errors.MechanismFileError, match=words):
        written(tmp_path, "planar", entry)


def test_initial_conditions_are_drivers(tmp_path):
    entry = "{start: {type: coordinate, bodies: [ground, a], coordinate: angle, motion: 30*deg + 2*t}}"
    mechanism = written(tmp_path, "planar", entry, section="initial")
    assert type(mechanism.initial["start"]) is jn.drivers.CoordinateDriver
    assert not mechanism.drivers
    assert build(mechanism).rows == ()  # they hold at the start only


TEXT = """\
space: spatial
gravity: [0, 0, -9.81]
parameters: {k: 3 N*m/rad, r: 2 cm}
bodies:
  a: {position: [0, 0, 0], inertia: {solid: cylinder, radius: r, length: 30 cm, density: 7850 kg/m^3, axis: x}}
forces:
  twist: {type: torsional_spring, bodies: [ground, a], axis: [0, 0, 1], stiffness: k, damping: 0.1}
  push: {type: point_force, body: a, point: [0, 0, 1 cm], law: ["-2*vx", 3 N, "sin(t)"], frame: body}
initial:
  start: {type: rotation, bodies: [ground, a], axis: [0, 0, 1], motion: 0.1 + t}
"""


def test_toml_and_json_say_the_same(tmp_path):
    path = tmp_path / "file.yaml"
    path.write_text(TEXT)
    data = read_source(path).data

    def toml(value):
        if isinstance(value, dict):
            return "{" + ", ".join(f"{key} = {toml(item)}" for key, item in value.items()) + "}"
        return json.dumps(value) if not isinstance(value, list) else "[" + ", ".join(map(toml, value)) + "]"

    (tmp_path / "file.json").write_text(json.dumps(data))
    (tmp_path / "file.toml").write_text("".join(f"{key} = {toml(item)}\n" for key, item in data.items()))
    found = [load(tmp_path / f"file.{ending}") for ending in ("yaml", "json", "toml")]
    assert repr(found[0]) == repr(found[1]) == repr(found[2])
    assert list(found[0].forces) == ["twist", "push"]


SOLIDS = [
    ("spatial", "{solid: box, size: [L, 2 cm, 3 cm]}", ("box", {"size": [0.1, 0.02, 0.03]})),
    ("spatial", "{solid: tube, radius: L, inner_radius: L/2, length: 1}", ("tube", {"axis": "z"})),
    ("spatial", "{solid: sphere, radius: L}", ("sphere", {"radius": 0.1})),
    (
        "spatial",
        "{solid: capsule, radius: L, length: 50 cm, axis: y}",
        ("capsule", {"radius": 0.1, "length": 0.5, "axis": "y"}),
    ),
    ("spatial", "{solid: ellipsoid, size: [L, 2 cm, 3 cm]}", ("ellipsoid", {"size": [0.1, 0.02, 0.03]})),
    ("planar", "{solid: cone, radius: L, length: 5}", ("cone", {"radius": 0.1, "length": 5.0})),
    ("planar", "{solid: cylinder, radius: L, length: 5}", ("cylinder", {"radius": 0.1, "length": 5.0})),
]
THIN = [
    ("spatial", "{solid: rod, length: L, axis: y}", ("rod", {"length": 0.1, "axis": "y"})),
    ("planar", "{solid: disc, radius: L}", ("disc", {"radius": 0.1})),
    ("planar", "{solid: rod, length: 20 cm}", ("rod", {"length": 0.2})),
]


@pytest.mark.parametrize(
    "space, form, solid, density", [(*s, d) for d in (False, True) for s in SOLIDS + THIN * (not d)]
)
def test_solids_have_the_moments_of_the_same_in_python(tmp_path, space, form, solid, density):
    kind, sizes = solid
    if kind == "tube":
        sizes = {"radius": 0.1, "inner_radius": 0.05, "length": 1.0}
    text = f"inertia: {form[:-1]}, density: 7 g/cm^3}}" if density else f"mass: m, inertia: {form}"
    mechanism = written(tmp_path, space, "{}", bodies=f"{{a: {{{text}}}}}")
    expected = jn.Inertia.solid(kind, **sizes, **({"density": 7000.0} if density else {"mass": 2.0}))
    components = 2 if space == "planar" else 3
    mass, center, inertia = body_mass("a", mechanism.bodies["a"], mechanism.parameter_values, components)
    assert mass == pytest.approx(expected.mass, rel=1e-15)
    assert not center.any()
    tensor = expected.tensor[2, 2] if space == "planar" else expected.tensor
    np.testing.assert_allclose(inertia, tensor, rtol=1e-15)


@pytest.mark.parametrize("form", ["solid: disc, radius: L", "solid: rod, length: 20 cm"])
def test_solids_without_a_volume_have_no_density(tmp_path, form):
    with pytest.raises(jn.errors.MechanismFileError, match=r"bodies\.a\.inertia\.density: unknown key"):
        written(tmp_path, "planar", "{}", bodies=f"{{a: {{inertia: {{{form}, density: 7 g/cm^3}}}}}}")


def test_solids_follow_the_parameters(tmp_path):
    bodies = "{a: {inertia: {solid: sphere, radius: L, density: 1000}}}"
    mechanism = written(tmp_path, "planar", "{}", bodies=bodies)
    found = [
        body_mass("a", m.bodies["a"], m.parameter_values, 2) for m in (mechanism, mechanism.with_parameters(L=0.2))
    ]
    np.testing.assert_allclose([found[1][0] / found[0][0], found[1][2] / found[0][2]], [8.0, 32.0], rtol=1e-14)


def test_pseudo_inertia_in_space_and_in_the_plane(tmp_path):
    expected = jn.Inertia(2.0, [0.1, -0.2, 0.3], [[0.5, 0.02, 0.01], [0.02, 0.6, -0.03], [0.01, -0.03, 0.7]])
    rows = expected.pseudo_inertia.tolist()
    rows[3][3] = "m"
    mechanism = written(tmp_path, "spatial", "{}", bodies=f"{{a: {{inertia: {{pseudo: {rows}}}}}}}".replace("'", ""))
    mass, center, inertia = body_mass("a", mechanism.bodies["a"], mechanism.parameter_values, 3)
    assert mass == 2.0
    np.testing.assert_allclose(center, expected.center_of_mass, rtol=1e-15)
    np.testing.assert_allclose(inertia, expected.tensor, rtol=1e-13)
    rows = [[row[i] for i in (0, 1, 3)] for row in (rows[0], rows[1], rows[3])]
    mechanism = written(tmp_path, "planar", "{}", bodies=f"{{a: {{inertia: {{pseudo: {rows}}}}}}}".replace("'", ""))
    mass, center, inertia = body_mass("a", mechanism.bodies["a"], mechanism.parameter_values, 2)
    np.testing.assert_allclose(center, expected.center_of_mass[:2], rtol=1e-15)
    assert inertia == pytest.approx(expected.tensor[2, 2], rel=1e-13)


def test_a_whole_matrix_of_inertia_may_have_negative_products(tmp_path):
    form = "mass: 1, inertia: [[2, -0.5, 0], [-0.5, 2, 0.1 kg*m^2], [0, 0.1, 3]]"
    mechanism = written(tmp_path, "spatial", "{}", bodies=f"{{a: {{{form}}}}}")
    _, _, inertia = body_mass("a", mechanism.bodies["a"], {}, 3)
    np.testing.assert_array_equal(inertia, [[2, -0.5, 0], [-0.5, 2, 0.1], [0, 0.1, 3]])


def test_a_force_of_ones_own_in_a_file(tmp_path):
    class Wind(jn.forces.AbstractForce, type="wind", space="planar"):
        """Push on the origin of a body."""

        strength: jn.joints.Scalar
        law: jn.forces.Law

        body_count = 1
        dimensions = {"strength": "force"}

        def displacement(self, body, time):
            return body.position[0]

        def force(self, displacement, velocity, time):
            return self.strength * self.law(displacement, velocity, time)

    force = written(tmp_path, "planar", "{F: {type: wind, body: a, strength: 3 N, law: 1 - v**2}}").forces["F"]
    assert isinstance(force, Wind)
    with pytest.raises(jn.errors.MechanismFileError, match=r"line 4, forces\.F\.strength: .*such as 10 N"):
        written(tmp_path, "planar", "{F: {type: wind, body: a, strength: 3 m, law: 1 - v**2}}")


WHOLE = {
    "planar": """\
space: planar
parameters: {k: 3 N/m}
bodies:
  a: {}
  b: {mass: 1, inertia: {solid: tube, radius: 1, inner_radius: 0.5, length: 2, axis: x}}
  c: {inertia: {pseudo: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}}
forces:
  s: {type: spring, bodies: [a, b], points: [[0, 0], [0, 0]], stiffness: 1, length: 1, damping: 1}
  p: {type: point_force, body: a, point: [0, 0], law: [x, 1], frame: body}
  t: {type: torque, bodies: [a, b], law: x}
initial:
  i: {type: coordinate, bodies: [ground, a], coordinate: angle, motion: t}
""",
    "spatial": """\
space: spatial
bodies:
  a: {}
  b: {mass: 1, inertia: {solid: box, size: [1, 1, 1]}}
forces:
  s: {type: slide_spring, bodies: [a, b], points: [[0, 0, 0], [0, 0, 0]], vector: [1, 0, 0], stiffness: 1}
  m: {type: moment, body: a, law: [wx, 1, 0], frame: global}
  t: {type: torque, bodies: [a, b], axis: [0, 0, 1], vectors: [[1, 0, 0], [1, 0, 0]], law: x}
""",
}
ODD = [None, True, [], {}, "", "nan", 1e308, -1, 0, "a b", "x/0", [[]], [None], {"x": 1}, {"samples": "no.csv"}]
ODD += [{"expression": 3}, ["x"], "k", "1 furlong", "'", "__import__('os')", [1, 2, 3, 4], "sqrt(-1)"]


def places(data, at=()):
    """Return the paths of all entries below a mapping or list."""
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    return [path for key, value in items for path in ((*at, key), *places(value, (*at, key)))]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::jounce.errors.UnitWarning")  # odd numbers are hinted at, which is not asked here
@pytest.mark.parametrize("space", WHOLE)
def test_any_value_anywhere_loads_or_ends_in_one_message_with_its_line(tmp_path, space):
    path = tmp_path / "file.yaml"
    path.write_text(WHOLE[space])
    original, refused = json.dumps(read_source(path).data), []
    path = tmp_path / "file.json"
    for at in places(json.loads(original)):
        for value in ODD if at[0] in ("bodies", "forces", "initial") else ():
            entry = data = json.loads(original)
            for key in at[:-1]:
                entry = entry[key]
            entry[at[-1]] = value
            path.write_text(json.dumps(data))
            try:
                assert load(path).bodies
            except jn.errors.MechanismFileError as error:
                refused.append(error)
    assert len(refused) > 500
    assert all(error.line is not None and str(error).isprintable() for error in refused)
