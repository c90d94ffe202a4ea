"""The base of joints and drivers: named values on two or three bodies, and one residual on jets."""

import abc
import dataclasses
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Annotated, Any, ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Bool

from jounce.base.modules import Module, as_names, field
from jounce.base.shapes import Numbers
from jounce.constraints.facts import (
    USUAL_DIMENSIONS,
    USUAL_SIGNS,
    facts_of,
    field_kind as field_kind,
    field_kinds as field_kinds,
    value_fields as value_fields,
)
from jounce.errors import MechanismError, ReplacedTypeWarning, check_choice, warn_caller
from jounce.jet import Jet, concatenate

Scalar = Annotated[Any, "scalar"]
Vector = Annotated[Any, "vector"]
MotionLaw = Annotated[Any, "motion"]
Wrenches = Annotated[Any, "wrenches"]
Whole = Annotated[int, "whole"]
Flag = Annotated[bool, "flag"]
Points = Annotated[Any, "points"]  # one point on each body
Nested = Annotated[Any, "nested"]  # an element within another
Curve = Annotated[Any, "curve"]
Part = Annotated[Any, "part"]  # another joint or driver as a part

SPACES = ("planar", "spatial")
ROLES = ("joint", "driver", "force")
RESERVED_KEYS = ("bodies", "type")  # keys of every element in a file
_REGISTRY: dict[tuple[str, str], dict[str, tuple[type[Any], ...]]] = {}  # the last class that was fully defined counts


def register(kind: type[Any], type: str, space: str, role: str) -> None:  # noqa: A002
    """Register a class under its type for mechanism files; a class without a space serves both.

    Raises
    ------
    MechanismError
        If another class of a user has this type, as files would silently get the new one; or if a field has a name that
        files reserve. A class defined again, as in a notebook cell that is run again, replaces its former definition
        once it is complete.

    Warns
    -----
    ReplacedTypeWarning
        If a class of this package has this type: files name the new class by it from then on, so that programs written
        before the package had this type work as before.
    """
    check_choice("role", role, ROLES, MechanismError)
    if space:
        check_choice("space", space, SPACES, MechanismError)
    for name in vars(kind).get("__annotations__", {}):
        if name in RESERVED_KEYS:
            message = (
                f"no field of {kind.__qualname__} may have this name, which files use for something else; rename it"
            )
            raise MechanismError(message, name="field", value=name)
    catalogues = [_REGISTRY.setdefault((key, role), {}) for key in ((space,) if space else SPACES)]
    for entries in catalogues:
        other = _last_whole(entries.get(type, ()))
        is_own = other is not None and _belongs_to_package(other)
        if other is None or (not is_own and _full_name(other) == _full_name(kind)):
            continue
        name = f"{other.__module__}.{other.__qualname__}"
        if not is_own or _belongs_to_package(kind):
            message = f"the {role} type of {kind.__qualname__} is that of {name} already; give it another one"
            raise MechanismError(message, name="type", value=type)
        message = f"type {type!r} names {kind.__qualname__} in files now, no longer {name}; another type keeps both"
        warn_caller(ReplacedTypeWarning(message))
    kind.type_name, kind.space, kind.role = type, space, role
    for entries in catalogues:
        before = _last_whole(entries.get(type, ()))
        entries[type] = (kind,) if before is None else (before, kind)


