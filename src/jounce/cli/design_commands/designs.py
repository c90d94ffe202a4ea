"""The command that optimizes a design, and writes it to a mechanism file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from jounce.base.activity import Count
from jounce.cli.options import (
    PLAIN_MECHANISM,
    MechanismReading,
    Overwrite,
    allowed,
    print_result,
    spare_inputs,
    written,
)
from jounce.errors import DesignError, JounceError
from jounce.reporting.terminal import print_text, show_table

OPTIONS = tuple("minimize subject_to vary curves starts samples assemblies seed clearance iterations".split())
SPELT = {"minimize": "minimize", "subject_to": "subject-to", "curves": "curve"}


def optimize(
    file: Path,
    /,
    *,
    minimize: Annotated[str, Parameter(allow_leading_hyphen=True)],
    vary: list[str],
    subject_to: Annotated[list[str] | None, Parameter(allow_leading_hyphen=True)] = None,
    curve: list[str] | None = None,
    assemblies: str | None = None,
    starts: int = 8,
    samples: int | None = None,
    seed: int = 0,
    clearance: float = 1e-2,
    iterations: int = 100,
    out: Path | None = None,
    reading: MechanismReading = PLAIN_MECHANISM,
    overwrite: Overwrite = False,
    json: bool = False,
) -> int:
    r"""Find the parameters of a mechanism that minimize an expression.

    Expressions may use peak, maximum, minimum, span, mean, rms and at of
    outputs, their derivatives, and forces: peak(psi, 4) is the largest
    jounce of psi. Peaks include those between instants.

    Parameters
    ----------
    file
        Mechanism file: .yaml, .yml, .toml or .json.
    minimize
        Expression to minimize; a minus sign maximizes: "-span(psi)".
    vary
        NAME=LOW:HIGH of a parameter, with units; repeatable.
    subject_to
        Condition with <=, >= or ==: "span(psi) == 60 deg"; repeatable.
    curve
        NAME=FILE.csv, points for path_error(C, NAME); repeatable.
    assemblies
        Assemblies to try, such as 1,2, or all [the file's].
    starts
        Number of searches; one starts from the file's values.
    samples
        Number of random designs from which other starts are chosen.
    seed
        Seed of these random designs.
    clearance
        Smallest allowed singular value of a design; 0 allows any.
    iterations
        Iterations of a search between changes of its trust region.
    out
        Write the file with the new values; comments and units stay.
    overwrite
        Let --out replace the file that is read.
    json
        Print the result as JSON.

    Examples
    --------
      jounce optimize examples/four_bar.yaml --minimize "peak(psi, 4)" \
        --vary BC=12cm:16cm --out better.yaml
      jounce optimize examples/four_bar.yaml --minimize "peak(psi, 4)" \
        --vary BC=12cm:18cm --vary CD=15cm:25cm \
        --subject-to "span(psi) == 30 deg"
    """
    from jounce.io.files import DATA_FILES
    from jounce.io.files.writing import check_target
    from jounce.io.mechanisms.schema.unit_hints import warn_of_variations
    from jounce.units.assignments import assignments

    if out is not None:
        check_target(out, DATA_FILES, "mechanism file", overwrite=overwrite)
    forms = assignments(vary, "--vary", "a parameter is varied by NAME=LOW:HIGH, such as BC=12cm:16cm")
    bounds = _bounds(forms)
    mechanism = reading.mechanism(file)
    warn_of_variations(mechanism, forms, "--vary")
    curves = {name: _points(name, path) for name, path in assignments(curve or (), "--curve", "as NAME=FILE").items()}
    spare_inputs(out, overwrite=overwrite)
    from jounce.design import optimize
    from jounce.reporting.facts.design_facts import design_facts, design_table, design_words

    with _errors_about(file), Count("optimizing") as bar:
        design = optimize(
            mechanism,
            minimize,
            bounds,
            subject_to or (),
            curves=curves,
            assemblies=_numbers(assemblies),
            starts=starts,
            samples=samples,
            seed=seed,
            clearance=clearance,
            iterations=iterations,
            progress=lambda done, total, _: bar(done, total),
        )
    facts = design_facts(design, file)
    if not json:
        print_text(design_words(facts))
        show_table(design_table(facts))
    if out is not None:
        from jounce.io.mechanisms.revision import write_revised

        varied = {*bounds, *assignments(reading.set_ or (), "--set", "as NAME=VALUE")}
        arguments: Any = (design.mechanism, sorted(varied), file, out)
        written(lambda: write_revised(*arguments, allow=allowed(reading.allow), overwrite=overwrite))
    print_result("optimize", lambda: {**facts, "written": out}, out, json=json)
    return 0 if design.success else 1


def _bounds(given: dict[str, str]) -> dict[str, tuple[Any, Any]]:
    """Return the bounds of parameters, as text with units."""
    bounds = {}
    for name, text in given.items():
        low, colon, high = (part.strip() for part in text.partition(":"))
        if not (low and colon and high) or ":" in high:
            message = "a parameter is varied by NAME=LOW:HIGH, such as BC=12cm:16cm"
            raise JounceError(message, name="--vary", value=f"{name}={text}")
        bounds[name] = low, high
    return bounds


def _points(name: str, path: str) -> Any:
    """Return the points of a file, with their times if it has any."""
    from jounce.io.files.samples import read_points

    try:
        times, points = read_points(path)
    except JounceError as error:
        raise error.located(name=f"--curve {name}") from None
    return points if times is None else (times, points)


def _numbers(text: str | None) -> str | Sequence[int] | None:
    """Return the numbers of assemblies in a text."""
    if text is None or text.strip() == "all":
        return text and text.strip()
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        raise JounceError("must be numbers, such as 1,2, or all", name="--assemblies", value=text) from None


@contextmanager
def _errors_about(file: Path) -> Iterator[None]:
    """Add the option or the file to errors."""
    try:
        yield
    except DesignError as error:
        raise error.located(path=file) from None
    except JounceError as error:
        first, dot, remainder = str(error.name).partition(".")
        if first in OPTIONS:
            error.name = f"--{SPELT.get(first, first)}{' ' if dot else ''}{remainder}"
            raise
        raise error.located(path=file) from None
