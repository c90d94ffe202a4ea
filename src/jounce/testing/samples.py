"""Random joints of a class, from its fields and facts only, and random motions of the connected bodies."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np

from jounce.base.shapes import Numbers
from jounce.constraints.facts import facts_of, field_kinds, value_fields
from jounce.constraints.friction import Friction, GearFriction, friction_class
from jounce.errors import MechanismError
from jounce.jet import Jet, sqrt, stack
from jounce.mechanism.carriages import carriage_of
from jounce.mechanism.system import POSITION_COMPONENTS, Group, group_elements
from jounce.rigid import PlanarPose, SpatialPose

BODIES = ("ground", "one", "two", "three", "four")
INDEX = {name: k for k, name in enumerate(BODIES)}
CURVES = {  # by the space and the number of parameters; always the same, since random values are numbers
    ("planar", 1): ("0.8*cos(s) + 0.1*s", "0.6*sin(s) - 0.2"),
    ("spatial", 1): ("0.8*cos(s) + 0.1*s", "0.6*sin(s) - 0.2", "0.3*s + 0.1*sin(2*s)"),
    ("spatial", 2): ("0.8*cos(u) + 0.1*v", "0.6*sin(u) - 0.1*v**2", "0.7*v + 0.1*u"),
}
LAW = "0.9 + 0.4*sin(1.3*t + 0.2) + 0.1*t**2"
INSTANT = 0.3

Motion = Mapping[str, np.ndarray]
"""Taylor coefficients of the coordinates of all bodies, the ground first: order, component, body, batch."""


@dataclasses.dataclass(frozen=True)
class Samples:
    """Random joints or drivers of a class.

    Parameters
    ----------
    kind : type
        The class.
    space : str
        ``planar`` or ``spatial``.
    given : mapping, optional
        Values of fields that are not random.
    optional : bool, default False
        Whether optional fields have values, too; an offset always has a value.
    joined : int, optional
        Number of connected bodies, if the class allows several numbers; the first of these numbers unless given.
    """

    kind: type[Any]
    space: str
    given: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    optional: bool = False
    joined: int | None = None

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the connected bodies, all of which move."""
        return BODIES[1 : 1 + self.count]

    @property
    def count(self) -> int:
        """Number of connected bodies."""
        counts: tuple[int, ...] = self.kind.body_counts or (self.kind.body_count,)
        return self.joined or counts[0]

    def element(
        self, random: np.random.Generator, bodies: Sequence[str] = (), values: Mapping[str, Any] | None = None
    ) -> Any:
        """Return a random joint between bodies, with the given `values` of some fields."""
        fixed_values = {**self.given, **(values or {})}
        chosen = {}
        for name, field in value_fields(self.kind).items():
            left_out = field.default is not dataclasses.MISSING and not self.optional and name != "offset"
            if name in fixed_values or not left_out:
                chosen[name] = fixed_values[name] if name in fixed_values else self._value(name, random)
        return self.kind(tuple(bodies) or self.bodies, **chosen)

    def _value(self, name: str, random: np.random.Generator) -> Any:
        kind, facts = field_kinds(self.kind)[name], facts_of(self.kind)
        if kind == "motion":
            return LAW
        if kind == "curve":
            return CURVES[self.space, len(self.kind.hidden)]
        if kind == "vector":
            return random.uniform(0.2, 1.0, POSITION_COMPONENTS[self.space]).tolist()
        if kind == "points":
            return random.uniform(0.2, 1.0, (self.count, POSITION_COMPONENTS[self.space])).tolist()
        if kind == "flag":
            return True
        if kind == "scalar":
            return float(random.uniform(0.5, 1.5)) * (0.5 if facts.signs[name] == "pressure angle" else 1.0)
        if name == "friction" and friction_class(self.kind) is GearFriction:
            return GearFriction(random.uniform(0.1, 0.2), random.uniform(0.6, 0.9), random.uniform(-0.2, 0.5))
        if name == "friction":
            radius = random.uniform(0.01, 0.02) if self.kind.has_friction_radius else None
            return Friction(random.uniform(0.1, 0.3), random.uniform(0.01, 0.02), radius)
        if name in facts.choices:
            return facts.choices[name][0]
        message = f"this field of {self.kind.__qualname__} has no default sample; give a value in `values`"
        raise MechanismError(message, name=name)


