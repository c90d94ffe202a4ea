"""Every reader under texts changed by chance, and under values that hypothesis makes up and shrinks."""

import copy
import json
import pathlib
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET

import pytest
from hypothesis import given, settings, strategies as st

from tests.fuzz.cases import ALLOWED, case, judged, shrunk
from tests.fuzz.readers import READERS, ROOT

CASES = 30  # of each reader, in this process
FEWER = {"sweep": 6}
plain = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=20)
    | st.sampled_from(["t", "ground", "3 m", "2 deg", "a*t", "1/0", "sin(t)", "lift.csv", "spherical", "x"]),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)
thorough = settings(max_examples=25)


def check(reader, content):
    """Fail, with all that was found, where a case does not end as it may."""
    with tempfile.TemporaryDirectory() as folder:
        found = judged(reader, content, pathlib.Path(folder))
    assert found.kind in ALLOWED, f"{found.kind}\n{found.words}\n-- the text:\n{content.decode(errors='replace')}"


@pytest.mark.parametrize("reader", READERS)
def test_texts_changed_by_chance(reader, tmp_path):
    for index in range(FEWER.get(reader, CASES)):
        content = case(reader, 0, index)
        found = judged(reader, content, tmp_path)
        if found.kind not in ALLOWED:
            text = shrunk(reader, content, tmp_path).decode(errors="backslashreplace")
            pytest.fail(f"case {index}: {found.kind}\n{found.words}\n-- the text, shrunk:\n{text}")


def places(node, at=()):
    """Give every place in plain data."""
    yield at
    for key, entry in node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ():
        yield from places(entry, (*at, key))


def changed(data, at, value):
    if not at:
        return value
    data = copy.deepcopy(data)
    holder = data
    for step in at[:-1]:
        holder = holder[step]
    holder[at[-1]] = value
    return data


@pytest.mark.parametrize("reader", ["json", "limits", "trajectory"])
@thorough
@given(data=st.data())
def test_any_value_in_any_place(reader, data):
    from jounce.io.files.parsers import read_json, read_yaml

    text = data.draw(st.sampled_from(READERS[reader].texts))
    good = (read_json if reader == "json" else read_yaml)("seed", text).data
    at = data.draw(st.sampled_from(list(places(good))))
    check(reader, json.dumps(changed(good, at, data.draw(plain)), ensure_ascii=False).encode("utf-8", "replace"))


@pytest.mark.parametrize("reader", ["urdf", "mjcf", "sdf"])
@thorough
@given(data=st.data())
def test_any_text_in_any_attribute(reader, data):
    root = ET.fromstring(data.draw(st.sampled_from(READERS[reader].texts)))
    elements = [element for element in root.iter() if element.attrib]
    element = data.draw(st.sampled_from(elements))
    key = data.draw(st.sampled_from(sorted(element.attrib)))
    numbers = st.lists(st.floats(), max_size=6).map(lambda row: " ".join(map(repr, row)))
    xml = st.characters(min_codepoint=32, exclude_categories=["Cs", "Cc"], exclude_characters="\ufffe\uffff")
    element.set(key, data.draw(numbers | st.text(xml, max_size=20)))
    check(reader, ET.tostring(root))


entries = st.floats().map(repr) | st.integers().map(str) | st.sampled_from(["time", "", "a", "a_d1", '"', "1 2", "nan"])


@pytest.mark.parametrize("reader", ["samples", "table"])
@thorough
@given(rows=st.lists(st.lists(entries, min_size=1, max_size=4), max_size=12), header=st.booleans())
def test_any_table(reader, rows, header):
    rows = [["time", "value"], *rows] if header else rows
    check(reader, "\n".join(map(",".join, rows)).encode())


@pytest.mark.parametrize("reader", ["samples", "table"])
@thorough
@given(table=st.lists(st.tuples(st.floats(), st.floats()), min_size=4, max_size=12, unique_by=lambda row: row[0]))
def test_any_numbers_at_increasing_times(reader, table):
    rows = [f"{t!r},{x!r}" for t, x in sorted(table)]
    check(reader, "\n".join(["time,value", *rows]).encode())


signs = st.sampled_from(["+", "-", "*", "/", "**", "(", ")", ",", " "])
words = st.sampled_from(
    ["t", "a", "pi", "deg", "sin", "exp", "log", "sqrt", "atan2", "tanh", "m", "rad/s", "AB", "tau="]
)
pieces = st.lists(signs | words | st.floats().map(repr) | st.integers().map(str), max_size=14).map("".join)


@pytest.mark.parametrize("reader", ["expression", "set", "payload", "drive"])
@settings(max_examples=100)
@given(text=pieces | st.text(max_size=30), name=st.booleans())
def test_any_words(reader, text, name):
    names = {"set": "BC=", "payload": READERS["payload"].texts[0].partition("=")[0] + "=", "drive": "elbow="}
    check(reader, ((names.get(reader, "") if name else "") + text).encode("utf-8", "replace"))


@pytest.mark.slow
def test_a_few_thousand_cases_in_processes_of_bounded_memory():
    command = [sys.executable, "-m", "tests.fuzz", "--cases", "3000", "--seed", "1"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stdout[-5000:] + done.stderr[-2000:]
    assert "dies" not in done.stdout
