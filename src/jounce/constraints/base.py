"""What a joint or a driver is: named values on two or three bodies, and one residual on jets."""

import abc
import dataclasses
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Annotated, Any, ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Bool

from jounce.base.modules import Module, field
from jounce.base.shapes import Numbers
from jounce.constraints.facts import (
    USUAL_DIMENSIONS,
    USUAL_SIGNS,
    facts_of,
    field_kind as field_kind,
    field_kinds as field_kinds,
    value_fields as value_fields,
)
from jounce.errors import MechanismError, check_choice
from jounce.jet import Jet, concatenate

Scalar = Annotated[Any, "scalar"]
Vector = Annotated[Any, "vector"]
MotionLaw = Annotated[Any, "motion"]
Wrenches = Annotated[Any, "wrenches"]
Whole = Annotated[int, "whole"]
Flag = Annotated[bool, "flag"]
Points = Annotated[Any, "points"]  # one on each body
Nested = Annotated[Any, "nested"]  # an element within another
Curve = Annotated[Any, "curve"]
Part = Annotated[Any, "part"]  # another joint or driver within one

SPACES = ("planar", "spatial")
ROLES = ("joint", "driver", "force")
RESERVED_KEYS = ("bodies", "type")  # keys that every element of a file has
_REGISTRY: dict[tuple[str, str], dict[str, tuple[type[Any], ...]]] = {}  # the last counts whose definition succeeded


def register(kind: type[Any], type: str, space: str, role: str) -> None:  # noqa: A002
    """Let files name a class by its type; one of no particular space is of both.

    Raises
    ------
    MechanismError
        If another class has this type: files would silently mean the new one. The same class defined again, as in a
        cell of a notebook that is run again, takes its own place once it is whole; those of this package stay. If a
        field has a name that files use otherwise.
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
    catalogues = [_REGISTRY.setdefault((each, role), {}) for each in ((space,) if space else SPACES)]
    for taken in catalogues:
        other = _last_whole(taken.get(type, ()))
        if other is not None and (_belongs_to_package(other) or _full_name(other) != _full_name(kind)):
            message = (
                f"the {role} type of {kind.__qualname__} is that of {other.__module__}.{other.__qualname__} already"
            )
            raise MechanismError(f"{message}; give it another one", name="type", value=type)
    kind.type_name, kind.space, kind.role = type, space, role
    for free in catalogues:
        before = _last_whole(free.get(type, ()))
        free[type] = (kind,) if before is None else (before, kind)


class AbstractConstraint(Module):
    """A joint or driver: one residual, written on the jets of its bodies, that vanishes when it holds.

    A subclass lists its values as fields and defines `residual`. Jacobian, right-hand sides of every order, forces and
    files follow. Fields are annotated `Scalar`, `Vector`, `MotionLaw` or ``str``; the fields ``point_i`` and
    ``point_j`` are the key ``points`` of a mechanism file, and likewise vectors, axes and normals. Given a `type`, the
    subclass can be used in files by that name. What else there is to know of the joint, the class states in class
    variables, which subclasses inherit; `jounce.testing.check_joint` tells whether all of it is true.

    Parameters
    ----------
    bodies : tuple of str
        Names of the bodies i, j (and m), ``"ground"`` among them if one is fixed.

    Attributes
    ----------
    dimensions : mapping of str to str
        Class variable: dimensions of fields, ``length``, ``angle``, ``ratio``, ``mass`` and so on; ``direction`` for a
        vector of any unit; ``of coordinate`` or ``per angle`` where it depends on the field ``coordinate``; ``any``.
        An entry ``axis`` is for ``axis_i`` and ``axis_j``. Points and fields named length, radius and lead are lengths,
        vectors, axes and normals are directions, unless it says otherwise.
    signs : mapping of str to str
        Class variable: ``positive``, ``not negative``, ``not zero`` (a vector of no zero length) or ``any``, by field.
        Fields named length and radius must be positive, lead, vectors, axes and normals not zero, unless it says
        otherwise.
    choices : mapping of str to tuple of str
        Class variable: the words that fields annotated ``str`` may be.
    held_parallel : tuple of tuple of str
        Class variable: pairs of fields, of the first and of the second body, whose directions the joint holds parallel.
        Its residual then cannot tell a part from one that is turned over, which assembly avoids.
    never_parallel : tuple of tuple of str
        Class variable: pairs of fields of one body, of which the first must not be parallel to the second.
    squared_distance : str
        Class variable: the field, a value or a law, whose square the residual subtracts from that of a distance.
    point_distance : str
        Class variable: how far apart the joint holds ``point_i`` and ``point_j``: ``zero``, or the field of their
        distance. Of a `pair` it is known.
    rolls_along : tuple of str
        Class variable, of a disc that rolls on the first body: fields of the direction of its line, and in space of the
        axis of the disc, whose center ``point_j`` lies by ``radius`` on the right of the line through ``point_i``.
    symbol : str
        Class variable: what plots and the viewer draw, one of `jounce.constraints.facts.symbols`, from the fields of
        the joint of the library that has it; ``none`` for nothing, empty for a mark at each point.
    pair : str
        Class variable: ``revolute``, ``rod`` or ``prismatic`` if the planar joint is nothing else, with the fields of
        that joint of the library. Linkages are recognized by it.

    Raises
    ------
    MechanismError
        If the number of bodies is wrong or a body is joined with itself; if a field of text has a word that it may not
        have; or if its class states a fact that cannot be.
    """

    bodies: tuple[str, ...] = field(static=True, converter=tuple)

    space: ClassVar[str] = ""
    role: ClassVar[str] = ""
    type_name: ClassVar[str] = ""
    body_count: ClassVar[int] = 2
    body_counts: ClassVar[Sequence[int]] = ()  # where more than one number is right
    may_repeat: ClassVar[bool] = False  # whether a body may be named more than once
    hidden: ClassVar[tuple[str, ...]] = ()  # coordinates besides those of bodies, which a carriage of its own has
    periodic: ClassVar[bool] = False  # whether its residual forgets whole turns, which the law must not skip then
    nonholonomic: ClassVar[bool] = False  # whether rows of it hold velocities, which no positions fulfill
    parts: ClassVar[Mapping[str, Mapping[str, str]]] = MappingProxyType({})  # keys of files within a key, with fields
    separable: ClassVar[bool] = False  # of the class that defines `residual`: a function of bodies less one of the law
    has_friction_radius: ClassVar[bool] = False  # whether its surfaces turn on one another
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
    def residual(self, *bodies_and_time: Any, **_: Any) -> Jet:  # with both, type checkers let parameters be named
        """Return the jet that vanishes when the joint holds: ``residual(self, body_i, body_j, time)``.

        Bodies are poses (`PlanarPose` or `SpatialPose`), `time` is a jet in s. The result has the shape of one row,
        (...), or of several, (rows, ...), as `rows` joins them.
        """

    def variation(self, bodies: tuple[Any, ...], changes: tuple[Any, ...], time: Jet) -> Jet:
        """Return how the residual varies as the bodies are displaced; linear in the displacements.

        It follows from the residual, unless rows of it hold velocities: then it is these for the displacements instead.

        Parameters
        ----------
        bodies : tuple of PlanarPose or SpatialPose
            Where the bodies are.
        changes : tuple of PlanarPose or SpatialPose or None
            What ``varied`` of them gives; None for a body that is not displaced.
        time : Jet
            In s.
        """
        varied = [k for k, change in enumerate(changes) if change is not None]

        def residual(*poses: Any) -> Jet:
            placed = list(bodies)
            for k, pose in zip(varied, poses, strict=True):
                placed[k] = pose
            return self.residual(*placed, time)

        return jax.jvp(residual, tuple(bodies[k] for k in varied), tuple(changes[k] for k in varied))[1]

    def admissible(self, time: Jet) -> Bool[Numbers, "..."]:
        """Tell at which instants the motion law, if there is one, has a permitted value: a finite one, unless more."""
        motion = getattr(self, "motion", None)
        if motion is None:
            return jnp.ones_like(time.coefficients[0], dtype=bool)
        return jnp.isfinite(motion(time.truncate(0)).coefficients[0])


def catalogue(space: str, role: str) -> dict[str, type[Any]]:
    """Return the classes that files may name, by their type: `space` planar or spatial, `role` joint, driver or force.

    Examples
    --------
    >>> from jounce.constraints import catalogue
    >>> sorted(catalogue("planar", "driver"))
    ['coordinate', 'distance', 'slide']
    """
    kinds_by_name = {name: _last_whole(kinds) for name, kinds in _REGISTRY.get((space, role), {}).items()}
    return {name: kind for name, kind in kinds_by_name.items() if kind is not None}


def _last_whole(kinds: tuple[type[Any], ...]) -> type[Any] | None:
    """Return the last of some classes that is whole: the definition of others failed, as their fields are in no order.

    A class is registered before it gets its fields; the last that a dataclass gets tells that it has them.
    """
    return next((kind for kind in reversed(kinds) if "__match_args__" in vars(kind)), None)


def _full_name(kind: type[Any]) -> tuple[str, str]:
    return kind.__module__, kind.__qualname__


def _belongs_to_package(kind: type[Any]) -> bool:
    """Tell whether a class is one of this package, for which another only passes itself off, by its module's name."""
    return kind.__module__.partition(".")[0] == __name__.partition(".")[0]


