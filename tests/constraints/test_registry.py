"""A type of joints, drivers or forces is one class: no class replaces another silently."""

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
        ("revolute", "planar", "joint"),
        ("revolute", "spatial", "joint"),
        ("spherical", "", "joint"),
        ("slide", "", "driver"),
    ],
)
def test_types_of_the_library_are_taken(kind, space, role):
    before = {each: catalogue(each, role) for each in ("planar", "spatial")}
    with pytest.raises(jn.errors.MechanismError, match=rf"jounce\.constraints\..*got '{kind}'"):
        own(kind, space=space, role=role)
    assert {each: catalogue(each, role) for each in ("planar", "spatial")} == before


def test_forces_too():
    with pytest.raises(jn.errors.MechanismError, match=r"jounce\.forces\..*got 'spring'"):

        class Spring(jn.forces.AbstractForce, type="spring", space="planar"):
            pass

    assert catalogue("planar", "force")["spring"] is jn.forces.Spring


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
