"""The command for the spread of outputs by deviations of parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from jounce.base.activity import Count
from jounce.cli.options import (
    NO_TABLE,
    PLAIN_MECHANISM,
    MechanismReading,
    TableOutput,
    errors_about,
    spare_inputs,
    written,
)
from jounce.reporting.terminal import print_text, show_table


def tolerance(
    file: Path,
    /,
    *,
    vary: list[str],
    of: Annotated[str | None, Parameter(name="--output", alias="--of")] = None,
    order: int = 4,
    samples: int = 1024,
    no_linear: bool = False,
    indices: bool = False,
    figure: Path | None = None,
    reading: MechanismReading = PLAIN_MECHANISM,
    output: TableOutput = NO_TABLE,
) -> int:
    r"""Compute the spread of outputs under deviations of parameters.

    The spread is found to first order by exact gradients, and by Monte
    Carlo on a Sobol sequence. The command prints each column at the
    instant of its largest spread, with the parameters that cause it.

    Parameters
    ----------
    file
        Mechanism file: .yaml, .yml, .toml or .json.
    vary
        NAME=normal:SIGMA, NAME=uniform:HALFWIDTH or NAME=LOW:HIGH, with
        units; repeatable.
    of
        Outputs, components, derivatives: C_x,psi_d3 [all].
    order
        Highest derivative, unless --output gives it.
    samples
        Number of designs to solve; 0 for gradients alone.
    no_linear
        Omit the gradients.
    indices
        Compute Sobol indices of the peaks with SALib.
    figure
        Draw the bands of outputs: .png, .svg or .pdf.

    Examples
    --------
      jounce tolerance examples/four_bar.yaml --vary BC=normal:0.1mm \
        --vary CD=normal:0.1mm --output C_x,psi_d3 --figure bands.png
      jounce tolerance examples/four_bar.yaml --vary AB=uniform:0.2mm \
        --samples 0 --out spread.csv
    """
    from jounce.design.tolerances.spread import column_of, tolerance as spread_of
    from jounce.design.tolerances.variations import named_forms
    from jounce.io.mechanisms.schema.unit_hints import warn_of_variations
    from jounce.reporting.facts.spread_facts import columns_of, index_table, spread_facts, spread_summary, spread_table

    output.check()
    forms = named_forms(vary)
    if figure is not None:
        from jounce.plot import check_figure

        check_figure(figure, overwrite=output.overwrite)
    mechanism = reading.mechanism(file)
    warn_of_variations(mechanism, forms, "--vary")
    for target in (output.out, figure):
        spare_inputs(target, overwrite=output.overwrite)
    names = None if of is None else [name.strip() for name in of.split(",") if name.strip()]
    with errors_about(file), Count("solving", "designs") as bar:
        selection = None if names is None else [column_of(mechanism, name) for name in names]
        settings = {"of": names, "samples": samples, "linear": not no_linear, "indices": indices, "progress": bar}
        spread = spread_of(mechanism, forms, order=order, **settings)
    columns = columns_of(spread, selection)
    facts = spread_facts(spread, columns)
    if not output.json:
        print_text(spread_summary(facts, file.name, samples))
        show_table(spread_table(facts))
        if indices:
            show_table(index_table(facts))
    output.write(lambda: spread)
    if figure is not None:
        from jounce.plot import draw_bands, save

        written(lambda: save(draw_bands(spread, columns), figure, overwrite=output.overwrite))
    output.tell("tolerance", lambda: {"file": file, "samples": samples, **facts, "written": output.out})
    if figure is not None and not output.json:
        print_text(f"\nWritten to {figure}")
    return 0
