"""Every value of a file follows its parameters: each field of the schema, one after the other, as an expression."""

import copy
import json

import jax
import numpy as np
import pytest

import jounce as jn
from jounce.constraints import catalogue
from jounce.constraints.friction import GearFriction, friction_class
from jounce.integrate.mechanisms.batch_equations import ParametricMechanism
from jounce.io import json_schema
from jounce.io.mechanisms.overrides import override
from jounce.io.mechanisms.schema.keys import file_keys
from jounce.io.mechanisms.schema.output_types import output_holder, output_types
from jounce.io.mechanisms.values.inertia_forms import _solid_keys
from jounce.mechanism import build, time_grid
from jounce.mechanism.building.starting_guess import starting_guess
from jounce.mechanism.masses import body_mass
from jounce.mechanism.redundant_reactions import resolved_reactions
from jounce.mechanism.resolve import resolve, resolve_element
from jounce.rigid.solids import SOLIDS

pytestmark = pytest.mark.long

COMPONENTS = {"planar": 2, "spatial": 3}
VECTORS = {
    "axis": [0.1, 0.2, 1.0],
    "axes": [0.1, 0.2, 1.0],
    "normals": [1.0, 0.1, 0.2],
    "vector": [1.0, 0.3, 0.2],
    "vectors": [1.0, 0.3, 0.2],
}
CURVE, SURFACE = ["cos(s)", "sin(s)", "0.2*s"], ["0.4*u", "0.5*v", "0.2*u*v"]
GEARS = ("ratio", "points radii pressure_angle")  # of planar gears, either of both
WORDS = {"coordinate": "angle", "frame": "body", "roles": "ijim", "kinds": "turn-slide"}
FLAT = [("pseudo", 0, 1), ("pseudo", 1, 0), ("size", 2)]  # what does not bear on the moment of a plane body about z
ROLES = {"joints": "joint", "drivers": "driver", "forces": "force", "initial": "driver"}


def values_of(kind, size):
    """Return a value for each key of a class."""
    found = {}
    for key in file_keys(kind):
        if key.kind == "parts":
            found[key.key] = {name: [*VECTORS.get(name, [0.4, 0.5, 0.6])][:size] for name in key.names}
            continue
        vector = [*VECTORS.get(key.key, [0.4, 0.5, 0.6])][:size]
        one = {
            "scalar": 0.3,
            "vector": vector,
            "motion": 0.7,
            "law": 0.8,
            "laws": [0.1, 0.2, 0.3][:size],
            "wrenches": [[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]],
        }.get(key.kind)
        if key.kind == "points":
            one = [[0.4, 0.5, 0.6][:size], [0.3, 0.2, 0.1][:size]]
        if key.kind == "flag":
            one = True
        if key.kind == "text":
            one = WORDS.get(key.key)
        if key.kind == "curve":
            one = SURFACE if key.key == "surface" else {"expressions": CURVE[:size], "range": [-3.0, 3.0]}
        if key.key == "friction" and friction_class(kind) is GearFriction:
            thread = {"coefficient": 0.1, "lead_angle": 0.3, "pressure_angle": 0.4}
            one = ({"efficiency": 0.8, "backward": 0.6} if size == 2 else thread) | {"speed": 0.2}
        elif key.key == "friction":
            one = {"coefficient": 0.3, "speed": 0.2} | ({"radius": 0.1} if kind.has_friction_radius else {})
        found[key.key] = [copy.deepcopy(one) for _ in key.fields] if len(key.fields) > 1 else one
    return {key: value for key, value in found.items() if value is not None}


def bodies_of(kind):
    counts = getattr(kind, "body_counts", ()) or (kind.body_count,)
    if counts[0] == 1:
        return {"body": "a"}
    return {"bodies": ["a", "b", "c"][: counts[0]]}


