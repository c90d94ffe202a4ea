"""Plain data and line numbers from YAML, JSON and TOML."""

import json
import tomllib

import hypothesis
import hypothesis.strategies as st
import pytest

from jounce.errors import MechanismFileError
from jounce.io.files import located_data, parsers
from jounce.io.files.dumping import dumped
from jounce.io.files.located_data import MAX_DEPTH, dotted
from jounce.io.files.reading import MAX_BYTES
from jounce.io.files.source import read_source

YAML = """\
title: Four-bar   # a comment
parameters: {AB: 4 cm,
  BC: 1e-3}
bodies:
  crank:
    position: [0, AB]
    angle: 30 deg
"""
JSON = """\
{"title": "Four-bar",
 "parameters": {"AB": "4 cm",
  "BC": 1e-3},
 "bodies": {
  "crank": {
    "position": [0, "AB"],
    "angle": "30 deg"}}}
"""
TOML = """\
title = "Four-bar" # a comment
[parameters]
AB = "4 cm"
BC = 1e-3
[bodies.crank]
position = [0, "AB"]
angle = "30 deg"
"""
DATA = {
    "title": "Four-bar",
    "parameters": {"AB": "4 cm", "BC": 1e-3},
    "bodies": {"crank": {"position": [0, "AB"], "angle": "30 deg"}},
}


def read(folder, text, suffix=".yaml"):
    path = folder / f"file{suffix}"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_source(path)


def refusal(folder, text, suffix=".yaml"):
    with pytest.raises(MechanismFileError) as caught:
        read(folder, text, suffix)
    return caught.value


@pytest.mark.parametrize(
    "text, suffix, lines",
    [
        (YAML, ".yaml", (2, 2, 3, 6, 6, 7)),
        (YAML, ".YML", (2, 2, 3, 6, 6, 7)),
        (YAML.replace("\n", "\r\n"), ".yml", (2, 2, 3, 6, 6, 7)),
        ("\ufeff" + YAML, ".yaml", (2, 2, 3, 6, 6, 7)),
        (JSON, ".json", (2, 2, 3, 6, 6, 7)),
        (TOML, ".toml", (2, 3, 4, 6, 6, 7)),
    ],
)
def test_three_languages_give_the_same_data_and_their_lines(tmp_path, text, suffix, lines):
    found = read(tmp_path, text, suffix)
    assert found.data == DATA
    crank = ("bodies", "crank")
    parameters = [("parameters",), ("parameters", "AB"), ("parameters", "BC")]
    pose = [(*crank, "position"), (*crank, "position", 1), (*crank, "angle")]
    assert tuple(found.line(place) for place in parameters + pose) == lines
    assert found.line((*crank, "mass")) == found.line(crank)


plain = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**60), 2**60) | st.floats(allow_nan=False) | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
    max_leaves=15,
)


@hypothesis.given(plain, st.sampled_from([None, 1, "\t"]))
@hypothesis.settings(suppress_health_check=[hypothesis.HealthCheck.function_scoped_fixture])
def test_json_is_read_as_the_standard_library_reads_it(tmp_path, data, indent):
    text = json.dumps(data, indent=indent)
    assert read(tmp_path, text, ".json").data == json.loads(text)


@pytest.mark.parametrize(
    "text, value",
    [
        ("1e-3", 1e-3),
        ("1.", 1.0),
        (".5", 0.5),
        ("+12", 12),
        ("0o17", 15),
        ("0x1F", 31),
        ("012", 12),
        ("-.inf", float("-inf")),
        ("yes", "yes"),
        ("on", "on"),
        ("y", "y"),
        ("12:30", "12:30"),
        ("1_000", "1_000"),
        ("'1'", "1"),
        ("true", True),
        ("~", None),
        ("", None),
        ("30*deg", "30*deg"),
    ],
)
def test_scalars_follow_yaml_1_2(tmp_path, text, value):
    found = read(tmp_path, f"a: {text}").data["a"]
    assert (type(found), found) == (type(value), value)