def is_bare_ratio(element: AbstractConstraint) -> bool:
    """Tell whether a joint couples moving bodies by a ratio and nothing else: it does not say where its teeth touch."""
    fields = value_fields(type(element))
    given = "ratio" in fields and getattr(element, "ratio", None) is not None and element.role != "driver"
    placed = any(getattr(element, name) is not None for name in fields if name.startswith("point"))
    return given and len({*element.bodies} - {"ground"}) > 1 and not placed


def counted(counts: Sequence[int]) -> str:
    """Word the numbers that are right.

    Examples
    --------
    >>> counted((2, 3)), counted(range(2, 101))
    ('2 or 3', '2 to 100')
    """
    return f"{counts[0]} to {counts[-1]}" if isinstance(counts, range) else " or ".join(map(str, counts))


def check_bodies(element: Any, counts: Sequence[int], does: str = "joins", must: str = "join") -> None:
    """Raise MechanismError unless a joint, driver, force or output has as many bodies as it needs, all different."""
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
    """Have the fields of text of a class, before it is made a dataclass, be no values that JAX sees."""
    for name, annotation in vars(kind).get("__annotations__", {}).items():
        default = vars(kind).get(name, dataclasses.MISSING)
        if annotation in (str, "str") and not isinstance(default, dataclasses.Field):
            setattr(kind, name, field(static=True, default=default))


def check_words(element: Any) -> None:
    """Raise MechanismError unless fields of text have words that they may have, and the facts of its class can be."""
    for name, words in facts_of(type(element)).choices.items():
        check_choice(name, getattr(element, name), words, MechanismError)


def rows(*parts: Jet) -> Jet:
    """Join scalar residuals, of shape (...), and vector ones, of shape (rows, ...), into one of shape (rows, ...)."""
    whole = [part if len(part.shape) == 3 else part.map(lambda c: c[None]) for part in parts]
    return concatenate(whole)
