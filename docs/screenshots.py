"""Makes the pictures of docs/view.md again: python docs/screenshots.py [NAME ...], from the root of the repository.

It needs the extras viewer and test, and Debian's chromium.
"""

import io
import sys
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

import jounce as jn
from jounce.viewer import view
from jounce.viewer.shapes.appearance import BodyPoint

IMAGES = Path(__file__).parent / "images"
FLAGS = ["--headless=new", "--no-sandbox", "--enable-unsafe-swiftshader"]
SIZE = {"width": 1400, "height": 800}


def packed(content, path):
    """Write a picture at two pixels a point with few colors, which a page of plots and plain bodies needs."""
    few = Image.open(io.BytesIO(content)).convert("RGB").quantize(192, dither=Image.Dither.NONE)
    few.save(path, format="png", optimize=True)


def four_bar(shown, page):
    shown.arrows.trace(shown.page.recording.appearance.points[0], (1, 2, 3))
    shown.page.seek(1.17)
    page.get_by_role("tab", name="Arrows").click()


def failure(shown, page):
    page.get_by_text("Exact values").click()
    page.wait_for_timeout(800)
    field = page.locator("xpath=(//*[normalize-space(text())='BC (m)'])[last()]/following::input").first
    field.fill("0.03")
    field.press("Enter")
    shown.page.seek(0.4)


def forces(shown, page, kinds=("reactions of joints", "forces of drivers")):
    page.get_by_role("tab", name="Forces").click()
    for words in kinds:
        page.locator(
            f"xpath=(//*[normalize-space(text())='{words}'])[1]/following::input[@type='checkbox']"
        ).first.click()
    shown.page.seek(0.62)


def spatial(shown, _):
    shown.page.seek(0.6)


def cam(shown, _):
    shown.page.seek(2.7)


def robot(shown, page):
    shown.arrows.trace(BodyPoint("panda_link7", (0.0, 0.0, 0.2), "hand"), (1, 2))
    forces(shown, page, ["forces of drivers"])
    shown.page.seek(2.6)


PICTURES = {
    "view_four_bar": (["examples/four_bar.yaml"], four_bar),
    "view_failure": (["examples/four_bar.yaml"], failure),
    "view_forces": (["examples/press.yaml"], forces),
    "view_cam": ([jn.cams.load_cam("examples/cams/intake.yaml")], cam),
    "view_spatial": (["examples/rsur.yaml"], spatial),
    "view_robot": (["examples/robots/panda.urdf", "examples/trajectories/panda_wave.yaml"], robot),
}


def main():
    requested = sys.argv[1:] or list(PICTURES)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=FLAGS)
        for name in requested:
            files, act = PICTURES[name]
            with view(*files, open_page=False, playing=False) as shown:
                page = browser.new_page(viewport=SIZE, device_scale_factor=2)
                page.goto(shown.url)
                page.get_by_text("Legend and plots").wait_for(timeout=60_000)
                page.wait_for_timeout(5000)
                warning = page.get_by_text("Software WebGL rendering detected")
                if warning.count():  # of machines without a graphics card
                    warning.locator("xpath=ancestor::*[@role='alert'][1]//button").first.click()
                act(shown, page)
                shown.page.session.wait()
                page.wait_for_timeout(4000)
                packed(page.screenshot(), IMAGES / f"{name}.png")
                page.close()
            print(name)
        browser.close()


if __name__ == "__main__":
    main()