def test_toml_lines_of_inline_tables_and_long_lists(tmp_path):
    text = 'space = "planar"\n[joints]\nA = {type = "revolute", points = [\n [0, 1],\n [2, 3]\n]}\n"B" = {type = "x"}\n'
    found = read(tmp_path, text, ".toml")
    assert found.data == tomllib.loads(text)
    assert [found.line(("joints", n)) for n in "AB"] == [3, 7]
    assert found.line(("joints", "A", "points", 1, 0)) == 5
    assert found.line(("joints", "B", "type")) == 7


def test_locations_are_worded_with_dots_and_brackets():
    assert dotted(("joints", "BC", "points", 1, 0)) == "joints.BC.points[1][0]"
    assert dotted(("a\x1b", "\u03c8")) == "a\\x1b.\\u03c8"


@pytest.mark.parametrize(
    "text, suffix, line, words",
    [
        ("", ".yaml", None, "the file is empty"),
        (" \n\n", ".json", None, "the file is empty"),
        ("a: 1\na: 2", ".yaml", 2, "a: duplicate name, already given in line 1"),
        ("b: {a: 1,\n a: 2}", ".yaml", 2, "b.a: duplicate name, already given in line 1"),
        ('{"b": {"a": 1,\n"a": 2}}', ".json", 2, "b.a: duplicate name, already given in line 1"),
        ("a = 1\na = 2", ".toml", 2, "duplicate name"),
        ("[a]\nb = 1\n[a]\n", ".toml", 3, "duplicate name"),
        ("a: 1\n\tb: 2", ".yaml", 2, "a tab is where YAML requires spaces"),
        ("a: b: 1", ".yaml", 1, "a second ':' in one line"),
        ("a: [1, 2\nb: 3", ".yaml", 2, "started in line 1"),
        ("a: 'b", ".yaml", 1, "the YAML cannot be read"),
        ("a: &x 1\nb: *x", ".yaml", 2, "b: the YAML alias *x is not allowed"),
        ("a: !!python/name:os.system 1", ".yaml", 1, "the YAML tag"),
        ("!t {a: 1}", ".yaml", 1, "the YAML tag"),
        ("a: 1\n---\nb: 1", ".yaml", 2, "a second YAML document starts"),
        ("1: 2", ".yaml", 1, "a key must be a name, got 1"),
        ("? [a]\n: 1", ".yaml", 1, "a key must be a name, not a mapping or a list"),
        ('{"a": 1,}', ".json", 1, "the JSON cannot be read at column"),
        ('{"a": ' + "9" * 5000 + "}", ".json", None, "a number has too many digits"),
        ('{"a": "\\ud800"}', ".json", 1, "a: is not text in UTF-8"),
        ('{"\\ud800": 1}', ".json", 1, "is not text in UTF-8"),
        ('a: "\\ud800"', ".yaml", 1, "is not text in UTF-8"),
        ("a = ", ".toml", 1, "the TOML cannot be read: Invalid value"),
        ("a = {", ".toml", 1, "the TOML cannot be read"),
        (b"a: \xff", ".yaml", 1, "is not text in UTF-8"),
        (b"a: 1\nb: \x00", ".yaml", 2, "holds a control character"),
        ("a: 1\nb: 2".encode("utf-16"), ".yaml", 1, "is not text in UTF-8"),
        (bytes(range(256)) * 9, ".yaml", 2, "is not text in UTF-8"),
    ],
)
def test_what_cannot_be_read_is_refused_with_its_line(tmp_path, text, suffix, line, words):
    error = refusal(tmp_path, text, suffix)
    assert error.line == line
    assert words in str(error)
    assert str(error).startswith(str(tmp_path / f"file{suffix}"))