class AbstractConstraint(Module):
    """A joint or driver: one residual, written on the jets of its bodies, that vanishes when it holds.

    A subclass lists its values as fields and defines `residual`. Jacobian, right-hand sides of every order, forces and
    files follow. Fields are annotated `Scalar`, `Vector`, `MotionLaw` or ``str``; the fields ``point_i`` and
    ``point_j`` become the key ``points`` of a mechanism file, likewise vectors, axes and normals. With a `type`, the
    subclass can be used in files by that name. The class states other facts of the joint in class variables, which
    subclasses inherit; `jounce.testing.check_joint` checks them.

    Parameters
    ----------
    bodies : tuple of str
        Names of the bodies i, j (and m), including ``"ground"`` if one is fixed.

    Attributes
    ----------
    dimensions : mapping of str to str
        Class variable: dimensions of fields, ``length``, ``angle``, ``ratio``, ``mass`` and so on; ``direction`` for a
        vector of any unit; ``of coordinate`` or ``per angle`` if it depends on the field ``coordinate``; ``any``. An
        entry ``axis`` is for ``axis_i`` and ``axis_j``. By default, points and fields named length, radius and lead are
        lengths; vectors, axes and normals are directions.
    signs : mapping of str to str
        Class variable: ``positive``, ``not negative``, ``not zero`` (for a vector, nonzero length) or ``any``, by
        field. By default, fields named length and radius must be positive; lead, vectors, axes and normals must not be
        zero.
    choices : mapping of str to tuple of str
        Class variable: the permitted words of fields annotated ``str``.
    held_parallel : tuple of tuple of str
        Class variable: pairs of fields, of the first and the second body, whose directions the joint holds parallel.
        The residual of such a joint also vanishes with a part turned over, which assembly avoids.
    never_parallel : tuple of tuple of str
        Class variable: pairs of fields of one body, the first of which must not be parallel to the second.
    squared_distance : str
        Class variable: the field, a value or a law, whose square the residual subtracts from a squared distance.
    point_distance : str
        Class variable: the distance at which the joint holds ``point_i`` and ``point_j``: ``zero``, or the field of the
        distance. A `pair` implies it.
    rolls_along : tuple of str
        Class variable, for a disc that rolls on the first body: fields of the direction of its line, and in space of
        the axis of the disc, whose center ``point_j`` lies ``radius`` to the right of the line through ``point_i``.
    symbol : str
        Class variable: what plots and the viewer draw, one of `jounce.constraints.facts.symbols`, with the same fields
        as the joint of the library with that symbol; ``none`` for nothing, empty for a mark at each point.
    pair : str
        Class variable: ``revolute``, ``rod`` or ``prismatic`` if the planar joint is equivalent to it, with the fields
        of that joint of the library. Linkages are recognized by it.

    Raises
    ------
    MechanismError
        If the number of bodies is wrong or a body is joined with itself; if a text field has a word that is not
        permitted; or if its class states an impossible fact.
    """

    bodies: tuple[str, ...] = field(static=True, converter=as_names)

    space: ClassVar[str] = ""
    role: ClassVar[str] = ""
    type_name: ClassVar[str] = ""
    body_count: ClassVar[int] = 2
    body_counts: ClassVar[Sequence[int]] = ()  # permitted numbers of bodies, if several
    may_repeat: ClassVar[bool] = False  # whether a body may be named more than once
    hidden: ClassVar[tuple[str, ...]] = ()  # additional coordinates, which a carriage holds
    periodic: ClassVar[bool] = False  # whether the residual is periodic in whole turns, which the law must not skip
    nonholonomic: ClassVar[bool] = False  # whether some rows constrain velocities that follow from no positions
    parts: ClassVar[Mapping[str, Mapping[str, str]]] = MappingProxyType({})  # nested keys in files, with their fields
    separable: ClassVar[bool] = False  # whether `residual` is a function of bodies minus one of the law
    has_friction_radius: ClassVar[bool] = False  # whether its surfaces rotate on each other
    dimensions: ClassVar[Mapping[str, str]] = USUAL_DIMENSIONS
    signs: ClassVar[Mapping[str, str]] = USUAL_SIGNS
    choices: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType({})
    held_parallel: ClassVar[tuple[tuple[str, str], ...]] = ()
    never_parallel: ClassVar[tuple[tuple[str, str], ...]] = ()
    squared_distance: ClassVar[str] = ""
    point_distance: ClassVar[str] = ""
    rolls_along: ClassVar[tuple[str, ...]] = ()
    symbol: ClassVar[str] = ""
    pair: ClassVar[str] = ""

    def __init_subclass__(cls, type: str = "", space: str = "", role: str = "joint", **keywords: Any):  # noqa: A002
        super().__init_subclass__(**keywords)
        keep_words_static(cls)
        check_choice("role", role, ("joint", "driver"), MechanismError)
        if type:
            register(cls, type, space, role)
            return
        if space:
            check_choice("space", space, SPACES, MechanismError)
            cls.space = space
        if role == "driver" or not cls.role:
            cls.role = role

    def __check_init__(self):
        check_bodies(self, self.body_counts or (self.body_count,))
        check_words(self)

    @abc.abstractmethod
    def residual(self, *bodies_and_time: Any, **_: Any) -> Jet:  # with both, type checkers accept named parameters
        """Return the jet that vanishes when the joint holds: ``residual(self, body_i, body_j, time)``.

        Bodies are poses (`PlanarPose` or `SpatialPose`), `time` is a jet in s. The result has the shape of one row,
        (...), or of several, (rows, ...), joined by `rows`.
        """

    def variation(self, bodies: tuple[Any, ...], changes: tuple[Any, ...], time: Jet) -> Jet:
        """Return the variation of the residual by displacements of the bodies, in which it is linear.

        It follows from the residual, unless some rows constrain velocities; it then has these rows, applied to the
        displacements.

        Parameters
        ----------
        bodies : tuple of PlanarPose or SpatialPose
            Poses of the bodies.
        changes : tuple of PlanarPose or SpatialPose or None
            Variations from ``varied``; None for a body that is not displaced.
        time : Jet
            Time, s.
        """
        varied = [k for k, change in enumerate(changes) if change is not None]

        def residual(*poses: Any) -> Jet:
            displaced = list(bodies)
            for k, pose in zip(varied, poses, strict=True):
                displaced[k] = pose
            return self.residual(*displaced, time)

        return jax.jvp(residual, tuple(bodies[k] for k in varied), tuple(changes[k] for k in varied))[1]

    def admissible(self, time: Jet) -> Bool[Numbers, "..."]:
        """Return the instants at which the motion law, if any, has a permitted value; any finite value by default."""
        motion = getattr(self, "motion", None)
        if motion is None:
            return jnp.ones_like(time.coefficients[0], dtype=bool)
        return jnp.isfinite(motion(time.truncate(0)).coefficients[0])