def group_of(elements: Sequence[Any], space: str, parameters: Mapping[str, Any] | None = None) -> Group:
    """Return the group of stacked joints of one kind; the last body has their hidden coordinates."""
    elements_by_name = {f"joints.{k}": e for k, e in enumerate(elements)}
    carriage = {carriage_of(str(k)): len(BODIES) - 1 for k in range(len(elements))}
    (group,), _ = group_elements(elements_by_name, parameters or {}, {**INDEX, **carriage}, POSITION_COMPONENTS[space])
    return group


def time_jet(order: int, batch: int = 1) -> Jet:
    """Return the jet of time at the instant of all samples, s."""
    return Jet.variable(jnp.full((1, batch), INSTANT), order)


def random_motion(
    random: np.random.Generator, space: str, order: int, batch: int = 1, degree: int | None = None
) -> dict[str, np.ndarray]:
    """Return coefficients of a random motion of all bodies: polynomials of time, the ground at rest.

    Planar: position (2, bodies, batch) and angle (bodies, batch); spatial: position and a quaternion, not normalized.
    """
    degree = order if degree is None else degree
    count, components = len(BODIES), POSITION_COMPONENTS[space]
    shapes = {"position": (components, count, batch), "angle" if components == 2 else "quaternion": (count, batch)}
    if components == 3:
        shapes["quaternion"] = (4, count, batch)
    motion = {}
    for name, shape in shapes.items():
        series = random.uniform(-1, 1, (degree + 1, *shape)) * 0.5 ** np.arange(degree + 1).reshape(
            -1, *[1] * len(shape)
        )
        series = np.concatenate([series, np.zeros((max(order - degree, 0), *shape))])[: order + 1]
        series[..., 0, :] = 0
        if name == "quaternion":
            series[0, 0] = 1.5 * np.sign(series[0, 0] + 1e-9)
            series[0, 0, 0] = 1.0
        motion[name] = series
    return motion


def pose_of(motion: Mapping[str, Numbers]) -> Any:
    """Return the pose with the given coefficients of position and angle, or position and quaternion."""
    position = Jet(map(jnp.asarray, motion["position"]))
    if "angle" in motion:
        return PlanarPose.from_jets(position, Jet(map(jnp.asarray, motion["angle"])))
    quaternion, rate = unit_quaternion_and_rate([list(c) for c in motion["quaternion"]])
    given = {"position": position, "quaternion": quaternion}
    return SpatialPose.from_coordinates({**given, "angular_velocity": rate} if rate is not None else given)


def unit_quaternion_and_rate(series: Sequence[Sequence[Any]]) -> tuple[Jet, Jet | None]:
    """Return the jets of the normalized quaternion and of the body-fixed angular velocity ``2 conj(p) p'``."""
    q = [Jet([jnp.asarray(level[k]) for level in series]) for k in range(4)]
    length = sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
    p = [x / length for x in q]
    quaternion = stack(p)
    if quaternion.order == 0:
        return quaternion, None
    a, b = p, [x.differentiate() for x in p]
    rate = [
        2.0 * (a[0] * b[1] - a[1] * b[0] - a[2] * b[3] + a[3] * b[2]),
        2.0 * (a[0] * b[2] - a[2] * b[0] - a[3] * b[1] + a[1] * b[3]),
        2.0 * (a[0] * b[3] - a[3] * b[0] - a[1] * b[2] + a[2] * b[1]),
    ]
    return quaternion.dense(), stack(rate).dense()


def coordinates_of(space: str) -> int:
    """Return the number of coordinates of a body: translations and rotations."""
    return 3 if space == "planar" else 6


