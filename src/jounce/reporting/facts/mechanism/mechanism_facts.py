"""Contents of a mechanism file, counted and assembled, as ``jounce inspect`` and a notebook show them."""

from __future__ import annotations

from fractions import Fraction
from os import PathLike, fspath
from typing import Any, Literal, NotRequired

import numpy as np
from jaxtyping import Float
from typing_extensions import TypedDict

from jounce.constraints import Cam
from jounce.constraints.base import is_bare_ratio, value_fields
from jounce.constraints.planar import Belt
from jounce.dynamics.inverse.outputs.output_words import belt_words, cam_words, ratio_words
from jounce.errors import JounceError
from jounce.io.files.source import read_source
from jounce.io.mechanisms.schema.output_types import OUTPUTS, output_holder
from jounce.kinematics.curves.choice import chosen
from jounce.mechanism import Mechanism, Model, ParameterOutput, build, time_grid, with_output_drivers
from jounce.mechanism.masses import body_mass
from jounce.mechanism.outputs.derivative_outputs import form_of
from jounce.mechanism.resolve import resolved
from jounce.mechanism.system import POSITION_COMPONENTS
from jounce.mechanism.time import last_step_words
from jounce.reporting.facts.mechanism.freedom_facts import AssemblyFacts, FreedomFacts, MobilityFacts, StartingState
from jounce.reporting.facts.mechanism.gear_facts import EfficiencyFacts, TrainFacts, efficiency_facts, train_facts
from jounce.reporting.facts.mechanism.line_facts import LineFacts, line_facts
from jounce.reporting.facts.mechanism.range_facts import RangeFacts
from jounce.reporting.facts.mechanism.screw_facts import ScrewFacts, screw_facts
from jounce.reporting.text.law_facts import LawFacts, law_facts
from jounce.trajectory import OutputMotion, SegmentedMotion
from jounce.units.dimensions import Dimension
from jounce.units.expression import Expression
from jounce.units.values import parse_value

KINDS = ("joints", "drivers", "forces", "initial")
BASES = {"mass": "kg", "length": "m", "angle": "rad", "time": "s", "ampere": "A", "kelvin": "K"}


class ParameterFacts(TypedDict):
    """A parameter: its value in SI units, and as written if that differs."""

    name: str
    value: float
    unit: str | None
    written: str | None


class Pose(TypedDict):
    """Pose of a body: m, rad, Euler parameters."""

    position: list[float]
    angle: NotRequired[float]
    quaternion: NotRequired[list[float]]


class Shift(TypedDict):
    """Displacement of a body from its guess, m and rad."""

    distance: float
    angle: float


class BodyFacts(TypedDict):
    """A body: mass, guessed pose and assembled pose."""

    name: str
    mass: float | None
    center_of_mass: list[float] | None
    inertia: float | list[float] | list[list[float]] | None
    guess: Pose
    pose: Pose | None
    moved: Shift | None


class ElementFacts(TypedDict):
    """A joint, driver, force or initial condition, with its equations and laws."""

    name: str
    type: str
    bodies: list[str]
    rows: NotRequired[int]
    motion: NotRequired[str]
    law: NotRequired[str]


class OutputFacts(TypedDict):
    """An output."""

    name: str
    quantity: str
    unit: str
    of: list[str]


class Grid(TypedDict):
    """Instants of a file, s."""

    start: float
    stop: float
    count: int
    remark: NotRequired[str]  # on a shorter last step


class MechanismFacts(TypedDict):
    """Contents of a mechanism file."""

    kind: Literal["mechanism"]
    title: str
    space: Literal["planar", "spatial"]
    gravity: list[float] | None
    parameters: list[ParameterFacts]
    joints: list[ElementFacts]
    drivers: list[ElementFacts]
    forces: list[ElementFacts]
    initial: list[ElementFacts]
    outputs: list[OutputFacts]
    time: Grid | None


class InspectedMechanism(MechanismFacts):
    """Contents of a mechanism file, and its start; ``ok`` is whether a solve or a simulation can start."""

    file: str | None
    bodies: list[BodyFacts]
    freedom: FreedomFacts
    mobility: MobilityFacts | None
    laws: list[LawFacts]
    assembly: AssemblyFacts
    ok: bool
    trains: list[TrainFacts]
    efficiencies: list[EfficiencyFacts]
    lines: list[LineFacts]
    screws: list[ScrewFacts]
    remarks: list[str]
    range: NotRequired[RangeFacts | None]


