"""The report: what is in the page, and that it needs nothing else. A browser is asked in the slow test."""

import html
import json
import pathlib
import re
import shutil

import numpy as np
import pytest

import jounce as jn
from jounce.plot import report
from jounce.reporting.peaks import peaks

ROOT = pathlib.Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def four_bar():
    return jn.solve(jn.load(ROOT / "examples" / "four_bar.yaml"), np.linspace(0.0, 2.0, 41), order=3)


@pytest.fixture(scope="module")
def page(four_bar, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "four_bar.html"
    report(four_bar, path, source="four_bar.yaml")
    return path


def data_of(path):
    text = path.read_text(encoding="utf-8")
    (found,) = re.findall(r'<script id="data" type="application/json">(.*?)</script>', text, re.S)
    return json.loads(found)


@pytest.mark.slow
def test_values_are_those_of_the_motion(page, four_bar):
    data = data_of(page)
    assert [output["name"] for output in data["outputs"]] == ["psi", "C"]
    psi, c = data["outputs"]
    np.testing.assert_allclose(np.array(psi["values"])[:, 0].T, four_bar.outputs["psi"], rtol=1e-8)
    np.testing.assert_allclose(
        np.moveaxis(c["values"], (0, 1, 2), (1, 2, 0)), four_bar.outputs["C"], rtol=1e-8, atol=1e-30
    )
    assert psi["words"] == ["angle", "velocity", "acceleration", "jerk"]
    assert psi["units"] == ["rad", "rad/s", "rad/s^2", "rad/s^3"]
    assert data["times"] == four_bar.time.tolist()
    assert len(data["peaks"]) == len(peaks(four_bar)) == 12
    assert ["BC", 0.1423, "m", ""] in data["parameters"]
    assert [body["name"] for body in data["bodies"]] == ["crank", "rocker"]
    assert ["theta", "coordinate driver", "ground, crank"] in data["elements"]


def test_parameters_are_shown_as_they_are_written(tmp_path):
    file = ROOT / "examples" / "four_bar.yaml"
    report(jn.solve(jn.load(file).with_parameters(AB=0.05), [0.0, 0.1], order=0), tmp_path / "a.html", source=file)
    data = data_of(tmp_path / "a.html")
    assert ["BC", 0.1423, "m", "14.23 cm"] in data["parameters"]
    assert ["AB", 0.05, "m", ""] in data["parameters"]  # not what the file says any more
    assert "from four_bar.yaml" in data["made"]


def test_the_sketch_moves_with_the_motion(page, four_bar):
    scene = data_of(page)["scene"]
    (rocker,) = [shape for shape in scene["shapes"] if shape["owner"] == "bodies.rocker"]
    places = np.array(rocker["points"]).reshape(len(scene["times"]), 2, 2) * scene["step"]
    at = np.searchsorted(four_bar.time, scene["times"])
    np.testing.assert_allclose(places[:, 1], four_bar.outputs["C"][at, 0], rtol=0, atol=scene["step"])
    still = [shape for shape in scene["shapes"] if shape["owner"] == "joints.A" and shape["kind"] == "line"]
    assert all(len(shape["points"]) == 2 * shape["count"] for shape in still)  # the ground is told once


def test_the_page_asks_for_nothing(page):
    text = page.read_text(encoding="utf-8")
    assert "default-src 'none'" in text
    assert not re.findall(r"""(?:src|href)\s*=|https?://|@import|url\(|fetch\(|XMLHttpRequest""", text)
    assert not re.findall(r"@[A-Z]+@", text)


@pytest.mark.parametrize(
    "name",
    [
        "</script><script>alert(1)</script>",
        "@DATA@ @SCRIPT@ @STYLE@ @TITLE@",
        "<!--<script>",
        "a\u2028b\u0000c\x1b[31m",
        "\\u003c \\1 \\g<0> &amp; \"'",
    ],
)
def test_names_cannot_break_the_page(tmp_path, name):
    mechanism = jn.Mechanism(
        space="planar",
        title=name,
        bodies={name: jn.Body([0, 0])},
        joints={"O": jn.planar.Revolute(("ground", name), [0, 0], [0, 0])},
        drivers={"turn": jn.drivers.CoordinateDriver(("ground", name), "angle", motion="t")},
        outputs={"tip": jn.outputs.PointOutput(name, [1, 0])},
    )
    path = tmp_path / "page.html"
    report(jn.solve(mechanism, [0.0, 1.0], order=1), path)
    text = path.read_text(encoding="utf-8")
    assert (text.count("<script"), text.count("</script>")) == (2, 2)
    assert html.unescape(re.search("<title>(.*?)</title>", text, re.S)[1]) == name
    assert data_of(path)["title"] == name
    assert [body["name"] for body in data_of(path)["bodies"]] == [name]


def test_instants_that_failed_are_reported(tmp_path):
    mechanism = jn.load(ROOT / "examples" / "four_bar.yaml").with_parameters(BC=0.11)
    motion = jn.solve(mechanism, np.linspace(0.0, 2.0, 21), order=1, strict=False)
    report(motion, tmp_path / "page.html")
    data = data_of(tmp_path / "page.html")
    assert data["messages"]
    assert data["messages"][0].startswith("Not solved at t = ")
    assert data["solved"] == (motion.status == 0).tolist()
    assert data["outputs"][0]["values"][0][0][data["solved"].index(False)] is None


def test_a_page_that_cannot_be_written_is_reported(four_bar, tmp_path):
    with pytest.raises(jn.errors.OutputError, match=r"valid: \.html"):
        report(four_bar, tmp_path / "page.pdf")
    with pytest.raises(jn.errors.OutputError, match="does not exist"):
        report(four_bar, tmp_path / "none" / "page.html")
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_the_page_works_in_a_browser(page):
    from playwright.sync_api import expect, sync_playwright

    program = shutil.which("chromium")
    assert program, "the test needs chromium"
    with sync_playwright() as playwright:
        options = ["--no-sandbox", "--enable-unsafe-swiftshader"]
        browser = playwright.chromium.launch(executable_path=program, args=options)
        tab = browser.new_page(viewport={"width": 1200, "height": 900})
        asked, wrong = [], []
        tab.on("request", lambda request: asked.append(request.url))
        tab.on("pageerror", lambda error: wrong.append(str(error)))
        tab.on("console", lambda message: wrong.append(message.text))
        tab.goto(page.as_uri())
        tab.wait_for_selector("html[data-ready=true]")
        assert tab.locator(".panel").count() == 8  # two outputs, four derivatives
        assert tab.locator("#peaks tbody tr").count() == 12
        picture = "document.getElementById('sketch').toDataURL()"
        first = tab.evaluate(picture)
        tab.locator("#time").fill("0.5")
        assert tab.inner_text("#clock") == "t = 0.500 s"
        assert tab.evaluate(picture) != first
        tab.click("#play")
        expect(tab.locator("#clock")).not_to_have_text("t = 0.500 s")  # it plays; the page allows no eval
        tab.click("#play")
        tab.locator("#paths").select_option("3")
        assert tab.inner_text("#range").endswith("m/s\u00b3")
        tab.locator("#outputs input").first.uncheck()
        assert tab.locator(".panel").count() == 4
        box = tab.locator(".panel canvas").first.bounding_box()
        tab.mouse.click(box["x"] + box["width"] * 0.5, box["y"] + 60)
        assert 0.9 < float(tab.inner_text("#clock").split()[2]) < 1.2  # press on a plot to go there
        tab.set_viewport_size({"width": 420, "height": 900})
        assert tab.evaluate("document.documentElement.scrollWidth") == 420
        browser.close()
    assert wrong == []
    assert asked == [page.as_uri()]


RECORD = """
window.written = [];
const plain = CanvasRenderingContext2D.prototype.fillText;
CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
  window.written.push([this.canvas.id || this.canvas.ariaLabel, text, x, y, this.measureText(text).width]);
  plain.call(this, text, x, y);
};
"""


@pytest.fixture
def written(tmp_path):
    """Return what a page writes on its canvases, and where the places of names are in pixels."""
    from playwright.sync_api import sync_playwright

    def open_page(motion):
        path = tmp_path / "page.html"
        report(motion, path)
        with sync_playwright() as playwright:
            options = ["--no-sandbox", "--enable-unsafe-swiftshader"]
            browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=options)
            tab = browser.new_page(viewport={"width": 1200, "height": 900})
            tab.add_init_script(RECORD)
            tab.goto(path.as_uri())
            tab.wait_for_selector("html[data-ready=true]")
            tab.evaluate("window.written.length = 0")
            tab.locator("#time").fill("0.5")
            found = tab.evaluate("window.written"), tab.evaluate("[sketch.clientWidth, sketch.clientHeight]")
            browser.close()
        return data_of(path), *found

    return open_page


