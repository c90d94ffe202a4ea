"""The command that shows a mechanism or a robot in the browser."""

from __future__ import annotations

from pathlib import Path

from jounce.cli.arguments import check_ending
from jounce.cli.file_kinds import expecting
from jounce.cli.writing import allowed
from jounce.errors import JounceError
from jounce.interrupts import raising
from jounce.reporting.terminal import say


def view(
    file: Path,
    trajectory: Path | None = None,
    /,
    *,
    port: int = 0,
    no_open: bool = False,
    order: int = 4,
    set_: list[str] | None = None,
    import_: list[Path] | None = None,
    allow: list[Path] | None = None,
) -> int:
    """Show a mechanism or a robot in the browser, moving.

    With arrows, paths, plots, forces, and a slider for each parameter.
    The page is served on this machine only, and needs no network. Ctrl-C
    ends it.

    Parameters
    ----------
    file
        Mechanism file, or robot file: .urdf or .xml.
    trajectory
        Of a robot (.csv, .yaml, .toml, .json); it swings without.
    port
        Of this machine; 0 takes one that is free.
    no_open
        Only print the address; do not open the browser.
    order
        Highest derivative of arrows and plots, 0 to 30.
    set_
        NAME=VALUE of a parameter, with a unit; repeatable.
    import_
        Python file with your own joints and forces; repeatable.
    allow
        Folder whose files it may name, besides its own; repeatable.
    """
    from jounce.io.robots.loader import ENDINGS
    from jounce.kinematics.solve import checked_order
    from jounce.viewer import view as show
    from jounce.viewer.local_server import check_installed
    from jounce.viewer.server import MECHANISM_FILES

    check_installed()
    subject: object = file
    try:
        checked_order(order)
        if file.suffix.lower() in MECHANISM_FILES:
            from jounce.cli.mechanisms import loaded

            subject = loaded(file, set_, import_, allow)
        elif set_ or import_:
            raise JounceError("is for mechanism files; a robot has no parameters", name="--set" if set_ else "--import")
        with expecting(file, "mechanism", "robot"):
            check_ending(file, (*MECHANISM_FILES, *ENDINGS))
            page = show(subject, trajectory, port=port, order=order, open_page=not no_open, allow=allowed(allow))
    except JounceError as error:
        if error.name in ("port", "order"):
            error.name = f"--{error.name}"
            raise
        raise error.located(path=file) from None
    say(f"{page.page.recording.title or file.name}: {page.url} (Ctrl-C ends)")
    with raising():
        page.wait()
    return 0