def mechanism_facts(mechanism: Mechanism, path: str | PathLike[str] | None = None) -> dict[str, Any]:
    """Return the contents of a mechanism without assembling it: MechanismFacts.

    Parameters
    ----------
    mechanism : Mechanism
    path : optional
        Its file, for the values of parameters as written.
    """
    return {
        "kind": "mechanism",
        "title": mechanism.title,
        "space": mechanism.space,
        "gravity": _gravity(mechanism),
        "parameters": parameter_facts(mechanism, path),
        **{kind: [_element(name, x) for name, x in getattr(mechanism, kind).items()] for kind in KINDS},
        "outputs": [_output(name, x) for name, x in mechanism.outputs.items()],
        "time": _time(mechanism),
    }


def inspected(mechanism: Mechanism, path: str | PathLike[str] | None = None) -> dict[str, Any]:
    """Return the facts of a mechanism before it moves, as plain data in SI units: InspectedMechanism.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism, which need not be assemblable.
    path : optional
        Its file, for the values of parameters as written.

    Examples
    --------
    >>> import jounce as jn
    >>> facts = inspected(jn.load("examples/four_bar.yaml"))
    >>> facts["freedom"]["words"]
    '1 degree of freedom, driven by theta'
    >>> [(joint["name"], joint["rows"]) for joint in facts["joints"]]
    [('A', 2), ('D', 2), ('BC', 1)]
    """
    facts = mechanism_facts(mechanism, path)
    instant = 0.0 if facts["time"] is None else facts["time"]["start"]
    laws = [] if facts["time"] is None else law_facts(mechanism, instant, facts["time"]["stop"])
    mechanism = chosen(with_output_drivers(mechanism), instant)
    model = build(mechanism)
    state = StartingState(mechanism, model, instant)
    for kind in ("joints", "drivers"):
        for element in facts[kind]:
            element["rows"] = model.rows.count(f"{kind}.{element['name']}")
    return facts | {
        "file": None if path is None else fspath(path),
        "bodies": _bodies(mechanism, model, state.coordinates),
        "freedom": state.freedom,
        "mobility": state.mobility(),
        "laws": laws,
        "assembly": state.assembly,
        "ok": state.ok,
        "trains": train_facts(state),
        "efficiencies": efficiency_facts(state),
        "lines": line_facts(state),
        "screws": screw_facts(state),
        "remarks": _remarks(mechanism),
    }


def _remarks(mechanism: Mechanism) -> list[str]:
    """Return the remarks on forces: effects that reactions neglect."""
    if not mechanism.forces and all(body.mass is None for body in mechanism.bodies.values()):
        return []
    joints = mechanism.joints.items()
    gears = ratio_words([name for name, joint in joints if is_bare_ratio(joint)])
    cams = cam_words([name for name, joint in joints if isinstance(joint, Cam)])
    belts = belt_words([name for name, joint in joints if isinstance(joint, Belt)])
    return [phrase for phrase in (gears, cams, belts) if phrase]


def _time(mechanism: Mechanism) -> dict[str, Any] | None:
    if mechanism.time is None:
        return None
    instants = time_grid(mechanism.time, mechanism.parameter_values)
    return grid_facts(instants)


def grid_facts(instants: Float[np.ndarray, " time"]) -> dict[str, Any]:
    """Return instants as plain data, with a remark if necessary.

    Examples
    --------
    >>> grid_facts(np.array([0.0, 0.5, 1.0]))
    {'start': 0.0, 'stop': 1.0, 'count': 3}
    """
    facts = {"start": float(instants[0]), "stop": float(instants[-1]), "count": len(instants)}
    return facts | ({"remark": remark} if (remark := last_step_words(instants)) else {})


def _gravity(mechanism: Mechanism) -> list[float] | None:
    if mechanism.gravity is None:
        return None
    size, values = POSITION_COMPONENTS[mechanism.space], mechanism.parameter_values
    return resolved(mechanism.gravity, "gravity", "vector", size, values).tolist()


def parameter_facts(mechanism: Mechanism, path: str | PathLike[str] | None) -> list[ParameterFacts]:
    """Return the parameters of a mechanism, with the texts of its file if the values are unchanged."""
    given = read_source(path).data.get("parameters") or {} if path is not None else mechanism.parameters
    values, rows = mechanism.parameter_values, {}
    for name, value in values.items():
        formula, uses = given.get(name), mechanism.dimensions.get(name, ())
        text = formula if isinstance(formula, str) else getattr(formula, "text", None)
        dimension = uses[0] if len(uses) == 1 else None  # from the use of the parameter
        try:
            quantity = parse_value(formula, "any", mechanism.parameters)
        except JounceError:
            pass
        else:
            number = quantity.value.evaluate(values) if isinstance(quantity.value, Expression) else quantity.value
            text = text if np.isclose(number, float(value), rtol=1e-12, atol=0.0) else None
            dimension = dimension if quantity.dimension is None else quantity.dimension
        unit = None if dimension is None else unit_of_dimension(dimension)
        rows[name] = ParameterFacts(name=name, value=float(value), unit=unit, written=text)
    return [rows[name] for name in mechanism.parameters]


