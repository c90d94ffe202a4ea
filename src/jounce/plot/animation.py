"""Animations of a motion: the moving sketch as GIF or MP4."""

from __future__ import annotations

import numbers
import shutil
from collections.abc import Callable, Sequence
from contextlib import suppress
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.base.interrupts import cleanup_on_signal
from jounce.errors import MechanismError, OutputError
from jounce.io.files.writing import check_target, replacing
from jounce.kinematics import Motion
from jounce.mechanism.time import nearest_instants
from jounce.plot.drawings.drawing import VIEW, View
from jounce.plot.drawings.scene import scene_of
from jounce.plot.instants import solved_instants
from jounce.plot.machine_sketch import SketchFigure, check_names, paths_of
from jounce.plot.style import GRAY, style

ANIMATION_SUFFIXES = (".gif", ".mp4")
FRAMES_PER_SECOND = 25  # the frame time of a GIF is a multiple of a hundredth of a second
LONGEST, SHORTEST = 20.0, 2.0  # s, of an animation without a given speed
MOST_FRAMES = 3000
RESOLUTION = 110  # dots per inch


def check_animation(path: str | PathLike[str], *, overwrite: bool = False) -> None:
    """Raise OutputError unless an animation can be written to a path; to be called before a long computation.

    Raises
    ------
    OutputError
        If the suffix is not .gif or .mp4, the folder does not exist, or ffmpeg, which .mp4 needs, is not installed.
    """
    check_target(path, ANIMATION_SUFFIXES, "an animation", overwrite=overwrite)
    if Path(fspath(path)).suffix.lower() == ".mp4" and _ffmpeg() is None:
        message = 'an .mp4 needs ffmpeg, which is not there: pip install "jounce[viewer]", or write a .gif'
        raise OutputError(message, path=fspath(path))


def _ffmpeg() -> str | None:
    """Return the path of ffmpeg, that of the system or of imageio-ffmpeg."""
    program = shutil.which("ffmpeg")
    if program is None:
        with suppress(ImportError, RuntimeError):
            from imageio_ffmpeg import get_ffmpeg_exe

            program = get_ffmpeg_exe()
    return program


def frame_instants(
    time: Sequence[float] | Float[np.ndarray, " time"], *, speed: float | None = None, fps: int = FRAMES_PER_SECOND
) -> Float[np.ndarray, " frames"]:
    """Return the instants of the frames of an animation.

    Parameters
    ----------
    time : array_like of shape (time,)
        Instants of a motion, s.
    speed : float, optional
        Seconds of motion per second of the animation. By default real time, limited so that the animation lasts 2 s to
        20 s.
    fps : int, default 25
        Frames per second.

    Returns
    -------
    numpy.ndarray of shape (frames,)
        Evenly spaced instants, s.

    Raises
    ------
    MechanismError
        If the speed or the frame rate is not positive, or the animation would have more than 3000 frames.

    Examples
    --------
    >>> from jounce.plot.animation import frame_instants
    >>> len(frame_instants([0.0, 2.0])), len(frame_instants([0.0, 2.0], speed=0.5)), len(frame_instants([0.0, 0.03]))
    (51, 101, 51)
    """
    time = np.asarray(time, float)
    duration = abs(float(time[-1] - time[0]))
    rate, given = _above_zero("fps", fps), 1.0 if speed is None else _above_zero("speed", speed)
    length = duration / given
    if speed is None and duration:
        length = float(np.clip(length, SHORTEST, LONGEST))
    count = round(length * rate) + 1
    if count > MOST_FRAMES:
        message = (
            f"the animation would have {count} frames, of at most {MOST_FRAMES}; choose a higher speed or fewer fps"
        )
        raise MechanismError(message, name="speed", value=speed)
    return np.linspace(time[0], time[-1], count)


def _above_zero(name: str, value: Any) -> float:
    if not (isinstance(value, numbers.Real) and not isinstance(value, bool) and 0 < float(value) < np.inf):
        raise MechanismError("must be greater than zero", name=name, value=value)
    return float(value)


