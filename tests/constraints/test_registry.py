"""A type of joints, drivers or forces names one class: no class replaces another without a word."""

import dataclasses

import numpy as np
import pytest

import jounce as jn
from jounce.constraints import catalogue
from jounce.constraints.base import field_kind, value_fields
from jounce.io.mechanisms.user_classes import import_file


def own(kind="mine", name="Own", body=None, **keywords):
    """Define a class as if in a module, with additional lines in its body."""
    body = {"residual": lambda self, *_: None, "__qualname__": name, "__module__": "notebook"} | (body or {})
    return jn.joints.AbstractConstraint.__class__(name, (jn.joints.AbstractConstraint,), body, type=kind, **keywords)


@pytest.mark.parametrize(
    "kind, space, role",
    [
        ("rope", "planar", "joint"),
        ("revolute", "spatial", "joint"),
        ("spherical", "", "joint"),
        ("slide", "", "driver"),
    ],
)
def test_types_of_the_library_may_be_taken_with_a_warning(kind, space, role):
    before = {each: catalogue(each, role) for each in ("planar", "spatial")}
    with pytest.warns(jn.errors.ReplacedTypeWarning, match=rf"'{kind}' names Own in files now.*jounce\.constraints\."):
        mine = own(kind, space=space, role=role)
    for each in ("planar", "spatial"):
        expected = before[each] | ({kind: mine} if space in ("", each) else {})
        assert catalogue(each, role) == expected


def test_a_file_with_a_type_that_the_library_took_later_means_the_class_of_the_user(tmp_path):
    own_joint = tmp_path / "ropes.py"
    own_joint.write_text(
        "import jounce as jn\nfrom jounce import jet\n"
        'class Rope(jn.joints.AbstractConstraint, type="rope", space="planar"):\n'
        "    point_i: jn.joints.Vector\n    point_j: jn.joints.Vector\n    span: jn.joints.Scalar\n"
        "    def residual(self, body_i, body_j, time):\n"
        "        d = body_j.point(self.point_j) - body_i.point(self.point_i)\n"
        "        return jet.sqrt(d.dot(d)) - self.span\n"
    )
    path = tmp_path / "bead.yaml"
    path.write_text(
        "space: planar\nbodies: {bead: {position: [3, 4]}}\n"
        "joints:\n  r: {type: rope, bodies: [ground, bead], points: [[0, 0], [0, 0]], span: 5}\n"
        "  flat: {type: parallel1, bodies: [ground, bead], vectors: [[1, 0], [1, 0]]}\n"
        "drivers: {x: {type: coordinate, bodies: [ground, bead], coordinate: x, motion: 3 + t}}\n"
        "outputs: {p: {body: bead, point: [0, 0]}}\ntime: {start: 0, stop: 1, count: 2}\n"
    )
    with pytest.warns(jn.errors.ReplacedTypeWarning, match="'rope'"):
        import_file(own_joint)
    mechanism = jn.load(path)
    np.testing.assert_allclose(jn.solve(mechanism, [1.0], order=0).outputs["p"][0, 0], [4.0, 3.0], atol=1e-12)
    jn.write_mechanism(mechanism, tmp_path / "again.yaml")
    assert type(jn.load(tmp_path / "again.yaml").joints["r"]) is type(mechanism.joints["r"])
    rope = jn.joints.Rope(("ground", "bead"), points=[[0, 0], [0, 0]], length=5.0)
    other = dataclasses.replace(mechanism, joints={**mechanism.joints, "r": rope})
    with pytest.raises(jn.errors.MechanismError, match="type 'rope' names another class, Rope of jounce_own"):
        jn.write_mechanism(other, tmp_path / "other.yaml")


def test_types_of_forces_too():
    with pytest.warns(jn.errors.ReplacedTypeWarning, match=r"'spring'.*jounce\.forces\."):

        class Spring(jn.forces.AbstractForce, type="spring", space="planar"):
            pass

    assert catalogue("planar", "force")["spring"] is Spring


