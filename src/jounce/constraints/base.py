"""What a joint or a driver is: named values on two or three bodies, and one residual on jets."""

import abc
import dataclasses
from collections.abc import Mapping
from functools import lru_cache
from typing import Annotated, Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Bool

from jounce.errors import MechanismError, check_choice
from jounce.jet import Jet, concatenate
from jounce.modules import Module
from jounce.shapes import Numbers

Scalar = Annotated[Any, "scalar"]
Vector = Annotated[Any, "vector"]
MotionLaw = Annotated[Any, "motion"]
Wrenches = Annotated[Any, "wrenches"]
Whole = Annotated[int, "whole"]
WORDS = ("Scalar", "Vector", "Law", "Laws", "Wrenches", "Whole")  # annotations that say what kind of value a field has

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
    for field in vars(kind).get("__annotations__", {}):
        if field in RESERVED_KEYS:
            message = f"no field of {kind.__qualname__} may have this name, which files use otherwise; rename it"
            raise MechanismError(message, name="field", value=field)
    catalogues = [_REGISTRY.setdefault((each, role), {}) for each in ((space,) if space else SPACES)]
    for taken in catalogues:
        other = _last_whole(taken.get(type, ()))
        if other is not None and (_is_ours(other) or _full_name(other) != _full_name(kind)):
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

    A subclass lists its values as fields and defines `residual`; nothing else. Jacobian, right-hand sides of every
    order, forces and files follow. Fields are annotated `Scalar`, `Vector`, `MotionLaw` or ``str``; the fields
    ``point_i`` and ``point_j`` are the key ``points`` of a mechanism file, and likewise vectors, axes and normals.
    Given a `type`, the subclass can be used in files by that name.

    Parameters
    ----------
    bodies : tuple of str
        Names of the bodies i, j (and m), ``"ground"`` among them if one is fixed.

    Raises
    ------
    MechanismError
        If the number of bodies is wrong or a body is joined with itself.
    """

    bodies: tuple[str, ...] = eqx.field(static=True, converter=tuple)

    space: ClassVar[str] = ""
    role: ClassVar[str] = ""
    type_name: ClassVar[str] = ""
    body_count: ClassVar[int] = 2
    body_counts: ClassVar[tuple[int, ...]] = ()  # where more than one number is right
    periodic: ClassVar[bool] = False  # whether its residual forgets whole turns, which the law must not skip then
    law_apart: ClassVar[bool] = False  # of the class that defines `residual`: a function of bodies less one of the law

    def __init_subclass__(cls, type: str = "", space: str = "", role: str = "joint", **keywords: Any):  # noqa: A002
        super().__init_subclass__(**keywords)
        if type:
            check_choice("role", role, ("joint", "driver"), MechanismError)
            register(cls, type, space, role)

    def __check_init__(self):
        check_bodies(self, self.body_counts or (self.body_count,))

    @abc.abstractmethod
    def residual(self, *bodies_and_time: Any, **_: Any) -> Jet:  # with both, type checkers let parameters be named
        """Return the jet that vanishes when the joint holds: ``residual(self, body_i, body_j, time)``.

        Bodies are poses (`PlanarPose` or `SpatialPose`), `time` is a jet in s. The result has the shape of one row,
        (...), or of several, (rows, ...), as `rows` joins them.
        """

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
    found = {name: _last_whole(kinds) for name, kinds in _REGISTRY.get((space, role), {}).items()}
    return {name: kind for name, kind in found.items() if kind is not None}


def _last_whole(kinds: tuple[type[Any], ...]) -> type[Any] | None:
    """Return the last of some classes that is whole: the definition of others failed, as their fields are in no order.

    A class is registered before it gets its fields; the last that a dataclass gets tells that it has them.
    """
    return next((kind for kind in reversed(kinds) if "__match_args__" in vars(kind)), None)


def _full_name(kind: type[Any]) -> tuple[str, str]:
    return kind.__module__, kind.__qualname__


def _is_ours(kind: type[Any]) -> bool:
    """Tell whether a class is one of this package, for which another only passes itself off, by its module's name."""
    return kind.__module__.partition(".")[0] == __name__.partition(".")[0]


def by_ratio_alone(element: AbstractConstraint) -> bool:
    """Tell whether a joint couples moving bodies by a ratio and nothing else: it does not say where its teeth touch."""
    fields = value_fields(type(element))
    given = "ratio" in fields and getattr(element, "ratio", None) is not None and element.role != "driver"
    return given and len({*element.bodies} - {"ground"}) > 1 and not any(name.startswith("point") for name in fields)


def check_bodies(element: Any, counts: tuple[int, ...], does: str = "joins", must: str = "join") -> None:
    """Raise MechanismError unless a joint, driver, force or output has as many bodies as it needs, all different."""
    name = getattr(element, "type_name", "") or type(element).__name__
    if len(element.bodies) not in counts:
        noun = "body" if counts == (1,) else "bodies"
        message = f"{name} {does} {' or '.join(map(str, counts))} {noun}"
        raise MechanismError(message, name="bodies", value=list(element.bodies))
    if len(set(element.bodies)) != len(element.bodies):
        message = f"{name} must {must} different bodies, not a body with itself"
        raise MechanismError(message, name="bodies", value=list(element.bodies))


def rows(*parts: Jet) -> Jet:
    """Join scalar residuals, of shape (...), and vector ones, of shape (rows, ...), into one of shape (rows, ...)."""
    whole = [part if len(part.shape) == 3 else part.map(lambda c: c[None]) for part in parts]
    return concatenate(whole)


@lru_cache(maxsize=1000)
def value_fields(kind: type[Any]) -> Mapping[str, dataclasses.Field]:
    """Return the fields of a joint, driver or force that a user gives, by name; `bodies` is not among them."""
    return {field.name: field for field in dataclasses.fields(kind) if field.name != "bodies" and field.init}


@lru_cache(maxsize=1000)
def field_kinds(kind: type[Any]) -> Mapping[str, str]:
    """Return the kinds of the fields that a user gives, by name; see `field_kind`."""
    return {name: field_kind(field) for name, field in value_fields(kind).items()}


def field_kind(field: dataclasses.Field) -> str:
    """Return ``scalar``, ``vector``, ``motion``, ``law``, ``laws``, ``wrenches``, ``whole`` or ``text``."""
    if isinstance(field.type, str):  # under ``from __future__ import annotations``
        word = field.type.rpartition(".")[2].strip()
        return "motion" if word == "MotionLaw" else word.lower() if word in WORDS else "text"
    return next(iter(getattr(field.type, "__metadata__", ())), "text")
