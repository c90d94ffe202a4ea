"""Values of parameters that replace those of a mechanism file, given as ``NAME=VALUE`` with units."""

from __future__ import annotations

from collections.abc import Iterable

from jounce.errors import JounceError, MechanismError, check_name
from jounce.io.mechanisms.schema.unit_hints import is_plain, warn_of_values
from jounce.mechanism import Mechanism, TimeGrid
from jounce.mechanism.time import instants_of
from jounce.units.assignments import assignments
from jounce.units.values import parse_value


def times_chosen(mechanism: Mechanism, text: str) -> TimeGrid:
    """Return the time grid of a text ``START:STOP:COUNT``, with times as in a file.

    Raises
    ------
    MechanismError, UnitError, ExpressionError
        If the text has another form, or the grid is invalid.

    Examples
    --------
    >>> import jounce as jn
    >>> times_chosen(jn.load("examples/four_bar.yaml"), "0:tau:201")  # a parameter of the file
    TimeGrid(start=0.0, stop=Expression('tau'), step=None, count=201.0)
    """
    parts = text.split(":")
    if len(parts) != 3:
        raise MechanismError("must be START:STOP:COUNT, such as 0:2s:201", name="--times", value=text)
    try:
        known = {name: allowed[0] for name, allowed in mechanism.dimensions.items() if len(allowed) == 1}
        kinds = "time", "time", "ratio"
        values = [parse_value(x, kind, mechanism.parameters, known).value for x, kind in zip(parts, kinds, strict=True)]
        grid = TimeGrid(*values[:2], count=values[2])
        instants_of(grid, mechanism.parameter_values)
    except JounceError as error:
        raise type(error)(error.message, name="--times", value=text) from None
    return grid


def override(mechanism: Mechanism, texts: Iterable[str]) -> Mechanism:
    """Return a mechanism with other values of some parameters.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism from `load`, which knows the dimensions of the parameters.
    texts : iterable of str
        Texts ``NAME=VALUE``, with values as in a file: a number in SI units, a number with a unit, or an expression of
        the other parameters.

    Raises
    ------
    MechanismError, UnitError, ExpressionError
        If a name is not a parameter, or a value does not suit the parameter.

    Warns
    -----
    UnitWarning
        If a number without a unit is likely in degrees or millimeters.

    Examples
    --------
    >>> import jounce as jn
    >>> override(jn.load("examples/four_bar.yaml"), ["BC=15 cm"]).parameters["BC"]
    0.15
    """
    values = assignments(texts, "--set", "a parameter is set by NAME=VALUE, such as 'BC=15 cm'", MechanismError)
    for name in values:
        check_name("parameter", name, mechanism.parameters, MechanismError, name="--set")
    try:
        result = mechanism.with_parameters(**values) if values else mechanism
    except JounceError as error:
        name = (error.name or "").removeprefix("parameters.")
        raise type(error)(error.message, name=f"--set {name}", value=error.value) from None
    result.parameter_values  # noqa: B018 - evaluated to report circular expressions now
    unitless = [name for name, text in values.items() if is_plain(text)]
    if unitless:
        warn_of_values(mechanism, result, unitless, "--set")
    return result