def directions(space: str) -> np.ndarray:
    """Return a batch of unit steps, one for each coordinate of each moving body: shape (coordinates, bodies, batch)."""
    c, moving = coordinates_of(space), len(BODIES) - 1
    unit_steps = np.eye(c * moving).reshape(moving, c, moving * c)
    return np.concatenate([np.zeros((c, 1, moving * c)), np.swapaxes(unit_steps, 0, 1)], axis=1)


def lanes_of(space: str) -> int:
    """Return the number of lanes for residuals, as differences with respect to all coordinates need.

    Other evaluations are padded to this number, so that they share the compiled operations.
    """
    return 4 * (len(BODIES) - 1) * coordinates_of(space)


def widened(values: np.ndarray, lanes: int) -> np.ndarray:
    """Return an array padded to a number of lanes by repeating the last lane."""
    return np.pad(values, [*[(0, 0)] * (values.ndim - 1), (0, max(lanes - values.shape[-1], 0))], mode="edge")


def repeated(motion: Motion, batch: int) -> dict[str, np.ndarray]:
    """Return the position of a motion, the same in every lane of a batch."""
    return {name: np.repeat(series[:1], batch, axis=-1) for name, series in motion.items()}


def with_unknowns(motion: Motion, unknowns: np.ndarray) -> Any:
    """Return the pose at the position of a motion, with given x[k] = (r[k], phi[k]) or (r[k], w'[k-1] / k).

    The unknowns have the shape (order + 1, c, bodies, batch); those of order zero have no effect.
    """
    start, shifts = repeated(motion, unknowns.shape[-1]), motion["position"].shape[1]
    position = Jet(map(jnp.asarray, [start["position"][0], *unknowns[1:, :shifts]]))
    if "angle" in motion:
        return PlanarPose.from_jets(position, Jet(map(jnp.asarray, [start["angle"][0], *unknowns[1:, 2]])))
    rate = Jet(jnp.asarray(k * x) for k, x in enumerate(unknowns[:, shifts:]) if k)
    quaternion = Jet([jnp.asarray(start["quaternion"][0])])
    return SpatialPose.from_coordinates({"position": position, "quaternion": quaternion, "angular_velocity": rate})


def displaced(motion: Motion, steps: np.ndarray) -> dict[str, np.ndarray]:
    """Return a position after steps (c, bodies, batch): translations, and rotations about body axes."""
    result = repeated(motion, steps.shape[-1])
    shifts = result["position"].shape[1]
    result["position"][0] += steps[:shifts]
    if "angle" in result:
        result["angle"][0] += steps[2]
    else:
        angle = np.linalg.norm(steps[3:], axis=0)
        half = np.concatenate([np.cos(angle / 2)[None], steps[3:] * (0.5 * np.sinc(angle / 2 / np.pi))])
        result["quaternion"][0] = quaternion_product(result["quaternion"][0], half)
    return result


def quaternion_product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the product of quaternions, shape (4, ...)."""
    v = p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:], axis=0)
    return np.concatenate([(p[0] * q[0] - (p[1:] * q[1:]).sum(axis=0))[None], v])


def seen_from_moving_frame(motion: Motion, random: np.random.Generator, order: int) -> dict[str, np.ndarray]:
    """Return the motion after a common rigid motion of all bodies, a random function of time."""
    result = {name: series.copy() for name, series in motion.items()}
    common = random_motion(random, "planar" if "angle" in motion else "spatial", order)
    common = {name: series[..., 1:2, :] for name, series in common.items()}
    frame, local = pose_of(common), Jet(map(jnp.asarray, motion["position"]))
    result["position"] = np.array(frame.point(local).dense().coefficients)
    if "angle" in motion:
        result["angle"] = motion["angle"] + common["angle"]
        return result
    a, b = ([Jet(jnp.asarray(level[k]) for level in s["quaternion"]) for k in range(4)] for s in (common, motion))
    product = stack(
        [
            a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
            a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
            a[0] * b[2] + a[2] * b[0] + a[3] * b[1] - a[1] * b[3],
            a[0] * b[3] + a[3] * b[0] + a[1] * b[2] - a[2] * b[1],
        ]
    )
    result["quaternion"] = np.array(product.dense().coefficients)
    return result
