"""The page in a real browser: it asks nothing of the network, moves, follows its sliders, and gives its exports."""

import dataclasses
import shutil

import numpy as np
import pytest
from playwright.sync_api import sync_playwright

import jounce as jn
from jounce.io import read
from jounce.viewer import view

pytestmark = pytest.mark.slow

FLAGS = ["--headless=new", "--no-sandbox", "--enable-unsafe-swiftshader"]
PATIENCE = 60_000  # ms; pictures are drawn without a graphics card here


@pytest.fixture(scope="module")
def browser():
    chromium = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    assert chromium, "these tests need Debian's chromium: apt-get install chromium"
    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        yield found
        found.close()


@pytest.fixture(scope="module")
def opened(browser):
    """The page of the four-bar, at rest, with the addresses that it asked for."""
    with view("examples/four_bar.yaml", open_page=False, playing=False) as shown:
        page = browser.new_page(viewport={"width": 1300, "height": 800})
        asked, errors = [], []
        page.on("request", lambda request: asked.append(request.url))
        page.on("websocket", lambda socket: asked.append(socket.url))
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(shown.url)
        page.get_by_text("Legend and plots").wait_for(timeout=PATIENCE)
        page.get_by_text("psi: acceleration").first.wait_for(timeout=PATIENCE)
        page.wait_for_timeout(3000)
        yield shown, page, asked, errors
        page.close()


def canvas_of(page):
    """The pixels between the panels."""
    from io import BytesIO

    from matplotlib.image import imread

    image = page.screenshot(clip={"x": 400, "y": 160, "width": 520, "height": 620})
    return imread(BytesIO(image), format="png")[..., :3]


def settled(shown, page):
    assert shown.page.session.wait(60.0)
    page.wait_for_timeout(1500)


def test_it_loads_without_a_request_to_elsewhere(opened):
    shown, page, asked, errors = opened
    outside = [a for a in asked if not a.startswith((shown.url, shown.url.replace("http", "ws"), "data:", "blob:"))]
    assert outside == []
    assert any(address.startswith("ws://127.0.0.1") for address in asked)
    assert errors == []
    assert page.get_by_text("Planar four-bar").count() >= 1
    canvas = canvas_of(page)
    assert (canvas.std(axis=-1) > 0.08).mean() > 0.01  # colored bodies on gray and white


def test_it_moves_and_stops(opened):
    shown, page, _, _ = opened
    shown.page.seek(0.0)
    page.wait_for_timeout(1500)
    before = canvas_of(page)
    page.get_by_role("button", name="Play").click()
    page.wait_for_timeout(2500)
    page.get_by_role("button", name="Pause").click()
    page.wait_for_timeout(1500)
    assert not shown.page.player.playing
    assert shown.page.player.now > 0
    after = canvas_of(page)
    assert (np.abs(after - before).max(axis=-1) > 0.2).mean() > 0.01
    page.wait_for_timeout(500)
    assert np.abs(canvas_of(page) - after).max() < 0.05


def test_a_slider_changes_the_motion(opened):
    shown, page, _, _ = opened
    before = shown.page.recording
    thumb = page.get_by_role("slider").nth(2)  # after those of the time and of AD
    thumb.focus()
    thumb.press("End")
    page.wait_for_timeout(1000)
    settled(shown, page)
    recording = shown.page.recording
    assert recording is not before
    assert recording.values["AB"] == pytest.approx(0.06)
    expected = jn.solve(jn.load("examples/four_bar.yaml").with_parameters(AB=0.06), order=2).outputs["psi"]
    np.testing.assert_allclose(recording.outputs["psi"].values[:, :3, 0], expected, rtol=0, atol=1e-9)


def test_an_impossible_value_shows_the_message_and_keeps_the_motion(opened):
    shown, page, _, _ = opened
    page.get_by_text("Exact values").click()
    page.wait_for_timeout(800)
    good = shown.page.recording
    field = page.locator("xpath=(//*[normalize-space(text())='BC (m)'])[last()]/following::input").first
    field.fill("0.03")
    field.press("Enter")
    message = page.get_by_text("No motion for these values")
    message.wait_for(timeout=PATIENCE)
    assert page.get_by_text("cannot be assembled").count() >= 1
    assert shown.page.recording is good
    page.get_by_role("button", name="Reset").click()
    message.wait_for(state="hidden", timeout=PATIENCE)
    settled(shown, page)
    assert shown.page.recording.values["BC"] == pytest.approx(0.1423)
    page.get_by_text("Exact values").click()


def exported(page, name):
    with page.expect_download(timeout=PATIENCE) as download:
        page.get_by_role("button", name=name).click()
    return download.value


def test_exports_arrive(opened, browser, tmp_path):
    shown, page, _, _ = opened
    page.get_by_role("tab", name="Export").click()
    download = exported(page, "Table (CSV)")
    assert download.suggested_filename == "planar_four-bar.csv"
    download.save_as(tmp_path / "motion.csv")
    psi = read(tmp_path / "motion.csv")["psi"].values
    np.testing.assert_allclose(psi, shown.page.recording.outputs["psi"].values[..., 0], rtol=0, atol=1e-12)

    from matplotlib.image import imread

    exported(page, "Picture (PNG)").save_as(tmp_path / "view.png")
    image = imread(tmp_path / "view.png")[..., :3]
    assert min(image.shape[:2]) > 300
    assert (image.std(axis=-1) > 0.08).mean() > 0.01

    exported(page, "Animation (HTML)").save_as(tmp_path / "animation.html")
    offline = browser.new_page(viewport={"width": 800, "height": 600})
    asked = []
    offline.on("request", lambda request: asked.append(request.url))
    offline.goto(f"file://{tmp_path / 'animation.html'}")
    offline.wait_for_timeout(6000)
    first = offline.screenshot()
    offline.wait_for_timeout(1200)
    assert offline.screenshot() != first  # it plays by itself
    assert [address for address in asked if address.startswith(("http", "ws"))] == []
    offline.close()


def test_a_title_is_text_and_no_markup(browser):
    mechanism = dataclasses.replace(
        jn.load("examples/four_bar.yaml"), title="<script>window.marked = 1</script><b id='marked'>M</b>"
    )
    with view(mechanism, open_page=False, playing=False) as shown:
        page = browser.new_page()
        page.goto(shown.url)
        page.get_by_text("window.marked").first.wait_for(timeout=PATIENCE)
        assert page.evaluate("window.marked") is None
        assert page.evaluate("document.getElementById('marked')") is None
        page.close()
