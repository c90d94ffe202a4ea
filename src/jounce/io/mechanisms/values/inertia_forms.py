"""Inertia in a mechanism file: moments, a solid with its sizes, or a pseudo-inertia matrix.

Solids and pseudo-inertias are converted to moments as expressions of the parameters, so that these can be changed.
"""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np

from jounce.errors import UNSET, MechanismError, RobotError, show_value, unknown
from jounce.io.mechanisms.values.expressions import (
    ANY_VALUE,
    Checked,
    list_schema,
    object_schema,
    parse,
    problem,
    scalar_schema,
    vector_schema,
    vector_value,
)  # fmt: skip
from jounce.mechanism.resolve import resolve
from jounce.rigid.inertia import ADVICE, Inertia, check_solid
from jounce.rigid.solids import SOLIDS, pseudo_parts, solid_moments
from jounce.trajectory import Expression

AXES = ("x", "y", "z")


def inertia(space: str) -> Any:
    """Return the annotation of the inertia of a body."""
    planar = space == "planar"

    def check(raw: object, info: Any) -> Any:
        if isinstance(raw, dict):
            return _pseudo(raw, 3 if planar else 4, info) if "pseudo" in raw else _solid(raw, info)
        return parse(raw, "inertia", info).value if planar else _tensor(raw, info)

    forms = [*_solid_schemas(), _pseudo_schema(3 if planar else 4)]
    solid = "a solid such as {solid: rod, length: 20 cm}"
    if planar:
        single = scalar_schema("inertia")
        schema = {"description": f"{single['description']}; or {solid}", "anyOf": [*single["anyOf"], *forms]}
    else:
        rows = vector_schema(3, "inertia")
        matrix = list_schema(rows, 3)
        description = f"a list of 3 principal moments, or 3 rows of 3, such as 0.1 kg*m^2; or {solid}"
        schema = {"description": description, "anyOf": [rows, matrix, *forms]}
    return Annotated[Any, Checked(check, schema)]


def _tensor(raw: object, info: Any) -> tuple[Any, ...]:
    if not isinstance(raw, (list, tuple)) or len(raw) != 3:
        raise problem("must be a list of 3 principal moments, or 3 rows of 3")
    if not all(isinstance(row, (list, tuple)) for row in raw):
        return vector_value(raw, 3, "inertia", info)
    rows = tuple(vector_value(row, 3, "inertia", info, index) for index, row in enumerate(raw))
    if any(rows[i][j] != rows[j][i] for i in range(3) for j in range(i)):
        raise problem("a matrix of inertia must be symmetric")
    return rows


def _pseudo(raw: dict[str, Any], size: int, info: Any) -> dict[str, Any]:
    for key in raw:
        if key != "pseudo":
            raise problem(unknown(f"key {show_value(key)}", key, ("pseudo",)), key, value=UNSET)
    matrix = raw["pseudo"]
    if not isinstance(matrix, (list, tuple)) or len(matrix) != size:
        raise problem(f"must be {size} rows of {size}", "pseudo", value=matrix)
    moments = []
    for i, row in enumerate(matrix):
        if not isinstance(row, (list, tuple)) or len(row) != size:
            raise problem(f"must be a row of {size} values", "pseudo", i, value=row)
        kinds = ["inertia" if i < size - 1 else "first moment"] * (size - 1)
        kinds.append("first moment" if i < size - 1 else "mass")
        moments.append(tuple(parse(x, kinds[k], info, "pseudo", i, k).value for k, x in enumerate(row)))
    return {"pseudo": tuple(moments)}


def _solid(raw: dict[str, Any], info: Any) -> dict[str, Any]:
    kind = raw.get("solid")
    if kind is None:
        raise problem("is missing; give solid or pseudo", "solid", value=UNSET)
    if not isinstance(kind, str) or kind not in SOLIDS:
        raise problem(unknown("solid", kind, SOLIDS), "solid", value=kind)
    valid = _solid_keys(kind)
    for key in raw:
        if key not in valid:
            raise problem(unknown(f"key {show_value(key)}", key, valid), key, value=UNSET)
    for key in SOLIDS[kind].sizes:
        if key not in raw:
            raise problem("is missing", key, value=UNSET)
    if raw.get("axis", "x") not in AXES:
        raise problem("must be x, y or z", "axis", value=raw["axis"])
    entries = dict(raw)
    for key, value in raw.items():
        if key == "size":
            entries[key] = vector_value(value, 3, "length", info, key)
        elif key not in ("solid", "axis"):
            entries[key] = parse(value, "density" if key == "density" else "length", info, key).value
    return entries


def _solid_keys(kind: str) -> tuple[str, ...]:
    solid = SOLIDS[kind]
    axis = ("axis",) if solid.axis else ()
    density = () if kind in ("rod", "disc") else ("density",)
    return ("solid", *solid.sizes, *axis, *density)


