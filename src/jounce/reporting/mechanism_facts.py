"""What a mechanism file holds, counted and put together: the facts that ``jounce inspect`` prints."""

from __future__ import annotations

import dataclasses
from os import PathLike, fspath
from typing import Any

import numpy as np

from jounce.constraints.base import value_fields
from jounce.dynamics.start import driven
from jounce.errors import JounceError, MobilityError
from jounce.io.files.source import read_source
from jounce.io.files.units import parse_value
from jounce.io.mechanisms.keys import OUTPUTS, output_holder
from jounce.kinematics.assembly import (
    Trial,
    check_assembled,
    check_mobility,
    freely_moving,
    put_together,
    redundant_rows,
    split,
)
from jounce.mechanism import Mechanism, Model, build, time_grid
from jounce.mechanism.masses import body_mass
from jounce.mechanism.system import POSITION_COMPONENTS
from jounce.reporting.summaries import count

__all__ = ["inspected", "unit_of_dimension"]

TOLERANCE = 1e-12
BASES = {"mass": "kg", "length": "m", "angle": "rad", "time": "s", "ampere": "A", "kelvin": "K"}


def inspected(mechanism: Mechanism, path: str | PathLike[str] | None = None) -> dict[str, Any]:
    """Return what there is to know of a mechanism before it moves, as plain data in SI units.

    Parameters
    ----------
    mechanism : Mechanism
        One that cannot be put together is told of too.
    path : optional
        Its file, which says how parameters are written.

    Returns
    -------
    dict
        bodies, joints, drivers, forces, initial, outputs, parameters, time; ``freedom`` with what is counted, and
        ``assembly`` with status, message and instant. ``ok`` is whether a solve or a simulation can start.

    Examples
    --------
    >>> import jounce as jn
    >>> facts = inspected(jn.load("examples/four_bar.yaml"))
    >>> facts["freedom"]["words"]
    '1 degree of freedom, driven by theta'
    >>> [(joint["name"], joint["rows"]) for joint in facts["joints"]]
    [('A', 2), ('D', 2), ('BC', 1)]
    """
    model = build(mechanism)
    instant, time = _time(mechanism)
    state = _State(mechanism, model, instant)
    rows = {name: model.rows.count(name) for name in model.rows}
    return {
        "kind": "mechanism",
        "file": None if path is None else fspath(path),
        "title": mechanism.title,
        "space": mechanism.space,
        "gravity": _numbers(mechanism, mechanism.gravity, POSITION_COMPONENTS[mechanism.space]),
        "parameters": _parameters(mechanism, path),
        "bodies": _bodies(mechanism, model, state.coordinates),
        "joints": [_element("joints", n, x, rows) for n, x in mechanism.joints.items()],
        "drivers": [_element("drivers", n, x, rows) for n, x in mechanism.drivers.items()],
        "forces": [_element("forces", n, x, {}) for n, x in mechanism.forces.items()],
        "initial": [_element("initial", n, x, {}) for n, x in mechanism.initial.items()],
        "outputs": [_output(n, x) for n, x in mechanism.outputs.items()],
        "time": time,
        "freedom": state.freedom,
        "assembly": state.assembly,
        "ok": state.ok,
    }


def _time(mechanism: Mechanism) -> tuple[float, dict[str, Any] | None]:
    if mechanism.time is None:
        return 0.0, None
    instants = time_grid(mechanism.time, mechanism.parameter_values)
    told = {"start": float(instants[0]), "stop": float(instants[-1]), "count": len(instants)}
    return told["start"], told


