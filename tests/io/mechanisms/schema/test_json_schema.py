"""The published JSON Schema: up to date, and in agreement with what is read."""

import json
import pathlib

import jsonschema
import pytest
from ruamel.yaml import YAML

from jounce.constraints import catalogue
from jounce.io import json_schema
from jounce.io.mechanisms.schema.json_schema import write_json_schema

ROOT = pathlib.Path(__file__).parents[4]
PUBLISHED = ROOT / "docs" / "schema" / "mechanism.schema.json"


def plain(path):
    return YAML(typ="safe").load(path)


@pytest.fixture(scope="module")
def validator():
    schema = json.loads(PUBLISHED.read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def test_published_schema_is_up_to_date(tmp_path):
    """Write it anew with ``jounce.io.mechanisms.schema.json_schema.write_json_schema(PATH)``."""
    write_json_schema(tmp_path / "schema.json")
    assert json.loads(PUBLISHED.read_text()) == json.loads((tmp_path / "schema.json").read_text())


@pytest.mark.parametrize("path", sorted((ROOT / "examples").glob("*.yaml")), ids=lambda path: path.stem)
def test_examples_fit_the_schema(validator, path):
    validator.validate(plain(path))


@pytest.mark.parametrize("name", ["unknown_key", "unknown_type", "vector_length"])
def test_mistakes_of_form_do_not_fit_the_schema(validator, name):
    assert not validator.is_valid(plain(ROOT / "examples" / "broken" / f"{name}.yaml"))


@pytest.mark.parametrize(
    "orientation, fits",
    [
        ({"quaternion": [1, 0, 0, 0]}, True),
        ({"euler": "ZXZ", "angles": ["30 deg", 0, "a"]}, True),
        ({"axis": [0, 0, 1], "angle": 1}, True),
        ({"axis": [0, 0, 1]}, False),
        ({"euler": "zXz", "angles": [0, 0, 0]}, False),
        ({"quaternion": [1, 0, 0]}, False),
    ],
)
def test_orientations(validator, orientation, fits):
    assert validator.is_valid({"space": "spatial", "bodies": {"a": {"orientation": orientation}}}) is fits


@pytest.mark.parametrize(
    "motion, fits",
    [
        (1.5, True),
        ("2*t", True),
        ({"expression": "2*t"}, True),
        ({"samples": "a.csv", "degree": 7, "value": "b"}, True),
        ({"samples": "a.csv", "degree": 12}, False),
        ({"samples": "a.csv", "expression": "t"}, False),
        ([1], False),
    ],
)
def test_motions(validator, motion, fits):
    driver = {"type": "coordinate", "bodies": ["ground", "a"], "coordinate": "angle", "motion": motion}
    assert validator.is_valid({"space": "planar", "bodies": {"a": {}}, "drivers": {"d": driver}}) is fits


def test_every_type_is_in_the_schema():
    text = json.dumps(json_schema())
    for space in ("planar", "spatial"):
        for role in ("joint", "driver"):
            for name in catalogue(space, role):
                assert f'"#/$defs/{space}_{name}_{role}"' in text