def _solid_schemas() -> list[dict[str, Any]]:
    schemas = []
    for kind, solid in SOLIDS.items():
        keys: dict[str, Any] = {key: scalar_schema("length") for key in _solid_keys(kind)}
        special = {
            "density": scalar_schema("density"),
            "solid": {"const": kind},
            "axis": {"enum": list(AXES)},
            "size": vector_schema(3, "length"),
        }
        keys |= {key: schema for key, schema in special.items() if key in keys}
        schemas.append(object_schema(keys, ("solid", *solid.sizes)))
    return schemas


def _pseudo_schema(size: int) -> dict[str, Any]:
    text = "[[S, m c], [m c^T, m]] about the origin of the body, with S the integral of rho rho^T dm"
    matrix = list_schema(list_schema({"anyOf": ANY_VALUE}, size), size)
    return object_schema({"pseudo": matrix | {"description": text}})


_SIGNS = {np.add: "+", np.subtract: "-", np.multiply: "*", np.true_divide: "/"}


class _Formula(np.lib.mixins.NDArrayOperatorsMixin):
    """An expression as text, which grows by arithmetic."""

    def __init__(self, text: str):
        self.text = text

    def __array_ufunc__(self, ufunc: np.ufunc, _method: str, *parts: Any) -> _Formula:
        first, second = (part.text if isinstance(part, _Formula) else repr(float(part)) for part in parts)
        return _Formula(f"({first} {_SIGNS[ufunc]} {second})")


def _open(value: Any) -> Any:
    """Return values of a file, in any nesting of lists, ready for arithmetic: expressions become formulas."""
    if isinstance(value, (list, tuple)):
        return [_open(entry) for entry in value]
    return _Formula(f"({value.text})") if isinstance(value, Expression) else value


def _closed(value: Any) -> Any:
    """Return values with expressions in the place of formulas."""
    if isinstance(value, (list, tuple)):
        return tuple(_closed(entry) for entry in value)
    return Expression(value.text) if isinstance(value, _Formula) else value


def expanded(given: dict[str, Any], parameters: dict[str, Any], *, planar: bool) -> dict[str, Any]:
    """Return the mass, the inertia and the center of mass of a body with a solid or a pseudo-inertia.

    Parameters
    ----------
    given : dict
        Keys of a body, as in the file.
    parameters : dict of str to float
        Values with which the sizes are checked.
    planar : bool
        Whether the body is planar; then the moment is that about z.

    Raises
    ------
    JounceError
        If a size is not positive, a mass is missing or given twice, or no rigid body has such moments; the name is the
        key within the body.
    """
    form, mass = given["inertia"], given["mass"]
    if "pseudo" in form:
        if mass is not None or given["center_of_mass"] is not None:
            message = "a pseudo-inertia contains mass and center of mass; do not give them besides"
            raise MechanismError(message, name="pseudo")
        return _from_pseudo(form["pseudo"], parameters, planar=planar)
    words, kind = ("solid", "axis", "density"), form["solid"]
    sizes = {key: value for key, value in form.items() if key not in words}
    density = form.get("density")
    checked = {"mass": mass, "density": density, **sizes}
    values = {key: None if value is None else resolve(value, parameters) for key, value in checked.items()}
    axis = check_solid(kind, form.get("axis", ""), values)
    volume, moments = solid_moments(kind, axis, {key: _open(value) for key, value in sizes.items()})
    mass = _open(mass) if density is None else _open(density) * volume
    products = [mass * moment for moment in moments]
    return {"mass": _closed(mass), "inertia": _closed(products[2] if planar else products)}


def _from_pseudo(matrix: Any, parameters: dict[str, Any], *, planar: bool) -> dict[str, Any]:
    numbers = [[float(resolve(x, parameters)) for x in row] for row in matrix]
    if planar:  # a lamina
        numbers = [[*row[:2], 0.0, row[2]] for row in (*numbers[:2], [0.0] * 3, numbers[2])]
    try:
        fault = Inertia.from_pseudo(numbers, strict=False).fault
    except RobotError as error:
        message = f"its mass {error.message}" if error.name == "mass" else error.message
        raise MechanismError(message, name="pseudo", value=error.value) from None
    if fault:
        raise MechanismError(f"{fault.words}; {ADVICE}", name="pseudo", value=fault.value)
    mass, center, second = pseudo_parts(_open(matrix))
    trace = second[0][0] + second[1][1] if planar else second[0][0] + second[1][1] + second[2][2]
    tensor = trace if planar else [[(trace if i == k else 0.0) - second[i][k] for k in range(3)] for i in range(3)]
    return {"mass": _closed(mass), "inertia": _closed(tensor), "center_of_mass": _closed(center)}
