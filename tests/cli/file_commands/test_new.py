"""``jounce new``: the starter files, each of which runs; and what is refused."""

import functools
import json
import pathlib
import shlex

import numpy as np
import pytest

import jounce as jn
from jounce.io.mechanisms.starters import STARTERS


@pytest.fixture(autouse=True)
def _here(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)


def test_without_a_name_the_starters_are_listed(run):
    status, out, err = run("new")
    assert (status, err) == (0, "")
    names = {line.split()[0] for line in out.splitlines()[: len(STARTERS)]}
    assert names == STARTERS.keys()
    assert {"four-bar", "slider-crank", "cam", "spatial-linkage", "gear-train", "robot-arm", "free-pendulum"} <= names


def test_the_files_are_those_of_the_package():
    folder = pathlib.Path(jn.__file__).parent / "templates"
    assert {path.stem for path in folder.iterdir()} == STARTERS.keys()


def test_a_starter_is_written_with_its_comments_and_what_to_try_next(run):
    status, out, err = run("new", "four-bar")
    assert (status, err) == (0, "")
    text = pathlib.Path("four-bar.yaml").read_text()
    assert text == STARTERS["four-bar"].text
    assert text.count("#") > 10
    tried = [line.strip() for line in out.splitlines() if line.startswith("  jounce ")]
    assert tried == ["jounce run four-bar.yaml", "jounce plot four-bar.yaml --out four-bar.png"]


@pytest.mark.slow
def test_what_is_suggested_works(run):
    _, out, _ = run("new", "gear-train", "my gears.yaml")
    for line in out.splitlines():
        if line.startswith("  jounce "):
            assert run(*shlex.split(line)[1:])[0] == 0
    assert pathlib.Path("my gears.png").read_bytes().startswith(b"\x89PNG")


def test_a_file_that_is_there_is_kept_unless_forced(run):
    path = pathlib.Path("four-bar.yaml")
    path.write_text("mine")
    status, out, err = run("new", "four-bar")
    assert (status, out) == (2, "")
    assert "--overwrite" in err
    assert path.read_text() == "mine"
    assert run("new", "four-bar", "--overwrite")[0] == 0
    assert run("new", "four-bar", "--force")[0] == 0  # as it was called first
    assert path.read_text() == STARTERS["four-bar"].text


@pytest.mark.parametrize(
    "arguments, part",
    [
        (("fourbar",), "did you mean 'four-bar'?"),
        (("press",), "no starter has this name, got 'press'; `jounce new --from press` copies the example"),
        (("cam", "cam.txt"), "valid: .yaml, .yml, .toml, .json"),
        (("cam", "no/where/cam.yaml"), "does not exist"),
        (("cam", "--forse"), "--force"),
    ],
)
def test_bad_calls_write_nothing(run, tmp_path, arguments, part):
    status, out, err = run("new", *arguments)
    assert (status, out) == (2, "")
    assert part in err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", STARTERS)
def test_every_format_holds_the_same_mechanism(run, name):
    made = []
    for suffix in ("yaml", "toml", "json"):
        assert run("new", name, f"{name}.{suffix}")[0] == 0
        made.append(jn.load(f"{name}.{suffix}"))
    assert made[0] == made[1] == made[2]


def test_the_list_as_json(run):
    found = json.loads(run("new", "--json")[1])
    assert [starter["name"] for starter in found["starters"]] == list(STARTERS)
    found = json.loads(run("new", "cam", "--json")[1])
    assert found["written"] == "cam.yaml"
    assert found["next"][0] == "jounce run cam.yaml"


@functools.cache
def solved(name):
    path = pathlib.Path(jn.__file__).parent / "templates" / f"{name}.yaml"
    mechanism = jn.load(path)
    if STARTERS[name].command == "simulate":
        return jn.simulate(mechanism, order=2, method=jn.Taylor(8))  # compiles sooner than the order of the tolerance
    return jn.solve(mechanism, order=2)


@pytest.mark.slow
def test_gears_turn_by_the_formula_of_willis():
    """A ring that is held, and gears whose ring is the ground: the bodies of one kind of joint are of mixed places."""
    motion = solved("gear-train")
    sun, carrier = motion.outputs["sun_angle"], motion.outputs["carrier_angle"]
    np.testing.assert_allclose(carrier, sun * 24 / (24 + 60), rtol=0, atol=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("name", STARTERS)
def test_every_starter_moves(name):
    motion = solved(name)
    assert (motion.status == jn.Status.OK).all()
    assert all(np.isfinite(values).all() for values in motion.outputs.values())
    moving = [values for values in motion.outputs.values() if np.ptp(values[:, 0], axis=0).max() > 1e-3]
    assert len(moving) >= 2


@pytest.mark.slow
def test_facts_of_the_starters():
    cam = solved("cam").outputs
    assert np.ptp(cam["lift"][:, 0, 1]) == pytest.approx(0.016, rel=1e-6)  # twice the eccentricity
    assert cam["contact"][:, 0, 1].min() > 10
    block = solved("spring-mass").outputs["block"][:, 0, 0]
    assert block[0] == pytest.approx(0.2)
    arm = solved("robot-arm")
    reach = np.linalg.norm(arm.outputs["tip"][:, 0] - np.array([0, 0, 0.35]), axis=1)
    angles = -80 + 50 * (arm.time / 2 - np.sin(np.pi * arm.time) / (2 * np.pi))
    np.testing.assert_allclose(reach, np.sqrt(0.4**2 + 0.35**2 + 0.28 * np.cos(np.radians(angles))), atol=1e-12)


def test_an_example_may_be_what_a_file_starts_from(run):
    status, out, err = run("new", "--from", "press", "mine.yaml")
    assert (status, err) == (0, "")
    example = pathlib.Path(__file__).resolve().parents[3] / "examples" / "press.yaml"
    assert pathlib.Path("mine.yaml").read_text() == example.read_text()
    assert "jounce inspect mine.yaml" in out
    assert run("new", "--from", "press")[0] == 0
    assert pathlib.Path("press.yaml").read_text() == example.read_text()
    assert run("new", "--from", "four-bar", "linkage.yaml")[0] == 0
    assert pathlib.Path("linkage.yaml").read_text() == STARTERS["four-bar"].text


def test_from_takes_one_file_and_a_name_that_is_known(run):
    status, _, err = run("new", "--from", "press", "one.yaml", "two.yaml")
    assert status == 2
    assert "writes one file: jounce new --from NAME [FILE]" in err
    status, _, err = run("new", "--from", "pres")
    assert status == 2
    assert "did you mean 'press'" in err.lower()
    assert not list(pathlib.Path().iterdir())
