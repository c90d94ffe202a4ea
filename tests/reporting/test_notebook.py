"""What a notebook shows: tables with the facts of mechanisms, motions, robots, trajectories and batches."""

import html.parser
import pathlib

import numpy as np
import pytest

import jounce as jn
from jounce.reporting.notebook import shown

ROOT = pathlib.Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"


class Tables(html.parser.HTMLParser):
    """Reads tables: rows of cells below each caption; checks that tags are closed."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tables, self.texts, self.tags = [], {}, [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        self.open.append(tag)
        self.tags.append(tag)
        if tag in ("tr", "caption"):
            self.texts = []
        if tag in ("td", "th", "caption"):
            self.texts.append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag
        if tag == "caption":
            self.rows = self.tables.setdefault(self.texts[-1], [])
        if tag == "tr":
            self.rows.append(self.texts)

    def handle_data(self, data):
        if self.texts and self.open and self.open[-1] in ("td", "th", "caption"):
            self.texts[-1] += data


@pytest.fixture(scope="module")
def four_bar():
    return jn.load(EXAMPLES / "four_bar.yaml")


def test_a_mechanism(four_bar):
    found = Tables(four_bar._repr_html_()).tables
    assert found["Joints"][1:] == [
        ["A", "revolute", "ground, crank"],
        ["D", "revolute", "ground, rocker"],
        ["BC", "double_revolute", "crank, rocker"],
    ]
    assert ["BC", "0.1423", "m"] in found["Parameters (SI)"]
    assert found["Drivers"][1][-1] == "30*deg + 60*deg*sin(2*pi*t/tau)"
    assert found["Outputs"][1:] == [["psi", "angle", "rocker", "rad"], ["C", "point", "rocker", "m"]]
    assert found["Bodies, as guessed"][2] == ["rocker", "[AD, 0]", "1.74533"]


@pytest.mark.slow
def test_a_motion_and_one_that_fails(four_bar):
    motion = jn.solve(four_bar, order=2)
    rows = Tables(shown(motion)).tables["Peaks"]
    psi = motion.outputs["psi"]
    assert rows[1][:4] == ["psi", "position", "rad", f"{psi[:, 0].min():.6g}"]
    assert len(rows) == 1 + 3 * 3
    bad = jn.solve(four_bar.with_parameters(AB=0.08), order=2, strict=False)
    page = shown(bad)
    assert 'class="bad"' in page
    assert "body rocker" in page


def test_a_robot_and_one_with_a_loop():
    panda = Tables(shown(jn.load_robot(EXAMPLES / "robots" / "panda.urdf"))).tables
    moving = panda["Moving joints (rad, m, N m, N)"]
    assert len(moving) == 1 + 9
    assert moving[-1][-1] == "panda_finger_joint1 x 1"
    assert moving[1][3:6] == ["-2.8973 to 2.8973 rad", "2.175", "87"]
    loop = Tables(shown(jn.load_robot(EXAMPLES / "robots" / "five_bar.xml"))).tables
    assert loop["Loops closed by"][1] == ["tip", "connect", "left_forearm, right_forearm"]


def test_a_trajectory():
    trajectory = jn.JointTrajectory({"elbow": "0.5*t**2"}, 0.0, 2.0)
    row = Tables(trajectory._repr_html_()).tables["Ranges"][1]
    assert row == ["elbow", "ExpressionMotion", "0 to 2", "0 to 2", "1 to 1", "0 to 0"]


def test_ranges_of_a_trajectory_of_few_points_are_those_between_them_too():
    trajectory = jn.JointTrajectory({"elbow": "sin(t)"}, 0.0, 2 * np.pi, times=[0.0, np.pi, 2 * np.pi])
    row = Tables(trajectory._repr_html_()).tables["Ranges"][1]
    assert row[2] == "-1 to 1"


def test_a_batch(four_bar):
    time, status = np.linspace(0, 1, 3), np.array([[0, 0, 0], [0, 6, 7]])
    outputs = {"angle": np.arange(18.0).reshape(2, 3, 3)}
    outputs["angle"][1, 1:] = np.nan
    batch = jn.integrate.Batch(time, {"length": np.array([0.1, 0.2])}, outputs, status, np.array([4, 5]), four_bar, 2)
    page = batch._repr_html_()
    assert "1 of 2 runs complete" in page
    assert Tables(page).tables["Outputs of complete runs (SI)"][1] == ["angle", "2 x 3 x 3", "0", "6"]


def test_names_cannot_write_html():
    bodies = {"<script>alert(1)</script>": jn.Body([0, 0])}
    page = jn.Mechanism(space="planar", title="<b>&", bodies=bodies, joints={})._repr_html_()
    assert "<script>" not in page
    assert "&lt;script&gt;" in page
    assert "&lt;b&gt;&amp;" in page


def test_colors_are_left_to_the_page(four_bar):
    import re

    style = re.search(r"<style[^>]*>(.*?)</style>", shown(four_bar))[1]
    assert not re.search(r"(?<!-)color:(?!inherit)", style)
    assert "#" not in style


def test_long_tables_are_cut():
    bodies = {f"b{k}": jn.Body([k, 0]) for k in range(45)}
    rows = Tables(jn.Mechanism(space="planar", bodies=bodies, joints={})._repr_html_()).tables["Bodies, as guessed"]
    assert rows[-1] == ["and 15 more"]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of the machinery of notebooks
def test_the_notebook_of_the_examples_runs():
    import nbclient
    import nbformat

    book = nbformat.read(EXAMPLES / "notebook.ipynb", as_version=4)
    nbclient.NotebookClient(book, timeout=300, resources={"metadata": {"path": str(EXAMPLES)}}).execute()
    shows, streams = [], []
    for cell in book.cells:
        for output in cell.get("outputs", []):
            if output.output_type == "stream":
                streams.append(output)
            elif "text/html" in output.get("data", {}):
                shows.append(output.data["text/html"])
    titles = [
        "Planar four-bar",
        "Planar four-bar",
        "singular",
        "scara",
        "Joint trajectory",
        "degree of freedom",
        "Batch",
    ]
    assert len(shows) == len(titles)
    assert all(title in page for title, page in zip(titles, shows, strict=True))
    assert {stream.name for stream in streams} == {"stdout"}, "no bars, no warnings"


@pytest.mark.slow
def test_an_equilibrium_and_what_moves_about_it():
    rest = jn.equilibrium(jn.load(EXAMPLES / "double_pendulum.yaml"))
    small = jn.linearize(rest)
    assert Tables(shown(rest)).tables["Bodies, at rest"][1][0] == "upper"
    matrices = Tables(small._repr_html_()).tables
    assert matrices["Mass (SI)"][1] == ["upper.angle", "2", "1"]
    assert matrices["Modes"][1][1] == Tables(shown(small.modes)).tables["Modes"][1][1] == "0.381526"


@pytest.mark.slow
def test_everything_that_shows_itself_has_a_table():
    arm = jn.load_robot(ROOT / "examples" / "robots" / "planar_arm.xml")
    cam = jn.cams.load_cam(ROOT / "examples" / "cams" / "intake.yaml")
    fall = jn.simulate(arm, [0.0, 0.01], order=2, drives=False)
    for thing, words in (
        (cam, "pressure_angle"),
        (fall, arm.joint_names[0]),
        (jn.assemblies(jn.load(ROOT / "examples" / "four_bar.yaml")), "least singular value"),
    ):
        page = shown(thing)
        assert "<table>" in page
        assert words in page