@pytest.mark.parametrize(
    "text, suffix",
    [
        ("a: " + "[" * 90_000, ".yaml"),
        ("a: " + "{b: " * 20_000, ".yaml"),
        ("- " * 40_000, ".yaml"),
        ("".join(" " * depth + "a:\n" for depth in range(300)), ".yaml"),
        ("[" * 90_000, ".json"),
        ('{"a":' * 15_000, ".json"),
        ("a = " + "[" * 90_000, ".toml"),
        ("a = " + "{b = " * 15_000, ".toml"),
        (".".join("a" * 10_000) + " = 1", ".toml"),
        ("[" + ".".join("a" * 10_000) + "]", ".toml"),
        ("[" + ".".join("a" * 30) + "]\n" + ".".join("a" * 30) + " = 1", ".toml"),
    ],
)
def test_deep_nesting_is_refused_at_once(tmp_path, text, suffix):
    error = refusal(tmp_path, text, suffix)
    assert f"nested more than {MAX_DEPTH} deep" in str(error)


def test_fifty_megabytes_are_refused_by_size(tmp_path):
    path = tmp_path / "large.yaml"
    path.write_bytes(b"- [[[[1]]]]\n" * 4_200_000)
    with pytest.raises(MechanismFileError, match=r"the file has 50.4 MB, at most 10 MB are read"):
        read_source(path)
    assert MAX_BYTES == 10_000_000


@pytest.mark.parametrize(
    "text, words",
    [
        ("a: " + "x" * 100_001, "a line has more than 100000 characters"),
        ("\n" * 1_000_001 + "a", "has 1000002 lines, at most 1000000 are read"),
    ],
)
def test_monstrous_lines_are_refused(tmp_path, text, words):
    assert words in str(refusal(tmp_path, text))


@pytest.mark.parametrize("suffix", [".json", ".yaml", ".toml"])
def test_too_many_names_in_a_mapping_are_refused(tmp_path, monkeypatch, suffix):
    text = dumped({"parameters": {f"p{k}": 1 for k in range(101)}}, suffix)
    for module in (located_data, parsers):
        monkeypatch.setattr(module, "MAX_KEYS", 100)
    assert "more than 100 names in one mapping" in str(refusal(tmp_path, text, suffix))


def test_too_many_values_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(located_data, "MAX_VALUES", 1000)
    for suffix in (".json", ".yaml"):
        error = refusal(tmp_path, '{"a": [\n' + "1, 1,\n" * 600 + "1]}", suffix)
        assert "more than 1000 entries" in str(error)
        assert error.line == 501


def test_paths_that_are_no_files(tmp_path):
    (tmp_path / "four_bar.yaml").write_text("a: 1")
    (tmp_path / "folder.yaml").mkdir()
    for path, words in [
        (tmp_path / "fourbar.yaml", "file not found; did you mean 'four_bar.yaml'?"),
        (tmp_path / "other.yaml", "file not found"),
        (tmp_path / "folder.yaml", "is a directory, a file is needed"),
        (tmp_path, "is a directory, a file is needed"),
        (tmp_path / "four_bar.txt", "valid: .yaml, .yml, .toml, .json"),
        (tmp_path / "four_bar.yaml" / "a.yaml", "cannot be read: Not a directory"),
        (f"{tmp_path}/a\0.yaml", "embedded null"),
        ("", "the name of a file is needed"),
    ]:
        with pytest.raises(MechanismFileError) as caught:
            read_source(path)
        assert words in str(caught.value)


def test_devices_are_not_read(tmp_path):
    (tmp_path / "zero.yaml").symlink_to("/dev/zero")
    with pytest.raises(MechanismFileError, match="is not a regular file"):
        read_source(tmp_path / "zero.yaml")


def test_a_file_without_the_right_to_read_it(tmp_path, monkeypatch):
    (tmp_path / "a.yaml").write_text("a: 1")

    def refuse(*_args, **_keywords):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("os.open", refuse)
    with pytest.raises(MechanismFileError, match="cannot be read: Permission denied"):
        read_source(tmp_path / "a.yaml")
