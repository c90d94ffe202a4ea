"""The command that shows a moving mechanism or robot in the browser."""

from __future__ import annotations

from pathlib import Path

from jounce.base.interrupts import raising
from jounce.cli.arguments import check_ending
from jounce.cli.file_kinds import explaining_other_kinds, kind_of
from jounce.cli.options import PLAIN_MECHANISM, MechanismReading, allowed, errors_about
from jounce.errors import JounceError
from jounce.io.files import DATA_FILES, ROBOT_FILES
from jounce.reporting.terminal import print_text


def view(
    file: Path,
    trajectory: Path | None = None,
    /,
    *,
    port: int = 0,
    no_open: bool = False,
    order: int = 4,
    modes: bool = False,
    without: list[str] | None = None,
    hold: list[str] | None = None,
    reading: MechanismReading = PLAIN_MECHANISM,
) -> int:
    r"""Show a mechanism or a robot in the browser, moving.

    The page has arrows, paths, plots, forces, and a slider for each
    parameter. It is served on this machine only, and needs no network.
    Ctrl-C ends the command.

    Parameters
    ----------
    file
        Mechanism or cam file, or robot file: .urdf, .xml or .sdf.
    trajectory
        Motion of a robot (.csv, .yaml, ...) [default: it swings].
    port
        Port of this machine; 0 chooses a free one.
    no_open
        Only print the address; do not open the browser.
    order
        Highest derivative of arrows and plots, 0 to 30.
    modes
        Show the modes about its equilibrium instead of its motion.
    without
        Driver to omit from the equilibrium; repeatable.
    hold
        Joint of a robot to lock there, or all; repeatable.

    Examples
    --------
      jounce view examples/four_bar.yaml
      jounce view examples/press.yaml --order 6 --set "stroke=80 mm"
      jounce view examples/sprung_four_bar.yaml --modes
      jounce view examples/robots/panda.urdf \
        examples/trajectories/panda_wave.yaml --port 8080 --no-open
    """
    from jounce.kinematics.position_analysis.solve import checked_order
    from jounce.viewer import view as show
    from jounce.viewer.page.local_server import check_installed

    check_installed()
    subject: object = file
    with errors_about(file):
        checked_order(order)
        if file.suffix.lower() in DATA_FILES:
            subject = _cam(file, reading) if kind_of(file) == "cam" else reading.mechanism(file)
        elif reading.units:
            raise JounceError("is for mechanism files; results for robots are in SI units", name="--units")
        elif reading.set_ or reading.import_:
            option = "--set" if reading.set_ else "--import"
            raise JounceError("is for mechanism files; a robot has no parameters", name=option)
        if file.suffix.lower() not in DATA_FILES:
            reading.refuse_times(file)
        with explaining_other_kinds(file, "mechanism", "robot", "cam"):
            check_ending(file, (*DATA_FILES, *ROBOT_FILES))
            folders = allowed(reading.allow)
            for name, given in (("--without", without), ("--hold", hold)):
                if given and not modes:
                    raise JounceError("goes with --modes", name=name)
            opened = {"port": port, "order": order, "open_page": not no_open, "allow": folders}
            held_joints = "all" if hold == ["all"] else hold or ()
            page = show(subject, trajectory, modes=modes, without=without or (), hold=held_joints, **opened)
    print_text(f"{page.page.recording.title or file.name}: {page.url} (Ctrl-C ends)")
    with raising():
        page.wait()
    return 0


def _cam(file: Path, reading: MechanismReading) -> object:
    """Return the plate cam of a file."""
    from jounce.io import load_cam

    if reading.import_ or reading.units:
        raise JounceError("is for mechanism files", name="--import" if reading.import_ else "--units")
    reading.refuse_times(file)
    return load_cam(file, allow=allowed(reading.allow), set_=reading.set_ or ())
