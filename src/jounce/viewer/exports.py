"""What a page can be kept as: a table, a picture, an animation in one file that plays without this package."""

from __future__ import annotations

import io
from contextlib import redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from jounce.errors import JounceError
from jounce.viewer.guard import Guard, refuse_uploads
from jounce.viewer.prepared import Prepared
from jounce.viewer.take import Take

__all__ = ["animation", "check_installed", "file_name", "picture", "quiet_server", "quiet_stop", "table"]

SMOOTH = 1 / 30  # s between two pictures of an animation


def file_name(title: str, ending: str) -> str:
    """Return a name for a file of a motion.

    Examples
    --------
    >>> file_name("Planar four-bar: psi", ".csv")
    'planar_four-bar_psi.csv'
    """
    kept = "".join(c if c.isascii() and (c.isalnum() or c in "-_") else " " for c in title)
    return ("_".join(kept.lower().split()) or "motion") + ending


def table(take: Take) -> bytes:
    """Return all outputs with their derivatives as a CSV file.

    Raises
    ------
    JounceError
        If there are no outputs.
    """
    from jounce.io import write

    with TemporaryDirectory() as folder:
        path = Path(folder) / "motion.csv"
        write(take.dataset(), path)
        return path.read_bytes()


def picture(client: Any, height: int | None = None, width: int | None = None) -> bytes:
    """Return what a browser shows of the scene as a PNG file, on white.

    Parameters
    ----------
    client : viser.ClientHandle
        The browser, which draws it.
    height, width : int, optional
        Pixels; those of the browser unless given.

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
    share = image[..., 3:] / 255 if image.shape[-1] == 4 else 1.0
    flat = image[..., :3] * share + 255 * (1 - share)
    stream = io.BytesIO()
    imsave(stream, flat.round().astype(np.uint8), format="png")
    return stream.getvalue()


def check_installed() -> None:
    """Raise JounceError unless the packages of the extra ``viewer`` are there."""
    from importlib.util import find_spec

    if find_spec("viser") is None or find_spec("trimesh") is None:
        message = 'the view needs the package viser, which is not installed: pip install "jounce[viewer]"'
        raise JounceError(message)


def quiet_server(port: int = 0, label: str | None = None, guard: Guard | None = None) -> Any:
    """Return a viser server that listens on this machine only, answers whom its guard allows, and prints nothing.

    Raises
    ------
    JounceError
        If viser is not installed or cannot be guarded, or the port is taken.
    """
    check_installed()
    import viser

    server = None
    try:
        with redirect_stdout(io.StringIO()), (guard or Guard()).starting():
            server = viser.ViserServer(host="127.0.0.1", port=port or free_port(), label=label, verbose=False)
        refuse_uploads(server)
    except BaseException:
        if server is not None:
            quiet_stop(server)
        raise
    return server


def quiet_stop(server: Any) -> None:
    """End a viser server without a word."""
    with redirect_stdout(io.StringIO()):
        server.stop()


def free_port() -> int:
    """Return a port of this machine that nobody listens on."""
    import socket

    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def animation(prepared: Prepared) -> str:
    """Return what a page shows as one HTML file that plays in any browser, without a network and this package.

    Parameters
    ----------
    prepared : Prepared
        The motion, with arrows, paths and forces.

    Raises
    ------
    JounceError
        If viser is not installed.
    """
    from jounce.viewer.scene import Scene

    take, server = prepared.take, quiet_server()
    try:
        scene = Scene(server)
        scene.stage(take)
        scene.dress(take)
        prepared.begin(scene)
        frames = frames_shown(take)
        prepared.show(scene, frames[0])
        recording = server.get_scene_serializer()
        for frame, after in zip(frames, [*frames[1:], None], strict=True):
            prepared.show(scene, frame)
            recording.insert_sleep(SMOOTH if after is None else float(take.time[after] - take.time[frame]))
        return recording.as_html()
    finally:
        quiet_stop(server)


def frames_shown(take: Take) -> list[int]:
    """Return the frames of an animation: all, or as many as are needed to look smooth."""
    if len(take.time) < 2:
        return [0]
    wanted = np.arange(take.time[0], take.time[-1] + 0.5 * SMOOTH, SMOOTH)
    if len(wanted) < 60:  # short motions are shown instant by instant
        return list(range(len(take.time)))
    return sorted({take.frame_at(float(instant)) for instant in wanted} | {len(take.time) - 1})
