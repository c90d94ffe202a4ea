"""From named values to arrays: parameters and expressions evaluated, values checked, instances of a type stacked."""

import dataclasses
import numbers
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jounce.constraints.base import field_kind, value_fields
from jounce.errors import JounceError, MechanismError
from jounce.trajectory import AbstractMotion, Expression, ExpressionMotion, FunctionMotion

POSITIVE = ("length", "radius")
NONZERO = ("axis", "vector", "normal")


def resolve(value: Any, parameters: Mapping[str, Any]) -> Any:
    """Return the number or array that a value stands for; it may be given by an expression of the parameters."""
    if isinstance(value, str):
        value = Expression(value)
    if isinstance(value, Expression):
        return value.evaluate(parameters)
    if isinstance(value, numbers.Real):
        return float(value)
    if isinstance(value, Sequence) and not isinstance(value, str):
        entries = [resolve(entry, parameters) for entry in value]
        plain = all(isinstance(entry, float | np.ndarray) for entry in entries)
        return np.array(entries) if plain else jnp.stack([jnp.asarray(entry, float) for entry in entries])
    return value


def resolve_motion(motion: Any, parameters: Mapping[str, Any]) -> AbstractMotion:
    """Return the motion law that a number, an expression, a Python function or a law stands for."""
    if isinstance(motion, AbstractMotion):
        return motion
    if isinstance(motion, numbers.Real):
        motion = Expression(repr(float(motion)))
    if isinstance(motion, str):
        motion = Expression(motion)
    if isinstance(motion, Expression):
        motion.check({*parameters, "t"})
        return ExpressionMotion(motion, {name: parameters[name] for name in sorted(motion.names - {"t"})})
    if callable(motion):
        return FunctionMotion(motion)
    raise MechanismError("a motion is an expression, a function of time or a motion law", value=motion)


def check_value(field: str, kind: str, value: Any, components: int) -> None:
    """Raise MechanismError unless a value fits its field: shape, finite, not a zero axis, not a negative length."""
    if isinstance(value, jax.core.Tracer):
        return
    shape = (components,) if kind == "vector" else ()
    if np.shape(value) != shape or np.asarray(value).dtype.kind != "f":
        wanted = f"a vector of {components} numbers" if kind == "vector" else "one number"
        raise MechanismError(f"must be {wanted}", value=_plain(value))
    if not np.isfinite(value).all():
        raise MechanismError("must be finite", value=_plain(value))
    word = field.removesuffix("_i").removesuffix("_j")
    if word in POSITIVE and value <= 0:
        raise MechanismError("must be greater than zero", value=_plain(value))
    if word == "lead" and value == 0:
        raise MechanismError("must not be zero", value=_plain(value))
    if word in NONZERO and not np.any(value):
        raise MechanismError("must not be of zero length", value=_plain(value))


def _plain(value: Any) -> Any:
    return np.asarray(value).tolist() if isinstance(value, np.ndarray | jax.Array | np.generic) else value


def resolve_element(element: Any, parameters: Mapping[str, Any], components: int, name: str) -> dict[str, Any]:
    """Return the values of a joint, driver or output as arrays, by field, checked."""
    values = {}
    for field_name, field in value_fields(type(element)).items():
        kind, value = field_kind(field), getattr(element, field_name)
        try:
            if kind == "motion":
                value = resolve_motion(value, parameters)
            elif kind in ("scalar", "vector") and value is not None:
                value = resolve(value, parameters)
                check_value(field_name, kind, value, components)
        except JounceError as error:
            raise error.located(name=f"{name}.{field_name}") from None
        values[field_name] = value
    return values


def static_fields(element: Any) -> tuple[str, ...]:
    """Return the names of the fields that hold no numbers, `bodies` aside."""
    return tuple(
        field.name
        for field in dataclasses.fields(element)
        if field.metadata.get("static", False) and field.name != "bodies"
    )


def group_key(element: Any, values: Mapping[str, Any]) -> Any:
    """Return what instances must share to be stacked: class, words, and the structure of their values."""
    words = tuple(getattr(element, name) for name in static_fields(element))
    numbers_only = {name: value for name, value in values.items() if name not in static_fields(element)}
    leaves, structure = jax.tree.flatten(numbers_only)
    return type(element), words, structure, tuple(np.shape(leaf) for leaf in leaves)


def stack_elements(elements: Sequence[Any], values: Sequence[Mapping[str, Any]]) -> Any:
    """Return one element whose values hold all instances, along an axis that stands before the batch axis."""
    kind = type(elements[0])
    stacked = object.__new__(kind)  # the checks of __init__ were made for each instance
    object.__setattr__(stacked, "bodies", ())
    static = static_fields(elements[0])
    for name in value_fields(kind):
        if name in static:
            value = values[0][name]
        else:
            value = jax.tree.map(_along_instances, *(v[name] for v in values))
        object.__setattr__(stacked, name, value)
    return stacked


def _along_instances(*leaves: Any) -> Any:
    traced = any(isinstance(leaf, jax.core.Tracer) for leaf in leaves)
    namespace = jnp if traced else np
    return namespace.stack([namespace.asarray(leaf) for leaf in leaves], axis=-1)[..., None]