def test_a_class_defined_again_takes_its_own_place():
    first, second = own(space="planar"), own(space="planar")
    assert first is not second
    assert catalogue("planar", "joint")["mine"] is second
    with pytest.raises(jn.errors.MechanismError, match=r"notebook\.Own"):
        own(space="planar", name="Other")
    assert own(space="spatial", name="Other") is catalogue("spatial", "joint")["mine"]
    assert own(space="planar", name="Other", role="driver") is catalogue("planar", "driver")["mine"]


def test_a_space_or_role_that_does_not_exist_is_reported():
    with pytest.raises(jn.errors.MechanismError, match="did you mean 'planar'"):
        own(space="plannar")
    with pytest.raises(jn.errors.MechanismError, match="did you mean 'driver'"):
        own(role="drivers")


def test_files_of_one_name_are_two_files(tmp_path):
    head = 'import jounce as jn\nclass Own(jn.joints.AbstractConstraint, type="mine", space="planar"):\n'
    text = f"{head}    size: jn.joints.Scalar\n"
    paths = [tmp_path / folder / "own.py" for folder in ("a", "b")]
    for path in paths:
        path.parent.mkdir()
        path.write_text(text)
    import_file(paths[0])
    import_file(paths[0])
    with pytest.raises(jn.errors.MechanismError, match="got 'mine'") as caught:
        import_file(paths[1])
    assert (caught.value.path, caught.value.line) == (str(paths[1]), 2)


def test_annotations_may_be_strings(tmp_path):
    path = tmp_path / "postponed.py"
    path.write_text(
        "from __future__ import annotations\n"
        "import jounce as jn\nfrom jounce.joints import Vector\n"
        'class Postponed(jn.joints.AbstractConstraint, type="postponed", space="planar"):\n'
        "    point_i: Vector\n    length: jn.joints.Scalar\n    word: str = 'x'\n"
    )
    import_file(str(path))
    fields = value_fields(catalogue("planar", "joint")["postponed"])
    assert {name: field_kind(field) for name, field in fields.items()} == {
        "point_i": "vector",
        "length": "scalar",
        "word": "text",
    }


def test_a_class_whose_definition_fails_is_not_in_the_catalogue():
    before = catalogue("planar", "joint")
    with pytest.raises(TypeError, match="default"):

        class Torn(jn.joints.AbstractConstraint, type="torn", space="planar"):
            size: jn.joints.Scalar = 1.0
            length: jn.joints.Scalar

    assert catalogue("planar", "joint") == before
    assert own("torn", space="planar") is catalogue("planar", "joint")["torn"]


def test_a_definition_that_fails_leaves_the_class_before_it():
    first = own(space="planar")
    torn = {"__annotations__": {"size": jn.joints.Scalar, "length": jn.joints.Scalar}, "size": 1.0}
    with pytest.raises(TypeError, match="default"):
        own(space="planar", body=torn)
    assert catalogue("planar", "joint")["mine"] is first
    second = own(space="planar")
    assert catalogue("planar", "joint")["mine"] is second


def test_no_class_passes_itself_off_as_one_of_the_library():
    body = {"__module__": jn.planar.Revolute.__module__}
    with pytest.raises(jn.errors.MechanismError, match=r"Revolute.*got 'revolute'"):
        own("revolute", "Revolute", body=body, space="planar")
    assert catalogue("planar", "joint")["revolute"] is jn.planar.Revolute


@pytest.mark.parametrize("field", ["type", "bodies"])
def test_a_field_that_would_break_all_files_is_refused(field):
    before = catalogue("planar", "joint")
    body = {"__annotations__": {field: jn.joints.Scalar}, "residual": lambda self, *_: None}
    with pytest.raises(jn.errors.MechanismError, match=f"got '{field}'"):
        jn.joints.AbstractConstraint.__class__("Odd", (jn.joints.AbstractConstraint,), body, type="odd", space="planar")
    assert catalogue("planar", "joint") == before


def test_a_joint_is_no_force():
    with pytest.raises(jn.errors.MechanismError, match="role"):
        own(role="force")
