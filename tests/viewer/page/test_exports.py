"""What is exported can be read back: the table, the animation, the picture; pages on a real server."""

import base64
import io
import re
import struct

import numpy as np
import pytest

import jounce as jn
from jounce.cli import main
from jounce.io import read
from jounce.viewer import view
from jounce.viewer.page.exports import animation, file_name, picture, table
from jounce.viewer.page.legend import error_box, legend
from jounce.viewer.page.overlay import DisplayOptions, Overlay
from jounce.viewer.shapes.arrows import TracedPoint
from jounce.viewer.subjects.mechanisms import MechanismSubject
from tests.viewer.small import derivatives_of_the_rim, wheel


@pytest.fixture(scope="module")
def recording():
    return MechanismSubject(wheel(time=np.linspace(0.0, 1.0, 101))).solve({}, 2)


def test_a_table_has_all_outputs_and_derivatives(recording, tmp_path):
    path = tmp_path / "motion.csv"
    path.write_bytes(table(recording))
    found = read(path)
    rim = np.stack([found["rim"].sel(component=c).values for c in "xy"], axis=-1)
    np.testing.assert_allclose(rim, derivatives_of_the_rim(recording.time)[..., :2], rtol=0, atol=1e-11)
    assert file_name(recording.title, ".csv") == "wheel.csv"


def recorded(html):
    """The messages of an animation, as the page will read them."""
    import msgspec
    import zstandard

    data = base64.b64decode(re.search(r'__VISER_EMBED_DATA__="([^"]+)"', html)[1])
    (size,) = struct.unpack("<Q", data[:8])
    inner = zstandard.ZstdDecompressor().decompress(data[8:], max_output_size=size)
    (length,) = struct.unpack("<Q", inner[:8])
    return msgspec.msgpack.decode(inner[8 : 8 + length], strict=False)


@pytest.mark.slow
def test_an_animation_holds_all_instants_and_needs_nothing_else(recording):
    point = next(s for s in recording.appearance.points if s.name == "rim")
    html = animation(Overlay.of(recording, DisplayOptions((TracedPoint(point, (1,)),), kinds=frozenset({"driver"}))))
    content = recorded(html)
    assert content["durationSeconds"] == pytest.approx(1.0 + 1 / 30)
    turns = [(t, m["wxyz"]) for t, m in content["messages"] if m.get("name") == "/bodies/wheel" and "wxyz" in m]
    assert len(turns) >= 100
    instant, wxyz = turns[-1]
    assert instant == pytest.approx(1.0)
    assert wxyz == pytest.approx([np.cos(1.0), 0, 0, np.sin(1.0)])  # half of 2 rad
    names = {m.get("name", "") for _, m in content["messages"]}
    assert {"/arrows/derivative 1", "/paths", "/torques/driver turn"} <= names
    outside = set(
        re.findall(r"https?://[^\s\"'`<>\\)]+", html.replace(html[html.index("__VISER_EMBED") :][: 10**7], ""))
    )
    assert {address for address in outside if "w3.org" not in address} == set()


class Camera:
    image_height, image_width = 40, 60


class Client:
    camera = Camera()

    def get_render(self, height, width, transport_format, timeout):
        image = np.zeros((height, width, 4), np.uint8)
        image[: height // 2] = (10, 20, 30, 255)
        return image


class Silent(Client):
    def get_render(self, *args, **keywords):
        raise TimeoutError("no frame")


def test_a_picture_is_a_png_on_white():
    from matplotlib.image import imread

    image = imread(io.BytesIO(picture(Client())), format="png")
    assert image.shape[:2] == (40, 60)
    assert (image[0, 0, :3] * 255).round().tolist() == [10, 20, 30]
    assert image[-1, -1, :3].tolist() == [1, 1, 1]
    with pytest.raises(jn.JounceError, match="no picture: no frame"):
        picture(Silent())


def test_the_legend_says_how_large_everything_is(recording):
    point = next(s for s in recording.appearance.points if s.name == "rim")
    options = DisplayOptions((TracedPoint(point, (1, 2)),), kinds=frozenset({"driver", "reaction"}))
    shown = Overlay.of(recording, options)
    text = legend(shown, 100)
    assert "1.80 m/s<" in text  # r 3 c t^2
    assert "m/s<sup>2</sup>" in text
    assert "20.0 N<" in text
    assert "6.00 N m" in text
    assert "<b>reactions of joints, forces of drivers</b>" in text
    assert "&lt;b&gt;" in error_box("<b>")


@pytest.fixture(scope="module")
def page():
    with view(wheel(), open_page=False, order=2, playing=False) as found:
        yield found


def test_a_page_listens_on_this_machine_only(page):
    assert re.match(r"http://127\.0\.0\.1:\d+/", page.url)
    server = page.page.server
    assert server.get_host() == "127.0.0.1"
    with pytest.raises(jn.JounceError, match="port: cannot be used"):
        view(wheel(), open_page=False, port=server.get_port())


def test_a_page_solves_again_and_keeps_its_motion_after_a_failure(page):
    inner = page.page
    inner.seek(0.5)
    inner.session.request({"r": 0.6})
    assert inner.session.wait(60.0)
    assert inner.recording.values["r"] == 0.6
    assert inner.frame == 50
    assert not page.panel.message.visible
    good = inner.recording
    inner.session.request({"r": 1e999})
    assert inner.session.wait(60.0)
    assert inner.recording is good
    assert page.panel.message.visible
    assert "finite" in page.panel.message.content
    inner.session.request({"r": 0.3}, order=3)
    assert inner.session.wait(60.0)
    assert not page.panel.message.visible
    assert inner.recording.order == 3
    inner.session.request(order=2)
    assert inner.session.wait(60.0)


def test_a_page_marks_points_and_plots(page):
    inner = page.page
    page.arrows.trace(next(s for s in inner.recording.appearance.points if s.name == "wheel: O"), (1,))
    assert inner.session.wait(60.0)
    assert [each.point.name for each in inner.options.traced] == ["rim", "wheel: O"]
    before = len(page.plots.charts)
    page.plots.add("angle", 1)
    inner.seek(0.25)
    chart = page.plots.charts[-1]
    assert len(page.plots.charts) == before + 1
    cursor = chart.handle.data[-1]
    assert inner.recording.time[np.flatnonzero(np.isfinite(cursor))[0]] == pytest.approx(0.25)
    page.plots.remove()
    assert len(page.plots.charts) == before


@pytest.mark.parametrize(
    "arguments, words",
    [
        (["missing.yaml"], "missing.yaml"),
        (["missing.urdf"], "missing.urdf"),
        (["examples/four_bar.yaml", "examples/trajectories/panda_wave.yaml"], "a trajectory is for robots"),
        (["examples/four_bar.yaml", "--port", "70000"], "--port: must be a whole number from 0 to 65535"),
        (["examples/four_bar.yaml", "--order", "31"], "--order: the order"),
        (["examples/four_bar.yaml", "--set", "BC=3 cm"], "cannot be assembled"),
        (["examples/robots/scara.urdf", "--set", "a=1"], "--set: is for mechanism files"),
        (["examples/robots/scara.urdf", "examples/trajectories/panda_wave.yaml"], "no moving joint has this name"),
    ],
)
def test_bad_input_ends_with_status_two_and_a_message(arguments, words, capsys):
    assert main(["view", "--no-open", *arguments]) == 2
    assert words in capsys.readouterr().err


def test_what_is_no_mechanism_is_refused():
    with pytest.raises(jn.JounceError, match="must be a mechanism, a robot, a cam, or the path"):
        view(3, open_page=False)
