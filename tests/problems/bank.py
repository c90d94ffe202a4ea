"""Random instances of every joint and driver, by its fields alone, and random motions of bodies to put them on."""

import dataclasses

import jax.numpy as jnp
import numpy as np

import jounce as jn
from jounce.constraints import base
from jounce.constraints.base import field_kind, value_fields
from jounce.mechanism.system import POSITION_COMPONENTS, group_elements
from jounce.rigid import PlanarPose, SpatialPose
from tests.problems.own_types import taken_back

BODIES = ("ground", "one", "two", "three", "four")
INDEX = {name: k for k, name in enumerate(BODIES)}
LAW = "0.9 + 0.4*sin(1.3*t + 0.2) + 0.1*t**2"


def users_own_joint():
    """Return a joint as a user writes it: registered by a type of its own, then taken out of the registry again."""
    with taken_back():

        class PointOnParabola(jn.AbstractConstraint, type="point_on_parabola", space="planar", role="joint"):
            point_j: jn.Vector
            curvature: jn.Scalar

            def residual(self, body_i, body_j, time):
                d = body_j.point(self.point_j) - body_i.position
                x, y = (
                    body_i.direction(np.array([1.0, 0.0])[:, None, None]),
                    body_i.direction(np.array([0.0, 1.0])[:, None, None]),
                )
                return y.dot(d) - self.curvature * x.dot(d) ** 2

        return base.catalogue("planar", "joint")["point_on_parabola"]


OWN = users_own_joint()


@dataclasses.dataclass(frozen=True)
class Case:
    """A class of the catalogue, with or without its optional values, and its word where it takes one."""

    kind: type
    space: str
    optional: bool = False
    word: str = ""

    def __str__(self):
        extra = "-".join(x for x in (self.word, "all" if self.optional else "") if x)
        return f"{self.space}-{self.kind.role}-{self.kind.type_name}" + (f"-{extra}" if extra else "")

    def element(self, random, bodies=None, values=None):
        """Return a random instance; `values` replaces some of its values."""
        chosen = {}
        for name, field in value_fields(self.kind).items():
            optional = field.default is not dataclasses.MISSING
            if optional and not self.optional and name != "offset":
                continue
            chosen[name] = self._value(name, field_kind(field), random)
        chosen |= values or {}
        return self.kind(bodies or BODIES[1 : 1 + self.kind.body_count], **chosen)

    def _value(self, name, kind, random):
        if kind == "motion":
            return LAW
        if kind == "vector":
            return random.uniform(0.2, 1.0, POSITION_COMPONENTS[self.space]).tolist()
        return self.word if kind == "text" else float(random.uniform(0.5, 1.5))


def cases():
    """Return every class of the catalogue, in all variants, and a user's own."""
    found = []
    for space in ("planar", "spatial"):
        kinds = [k for role in ("joint", "driver") for k in base.catalogue(space, role).values()]
        kinds = [k for k in kinds if not k.__module__.startswith("jounce.robot")]  # judged with the robots they hold
        for kind in [*kinds, *([OWN] if space == "planar" else [])]:
            fields = value_fields(kind)
            extras = {n for n, f in fields.items() if f.default is None and n != "offset"}
            variants = [(False, ""), (True, "")] if extras else [(False, "")]
            if "coordinate" in fields:
                variants = [(False, "angle"), (True, "angle"), (False, "x"), (True, "y")]
            found += [Case(kind, space, *variant) for variant in variants]
    return found


def group_of(elements, space, parameters=None):
    """Return the one group that elements of one kind are stacked in."""
    named = {f"joints.{k}": e for k, e in enumerate(elements)}
    (group,), _ = group_elements(named, parameters or {}, INDEX, POSITION_COMPONENTS[space])
    return group


def random_motion(random, space, order, batch=1, degree=None):
    """Return coefficients of a random motion of all bodies: polynomials of time, the ground at rest.

    Planar: position (2, bodies, batch) and angle (bodies, batch); spatial: position and a quaternion, not normalised.
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


def pose_of(motion):
    """Return the pose with the given coefficients of position and angle, or position and quaternion."""
    position = jn.Jet(map(jnp.asarray, motion["position"]))
    if "angle" in motion:
        return PlanarPose.from_jets(position, jn.Jet(map(jnp.asarray, motion["angle"])))
    p, rate = unit_quaternion_and_rate([list(c) for c in motion["quaternion"]])
    return SpatialPose.from_coordinates(
        {"position": position, "quaternion": p, "angular_velocity": rate}
        if rate
        else {"position": position, "quaternion": p}
    )


def unit_quaternion_and_rate(series):
    """Return the jets of the normalised quaternion and of the body-fixed angular velocity ``2 conj(p) p'``."""
    q = [jn.Jet([jnp.asarray(level[k]) for level in series]) for k in range(4)]
    length = jn.jet.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
    p = [x / length for x in q]
    whole = jn.jet.stack(p)
    if whole.order == 0:
        return whole, None
    a, b = p, [x.differentiate() for x in p]
    rate = [
        2.0 * (a[0] * b[1] - a[1] * b[0] - a[2] * b[3] + a[3] * b[2]),
        2.0 * (a[0] * b[2] - a[2] * b[0] - a[3] * b[1] + a[1] * b[3]),
        2.0 * (a[0] * b[3] - a[3] * b[0] - a[1] * b[2] + a[2] * b[1]),
    ]
    return whole.dense(), jn.jet.stack(rate).dense()
