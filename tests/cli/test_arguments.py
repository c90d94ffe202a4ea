"""What the command line takes as a value, and what it says of a file that belongs to another command."""

import pathlib

import pytest

from jounce.cli.file_kinds import kind_of

ROOT = pathlib.Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
FOUR_BAR = str(EXAMPLES / "four_bar.yaml")
PANDA, FIVE_BAR = (str(EXAMPLES / "robots" / name) for name in ("panda.urdf", "five_bar.xml"))
WAVE, GOOD = (str(EXAMPLES / "trajectories" / name) for name in ("panda_wave.yaml", "panda_good.csv"))
LIMITS = str(EXAMPLES / "limits" / "franka_panda.yaml")
KINDS = {
    FOUR_BAR: "mechanism",
    PANDA: "robot",
    FIVE_BAR: "robot",
    WAVE: "trajectory",
    GOOD: "trajectory",
    LIMITS: "limits",
}
TAKEN = {
    "run": ["mechanism"],
    "simulate": ["mechanism", "robot"],
    "plot": ["mechanism"],
    "report": ["mechanism"],
    "inspect": ["mechanism", "robot"],
    "view": ["mechanism", "robot"],
    "convert": ["mechanism", "robot"],
    "check": ["robot"],
}
WORDS = {
    "mechanism": "is a mechanism",
    "robot": "is a robot",
    "trajectory": "is a trajectory",
    "limits": "holds limits",
}


@pytest.mark.parametrize("command", TAKEN)
def test_a_file_for_another_command_is_refused_with_what_it_is(run, command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    more = {"convert": ["new.yaml"], "check": [GOOD]}.get(command, [])
    for file, kind in KINDS.items():
        if kind in TAKEN[command]:
            continue
        status, out, err = run(command, file, *more)
        assert (status, out) == (2, "")
        assert WORDS[kind] in err
        assert err.startswith(f"error: {file}: ")
        assert len(err.splitlines()) == 1
        taker = {"mechanism": "run", "robot": "check", "trajectory": "jounce check", "limits": "--limits"}[kind]
        assert taker in err
    assert list(tmp_path.iterdir()) == []


def test_the_second_file_too(run):
    assert "is a mechanism" in run("check", PANDA, FOUR_BAR)[2]
    assert "holds limits" in run("check", PANDA, LIMITS)[2]
    assert "is a trajectory" in run("check", PANDA, GOOD, "--limits", WAVE)[2]
    assert (
        f"{PANDA}: is a robot, whose own limits count without --limits"
        in run("check", PANDA, GOOD, "--limits", PANDA)[2]
    )


@pytest.mark.parametrize("given, kind", [(PANDA, "robot"), (FOUR_BAR, "mechanism")])
def test_a_file_in_the_place_of_a_trajectory_is_named(run, given, kind):
    status, _, message = run("torques", PANDA, given)
    assert status == 2
    assert f"{given}: is a {kind}; a trajectory is needed" in message
    assert "convert" not in message


def test_what_a_file_is_its_content_tells(run, tmp_path):
    robot = tmp_path / "arm.yaml"
    robot.write_text((EXAMPLES / "robots" / "scara.urdf").read_text())
    assert kind_of(robot) == "robot"
    assert "is a robot" in run("run", robot)[2]
    page = tmp_path / "page.xml"
    page.write_text("<html/>")
    assert kind_of(page) is None
    assert "valid: .yaml" in run("run", page)[2]
    assert kind_of(tmp_path) is None
    assert kind_of(tmp_path / "none.urdf") is None


def test_a_broken_mechanism_keeps_its_message(run, tmp_path):
    broken = tmp_path / "broken.yaml"
    broken.write_text("bodies: {a: {position: [0, 0]}}\n")
    assert "space: is missing" in run("run", broken)[2]


@pytest.mark.parametrize(
    "arguments, name, value",
    [
        (["run", FOUR_BAR, "--order", "2.5"], "--order", "'2.5'"),
        (["run", FOUR_BAR, "--order", "1_0"], "--order", "'1_0'"),
        (["run", FOUR_BAR, "--order", "0x4"], "--order", "'0x4'"),
        (["run", FOUR_BAR, "--order", "four"], "--order", "'four'"),
        (["run", FOUR_BAR, "--order", "9" * 5000], "--order", "999"),
        (["run", FOUR_BAR, "--tolerance", "nan"], "--tolerance", "'nan'"),
        (["simulate", FOUR_BAR, "--step", "inf"], "--step", "'inf'"),
        (["plot", FOUR_BAR, "--fps", "24.9"], "--fps", "'24.9'"),
        (["plot", FOUR_BAR, "--derivative", "1.5"], "--derivative", "'1.5'"),
        (["plot", FOUR_BAR, "--azimuth", "1_0"], "--azimuth", "'1_0'"),
        (["check", PANDA, GOOD, "--degree", "5.5"], "--degree", "'5.5'"),
        (["view", FOUR_BAR, "--port", "80.5"], "--port", "'80.5'"),
    ],
)
def test_numbers_are_taken_as_they_are_or_not(run, arguments, name, value):
    status, out, err = run(*arguments)
    assert (status, out) == (2, "")
    assert err.startswith(f"error: {name}: ")
    assert value in err
    assert len(err) < 300


def test_a_whole_number_may_have_a_point(run):
    assert run("run", FOUR_BAR, "--order", "0.0")[1] == run("run", FOUR_BAR, "--order", "0")[1]


@pytest.mark.parametrize(
    "arguments, name, values",
    [
        (["run", FOUR_BAR, "--set", "BC=15 cm", "--set", " BC = 16 cm"], "--set BC", ("15 cm", "16 cm")),
        (["inspect", FOUR_BAR, "--set", "BC=15 cm", "--set", "tau=1", "--set", "BC=15 cm"], "--set BC", ("15 cm",)),
        (["convert", PANDA, "p.yaml", "--drive", "panda_joint1=t", "--drive", "panda_joint1=2*t"], "--drive", ("2*t",)),
        (["convert", PANDA, "p.yaml", "--start", "panda_joint1=1", "--start", "panda_joint1=2"], "--start", ("1", "2")),
    ],
)
def test_a_name_is_given_one_value(run, arguments, name, values, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    status, out, err = run(*arguments)
    assert (status, out) == (2, "")
    assert err.startswith(f"error: {name}")
    assert all(value in err for value in values)


def test_warnings_are_one_line_each_without_a_path(run, monkeypatch):
    import warnings

    import jounce.kinematics

    solve = jounce.kinematics.solve

    def warned(*arguments, **options):
        with warnings.catch_warnings():
            warnings.simplefilter("always")
            warnings.warn("the samples\nare noisy", UserWarning, stacklevel=2)
        return solve(*arguments, **options)

    monkeypatch.setattr("jounce.kinematics.solve", warned)
    status, _, err = run("run", FOUR_BAR, "--order", "0")
    assert (status, err) == (0, "warning: the samples are noisy\n")