def animate(
    motion: Motion,
    path: str | PathLike[str],
    *,
    speed: float | None = None,
    fps: int = FRAMES_PER_SECOND,
    names: str = "bodies",
    paths: Sequence[str] | None = None,
    order: int = 0,
    view: View = VIEW,
    progress: Callable[[int, int], None] | None = None,
    overwrite: bool = False,
) -> None:
    """Write an animation of the sketch of a motion to a .gif or .mp4 file.

    Parameters
    ----------
    motion : Motion
        The motion; each frame shows the nearest solved instant.
    path : str or path
        File with the suffix .gif or .mp4, which needs ffmpeg, of the system or of the extra ``viewer``.
    speed : float, optional
        Seconds of motion per second of the animation; see `frame_instants`.
    fps : int, default 25
        Frames per second; a GIF rounds the frame time to hundredths of a second.
    names : str, default "bodies"
        Names to write: ``"all"``, ``"bodies"``, ``"joints"``, ``"outputs"`` or ``"none"``.
    paths, order, view
        As for `sketch`.
    progress : callable, optional
        Called with the number of frames done and their total.
    overwrite : bool, default False
        Whether the animation may replace a file that this process has read as an input.

    Raises
    ------
    MechanismError
        If an option is not valid, or no instant was solved.
    OutputError
        If the file cannot be written.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.plot import animate
    >>> motion = jn.solve(jn.load("examples/four_bar.yaml"), order=0)
    >>> animate(motion, "four_bar.gif", fps=10)  # doctest: +SKIP
    """
    import matplotlib as mpl
    import matplotlib.animation as writers

    check_names(names)
    check_animation(path, overwrite=overwrite)
    path_lines, solved = paths_of(motion, paths, order, view), solved_instants(motion)
    nearest = nearest_instants(motion.time, frame_instants(motion.time, speed=speed, fps=fps))
    selected = nearest[np.isin(nearest, solved)]
    instants, frames = np.unique(selected if selected.size else solved, return_inverse=True)
    scene, mechanism = scene_of(motion, view=view, instants=instants), motion.mechanism
    program: dict[Any, Any] = {}
    if Path(fspath(path)).suffix.lower() == ".gif":
        writer = writers.PillowWriter(fps=fps)
    else:
        program = {"animation.ffmpeg_path": _ffmpeg()}
        writer = writers.FFMpegWriter(fps=fps, extra_args=["-pix_fmt", "yuv420p"])
    with style(), mpl.rc_context(program), replacing(path, overwrite=overwrite) as temporary:
        drawing = SketchFigure(scene, path_lines, mechanism.title, None if mechanism.space == "planar" else view)
        drawing.show(0)
        drawing.write_names(names, fixed=False)
        at_the_corner = {"transform": drawing.axes.transAxes, "ha": "right", "va": "bottom", "color": GRAY}
        clock = drawing.axes.text(0.99, 0.01, _clock_text(motion.time, float(motion.time[0])), **at_the_corner)
        drawing.figure.set_layout_engine("none")
        _even_pixels(drawing.figure)
        with writer.saving(drawing.figure, str(temporary), dpi=RESOLUTION), cleanup_on_signal(lambda: _stop(writer)):
            for done, frame in enumerate(frames.tolist(), 1):
                drawing.show(frame)
                drawing.move_names(frame)
                clock.set_text(_clock_text(motion.time, float(motion.time[instants[frame]])))
                writer.grab_frame()
                if progress is not None:
                    progress(done, len(frames))


def _stop(writer: Any) -> None:
    """Stop the encoder, which would otherwise write the file again after its removal."""
    encoder = getattr(writer, "_proc", None)
    if encoder is not None:
        encoder.kill()
        encoder.wait(1.0)


def _even_pixels(figure: Any) -> None:
    """Set width and height to even numbers of pixels, as video requires."""
    size = np.ceil(figure.get_size_inches() * RESOLUTION / 2) * 2 / RESOLUTION
    figure.set_size_inches(*(size + 1e-6))


def _clock_text(time: Float[np.ndarray, " time"], instant: float) -> str:
    duration = abs(float(time[-1] - time[0])) or 1.0
    digits = max(0, 2 - int(np.floor(np.log10(duration))))
    return f"t = {instant:.{min(digits, 9)}f} s"