def catalogue(space: str, role: str) -> dict[str, type[Any]]:
    """Return the classes that files may name by type: `space` planar or spatial, `role` joint, driver or force.

    Examples
    --------
    >>> from jounce.constraints import catalogue
    >>> sorted(catalogue("planar", "driver"))
    ['coordinate', 'distance', 'slide']
    """
    kinds_by_name = {name: _last_whole(kinds) for name, kinds in _REGISTRY.get((space, role), {}).items()}
    return {name: kind for name, kind in kinds_by_name.items() if kind is not None}


def _last_whole(kinds: tuple[type[Any], ...]) -> type[Any] | None:
    """Return the last completely defined class; the definition of others failed, as their fields are out of order.

    A class is registered before its fields are defined; `__match_args__`, the last attribute of a dataclass, marks it
    as complete.
    """
    return next((kind for kind in reversed(kinds) if "__match_args__" in vars(kind)), None)


def _full_name(kind: type[Any]) -> tuple[str, str]:
    return kind.__module__, kind.__qualname__


def _belongs_to_package(kind: type[Any]) -> bool:
    """Return whether a class belongs to this package, by the name of its module."""
    return kind.__module__.partition(".")[0] == __name__.partition(".")[0]


def is_bare_ratio(element: AbstractConstraint) -> bool:
    """Return whether a joint couples moving bodies by a ratio only, without the point of contact of its teeth."""
    fields = value_fields(type(element))
    given = "ratio" in fields and getattr(element, "ratio", None) is not None and element.role != "driver"
    has_points = any(getattr(element, name) is not None for name in fields if name.startswith("point"))
    return given and len({*element.bodies} - {"ground"}) > 1 and not has_points


def counted(counts: Sequence[int]) -> str:
    """Return the permitted numbers in words.

    Examples
    --------
    >>> counted((2, 3)), counted(range(2, 101))
    ('2 or 3', '2 to 100')
    """
    return f"{counts[0]} to {counts[-1]}" if isinstance(counts, range) else " or ".join(map(str, counts))


def check_bodies(element: Any, counts: Sequence[int], does: str = "joins", must: str = "join") -> None:
    """Raise MechanismError unless a joint, driver, force or output has the required number of different bodies."""
    name = getattr(element, "type_name", "") or type(element).__name__
    if len(element.bodies) not in counts:
        message = f"{name} {does} {counted(counts)} {'body' if counts == (1,) else 'bodies'}"
        if not _belongs_to_package(type(element)):
            message += ", as its class says by body_count"
        raise MechanismError(message, name="bodies", value=list(element.bodies))
    if len(set(element.bodies)) != len(element.bodies) and not getattr(element, "may_repeat", False):
        message = f"{name} must {must} different bodies, not a body with itself"
        raise MechanismError(message, name="bodies", value=list(element.bodies))


def keep_words_static(kind: type[Any]) -> None:
    """Make text fields of a class static for JAX, before it becomes a dataclass."""
    for name, annotation in vars(kind).get("__annotations__", {}).items():
        default = vars(kind).get(name, dataclasses.MISSING)
        if annotation in (str, "str") and not isinstance(default, dataclasses.Field):
            setattr(kind, name, field(static=True, default=default))


def check_words(element: Any) -> None:
    """Raise MechanismError unless text fields have permitted words, and the facts of the class are possible."""
    for name, choices in facts_of(type(element)).choices.items():
        check_choice(name, getattr(element, name), choices, MechanismError)


def rows(*parts: Jet) -> Jet:
    """Join scalar residuals, of shape (...), and vector ones, of shape (rows, ...), into one of shape (rows, ...)."""
    reshaped = [part if len(part.shape) == 3 else part.map(lambda c: c[None]) for part in parts]
    return concatenate(reshaped)