def body_forms(space):
    """Return one body for each form of its values."""
    size = COMPONENTS[space]
    frame = {"position": [0.1, 0.2, 0.3][:size]}
    massed = {"mass": 2.0, "center_of_mass": [0.01, 0.02, 0.03][:size]}
    if space == "planar":
        forms = [{"angle": 0.4, **massed, "inertia": 0.5}]
        forms.append({"inertia": {"pseudo": [[0.5, 0.1, 0.2], [0.1, 0.6, 0.3], [0.2, 0.3, 2.0]]}})
    else:
        forms = [{"orientation": {"quaternion": [0.9, 0.1, 0.2, 0.3]}, **massed, "inertia": [0.3, 0.4, 0.5]}]
        forms.append({"orientation": {"axis": [0.1, 0.2, 1.0], "angle": 0.7}})
        forms += [{"orientation": {"euler": word, "angles": [0.1, 0.2, 0.3]}} for word in ("zxz", "XYZ")]
        rows = [[0.5, 0.01, 0.02, 0.1], [0.01, 0.6, 0.03, 0.2], [0.02, 0.03, 0.7, 0.3], [0.1, 0.2, 0.3, 2.0]]
        forms.append({"inertia": {"pseudo": rows}})
    sizes = {"size": [0.1, 0.2, 0.3], "radius": 0.05, "inner_radius": 0.02, "length": 0.4}
    for kind in SOLIDS:
        keys = _solid_keys(kind)
        words = {"solid": kind, "density": 7850.0, "axis": "x"}
        solid = {key: {**sizes, **words}[key] for key in keys}
        forms.append({"inertia": solid} | ({} if "density" in keys else {"mass": 2.0}))
        if "density" in keys:
            forms.append({"inertia": {k: v for k, v in solid.items() if k != "density"}, "mass": 2.0})
    return [{**frame, **form} for form in forms]


def sections(space):
    """Return a part of a file for each class that files may name, and for all else that holds values."""
    size = COMPONENTS[space]
    for section, role in ROLES.items():
        for name, kind in catalogue(space, role).items():
            if not kind.__module__.startswith("jounce."):
                continue
            entry = {"type": name, **bodies_of(kind), **values_of(kind, size)}
            if (space, name) != ("planar", "gear"):
                yield f"{section}.{name}", {section: {"one": entry}}
                continue
            for keys, left_out, bodies in zip(GEARS, GEARS[::-1], ("abc", "ab"), strict=True):
                form = {k: v for k, v in entry.items() if k not in left_out.split()} | {"bodies": [*bodies]}
                yield f"{section}.{name} of {keys}", {section: {"one": form}}
    for tag, (quantity, kind) in output_types(space).items():
        entry = values_of(kind, size) | ({} if quantity is None else {"quantity": quantity})
        if output_holder(kind) in ("body", "bodies"):
            entry |= bodies_of(kind)
            yield f"outputs.{tag}", {"outputs": {"one": entry}}
    for number, form in enumerate(body_forms(space)):
        yield f"body {number}", {"bodies": {"a": form, "b": {}, "c": {}}}
    point = [0.4, 0.5, 0.6][:size]
    hinge = {"type": "revolute", "bodies": ["a", "b"], "points": [point, point]}
    hinge |= {} if space == "planar" else {"axes": [VECTORS["axis"]] * 2}
    reactions = {"one": {"force": 1e6, "torque": 1e4}}
    yield "redundant_reactions", {"joints": {"one": hinge}, "redundant_reactions": reactions}
    yield "gravity", {"gravity": [0.1, 0.2, 9.81][:size]}
    yield "time", {"time": {"start": 0.5, "stop": 2.0, "step": 0.25}}
    yield "count", {"time": {"start": 0.5, "stop": 2.0, "count": 4}}
    yield "parameters", {"parameters": {"q": 0.4}, "gravity": ["q", "q + 1", "2*q"][:size]}


def slots(node, path=()):
    """Return where the numbers of a part stand."""
    if isinstance(node, dict):
        return [slot for key, entry in node.items() for slot in slots(entry, (*path, key))]
    if isinstance(node, list):
        return [slot for key, entry in enumerate(node) for slot in slots(entry, (*path, key))]
    return [path] if isinstance(node, (int, float)) and not isinstance(node, bool) else []


def at(node, path):
    for step in path:
        node = node[step]
    return node


