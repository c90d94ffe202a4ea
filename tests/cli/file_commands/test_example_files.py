"""Examples are listed and copied, and nothing is replaced unasked."""

import json
import pathlib
import re

import pytest

EXAMPLES = pathlib.Path(__file__).parents[3] / "examples"


def test_all_are_listed(run):
    status, out, _ = run("example", "--json")
    names = {entry["name"] for entry in json.loads(out)["examples"]}
    assert status == 0
    assert {path.stem for path in EXAMPLES.glob("*.yaml")} | {"robots/panda.urdf", "own_joint/cam"} <= names
    assert not any(name.startswith("broken") for name in names)


@pytest.mark.parametrize("name", ["four_bar", "four-bar", "four_bar.yaml"])
def test_one_is_copied_and_nothing_is_replaced(run, tmp_path, name):
    target = tmp_path / "mine.yaml"
    assert run("example", name, target)[0] == 0
    assert target.read_bytes() == (EXAMPLES / "four_bar.yaml").read_bytes()
    target.write_text("mine")
    status, _, err = run("example", name, target)
    assert (status, target.read_text()) == (2, "mine")
    assert "--overwrite" in err
    assert run("example", name, target, "--overwrite")[0] == 0
    assert target.read_text() != "mine"


def test_robots_are_copied_with_their_ending_in_the_name(run, tmp_path):
    assert run("example", "robots/panda.urdf", tmp_path / "arm.urdf")[0] == 0
    assert (tmp_path / "arm.urdf").read_bytes() == (EXAMPLES / "robots" / "panda.urdf").read_bytes()


def test_only_models_are_to_be_inspected(run, tmp_path):
    assert "jounce inspect" in run("example", "four_bar", tmp_path / "four_bar.yaml")[1]
    status, out, _ = run("example", "limits/franka_panda", tmp_path / "limits.yaml")
    assert (status, out) == (0, f"Written to {tmp_path / 'limits.yaml'}\n")


def test_an_unknown_one_is_named_with_its_neighbor(run):
    status, _, err = run("example", "fourbar")
    assert status == 2
    assert "no example has this name, got 'fourbar'; did you mean 'four_bar'?" in err
    status, _, err = run("example", "nosuch")
    assert status == 2
    assert re.search(r"got 'nosuch'; there are \d+, such as andrews, barrel_cam, belt_drive$", err.strip())
