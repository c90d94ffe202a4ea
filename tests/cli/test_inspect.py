"""``jounce inspect`` and results as JSON: facts that are known otherwise, and the schema that they keep."""

import json
import pathlib
import re

import numpy as np
import pytest

import jounce as jn
from jounce.papers.sommer_2024 import VALIDATION_CASES
from jounce.reporting.json.result_schema import result_schema

ROOT = pathlib.Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
FOUR_BAR = EXAMPLES / "four_bar.yaml"


@pytest.fixture(scope="module")
def validator():
    from jsonschema import Draft202012Validator

    Draft202012Validator.check_schema(result_schema())
    return Draft202012Validator(result_schema())


@pytest.fixture
def facts(run, validator):
    def found(*arguments):
        status, out, err = run(*arguments, "--json")
        data = json.loads(out, parse_constant=lambda token: pytest.fail(f"{token} is no JSON"))
        validator.validate(data)
        return status, data, err

    return found


FREEDOM = [  # file, coordinates, equations of joints, of drivers, degrees of freedom of the joints alone
    ("four_bar", 6, 5, 1, 1),
    ("six_bar_watt", None, None, 1, 1),
    ("epicyclic", 12, 10, 2, 2),
    ("rsur", None, None, 1, 1),
    ("stewart_platform", None, None, 6, 6),
    ("double_pendulum", 6, 4, 0, 2),
    ("simple_pendulum", 3, 2, 0, 1),
]


@pytest.mark.parametrize("name, coordinates, joints, drivers, freedom", FREEDOM, ids=[row[0] for row in FREEDOM])
def test_degrees_of_freedom(facts, name, coordinates, joints, drivers, freedom):
    status, data, err = facts("inspect", EXAMPLES / f"{name}.yaml")
    assert (status, err) == (0, "")
    found = data["freedom"]
    assert found["of_joints"] == freedom
    assert found["of_drivers"] == drivers
    assert found["left"] == freedom - drivers
    assert found["redundant"] == 0
    if coordinates is not None:
        assert (found["coordinates"], found["equations"]) == (coordinates, joints + drivers)
    assert sum(joint["rows"] for joint in data["joints"]) == found["equations"] - drivers


def test_the_start_is_that_of_the_motion(facts):
    _, data, _ = facts("inspect", FOUR_BAR)
    mechanism = jn.load(FOUR_BAR)
    motion = jn.solve(mechanism, [0.0], order=0)
    poses = {body["name"]: body["pose"]["angle"] for body in data["bodies"]}
    assert poses["rocker"] == pytest.approx(float(motion.outputs["psi"][0, 0]), abs=1e-12)
    moved = {body["name"]: body["moved"]["angle"] for body in data["bodies"]}
    assert moved["rocker"] == pytest.approx(abs(poses["rocker"] - np.radians(100)), abs=1e-12)
    assert data["parameters"][2] == {"name": "BC", "value": 0.1423, "unit": "m", "written": "14.23 cm"}
    assert data["time"] == {"start": 0.0, "stop": 2.0, "count": 201}


def test_parameters_take_other_values(facts):
    _, data, _ = facts("inspect", FOUR_BAR, "--set", "BC=15 cm")
    assert data["parameters"][2]["value"] == 0.15


def test_words_for_a_person(run):
    status, out, err = run("inspect", FOUR_BAR)
    assert (status, err) == (0, "")
    assert out.splitlines()[:2] == ["Planar four-bar", "planar mechanism: 1 degree of freedom, driven by theta"]
    assert re.search(r"BC +double_revolute +crank, rocker +1", out)
    assert re.search(r"rocker +- +0.1321, 0 +2.\d+ +0 m, ", out)
    assert "all motion is prescribed: jounce run solves it" in out
    assert "\x1b" not in out


def test_what_cannot_be_put_together_is_reported_with_all_the_rest(run, facts):
    status, data, _ = facts("inspect", FOUR_BAR, "--set", "BC=60 cm")
    assert status == 1
    assert not data["ok"]
    assert data["assembly"]["status"] == "open"
    assert "joints.BC" in data["assembly"]["message"]
    assert data["assembly"]["open"] > 0.1
    assert [body["pose"] for body in data["bodies"]] == [None, None]
    assert len(data["joints"]) == 3
    status, out, _ = run("inspect", FOUR_BAR, "--set", "BC=60 cm")
    assert status == 1
    assert "cannot be assembled at t = 0 s" in out
    assert "Bodies, as guessed" in out