class _State:
    """The mechanism put together at its first instant, and its degrees of freedom there."""

    def __init__(self, mechanism: Mechanism, model: Model, instant: float):
        self.mechanism, self.model, self.instant = mechanism, model, instant
        self.coordinates, self.assembly = self._assembled()
        self.freedom = self._counted()
        possible = not self.freedom["redundant"] and (self.freedom["left"] == 0 or bool(_masses(mechanism)))
        self.ok = self.assembly["status"] == "assembled" and possible

    def _trial(self, model: Model) -> Trial | None:
        return put_together(model, self.instant, TOLERANCE) if model.rows else None

    def _assembled(self) -> tuple[dict[str, Any] | None, dict[str, Any]]:
        told = {"status": "assembled", "message": None, "at": self.instant, "open": None}
        model = build(driven(self.mechanism)) if self.mechanism.initial else self.model
        trial = self._trial(model)
        if trial is None:
            return model.guess, told
        told["open"] = float(np.max(np.abs(trial.gaps))) if np.isfinite(trial.gaps).all() else None
        try:
            check_assembled(model, trial, self.instant, TOLERANCE)
        except JounceError as error:
            return None, told | {"status": "open", "message": error.message}
        return trial.coordinates, told

    def _counted(self) -> dict[str, Any]:
        mechanism, model = self.mechanism, self.model
        columns = int(model.system.cells.shape[1])
        if self.coordinates is not None:
            model = dataclasses.replace(model, guess=self.coordinates)
        trial = self._trial(model)
        jacobian = np.zeros((0, columns)) if trial is None else trial.jacobian
        finite = bool(np.isfinite(jacobian).all())
        jacobian = jacobian if finite else np.zeros_like(jacobian)
        left, rank, right = split(jacobian) if len(jacobian) else (np.zeros((0, 0)), 0, np.eye(columns))
        drives = np.array([name.startswith("drivers.") for name in model.rows], bool)
        alone = jacobian[~drives]
        freedom = columns - (split(alone)[1] if len(alone) else 0)
        redundant = len(model.rows) - rank
        try:
            if trial is not None and finite:
                check_mobility(model, jacobian)
            message = None
        except MobilityError as error:
            message = error.message
        return {
            "coordinates": columns,
            "equations": len(model.rows),
            "of_drivers": int(drives.sum()),
            "independent": rank,
            "of_joints": freedom,
            "left": columns - rank,
            "redundant": redundant,
            "redundant_among": redundant_rows(model, left[:, rank:]).split(", ") if redundant and finite else [],
            "moving": freely_moving(model, right[rank:]).split(", ") if columns > rank else [],
            "words": _words(freedom, mechanism),
            "message": message,
        }


def _words(freedom: int, mechanism: Mechanism) -> str:
    words = count(freedom, "degree of freedom", "degrees of freedom")
    return f"{words}, driven by {', '.join(mechanism.drivers)}" if mechanism.drivers else words


def _masses(mechanism: Mechanism) -> list[str]:
    return [name for name, body in mechanism.bodies.items() if body.mass is not None]


def _numbers(mechanism: Mechanism, value: Any, size: int) -> list[float] | None:
    from jounce.mechanism.resolve import resolve

    if value is None:
        return None
    return np.reshape(np.asarray(resolve(value, mechanism.parameter_values), float), size).tolist()


def _parameters(mechanism: Mechanism, path: Any) -> list[dict[str, Any]]:
    given = read_source(path).data.get("parameters") or {} if path is not None else mechanism.parameters
    found = []
    for name, value in mechanism.parameter_values.items():
        written = given.get(name)
        try:
            dimension = parse_value(written, "any", mechanism.parameters).dimension
        except JounceError:
            dimension = None
        unit = None if dimension is None else unit_of_dimension(dimension)
        text = written if isinstance(written, str) else None
        found.append({"name": name, "value": float(value), "unit": unit, "written": text})
    order = list(mechanism.parameters)
    return sorted(found, key=lambda entry: order.index(entry["name"]))


def unit_of_dimension(dimension: Any) -> str:
    """Return the SI unit of a dimension.

    Examples
    --------
    >>> unit_of_dimension((("length", 2), ("mass", 1), ("time", -2)))
    'kg*m^2/s^2'
    """
    order = list(BASES)
    powers = sorted(dimension, key=lambda x: order.index(x[0]) if x[0] in order else 99)
    over = [_power(base, power) for base, power in powers if power > 0]
    under = [_power(base, -power) for base, power in powers if power < 0]
    return "*".join(over or ["1"] * bool(under)) + "".join(f"/{unit}" for unit in under)


