"""The command that traces a mechanism through the dead points of its driver."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from jounce.cli.options import (
    NO_TABLE,
    PLAIN_MECHANISM,
    MechanismReading,
    TableOutput,
    errors_about,
    options_named,
    spare_inputs,
    written,
)
from jounce.reporting.terminal import print_text, show_table

if TYPE_CHECKING:
    from jounce.kinematics import Curve


def trace(
    file: Path,
    /,
    *,
    driver: str | None = None,
    time: float | None = None,
    order: int = 2,
    points: int = 361,
    length: float = 200.0,
    circuits: bool = False,
    figure: Path | None = None,
    show: Annotated[list[str] | None, Parameter(name="--output", alias="--show")] = None,
    reading: MechanismReading = PLAIN_MECHANISM,
    output: TableOutput = NO_TABLE,
) -> int:
    """Follow a mechanism through dead points: limits, branches, curves.

    The value of one driver becomes an unknown, and the command follows
    the curve of configurations by arc-length continuation until it
    closes or ends. The command lists limit positions, branches and change points.

    Parameters
    ----------
    file
        Mechanism file: .yaml, .yml, .toml or .json.
    driver
        Driver to release, or "time" [default: the only one].
    time
        Instant of the start, s; other drivers stop there [file's first].
    order
        Highest derivative with respect to arc length, 0 to 8.
    points
        Points of the table, evenly spaced in arc length.
    length
        Limit of arc length in both directions, rad or mechanism sizes.
    circuits
        Trace the circuits of all assemblies, not only of the file's.
    figure
        Draw paths of points and outputs: .png, .svg or .pdf.
    show
        Output to draw in the figure; repeatable [all].

    Examples
    --------
      jounce trace examples/four_bar.yaml --set "AB=15 cm"
      jounce trace examples/rspu_slide.yaml --out curve.csv
      jounce trace examples/four_bar.yaml --circuits --figure curve.png
    """
    output.check()
    if figure is not None:
        from jounce.plot import check_figure

        check_figure(figure, overwrite=output.overwrite)
    mechanism = reading.mechanism(file)
    for target in (output.out, figure):
        spare_inputs(target, overwrite=output.overwrite)
    from jounce.kinematics import assemblies, trace as traced

    with errors_about(file), options_named():
        curves = [traced(mechanism, time, driver=driver, order=order, count=points, length=length)]
        if circuits:
            chosen_circuits = assemblies(mechanism, time, driver=curves[0].driver).circuits
            start = curves[0].coordinates_at(0.0)
            curves += [
                x.sampled(order, points) for x in chosen_circuits if not any(c.passes(start) for c in x.connected())
            ]
    return write_curves(curves, file, figure, show, output)


def write_curves(
    curves: list[Curve], file: Path, figure: Path | None, show: list[str] | None, output: TableOutput
) -> int:
    """Print the results for curves, write the first one, draw all, and return the exit status."""
    from jounce.reporting.facts.curve_facts import curve_facts, curve_summary, curve_tables

    facts = [curve_facts(curve) for curve in curves]
    if not output.json:
        for fact in facts:
            print_text(curve_summary(fact, file.name))
            for table in curve_tables(fact):
                show_table(table)
    output.write(lambda: curves[0].dataset)
    if figure is not None:
        _draw(curves, figure, show, file, overwrite=output.overwrite)
    output.tell("trace", lambda: {"file": file, "curves": facts, "written": output.out})
    if figure is not None and not output.json:
        print_text(f"\nWritten to {figure}")
    return 0


def _draw(curves: list[Curve], figure: Path, show: list[str] | None, file: Path, *, overwrite: bool) -> None:
    from jounce.plot import draw_curves, save

    with errors_about(file):
        drawing = draw_curves(curves, show)
        written(lambda: save(drawing, figure, overwrite=overwrite))