def written(folder, space, part, slot, value):
    """Write a file in which an expression of ``p`` stands in one place, and where symmetry asks for it in two."""
    part = copy.deepcopy(part)
    inside = at(part, slot[:-1])
    inside[slot[-1]] = "p + 0*p**2" if slot[-2:] != ("time", "count") else "p"
    if "pseudo" in slot:
        at(part, slot[:-2])[slot[-1]][slot[-2]] = inside[slot[-1]]
    whole = {"space": space, "bodies": {"a": {}, "b": {}, "c": {}}, **part}
    whole["parameters"] = {"p": value, **part.get("parameters", {})}
    path = folder / "part.json"
    path.write_text(json.dumps(whole))
    return path


def numbers(mechanism):
    """Return all numbers from which the model, the masses and the instants of a mechanism are made."""
    parameters, size = mechanism.parameter_values, COMPONENTS[mechanism.space]
    elements = [
        resolve_element(element, parameters, size, name)
        for group in mechanism.elements.values()
        for name, element in group.items()
    ]
    masses = [body_mass(name, body, parameters, size) for name, body in mechanism.bodies.items()]
    gravity = resolve(mechanism.gravity, parameters)
    time = [] if mechanism.time is None else time_grid(mechanism.time, parameters)
    reactions = resolved_reactions(mechanism.redundant_reactions, parameters)
    parts = [elements, masses, gravity, time, reactions, starting_guess(mechanism, parameters, size)]
    leaves = jax.tree.leaves(parts)
    return np.concatenate([np.ravel(leaf) for leaf in leaves if not isinstance(leaf, (str, type(None)))])


CASES = [
    pytest.param(space, part, id=f"{space}-{name}") for space in COMPONENTS for name, part in sections(space)
]  # fmt: skip


@pytest.mark.parametrize("space, part", CASES)
def test_every_value_follows_its_parameters(tmp_path, space, part):
    found = slots(part)
    assert found or "outputs" in part or space == "planar"
    for slot in found:
        before = at(part, slot)
        after = before + 2 if slot[-1] in ("count", "stop") else 1.0625 * before
        first = jn.load(written(tmp_path, space, part, slot, before))
        changed = first.with_parameters(p=after)
        overridden = override(first, [f"p={after!r}"])
        fresh = jn.load(written(tmp_path, space, part, slot, after))
        flat = any(slot[-len(end) :] == end for end in FLAT) and "density" not in at(part, slot[:3])
        bears = space == "spatial" or not flat
        assert np.array_equal(numbers(first), numbers(fresh)) != bears, slot
        np.testing.assert_array_equal(numbers(changed), numbers(fresh), err_msg=str(slot))
        np.testing.assert_array_equal(numbers(overridden), numbers(fresh), err_msg=str(slot))


def test_the_walk_meets_every_key_of_the_schema():
    """What a key of the schema is named is met above, or holds no number."""
    met, worded = set(), {"type", "space", "title", "body", "bodies", "joint", "driver", "force", "quantity", "frame"}
    for space in COMPONENTS:
        for _, part in sections(space):
            met |= {step for slot in slots(part) for step in slot if isinstance(step, str)}
    worded |= {
        "coordinate",
        "roles",
        "kinds",
        "solid",
        "euler",
        "sequence",
        "samples",
        "cam",
        "expression",
        "degree",
        "derivative",
        "mechanism",
        "order",
        "value",
        "beyond",
        "assembly",
        "of",
        "piecewise",
        "until",
        "units",
        "expressions",
        "closed",
        "crossed",
        "surface",
    }
    laws = {"profile", "duration", "to", "by", "begin", "end", "limits", "initial", "output"}  # in test_segment_laws.py
    named = set()

    def walk(node):
        if isinstance(node, dict):
            named.update(node.get("properties", {}))
            for entry in node.values():
                walk(entry)
        elif isinstance(node, list):
            for entry in node:
                walk(entry)

    walk(json_schema(own_types=False))
    assert named - met - worded - laws == set()


TOP = """
space: spatial
gravity: [0, 0, -9.81]
parameters: {tilt: 10 deg}
bodies:
  top:
    {orientation: {axis: [1, 0, 0], angle: tilt}, mass: 1, inertia: [0.2, 0.3, 0.4], center_of_mass: [0, 0, 0.3]}
joints:
  O: {type: spherical, bodies: [ground, top], points: [[0, 0, 0], [0, 0, 0]]}
outputs:
  tip: {body: top, point: [0, 0, 1]}
time: {start: 0, stop: 0.1, count: 2}
"""