def _power(base: str, power: int) -> str:
    unit = BASES.get(base, base)
    return unit if power == 1 else f"{unit}^{power}"


def _bodies(mechanism: Mechanism, model: Model, coordinates: dict[str, Any] | None) -> list[dict[str, Any]]:
    components, found = POSITION_COMPONENTS[mechanism.space], []
    attitude = "angle" if components == 2 else "quaternion"
    for k, (name, body) in enumerate(mechanism.bodies.items(), start=1):
        mass, center, inertia = body_mass(name, body, mechanism.parameter_values, components, solid=False)
        given = body.mass is not None
        guess = _pose(model.guess, k, attitude)
        pose = None if coordinates is None else _pose(coordinates, k, attitude)
        found.append({
            "name": name,
            "mass": float(mass) if given else None,
            "center_of_mass": np.asarray(center, float).tolist() if given else None,
            "inertia": np.asarray(inertia, float).tolist() if body.inertia is not None else None,
            "guess": guess,
            "pose": pose,
            "moved": None if pose is None else _moved(guess, pose, attitude),
        })  # fmt: skip
    return found


def _pose(coordinates: dict[str, Any], k: int, attitude: str) -> dict[str, Any]:
    pose = {"position": np.asarray(coordinates["position"])[:, k, 0].tolist()}
    turned = np.asarray(coordinates[attitude])[..., k, 0]
    return pose | {attitude: turned.tolist() if attitude == "quaternion" else float(turned)}


def _moved(guess: dict[str, Any], pose: dict[str, Any], attitude: str) -> dict[str, float]:
    """Return how far a body was moved and turned from its guess."""
    distance = float(np.linalg.norm(np.subtract(pose["position"], guess["position"])))
    if attitude == "angle":
        return {"distance": distance, "angle": abs(pose["angle"] - guess["angle"])}
    first, second = np.array(guess["quaternion"]), np.array(pose["quaternion"])
    second = second / np.linalg.norm(second) * (1.0 if first @ second >= 0 else -1.0)
    return {"distance": distance, "angle": float(4 * np.arcsin(min(1.0, np.linalg.norm(second - first) / 2)))}


def _element(section: str, name: str, element: Any, rows: dict[str, int]) -> dict[str, Any]:
    found: dict[str, Any] = {"name": name, "type": element.type_name or type(element).__name__}
    found["bodies"] = list(element.bodies)
    if section in ("joints", "drivers"):
        found["rows"] = rows.get(f"{section}.{name}", 0)
    fields = value_fields(type(element))
    for key in ("motion", "law"):
        if key in fields:
            found[key] = _law_words(getattr(element, key))
    return found


def _law_words(law: Any) -> str:
    """Word a law: its expression, or what kind it is."""
    if isinstance(law, (list, tuple, np.ndarray)):
        return "[" + ", ".join(map(_law_words, law)) + "]"
    text = getattr(law, "text", None) or getattr(getattr(law, "expression", None), "text", None)
    if text:
        return text
    if hasattr(law, "breakpoints"):
        return f"spline of degree {law.degree} through samples" if hasattr(law, "degree") else "piecewise polynomial"
    return f"{law:.9g}" if isinstance(law, float | int) else str(law) if isinstance(law, str) else type(law).__name__


def _output(name: str, output: Any) -> dict[str, Any]:
    words = [word for word, kind in OUTPUTS if kind is type(output)]
    holder = output_holder(type(output))
    of = list(output.bodies) if holder in ("body", "bodies") else [getattr(output, holder)]
    quantity = (words[-1] if words else type(output).__name__) or "point"
    return {"name": name, "quantity": quantity, "unit": output.unit, "of": of}
