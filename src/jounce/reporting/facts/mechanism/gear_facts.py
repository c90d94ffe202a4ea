"""Speed ratios of the gears of a mechanism to each driver, from the Jacobian, and efficiencies of their teeth."""

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from typing_extensions import TypedDict

from jounce.constraints import spatial
from jounce.constraints.facts import facts_of
from jounce.constraints.friction import GearFriction
from jounce.mechanism.building.builder import named_groups
from jounce.mechanism.laws.driver_outputs import is_turning
from jounce.mechanism.resolve import resolve
from jounce.mechanism.transmissions.axis_angles import turned
from jounce.mechanism.transmissions.gear_frames import carriers
from jounce.reporting.facts.mechanism.freedom_facts import StartingState

LARGEST_TEETH = 1000  # largest denominator of ratios shown as fractions
WHOLE = 1e-9
STILL = 1e-12


class TrainFacts(TypedDict):
    """Ratio of the speed of a gear to that of a driver, the other drivers held, also as a fraction if it is one."""

    body: str
    driver: str
    ratio: float
    fraction: str | None


class EfficiencyFacts(TypedDict):
    """Efficiency of gears with friction if the first of two bodies drives the second, and if the second drives the
    first; zero or less if they are self-locking.
    """

    joint: str
    bodies: list[str]
    forward: float
    backward: float


def efficiency_facts(state: StartingState) -> list[dict[str, Any]]:
    """Return the efficiencies of the gears with friction of a mechanism: EfficiencyFacts.

    Parameters
    ----------
    state : StartingState
        Start of the mechanism.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.mechanism import build
    >>> gearhead = jn.load("examples/worm_gearhead.yaml")
    >>> (worm,) = efficiency_facts(StartingState(gearhead, build(gearhead), 0.0))
    >>> worm["joint"], round(worm["forward"], 3), worm["backward"] < 0
    ('mesh', 0.422, True)
    """
    records: list[dict[str, Any]] = []
    for group, members in named_groups(state.model):
        if not isinstance(friction := getattr(group.element, "friction", None), GearFriction):
            continue
        shape = (group.instances, 1)
        forward, backward = (np.broadcast_to(np.asarray(x), shape)[:, 0] for x in friction.efficiencies)
        for k, row in enumerate(members):
            name = row.partition(".")[2]
            bodies = list(state.mechanism.joints[name].bodies[:2])
            if facts_of(type(group.element)).rolls_along:  # the disc is the second body
                bodies = bodies[::-1]
            shares = {"forward": float(forward[k]), "backward": float(backward[k])}
            records.append({"joint": name, "bodies": bodies, **shares})
    return records


def train_facts(state: StartingState) -> list[dict[str, Any]]:
    """Return the speed ratios of all bodies that mesh, have a belt or carry gears, as assembled: TrainFacts.

    In space, a speed is the angular velocity along the axis of a gear, or of a gear that the body carries.

    Parameters
    ----------
    state : StartingState
        Start of the mechanism; the result is empty unless the drivers determine its motion.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.mechanism import build
    >>> train = jn.load("examples/epicyclic.yaml")
    >>> facts = train_facts(StartingState(train, build(train), 0.0))
    >>> [(x["body"], x["driver"], x["fraction"]) for x in facts if x["body"] == "ring"]
    [('ring', 'sun_drive', '-2/5'), ('ring', 'carrier_drive', '7/5')]
    """
    mechanism, model, jacobian = state.mechanism, state.model, state.jacobian
    meshing = _meshing(state)
    if not meshing or jacobian is None or not state.ok or state.freedom["left"]:
        return []
    turning = {name: driver for name, driver in mechanism.drivers.items() if is_turning(driver)}
    facts = []
    scale = np.asarray(model.system.column_scale)
    for body, axes in meshing.items():
        for name in turning:
            rhs = np.zeros(len(model.rows))
            rhs[model.rows.index(f"drivers.{name}")] = -1.0
            step = jacobian.step(rhs)
            if step is None:
                continue
            turns = (step.reshape(-1, len(scale)) * scale)[:, model.pose_type.shifts :]
            speeds = [float(turns[list(mechanism.bodies).index(body)] @ axis) / _unit(state, name) for axis in axes]
            ratio = max(speeds, key=abs)
            if abs(ratio) > STILL:
                facts.append({"body": body, "driver": name, "ratio": ratio, "fraction": _fraction(ratio)})
    return facts


def _meshing(state: StartingState) -> dict[str, list[Any]]:
    """Return the moving bodies that gears and belts turn, or that carry them, with their axes in body frames."""
    mechanism = state.mechanism
    meshing: dict[str, list[Any]] = {}
    for joint in mechanism.joints.values():
        if isinstance(joint, spatial.Gear):
            shafts = [
                _unit_vector([resolve(entry, mechanism.parameter_values) for entry in np.asarray(axis).tolist()])
                for axis in (joint.axis_i, joint.axis_j)
            ]
            meshing |= {body: [axis] for body, axis in zip(joint.bodies, shafts, strict=False)}
            meshing.setdefault(joint.bodies[2], [_seen_from(state, joint.bodies, k, x) for k, x in enumerate(shafts)])
    if mechanism.space == "planar":
        symbols = {name: facts_of(type(joint)).symbol for name, joint in mechanism.joints.items()}
        for name, joint in mechanism.joints.items():
            if symbols[name] in ("gear", "belt") or (symbols[name] == "coordinate" and joint.coordinate == "angle"):
                meshing |= {body: [np.ones(1)] for body in joint.bodies}
        meshing |= {body: [np.ones(1)] for body in carriers(mechanism)}
    return {body: meshing[body] for body in mechanism.bodies if body in meshing}


def _seen_from(state: StartingState, bodies: Sequence[str], slot: int, axis: Any) -> Any:
    """Return an axis on one of the bodies of gears, given by its slot, in the frame of the third body."""
    index = ["ground", *state.mechanism.bodies]
    if state.coordinates is None:
        return axis
    shaft, frame = (np.asarray(state.coordinates["quaternion"])[:, [index.index(bodies[k])], 0] for k in (slot, 2))
    inverse = frame * np.array([[1.0], [-1.0], [-1.0], [-1.0]])
    return turned(inverse, turned(shaft, axis[:, None]))[:, 0]


def _unit_vector(given: Any) -> Any:
    vector = np.array(given, float)
    return vector / np.linalg.norm(vector)


def _unit(state: StartingState, driver: str) -> float:
    """Return the change of a driver for a unit change of its row of the residual."""
    return 1.0 / float(np.asarray(state.row_scale)[state.model.rows.index(f"drivers.{driver}"), 0])


def _fraction(ratio: float) -> str | None:
    fraction = Fraction(ratio).limit_denominator(LARGEST_TEETH)
    return (
        str(fraction)
        if abs(float(fraction) - ratio) <= WHOLE * abs(ratio) and abs(fraction.numerator) <= LARGEST_TEETH
        else None
    )
