"""The command for plate cams: from the law of a follower to the profile."""

from __future__ import annotations

from pathlib import Path

from jounce.cli.file_kinds import explaining_other_kinds
from jounce.cli.options import (
    NO_TABLE,
    PLAIN,
    Heading,
    TableOutput,
    allowed,
    errors_about,
    spare_inputs,
    units_chosen,
    written,
)
from jounce.reporting.terminal import print_text


def cam(
    file: Path,
    /,
    *,
    count: int | None = None,
    figure: Path | None = None,
    set_: list[str] | None = None,
    allow: list[Path] | None = None,
    units: list[str] | None = None,
    heading: Heading = PLAIN,
    output: TableOutput = NO_TABLE,
) -> int:
    r"""Find the profile of a plate cam, and whether it is undercut.

    The command prints the largest pressure angle, the smallest radii of
    curvature and the width of a flat face, with their cam angles, the
    smoothness of the law, and the parts of it that are lost to undercut.

    The exit status is 1 if the cam is undercut.

    Parameters
    ----------
    file
        Cam file: .yaml, .yml, .toml or .json.
    count
        Points of the table per turn, including both ends [file's].
    figure
        Draw the cam: .png, .svg or .pdf.
    set_
        NAME=VALUE of a parameter, with a unit; repeatable.
    allow
        Another folder from which the file may read others; repeatable.
    units
        Units of all results, such as angle=deg,length=mm; repeatable.

    Examples
    --------
      jounce cam examples/cams/intake.yaml --out cam.csv
      jounce cam examples/cams/intake.yaml --figure cam.png \
        --set "lift=12 mm" --units length=mm,angle=deg
    """
    from jounce.io import in_units, load_cam
    from jounce.reporting.facts.cam_facts import cam_facts, cam_words

    output.check()
    unit_choice = heading.units
    if figure is not None:
        from jounce.plot import check_figure

        check_figure(figure, overwrite=output.overwrite)
    with explaining_other_kinds(file, "cam"):
        profile = load_cam(file, allow=allowed(allow), set_=set_ or (), count=count)
    for target in (output.out, figure):
        spare_inputs(target, overwrite=output.overwrite)
    shown_units = units_chosen(profile.shown_units, units)
    with errors_about(file):
        facts = cam_facts(profile)
    if not output.json:
        print_text(cam_words(facts, shown_units))
    output.write(lambda: in_units(profile.dataset, shown_units), header_units=unit_choice)
    if figure is not None:
        from jounce.plot import draw_cam, save

        drawing = draw_cam(profile, shown_units)
        written(lambda: save(drawing, figure, overwrite=output.overwrite))
    output.tell("cam", lambda: {"file": file, **facts, "written": output.out})
    if figure is not None and not output.json:
        print_text(f"\nWritten to {figure}")
    return 1 if facts["undercut"] else 0