REDUNDANT = """\
space: planar
bodies: {bar: {position: [0, 1]}, other: {position: [5, 0]}}
joints:
  one: {type: prismatic, bodies: [ground, bar], points: [[0, 0], [0, 0]], vectors: [[0, 1], [0, 1]]}
  two: {type: parallel2, bodies: [ground, bar], points: [[0, 0], [0, 1]], vector: [0, 1]}
"""


def test_redundant_equations_are_named(facts, run, tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text(REDUNDANT)
    status, data, _ = facts("inspect", path)
    assert status == 1
    freedom = data["freedom"]
    assert (freedom["coordinates"], freedom["equations"], freedom["independent"]) == (6, 3, 2)
    assert (freedom["redundant"], freedom["left"]) == (1, 4)
    assert set(freedom["redundant_among"]) == {"joints.one", "joints.two"}
    assert set(freedom["moving"]) == {"bar", "other"}
    assert data["assembly"]["status"] == "assembled"
    assert freedom["repeated"] == [{"kind": "joint", "name": "two", "equations": 1, "of": ["one"]}]
    assert "joint two repeats 1 equation of one" in run("inspect", path)[1]


def test_a_body_without_joints(facts, tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text("space: spatial\nbodies: {stone: {mass: 1 kg, inertia: [1, 1, 1]}}\n")
    status, data, _ = facts("inspect", path)
    assert status == 0
    assert (data["freedom"]["coordinates"], data["freedom"]["left"], data["freedom"]["moving"]) == (6, 6, ["stone"])


def test_initial_conditions_place_the_bodies(facts):
    _, data, _ = facts("inspect", EXAMPLES / "simple_pendulum.yaml")
    mechanism = jn.load(EXAMPLES / "simple_pendulum.yaml")
    law = next(iter(mechanism.initial.values())).motion
    expected = jn.laws.Expression(getattr(law, "text", str(law))).evaluate(mechanism.parameter_values | {"t": 0.0})
    assert data["bodies"][0]["pose"]["angle"] == pytest.approx(float(expected), abs=1e-12)


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.yaml")), ids=lambda p: p.stem)
@pytest.mark.slow
def test_every_example_can_start(facts, path):
    status, data, err = facts("inspect", path)
    assert (status, err) == (0, "")
    assert data["ok"]


RUN_ELSEWHERE = {  # over the whole grid of their files
    "tests/papers/test_sommer_2024.py": "four_bar inverted_slider_crank_slide inverted_slider_crank_distance rsur rssr "
    "rspu_distance rspu_slide",
    "tests/examples/test_gallery.py": "peaucellier pantograph jansen_leg klann_leg six_bar_stephenson radial_engine "
    "wolfrom_train epicyclic excavator double_cardan delta_robot delta_pick",
    "tests/integrate/test_published.py": "andrews double_four_bar double_pendulum simple_pendulum flyball_governor "
    "spatial_slider_crank_free stewart_forces",
    "tests/io/mechanisms/writing/test_writer.py": "six_bar_watt press",
    "tests/cli/test_inspect.py": "four_bar_in_space",
    "docs/output_laws.md": "servo_press",
}
RUN_HERE = sorted({path.stem for path in EXAMPLES.glob("*.yaml")} - set(" ".join(RUN_ELSEWHERE.values()).split()))


@pytest.mark.parametrize("place, names", RUN_ELSEWHERE.items(), ids=RUN_ELSEWHERE)
def test_what_is_said_to_run_elsewhere_is_named_there(place, names):
    text = (ROOT / place).read_text()
    if "sommer" in place:
        text += " ".join(VALIDATION_CASES)  # all of which its reproduction simulates
    text = text.replace(f'"{place}": "{names}"', "")  # where it is said is no run of it
    assert names.split()
    assert [name for name in names.split() if name not in text or not (EXAMPLES / f"{name}.yaml").exists()] == []


@pytest.mark.slow
@pytest.mark.parametrize("name", RUN_HERE)
def test_examples_run_to_their_end(run, name, tmp_path):
    path = EXAMPLES / f"{name}.yaml"
    command = "simulate" if jn.load(path).initial else "run"  # degrees of freedom are left: forces move it
    status, out, err = run(command, path, "--order", 1, "--out", tmp_path / "motion.csv")
    assert (status, err) == (0, ""), out
    time = np.loadtxt(tmp_path / "motion.csv", delimiter=",", skiprows=1, usecols=0)
    assert len(time) > 1
    assert (np.diff(time) > 0).all()


def test_a_robot(facts, run):
    status, data, err = facts("inspect", EXAMPLES / "robots" / "panda.urdf")
    assert (status, err) == (0, "")
    robot = jn.load_robot(EXAMPLES / "robots" / "panda.urdf")
    assert data["mass"] == pytest.approx(robot.mass)
    assert data["freedom"]["left"] == 8
    joints = {joint["name"]: joint for joint in data["joints"]}
    assert joints["panda_joint1"]["limits"]["effort"] == 87
    assert joints["panda_finger_joint2"]["mimic"]["joint"] == "panda_finger_joint1"
    links = {link["name"]: link for link in data["links"]}
    assert links["panda_hand"]["moves_with"] == "panda_link7"
    status, out, _ = run("inspect", EXAMPLES / "robots" / "panda.urdf")
    assert status == 0
    assert "robot on panda_link0: 8 degrees of freedom, 17.4519 kg" in out


def test_a_robot_with_a_loop(facts):
    _, data, _ = facts("inspect", EXAMPLES / "robots" / "five_bar.xml")
    assert data["freedom"] == {"coordinates": 4, "equations": 2, "left": 2, "words": "2 degrees of freedom"}
    assert data["closures"][0]["redundant"] == 1


def test_bad_input(run):
    assert run("inspect", "none.yaml")[0] == 2
    assert run("inspect", "a.stl")[0] == 2
    assert "--set" in run("inspect", EXAMPLES / "robots" / "panda.urdf", "--set", "a=1")[2]


def test_run_as_json(facts, tmp_path):
    path = tmp_path / "motion.csv"
    status, data, err = facts("run", FOUR_BAR, "--order", 2, "--out", path)
    assert (status, err) == (0, "")
    assert data["written"] == str(path)
    assert path.exists()
    motion = jn.solve(jn.load(FOUR_BAR), order=2)
    peak = next(p for p in data["peaks"] if (p["output"], p["derivative"]) == ("psi", "acceleration"))
    grid = motion.outputs["psi"][:, 2].max()
    assert grid <= peak["maximum"] <= grid * 1.001  # between the instants it is a little more
    near = jn.solve(jn.load(FOUR_BAR), [0.0, peak["maximum_at"]], order=2)
    assert peak["maximum"] == pytest.approx(near.outputs["psi"][1, 2], rel=1e-12)
    assert data["time"] == {"start": 0.0, "stop": 2.0, "count": 201, "solved": 201}
    assert data["failures"] == []


@pytest.mark.slow
def test_a_solve_that_fails_on_the_way_as_json(facts):
    status, data, err = facts("run", FOUR_BAR, "--order", 2, "--set", "AB=8 cm")
    assert status == 1
    assert 100 < data["time"]["solved"] < 150
    assert data["failures"][0]["status"] != "OK"
    assert data["failures"][0]["fault"] == "body rocker"
    assert json.loads(err)["error"]["kind"] == "SolveError"


@pytest.mark.slow
def test_simulate_as_json(facts):
    status, data, _ = facts("simulate", EXAMPLES / "simple_pendulum.yaml", "--order", 1)
    assert status == 0
    assert data["steps"] > 1
    assert abs(data["energy"]["largest_change"]) < 1e-9
    assert data["drift"] < 1e-12


def test_check_as_json(facts):
    robot, trajectories = EXAMPLES / "robots" / "panda.urdf", EXAMPLES / "trajectories"
    status, data, _ = facts("check", robot, trajectories / "panda_too_fast.csv")
    assert status == 1
    assert not data["kept"]
    broken = [row for row in data["limits"] if row["broken"]]
    assert len(broken) == data["broken"] >= 1
    assert all(row["ratio"] > 1 for row in broken)


@pytest.mark.parametrize(
    "arguments, expected",
    [
        (
            ("run", EXAMPLES / "broken" / "negative_length.yaml"),
            {"kind": "MechanismFileError", "line": int, "name": str},
        ),
        (("run", "none.yaml"), {"kind": "MechanismFileError", "file": "none.yaml", "line": None}),
        (("run", FOUR_BAR, "--oder", "3"), {"kind": "JounceError"}),
        (("new", "cams"), {"kind": "JounceError", "value": "cams"}),
    ],
)
def test_errors_as_json(run, arguments, expected):
    from jsonschema import Draft202012Validator

    status, out, err = run(*arguments, "--json")
    assert (status, out) == (2, "")
    found = json.loads(err)
    Draft202012Validator(result_schema()["$defs"]["complaint"]).validate(found)
    for key, value in expected.items():
        actual = found["error"][key]
        assert isinstance(actual, value) if isinstance(value, type) else actual == value


def test_the_schema_is_printed(run):
    status, out, _ = run("schema", "results")
    assert status == 0
    assert json.loads(out) == result_schema()


@pytest.mark.parametrize(
    "shell, words", [("bash", "complete -F"), ("zsh", "#compdef jounce"), ("fish", "complete -c jounce")]
)
def test_completion_knows_commands_and_options(run, shell, words, tmp_path):
    status, out, err = run("completion", shell)
    assert (status, err) == (0, "")
    assert words in out
    for command in (
        "run",
        "simulate",
        "plot",
        "check",
        "new",
        "inspect",
        "convert",
        "reproduce",
        "schema",
        "completion",
    ):
        assert re.search(rf"\b{command}\b", out)
    for option in ("order", "tolerance", "payload"):
        assert option in out
    path = tmp_path / "script"
    assert run("completion", shell, "--out", path)[0] == 0
    assert path.read_text().strip() == out.strip()


def test_bash_reads_its_completion(run, tmp_path):
    import subprocess

    path = tmp_path / "script"
    run("completion", "bash", "--out", path)
    complete = (
        f"source {path}; COMP_WORDS=(jounce ins); COMP_CWORD=1; COMP_LINE='jounce ins'; COMP_POINT=10; "
        'eval "$(complete -p jounce | sed \'s/.*-F \\([^ ]*\\).*/\\1/\')"; echo "${COMPREPLY[@]}"'
    )
    done = subprocess.run(["bash", "-c", complete], capture_output=True, text=True, timeout=60, check=False)
    assert done.stdout.strip() == "inspect"


def test_completion_is_installed_in_the_home_of_the_user(run, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_DATA_HOME", raising=False)
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    status, out, _ = run("completion", "fish", "--install")
    assert status == 0
    path = pathlib.Path(re.search(r"Written to (.*)", out)[1])
    assert path.is_relative_to(tmp_path)
    assert "jounce" in path.read_text()


@pytest.mark.parametrize(
    "arguments, part", [(("insect",), "inspect"), (("completion", "tcsh"), "bash"), (("rn",), "run")]
)
def test_the_nearest_name_is_suggested(run, arguments, part):
    status, out, err = run(*arguments)
    assert (status, out) == (2, "")
    assert part in err


@pytest.mark.slow
def test_mobility_is_reported_in_words_and_as_data(facts, run):
    status, data, _ = facts("inspect", EXAMPLES / "sarrus.yaml")
    assert (status, data["ok"]) == (0, True)
    mobility = data["mobility"]
    assert [mobility[key] for key in ("count", "instantaneous", "finite", "order", "kind")] == [0, 1, 1, 10, "regular"]
    (branch,) = mobility["branches"]
    assert branch["tangents"]["platform"][0][2] > 0
    out = run("inspect", EXAMPLES / "sarrus.yaml")[1]
    assert "joint head_y repeats 1 equation of foot_x, knee_x, head_x, foot_y, knee_y" in out
    assert "1 degree of freedom, finite to order 10" in out


@pytest.mark.slow
def test_reactions_that_are_not_unique_are_nan_and_reported(run, tmp_path):
    path, out = EXAMPLES / "four_bar_in_space.yaml", tmp_path / "a.csv"
    for choice, open_ in (("unique", True), ("least_norm", False)):
        status, shown, _ = run("run", path, "--order", 2, "--redundant-reactions", choice, "--out", out, "--overwrite")
        assert status == 0
        assert (
            "bearing: not unique, as constraints are redundant: joint D repeats 3" in " ".join(shown.split())
        ) == open_
        header, *lines = out.read_text().splitlines()
        assert len(lines) == 201
        table = {name: [line.split(",")[k] for line in lines] for k, name in enumerate(header.split(","))}
        for name, nan in (("bearing_x", open_), ("bearing_z", False), ("torque", False)):
            assert all((text in ("", "nan", "NaN")) == nan for text in table[name]), name


def test_coordinates_as_another_program_numbers_them(run, facts):
    path = EXAMPLES / "robots" / "solo12.urdf"
    status, data, _ = facts("inspect", path, "--as", "pinocchio")
    other = data["other_reader"]
    assert status == 0
    assert (other["positions"], other["velocities"], other["version"]) == (12, 12, "4.1")
    assert sorted(other["indices"]) == list(range(12))
    assert [joint["joint"] for joint in other["joints"]] == sorted(joint["joint"] for joint in other["joints"])
    _, out, _ = run("inspect", path, "--as", "pinocchio")
    assert f"velocities of pinocchio = ours[{other['indices']}]" in out
    _, out, _ = run("inspect", EXAMPLES / "robots" / "panda.urdf", "--as", "drake")
    assert "unless it is welded to the world" in out
    assert "a constraint holds it there" in out


@pytest.mark.parametrize(
    "arguments, says",
    [
        ((EXAMPLES / "robots" / "panda.urdf", "--as", "kdl"), "--as: unknown reader, got 'kdl'"),
        ((EXAMPLES / "robots" / "five_bar.xml", "--as", "drake"), "has not been examined"),
        ((FOUR_BAR, "--as", "drake"), "--as: is for robot files"),
        ((FOUR_BAR, "--model", "a"), "--model: is for robot files"),
    ],
)
def test_programs_that_are_not_known_are_refused(run, arguments, says):
    status, _, err = run("inspect", *arguments)
    assert status == 2
    assert says in err


def test_inspect_reports_how_well_a_screw_turns_and_whether_it_locks(run, facts):
    rise = 8 / (2 * np.pi * 22)
    lead, phi = np.arctan(rise), np.arctan(0.12)
    (thread,) = facts("inspect", EXAMPLES / "screw_jack.yaml")[1]["screws"]
    assert (thread["joint"], thread["self_locking"], thread["back_efficiency"]) == ("thread", True, 0.0)
    assert thread["lead_angle"] == pytest.approx(lead, rel=1e-14)
    assert thread["efficiency"] == pytest.approx(np.tan(lead) / np.tan(lead + phi), rel=1e-14)
    status, out, _ = run("inspect", EXAMPLES / "screw_jack.yaml", "--set", "mu=0.04", "--set", "lead=-8 mm")
    assert status == 0
    forth = 100 * np.tan(lead) / np.tan(lead + np.arctan(0.04))
    back = 100 * np.tan(lead - np.arctan(0.04)) / np.tan(lead)
    words = f"efficiency {forth:.3g} % from turning to advance, {back:.3g} % from advance to turning"
    assert f"thread: lead angle {np.degrees(lead):.4g} deg, {words}" in " ".join(out.split())


@pytest.mark.slow
def test_run_reports_what_holds_a_jack_at_rest(run, facts):
    jack = EXAMPLES / "screw_jack.yaml"
    lead, phi = np.arctan(8 / (2 * np.pi * 22)), np.arctan(0.12)
    collar = 0.12 * 0.03 * 2012 * 9.81
    up, down = (2000 * 9.81 * 0.022 * np.tan(angle) + collar for angle in (lead + phi, phi - lead))
    (crank,) = facts("run", jack, "--holding", "--order", "0")[1]["holding"]
    assert crank["least"] == pytest.approx(-up, rel=1e-12)
    assert crank["greatest"] == pytest.approx(down, rel=1e-12)
    assert (crank["driver"], crank["unit"], crank["self_locking"], crank["locks"]) == ("crank", "N*m", True, False)
    status, out, _ = run("run", jack, "--holding", "--order", "0", "--units", "torque=N*mm")
    assert status == 0
    assert re.search(rf"crank +N\*mm +{-1000 * up:.6g} .* {1000 * down:.6g} .* everywhere", out)
    assert "holding" not in facts("run", jack, "--order", "0")[1]


@pytest.mark.slow
def test_run_writes_what_holds_a_jack_at_rest(run, tmp_path):
    jack, target = EXAMPLES / "screw_jack.yaml", tmp_path / "torque.csv"
    assert run("run", jack, "--order", "0", "--holding-out", target)[0] == 0
    held = jn.dynamics.holding_forces(jn.solve(jn.load(jack), order=0))
    found = np.genfromtxt(target, delimiter=",", names=True)
    assert found.dtype.names == ("time", "crank_least", "crank_frictionless", "crank_greatest")
    for bound in ("least", "frictionless", "greatest"):
        np.testing.assert_array_equal(found[f"crank_{bound}"], held["crank"].sel(bound=bound))
    assert run("run", jack, "--holding-out", tmp_path / "torque.txt")[0] == 2


def test_loops_of_a_file_beside_a_robot_are_listed(tmp_path, facts, run):
    path = tmp_path / "loops.yaml"
    path.write_text("closures:\n  tip: {type: ball, frames: [{link: base_link}, {link: tool0, xyz: [0.1, 0, 0]}]}\n")
    status, data, _ = facts("inspect", EXAMPLES / "robots" / "ur5.urdf", "--closures", path)
    assert status == 0
    (loop,) = data["closures"]
    assert (loop["name"], loop["type"], loop["links"]) == ("tip", "connect", ["base_link", "tool0"])
    assert run("inspect", FOUR_BAR, "--closures", path)[0] == 2