def unit_of_dimension(dimension: Dimension) -> str:
    """Return the SI unit of a dimension.

    Examples
    --------
    >>> unit_of_dimension((("length", 2), ("mass", 1), ("time", -2)))
    'kg*m^2/s^2'
    """
    order = list(BASES)
    powers = sorted(dimension, key=lambda x: order.index(x[0]) if x[0] in order else 99)
    numerator = [_power(base, power) for base, power in powers if power > 0]
    denominator = [_power(base, -power) for base, power in powers if power < 0]
    return "*".join(numerator or ["1"] * bool(denominator)) + "".join(f"/{unit}" for unit in denominator)


def _power(base: str, power: int | Fraction) -> str:
    unit = BASES.get(base, base)
    return unit if power == 1 else f"{unit}^{power}"


def _bodies(mechanism: Mechanism, model: Model, coordinates: dict[str, Any] | None) -> list[dict[str, Any]]:
    components, rows = POSITION_COMPONENTS[mechanism.space], []
    attitude = "angle" if components == 2 else "quaternion"
    for k, (name, body) in enumerate(mechanism.rigid_bodies.items(), start=1):
        mass, center, inertia = body_mass(name, body, mechanism.parameter_values, components, solid=False)
        given = body.mass is not None
        guess = _pose(model.guess, k, attitude)
        pose = None if coordinates is None else _pose(coordinates, k, attitude)
        rows.append({
            "name": name,
            "mass": float(mass) if given else None,
            "center_of_mass": np.asarray(center, float).tolist() if given else None,
            "inertia": np.asarray(inertia, float).tolist() if body.inertia is not None else None,
            "guess": guess,
            "pose": pose,
            "moved": None if pose is None else _moved(guess, pose, attitude),
        })  # fmt: skip
    return rows


def _pose(coordinates: dict[str, Any], k: int, attitude: str) -> dict[str, Any]:
    pose = {"position": np.asarray(coordinates["position"])[:, k, 0].tolist()}
    rotation = np.asarray(coordinates[attitude])[..., k, 0]
    return pose | {attitude: rotation.tolist() if attitude == "quaternion" else float(rotation)}


def _moved(guess: dict[str, Any], pose: dict[str, Any], attitude: str) -> dict[str, float]:
    """Return the distance and angle of a body from its guess."""
    distance = float(np.linalg.norm(np.subtract(pose["position"], guess["position"])))
    if attitude == "angle":
        return {"distance": distance, "angle": abs(pose["angle"] - guess["angle"])}
    first, second = np.array(guess["quaternion"]), np.array(pose["quaternion"])
    second = second / np.linalg.norm(second) * (1.0 if first @ second >= 0 else -1.0)
    return {"distance": distance, "angle": float(4 * np.arcsin(min(1.0, np.linalg.norm(second - first) / 2)))}


def _element(name: str, element: Any) -> dict[str, Any]:
    facts: dict[str, Any] = {"name": name, "type": element.type_name or type(element).__name__}
    facts["bodies"] = list(element.bodies)
    fields = value_fields(type(element))
    for key in ("motion", "law"):
        if key in fields:
            facts[key] = _law_words(getattr(element, key))
    if isinstance(element, Cam) and element.of:
        facts["motion"] += f" of {element.of}"
    return facts


def _law_words(law: Any) -> str:
    """Return a law in words: its expression, or its kind."""
    if isinstance(law, (list, tuple, np.ndarray)):
        return "[" + ", ".join(map(_law_words, law)) + "]"
    if isinstance(law, OutputMotion):
        return f"with which {law.output} is {_law_words(law.law)}"
    if isinstance(law, SegmentedMotion):
        return f"{len(law.segments)} segments: {', '.join(segment.profile for segment in law.segments)}"
    text = getattr(law, "text", None) or getattr(getattr(law, "expression", None), "text", None)
    if text:
        return text
    if hasattr(law, "breakpoints"):
        return f"spline of degree {law.degree} through samples" if hasattr(law, "degree") else "piecewise polynomial"
    return f"{law:.9g}" if isinstance(law, float | int) else str(law) if isinstance(law, str) else type(law).__name__


def _output(name: str, output: Any) -> dict[str, Any]:
    form = form_of(output)
    names, holder = [word for word, kind in OUTPUTS if kind is form], output_holder(form)
    bodies = list(output.bodies) if form.body_count and not isinstance(output, ParameterOutput) else []  # or a carriage
    holders = bodies or [getattr(output, holder, holder)]  # an energy may be that of the mechanism
    quantity = (names[-1] if names else type(output).__name__) or "point"
    return {"name": name, "quantity": quantity, "unit": output.unit, "of": holders}