@pytest.mark.slow
def test_values_beside_a_plot_are_those_of_its_axis(written):
    motion = jn.solve(jn.load("examples/four_bar.yaml").with_parameters(tau=0.5), np.linspace(0.0, 1.0, 201), order=4)
    _, texts, _ = written(motion)
    psi = motion.outputs["psi"][100]
    own = [text for canvas, text, *_ in texts if canvas == "psi, jounce"]
    assert any("10\u00b3 rad/s" in text for text in own)  # the axis counts in thousands
    numbers = [float(text.removesuffix(" \u00b7 10\u00b3")) for text in own if text.endswith(" \u00b7 10\u00b3")]
    np.testing.assert_allclose(numbers, [psi[4] / 1000], rtol=1e-5)
    assert "time (s)" in own


@pytest.mark.slow
@pytest.mark.parametrize("name", ["four_bar", "six_bar_watt", "servo_press"])
def test_names_are_nearest_to_their_own_places(written, name):
    data, texts, (wide, tall) = written(jn.solve(jn.load(f"examples/{name}.yaml"), np.linspace(0.0, 1.0, 11), order=1))
    left, right, low, high = data["scene"]["limits"]
    scale = min(wide / (right - left), tall / (high - low))
    places = {}
    frame = int(np.searchsorted(data["scene"]["times"], 0.5))
    for label in data["scene"]["labels"]:
        points = np.reshape(label["points"], (-1, 2))
        x, y = points[min(frame, len(points) - 1)] * data["scene"]["step"]
        places[label["text"]] = wide / 2 + scale * (x - (left + right) / 2), tall / 2 - scale * (y - (low + high) / 2)
    led = {label["text"]: label["places"][wide > 490][3] for label in data["scene"]["labels"]}
    drawn = {text: (x, y, width) for canvas, text, x, y, width in texts if canvas == "sketch" and text in places}
    assert set(drawn) == set(places)
    for text, (x, y, width) in drawn.items():
        gap = {
            other: np.hypot(max(abs(x - u) - width / 2, 0.0), max(abs(y - v) - 8.0, 0.0))
            for other, (u, v) in places.items()
            if other == text or np.hypot(u - places[text][0], v - places[text][1]) > 4.0
        }
        assert min(gap, key=gap.get) == text or led[text]


def test_equations_for_a_thesis(four_bar, page, tmp_path):
    path = tmp_path / "equations.html"
    report(four_bar, path, equations=True, at=0.51)
    text = html.unescape(re.sub("<[^>]+>", " ", path.read_text(encoding="utf-8").partition('id="equations"')[2]))
    assert "Constraint equations at t = 0.5 s" in text
    assert re.search(r"BC +double revolute +equations 26-30 +crank, rocker +1", text)
    assert "Jacobian, 6 by 6" in text
    assert re.search(r"A\.1 +x \. \. +\. \. \.", text)
    assert re.search(r"BC\.1 +x x x +x x x", text)
    equations = jn.constraint_equations(four_bar).sel(time=0.5, row="BC.1")
    assert f"{float(equations.right_side.sel(derivative=3)):.9g}" in text
    assert 'id="equations"' not in page.read_text(encoding="utf-8")
    with pytest.raises(jn.errors.MechanismError, match="at: is beyond the motion, 0 to 2 s, got 3"):
        report(four_bar, path, equations=True, at=3)
