"""The commands that draw figures, sketches and animations of a motion, and write its report."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from jounce.base.activity import Count
from jounce.cli.mechanism_commands.mechanisms import outcome, solve_or_simulate
from jounce.cli.options import PLAIN_MECHANISM, MechanismReading, errors_about, spare_inputs, written
from jounce.errors import JounceError, MechanismError, check_name
from jounce.reporting.terminal import print_text

if TYPE_CHECKING:
    from jounce.kinematics import Motion
    from jounce.mechanism import Mechanism

Kind = Literal["outputs", "sketch", "hodograph", "phase", "energy", "power", "reactions", "animation"]
Names = Literal["all", "bodies", "joints", "outputs", "none"]
ANIMATIONS = (".gif", ".mp4")
ORDERS = {"outputs": 4, "reactions": 4, "power": 4, "energy": 1, "phase": 1, "hodograph": 1}  # unless another is given
PORTRAITS = ("hodograph", "phase")


def plot(
    file: Path,
    /,
    *,
    kind: Kind | None = None,
    order: int | None = None,
    out: Path | None = None,
    output: list[str] | None = None,
    derivative: int | None = None,
    instant: Annotated[float | None, Parameter(name="--time", alias="--instant")] = None,
    names: Names | None = None,
    azimuth: float = -60.0,
    elevation: float = 25.0,
    speed: float | None = None,
    fps: int = 25,
    reading: MechanismReading = PLAIN_MECHANISM,
    overwrite: bool = False,
) -> int:
    """Draw outputs, a sketch, reactions, energies, or an animation.

    A file with initial conditions is simulated, any other is solved.

    Parameters
    ----------
    file
        Mechanism file: .yaml, .yml, .toml or .json.
    kind
        Kind of figure [default: outputs, or by the ending of --out].
    order
        Highest derivative, up to 30 [default: 4, or as needed].
    out
        .png, .svg, .pdf, .gif or .mp4 [default: FILE's name.png].
    output
        Output, point with a path, or joint to draw; repeatable [all].
    derivative
        Derivative in a hodograph, a portrait, or the color of paths.
    instant
        Instant that a sketch shows, s.
    names
        Names to write in a sketch or an animation.
    azimuth
        Azimuth of the viewer of a spatial mechanism, degrees.
    elevation
        Elevation of the viewer, degrees.
    speed
        Seconds of motion per second of the animation.
    fps
        Frames per second of the animation.
    overwrite
        Let --out replace a file that is read here.

    Examples
    --------
      jounce plot examples/four_bar.yaml --out four_bar.png
      jounce plot examples/rsur.yaml --order 6 --output psi --output C
      jounce plot examples/four_bar.yaml --kind sketch --derivative 3
      jounce plot examples/press.yaml --kind reactions --output main --output knee
      jounce plot examples/andrews.yaml --out andrews.gif
    """
    chosen = _kind(kind, out)
    out = Path(f"{file.stem}{'.gif' if chosen == 'animation' else '.png'}") if out is None else out
    _check_target(chosen, out, overwrite)
    mechanism = reading.mechanism(file)
    spare_inputs(out, overwrite=overwrite)
    _check_names(mechanism, chosen, output or (), file)
    lowest = max(derivative or 0, ORDERS.get(chosen, 0) if order is None or chosen in PORTRAITS else 0)
    motion = solve_or_simulate(mechanism, file, lowest if order is None else max(order, derivative or 0))
    style: dict[str, Any] = {"paths": output, "order": derivative or 0, "view": (azimuth, elevation)}
    if names is not None:
        style["names"] = names
    with errors_about(file):
        if chosen == "animation":
            from jounce.plot import animate

            with Count("drawing") as bar:
                written(lambda: animate(motion, out, progress=bar, speed=speed, fps=fps, overwrite=overwrite, **style))
        else:
            from jounce.plot import save

            figure = _drawn(motion, chosen, output, derivative, {"instant": instant, **style})
            written(lambda: save(figure, out, overwrite=overwrite))
    print_text(f"Written to {out}")
    return outcome(motion, file)


def _kind(kind: Kind | None, out: Path | None) -> str:
    """Return the kind of figure, by default from the suffix of the file."""
    suffix = "" if out is None else out.suffix
    moves = suffix.lower() in ANIMATIONS
    if kind is None:
        return "animation" if moves else "outputs"
    if moves and kind != "animation":
        message = f"a figure of this kind does not move; write a .png, .svg or .pdf instead of a {suffix}"
        raise JounceError(message, name="--kind", value=kind)
    return kind


def _check_target(kind: str, out: Path, overwrite: bool) -> None:
    from jounce.plot import check_animation, check_figure

    (check_animation if kind == "animation" else check_figure)(out, overwrite=overwrite)


def _check_names(mechanism: Mechanism, kind: str, names: Sequence[str], file: Path) -> None:
    """Raise MechanismError if a name does not exist, before anything is solved."""
    valid = [*mechanism.outputs]
    if kind == "reactions":
        valid = [*mechanism.joints, *mechanism.drivers, *mechanism.forces]
    elif not valid and kind in ("outputs", *PORTRAITS):
        raise MechanismError("there is nothing to draw; name some outputs", path=file, name="outputs")
    noun = "joint, driver or force" if kind == "reactions" else "output"
    for name in names:
        check_name(noun, name, valid, MechanismError, path=file, name="joints" if kind == "reactions" else "outputs")
    if kind in PORTRAITS and len(names) > 1:
        raise MechanismError("one output is drawn at a time", path=file, name="--output", value=list(names))


def _drawn(motion: Motion, kind: str, output: list[str] | None, derivative: int | None, style: dict[str, Any]) -> Any:
    import jounce.plot as figures

    output_name = _portrait_output(motion, kind, output)
    upper = 1 if derivative is None else max(derivative, 1)
    kinds: dict[str, Callable[[], Any]] = {
        "outputs": lambda: figures.draw(motion, output),
        "sketch": lambda: figures.sketch(motion, **style),
        "hodograph": lambda: figures.hodograph(motion, output_name, 1 if derivative is None else derivative),
        "phase": lambda: figures.phase_portrait(motion, output_name, (upper - 1, upper)),
        "energy": lambda: figures.draw_energy(motion),
        "power": lambda: figures.draw_power(motion),
        "reactions": lambda: figures.draw_reactions(motion, output),
    }
    return kinds[kind]()


def _portrait_output(motion: Motion, kind: str, output: list[str] | None) -> str:
    """Return the output of a portrait: the named one, or the first suitable one."""
    if output or kind not in PORTRAITS:
        return output[0] if output else ""
    given = motion.mechanism.outputs
    vectors = [n for n, values in motion.outputs.items() if kind == "phase" or (values.ndim == 3 and not given[n].axes)]
    return (vectors or list(motion.outputs))[0]


def report(
    file: Path,
    /,
    *,
    order: int = 4,
    out: Path | None = None,
    azimuth: float = -60.0,
    elevation: float = 25.0,
    equations: bool = False,
    at: float | None = None,
    reading: MechanismReading = PLAIN_MECHANISM,
    overwrite: bool = False,
) -> int:
    """Write a page to explore a motion in: one HTML file, offline.

    The page has a moving sketch, plots of all outputs and derivatives,
    peak values, parameters, bodies and joints. A file with initial
    conditions is simulated, any other is solved.

    Parameters
    ----------
    file
        Mechanism file: .yaml, .yml, .toml or .json.
    order
        Highest derivative, 0 to 30; 3 is jerk, 4 jounce.
    out
        The page, .html [default: FILE's name.html].
    azimuth
        Azimuth of the viewer of a spatial mechanism, degrees.
    elevation
        Elevation of the viewer, degrees.
    equations
        Add the constraint equations: joints with their numbers in Sommer
        2024, the pattern of the Jacobian, right sides.
    at
        Instant of the equations, s; the nearest is used [the first].
    overwrite
        Let --out replace a file that is read here.

    Examples
    --------
      jounce report examples/four_bar.yaml --out four_bar.html
      jounce report examples/press.yaml --order 3
      jounce report examples/rsur.yaml --equations --at 0.5
    """
    from jounce.plot import check_report, report as write_report

    if at is not None and not equations:
        raise JounceError("goes with --equations", name="--at", value=at)
    out = Path(f"{file.stem}.html") if out is None else out
    check_report(out, overwrite=overwrite)
    mechanism = reading.mechanism(file)
    spare_inputs(out, overwrite=overwrite)
    motion = solve_or_simulate(mechanism, file, order)
    style: dict[str, Any] = {"view": (azimuth, elevation), "source": file, "overwrite": overwrite}
    style |= {"equations": equations, "at": at}
    with errors_about(file):
        written(lambda: write_report(motion, out, **style))
    print_text(f"Written to {out}")
    return outcome(motion, file)
