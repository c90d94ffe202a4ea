"""Exports of a page: a table, a picture, or an animation in one file that plays without this package."""

from __future__ import annotations

import io
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from jounce.errors import JounceError
from jounce.mechanism.time import nearest_instants
from jounce.viewer.page.local_server import quiet_server, stop_silently
from jounce.viewer.page.overlay import Overlay
from jounce.viewer.page.scene import ViserScene
from jounce.viewer.shapes.recording import Recording

SMOOTH = 1 / 30  # s between two pictures of an animation


def file_name(title: str, ending: str) -> str:
    """Return a file name for a motion.

    Examples
    --------
    >>> file_name("Planar four-bar: psi", ".csv")
    'planar_four-bar_psi.csv'
    """
    letters = "".join(c if c.isascii() and (c.isalnum() or c in "-_") else " " for c in title)
    return ("_".join(letters.lower().split()) or "motion") + ending


def table(recording: Recording) -> bytes:
    """Return all outputs with their derivatives as a CSV file.

    Raises
    ------
    JounceError
        If there are no outputs.
    """
    from jounce.io import write

    with TemporaryDirectory() as folder:
        path = Path(folder) / "motion.csv"
        write(recording.dataset(), path)
        return path.read_bytes()


def picture(client: Any, height: int | None = None, width: int | None = None) -> bytes:
    """Return the scene in a browser as a PNG file, on white.

    Parameters
    ----------
    client : viser.ClientHandle
        The browser that draws the scene.
    height, width : int, optional
        Size in pixels, by default that of the browser.

    Raises
    ------
    JounceError
        If the browser does not answer.
    """
    from matplotlib.image import imsave

    height = height or client.camera.image_height
    width = width or client.camera.image_width
    try:
        image = client.get_render(height, width, transport_format="png", timeout=60.0)
    except (TimeoutError, RuntimeError) as error:
        raise JounceError(f"the browser gave no picture: {error}") from None
    image = np.asarray(image, float)
    opacity = image[..., 3:] / 255 if image.shape[-1] == 4 else 1.0
    flat = image[..., :3] * opacity + 255 * (1 - opacity)
    stream = io.BytesIO()
    imsave(stream, flat.round().astype(np.uint8), format="png")
    return stream.getvalue()


def animation(overlay: Overlay) -> str:
    """Return an animation of a page as one HTML file, which plays in any browser without a network or this package.

    Parameters
    ----------
    overlay : Overlay
        The motion, with arrows, paths and forces.

    Raises
    ------
    JounceError
        If viser is not installed.
    """
    recording, server = overlay.recording, quiet_server()
    try:
        scene = ViserScene(server)
        scene.set_stage(recording)
        scene.set_shapes(recording)
        scene.begin(overlay)
        frames = frames_shown(recording)
        scene.show(overlay, frames[0])
        messages = server.get_scene_serializer()
        pauses = [*np.diff(recording.time[frames]).tolist(), SMOOTH]
        for frame, pause in zip(frames, pauses, strict=True):
            scene.show(overlay, frame)
            messages.insert_sleep(pause)
        return messages.as_html()
    finally:
        stop_silently(server)


def frames_shown(recording: Recording) -> list[int]:
    """Return the frames of an animation: all, or as many as look smooth."""
    time = recording.time
    targets = np.arange(time[0], time[-1] + 0.5 * SMOOTH, SMOOTH)
    if len(targets) < 60:  # short motions are shown at all instants
        return list(range(len(time)))
    return sorted({*nearest_instants(time, targets).tolist(), len(time) - 1})
