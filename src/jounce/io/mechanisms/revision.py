"""A mechanism file with other parameter values, and otherwise unchanged: comments, units, order and spacing."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from decimal import Decimal, localcontext
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from jounce.errors import JounceError, MechanismFileError, OutputError
from jounce.io.files import DATA_FILES
from jounce.io.files.source import read_source
from jounce.io.files.writing import check_target, replacing
from jounce.io.mechanisms.loader import load
from jounce.mechanism import Mechanism
from jounce.units.values import parse_unit, parse_value

ROUNDING = 4e-16  # relative, for units whose size is no decimal number
_NUMBER_AND_UNIT = re.compile(r"\s*([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)(\s*)([^\s0-9.*/+-].*?|/.*?)\s*")
_TIMES_DEG = re.compile(r"\s*[-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?(\s*\*\s*deg)\s*")


def write_revised(
    mechanism: Mechanism,
    names: Iterable[str],
    original: str | PathLike[str],
    path: str | PathLike[str],
    *,
    allow: Iterable[str | PathLike[str]] = (),
    overwrite: bool = False,
) -> None:
    """Write a copy of a mechanism file with the parameter values of a mechanism.

    Nothing else changes, and values keep the units of the file. The new file is read back before it replaces an
    existing one, and must give the same values. Parameters ---------- mechanism : Mechanism
        Mechanism from the file, with other parameter values and possibly another choice of assembly.
    names : iterable of str
        Parameters whose values are written.
    original
        File from which the mechanism was read.
    path
        File to write, of the same format.
    allow
        See `load`.
    overwrite
        Whether the written file may be the original.

    Raises
    ------
    OutputError
        If the file cannot be written, is an input, or has another format; then nothing is written.
    MechanismFileError
        If the written file does not read back as the same mechanism.
    """
    suffix = Path(fspath(path)).suffix.lower()
    check_target(path, DATA_FILES, "mechanism file", overwrite=overwrite)
    kinds = [".yaml" if ending == ".yml" else ending for ending in (suffix, Path(fspath(original)).suffix.lower())]
    if kinds[0] != kinds[1]:
        message = f"must be of the format of {fspath(original)}; jounce convert makes another of it"
        raise OutputError(message, path=fspath(path), value=suffix)
    values = {name: float(mechanism.parameter_values[name]) for name in names}
    data = read_source(original).data
    texts = {name: with_value(data["parameters"][name], value) for name, value in values.items()}
    assembly = mechanism.assembly if mechanism.assembly != data.get("assembly") else None
    text = Path(original).read_bytes().decode("utf-8-sig")
    revised = (_toml if suffix == ".toml" else _with_replaced_scalars)(text, texts, assembly)
    with replacing(path, overwrite=overwrite) as scratch:
        with scratch.open("w", encoding="utf-8", newline="") as stream:
            stream.write(revised)
        try:
            read_back = load(scratch, allow=allow)
        except JounceError as error:
            error.path = fspath(path)
            raise
        read = read_back.parameter_values
        errors = [name for name, value in values.items() if abs(read[name] - value) > ROUNDING * abs(value)]
        if errors or read_back.assembly != mechanism.assembly:
            message = "what would be written does not read back as the same design"
            raise MechanismFileError(
                message, path=fspath(path), name=f"parameters.{errors[0]}" if errors else "assembly"
            )


def with_value(old: Any, value: float) -> Any:
    """Return a value for a file, in the unit of the value that it replaces.

    Parameters
    ----------
    old : object
        Old value: a number, text with a number and a unit, or an expression.
    value : float
        New value in SI units.

    Returns
    -------
    float or str
        Text or number that reads as the value, exactly if the size of the unit is a decimal number.

    Examples
    --------
    >>> with_value("14.23 cm", 0.1375), with_value(0.5, 0.25), with_value("30*deg", 0.5235987755982988)
    ('13.75 cm', 0.25, '30*deg')
    """
    if not isinstance(old, str):
        return value
    if times_deg := _TIMES_DEG.fullmatch(old):
        unit, gap = times_deg[1], ""
        size: Any = math.pi / 180
    elif with_unit := _NUMBER_AND_UNIT.fullmatch(old):
        gap, unit = with_unit[2], with_unit[3]
        try:
            size = parse_unit(unit)[0]
        except JounceError:
            return value
    else:
        return value
    for text in _digits(value, size):
        written = f"{text}{gap}{unit}"
        read = parse_value(written).value
        if isinstance(read, float) and abs(read - value) <= (
            0.0 if isinstance(size, Decimal) else ROUNDING * abs(value)
        ):
            return written
    return value


def _digits(value: float, size: Any) -> Iterator[str]:
    """Yield texts of a value in a unit, with increasing numbers of digits."""
    if isinstance(size, Decimal):
        with localcontext(prec=40):
            exact = Decimal(value) / size
        for count in range(1, 19):
            yield _shortest(f"{exact:.{count}g}")
        return
    quotient = value / float(size)
    for candidate in (quotient, math.nextafter(quotient, math.inf), math.nextafter(quotient, -math.inf)):
        for count in (12, 15, 16, 17):
            yield _shortest(f"{candidate:.{count}g}")


def _shortest(text: str) -> str:
    """Return a number without trailing zeros, and without an exponent if that stays short."""
    number = Decimal(text).normalize()
    return f"{number:f}" if -6 <= number.adjusted() < 18 else f"{number:e}"


def _with_replaced_scalars(text: str, values: Mapping[str, Any], assembly: Any) -> str:
    """Return YAML or JSON text with replaced scalars, and no other change."""
    from ruamel.yaml import YAML
    from ruamel.yaml.nodes import MappingNode

    root = YAML(typ="rt", pure=True).compose(text)
    assert isinstance(root, MappingNode)
    entries = {key.value: node for key, node in root.value}
    nodes = {key.value: node for key, node in entries["parameters"].value}
    splices = [(nodes[name], _scalar(value, nodes[name])) for name, value in values.items()]
    if assembly is not None and "assembly" in entries:
        splices.append((entries["assembly"], str(assembly)))
    for node, new in sorted(splices, key=lambda splice: splice[0].start_mark.index, reverse=True):
        text = text[: node.start_mark.index] + new + text[node.end_mark.index :]
    if assembly is not None and "assembly" not in entries:
        text = _with_assembly(text, assembly, flow=bool(root.flow_style), start=root.start_mark.index)
    return text


def _with_assembly(text: str, assembly: Any, *, flow: bool, start: int) -> str:
    """Return YAML or JSON text with the key `assembly` added at the top level."""
    if flow:
        return f'{text[: start + 1]}"assembly": {assembly}, {text[start + 1 :]}'
    line = "\r\n" if "\r\n" in text else "\n"
    return f"{text[:start]}assembly: {assembly}{line}{text[start:]}"


def _scalar(value: Any, node: Any) -> str:
    """Return a number or a text as YAML or JSON, in the quotes of the replaced node."""
    if not isinstance(value, str):
        return repr(value)
    return f"{node.style}{value}{node.style}" if node.style in ("'", '"') else value


def _toml(text: str, values: Mapping[str, Any], assembly: Any) -> str:
    """Return TOML text with other values, and with its comments."""
    import tomlkit

    document: Any = tomlkit.parse(text)
    for name, value in values.items():
        document["parameters"][name] = value
    if assembly is None:
        return tomlkit.dumps(document)
    if "assembly" in document:
        document["assembly"] = assembly
        return tomlkit.dumps(document)
    return f"assembly = {assembly}\n{tomlkit.dumps(document)}"