@pytest.mark.slow
def test_a_top_starts_from_the_orientation_that_its_parameter_gives(tmp_path):
    path = tmp_path / "top.yaml"
    path.write_text(TOP)
    top = jn.load(path)
    tilts = np.radians([10.0, 80.0, 45.0])
    single = [jn.simulate(top.with_parameters(tilt=tilt), order=2).outputs["tip"] for tilt in tilts]
    for tilt, tip in zip(tilts, single, strict=True):
        np.testing.assert_allclose(tip[0, 0], [0, -np.sin(tilt), np.cos(tilt)], atol=1e-15)
        torque = 9.81 * 0.3 * np.sin(tilt)  # about x, through the point that is held
        np.testing.assert_allclose(
            tip[0, 2], torque / (0.2 + 0.3**2) * np.array([0, -np.cos(tilt), -np.sin(tilt)]), atol=1e-13
        )
    batch = jn.simulate_batch(top, {"tilt": tilts}, order=2)
    assert (batch.status == 0).all()
    np.testing.assert_allclose(batch.outputs["tip"], single, rtol=1e-11, atol=1e-11)


def test_orientations_in_python_have_the_forms_of_files(tmp_path):
    path = tmp_path / "top.yaml"
    path.write_text(TOP)
    top = jn.load(path)
    for form in ({"axis": [1, 0, 0], "angle": "tilt"}, {"euler": "XYZ", "angles": ["tilt", 0, 0]},
                 ["cos(tilt/2)", "sin(tilt/2)", 0, 0]):  # fmt: skip
        body = jn.Body([0, 0, 0], orientation=form)
        made = jn.Mechanism(space="spatial", bodies={"top": body}, joints={}, parameters={"tilt": 0.1})
        for tilt in (0.1, 1.3):
            guess = starting_guess(made.with_parameters(tilt=tilt), {"tilt": tilt}, 3)["quaternion"][:, 1, 0]
            np.testing.assert_allclose(guess, [np.cos(tilt / 2), np.sin(tilt / 2), 0, 0], atol=1e-15)
    target = tmp_path / "copy.toml"
    jn.write_mechanism(top, target)
    assert jn.load(target) == top


@pytest.mark.parametrize(
    "form, words",
    [
        ({"axis": [0, 0, 1], "angel": 1.0}, "unknown key 'angel'; did you mean 'angle'"),
        ({"axis": [0, 0, 1]}, "is missing"),
        ({"axis": [0, 0, "tilt - 0.1"], "angle": 1.0}, "zero length"),
        ({"euler": "xyy", "angles": [0, 0, 1]}, "neighbors"),
        ([1, 0, 0], "4 numbers"),
        ("1000", "4 numbers"),
    ],
)
def test_orientations_that_are_none_are_refused(form, words):
    body = jn.Body([0, 0, 0], orientation=form)
    made = jn.Mechanism(space="spatial", bodies={"top": body}, joints={}, parameters={"tilt": 0.1})
    with pytest.raises(jn.errors.MechanismError, match=words) as error:
        starting_guess(made, made.parameter_values, 3)
    assert error.value.name.startswith("bodies.top.orientation")


def test_offsets_that_follow_from_the_guess_follow_it_in_a_batch():
    joints = {"O": jn.planar.Revolute(("ground", "a"), [0, 0], [0, 0])}
    joints |= {"P": jn.planar.Revolute(("ground", "b"), [1, 0], [0, 0])}
    joints |= {"gear": jn.planar.Coordinate(("a", "b"), "angle", ratio=-2.0)}
    bodies = {"a": jn.Body([0, 0], angle="turn", mass=1, inertia=1), "b": jn.Body([1, 0], mass=1, inertia=1)}
    gears = jn.Mechanism(space="planar", bodies=bodies, joints=joints, parameters={"turn": 0.1, "other": 1.0})
    family = ParametricMechanism(gears, build(gears), ("turn",))
    rows = np.array([[0.1], [0.5], [-0.3]])
    equations, _ = family.of(rows).at(slice(None))
    offsets = [g.element.offset for g in equations.system.groups if hasattr(g.element, "offset")]
    np.testing.assert_allclose(np.ravel(offsets), 2.0 * rows[:, 0], atol=1e-15)
