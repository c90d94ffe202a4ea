"""From named values to arrays: parameters and expressions evaluated, values checked, instances of a type stacked."""

import dataclasses
import math
import numbers
from collections.abc import Iterable, Mapping, Sequence
from functools import cache, lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from jounce.base.modules import Module, belongs_to_package, unchecked
from jounce.base.shapes import by_component, has_labels, real_numbers
from jounce.constraints.facts import SIGNS, facts_of, field_kinds, has_other_sign, stem_of, value_fields
from jounce.errors import JounceError, MechanismError
from jounce.forces import AbstractForce, AbstractLaw, ExpressionLaw, FunctionLaw, TimeLaw, VectorLaw
from jounce.forces.laws import read_law
from jounce.jet import Jet
from jounce.trajectory import AbstractMotion, Expression, ExpressionMotion, SplineMotion
from jounce.trajectory.curves import resolve_curve
from jounce.trajectory.laws.user_laws import read_laws, shape_of_result, tried_law
from jounce.units.values import expression_in_si

_ROWS, _REAL = frozenset((list, tuple)), frozenset((int, float))  # tested first: checks by abstract classes are slow
_NUMBERS = frozenset((float, np.float64, np.ndarray))
Element = Module
"""A joint, driver, force or output."""


def resolve(value: Any, parameters: Mapping[str, Any]) -> Any:
    """Return the number or array of a value, which may be given by an expression of the parameters."""
    kind = type(value)
    if kind is float:
        return value
    if kind in _ROWS and _REAL.issuperset(map(type, value)):
        return np.array(value, float)
    if isinstance(value, str):
        value = expression_in_si(value)
    if isinstance(value, Expression):
        return value.evaluate(parameters)
    if isinstance(value, Sequence):
        entries = [resolve(entry, parameters) for entry in value]
        if any(isinstance(entry, Tracer) for entry in entries):
            return jnp.stack([jnp.asarray(entry, float) for entry in entries])
        return np.array(entries, float) if _are_numbers(entries) else list(value)
    if isinstance(value, numbers.Real):
        return _number(value)
    if isinstance(value, np.ndarray | jax.Array) and not isinstance(value, Tracer):
        return real_numbers(None, value, MechanismError) if value.dtype.kind in "fiu" else value
    if has_labels(value):
        return real_numbers(None, by_component(None, value, MechanismError), MechanismError)
    return value


def _is_number(value: Any) -> bool:
    """Return whether a value is one number, also as an array without axes, such as an entry of a dataset."""
    return isinstance(value, numbers.Real) or (
        (isinstance(value, np.ndarray) or has_labels(value)) and not np.ndim(value)
    )


def _number(value: Any) -> float:
    return float(real_numbers(None, value, MechanismError, "one number"))


def _are_numbers(entries: list[Any]) -> bool:
    """Return whether entries are numbers, or rows of numbers of one length."""
    if set(map(type, entries)) <= {float}:
        return True
    numeric = all(isinstance(x, float) or (isinstance(x, np.ndarray) and x.dtype.kind == "f") for x in entries)
    return numeric and len({np.shape(x) for x in entries}) <= 1


def resolve_motion(motion: Any, parameters: Mapping[str, Any]) -> AbstractMotion:
    """Return the motion law given by a number, an expression, a Python function or a law."""
    if isinstance(motion, AbstractMotion):
        return _traceable(motion.resolved(parameters))
    if _is_number(motion):
        motion = Expression(repr(_number(motion)))
    if isinstance(motion, str):
        motion = expression_in_si(motion)
    if isinstance(motion, Expression):
        _check_names(motion, {"t"}, parameters)
        values = {name: parameters[name] for name in sorted(motion.names - {"t"})}
        return unchecked(ExpressionMotion, {"expression": motion, "parameters": values})
    if callable(motion):
        return read_laws(tried_law(motion))
    raise MechanismError("a motion is an expression, a function of time or a motion law", value=motion)


def _check_names(expression: Expression, variables: set[str], parameters: Mapping[str, Any]) -> None:
    """Raise ExpressionError for a name that is neither a parameter nor a variable of the expression."""
    if any(name not in variables and name not in parameters for name in expression.names):  # of thousands of parameters
        expression.check({*parameters, *variables})


def _traceable(motion: AbstractMotion) -> AbstractMotion:
    """Return a law after a trial on shapes only: Python functions can fail in ways that need an explanation."""
    if type(motion).__call__ is SplineMotion.__call__ and belongs_to_package(type(motion)):
        return motion  # checked numbers: tracing takes longer than solving a short grid
    return read_laws(tried_law(motion))


def resolve_law(law: Any, force: AbstractForce, parameters: Mapping[str, Any], components: int | None) -> AbstractLaw:
    """Return the law of a force, given by a number, an expression, a Python function or a motion law.

    Parameters
    ----------
    law : object
        Law as a user gives it; a list of laws for a force with components.
    force : AbstractForce
        Force that names displacement and velocity in expressions.
    parameters : mapping
        Values of the other names in expressions.
    components : int or None
        Size of a vector; None for a scalar.
    """
    if components is None or isinstance(law, AbstractLaw) or (callable(law) and not isinstance(law, AbstractMotion)):
        force_law = _scalar_law(law, force, parameters)
    else:
        law = resolve(law, parameters) if has_labels(law) else law
        entries = law.tolist() if isinstance(law, np.ndarray) else law
        if isinstance(entries, str) or not isinstance(entries, Sequence) or len(entries) != components:
            raise MechanismError(f"must be a list of {components} laws or numbers", value=_plain(law))
        force_law = VectorLaw(tuple(_scalar_law(entry, force, parameters) for entry in entries))
    shape = (1, 1) if components is None else (components, 1, 1)
    advice = "it must map the jets of displacement, velocity and time to the jet of the force"

    def evaluated(x: Any, v: Any, t: Any) -> Any:
        return force_law(Jet([x, v, v]), Jet([v, v]), Jet.variable(t, 2)).coefficients[0]

    force_shape = shape_of_result("law", advice, evaluated, np.zeros(shape), np.zeros(shape), np.zeros((1, 1)))
    if force_shape != shape:
        raise MechanismError(f"the law cannot be used: its value has the shape {force_shape}, not {shape}; {advice}")
    return read_law(force_law, shape[:-2])


def _scalar_law(law: Any, force: AbstractForce, parameters: Mapping[str, Any]) -> AbstractLaw:
    names = force.displacement_names, force.velocity_names
    if isinstance(law, AbstractLaw):
        return law
    if isinstance(law, AbstractMotion):
        return TimeLaw(law.resolved(parameters))
    if _is_number(law) and not isinstance(law, bool):
        size = _number(law)
        if not np.isfinite(size):
            raise MechanismError("must be finite", value=size)
        return ExpressionLaw("size", {"size": size}, *names)  # a leaf, so that laws with different sizes can be stacked
    if isinstance(law, str):
        law = expression_in_si(law)
    if isinstance(law, Expression):
        variables = {"t", *names[0], *names[1]}
        _check_names(law, variables, parameters)
        for name in sorted({name for name in law.names & variables if name in parameters}):
            message = f"the parameter '{name}' has the name of a variable of this law; give it another name"
            raise MechanismError(message, value=law.text)
        return ExpressionLaw(law, {name: parameters[name] for name in sorted(law.names - variables)}, *names)
    if callable(law):
        return FunctionLaw(law)
    raise MechanismError("a law is a number, an expression, a motion law or a function of jets", value=law)


def parameter_value(name: str, value: Any) -> Any:
    """Return the value of a parameter as a float; a traced value is returned unchanged.

    Raises
    ------
    MechanismError
        If the value is not one finite number.
    """
    if type(value) is float and math.isfinite(value):
        return value
    if isinstance(value, Tracer):
        return value

    def error(message: str, **place: Any) -> MechanismError:
        return MechanismError(f"a parameter {message}", **{**place, "value": _plain(value)})

    place, expected = f"parameters.{name}", "one finite number"
    number = real_numbers(place, value, error, expected)
    if number.ndim or not np.isfinite(number):
        raise error(f"must be {expected}", name=place)
    return float(number)


@cache
def _shapes(kind: str, components: int) -> tuple[tuple[int, ...], ...]:
    """Return the permitted shapes of a kind of value."""
    vector = (components,)
    return {"scalar": ((),), "vector": (vector,), "tensor": (vector, vector * 2)}[kind]


def check_value(kind: str, value: Any, components: int, sign: str = "any") -> None:
    """Raise MechanismError unless a value is finite, and has the shape of its field and the `sign` stated for it."""
    if isinstance(value, float):
        shape, entries = (), [value]
    elif isinstance(value, np.ndarray) and value.dtype.kind == "f":
        shape, entries = value.shape, value.ravel().tolist()  # Python is faster than NumPy for so few numbers
    elif isinstance(value, Tracer):
        return
    else:
        shape, entries = None, []
    if shape not in _shapes(kind, components):
        expected = "one number" if kind == "scalar" else f"a vector of {components} numbers"
        raise MechanismError(f"must be {expected}", value=_plain(value))
    if not all(map(math.isfinite, entries)):
        raise MechanismError("must be finite", value=_plain(value))
    if sign == "any":
        return
    if has_other_sign(sign, min(entries), max(map(abs, entries))):
        of_vector = kind == "vector" and sign == "not zero"
        raise MechanismError("must not be of zero length" if of_vector else SIGNS[sign], value=_plain(value))


def resolved(value: Any, name: str, kind: str, components: int, parameters: Mapping[str, Any]) -> Any:
    """Return the checked value of a body: a ``scalar``, ``vector`` or ``tensor``; `name` is its dotted name."""
    try:
        array = resolve(value, parameters)
        check_value(kind, array, components)
    except JounceError as error:
        raise error.located(name=name) from None
    return array


def _plain(value: Any) -> Any:
    return np.asarray(value).tolist() if isinstance(value, np.ndarray | jax.Array | np.generic) else value


def resolve_element(element: Element, parameters: Mapping[str, Any], components: int, name: str) -> dict[str, Any]:
    """Return the checked values of a joint, driver, force or output as arrays, by field."""
    values, facts = {}, facts_of(type(element))
    kinds = field_kinds(type(element))
    for field_name, field in value_fields(type(element)).items():
        kind: str = kinds[field_name]
        value: Any = getattr(element, field_name)
        try:
            if kind == "motion":
                value = resolve_motion(value, parameters)
            elif kind in ("law", "laws") and isinstance(element, AbstractForce):
                value = resolve_law(value, element, parameters, None if kind == "law" else components)
            elif kind in ("scalar", "vector") and (value is not None or field.default is not None):
                value = resolve(value, parameters)
                check_value(kind, value, components, facts.signs[field_name])
            elif kind == "part" and value is not None:
                # a mechanism file states the follower of a cam as the cam itself
                place = name if field_name == "follower" else f"{name}.{field_name}"
                value = unchecked(type(value), _of_part(value, parameters, components, place))
            elif kind == "points":
                value = _points(resolve(value, parameters), len(element.slots or element.bodies), components)
            elif kind == "wrenches":
                value = _wrenches(resolve(value, parameters))
            elif kind == "nested" and value is not None:  # the bodies are those of the containing element
                of_bodies = hasattr(value, "bodies")
                place = name if of_bodies else f"{name}.{field_name}"
                nested = resolve_element(value, parameters, components, place)
                value = unchecked(type(value), {**vars(value), **nested} | ({"bodies": ()} if of_bodies else {}))
        except JounceError as error:
            raise error.located(name=f"{name}.{field_name}") from None
        values[field_name] = value
    for field_name in (name for name, kind in kinds.items() if kind == "curve"):  # last, since a curve needs its start
        try:
            start = [values[name] for name in values if name.startswith("start")]
            start = None if any(x is None for x in start) else start
            values[field_name] = resolve_curve(values[field_name], element.hidden, components, start, parameters)
        except JounceError as error:
            key = f"{field_name}.{error.name}" if error.name else field_name
            raise MechanismError(error.message, name=f"{name}.{key}", value=error.value) from None
    _check_directions(values, facts.never_parallel, name)
    return values


def _of_part(element: Element, parameters: Mapping[str, Any], components: int, name: str) -> dict[str, Any]:
    """Return the values of an element within another element, which holds the bodies."""
    defaults = {field.name: field.default for field in dataclasses.fields(type(element)) if not field.init}
    return {"bodies": ()} | defaults | resolve_element(element, parameters, components, name)


def _points(value: Any, count: int, components: int) -> Any:
    """Return the points of an element, one for each body, after a check."""
    if isinstance(value, Tracer):
        return value
    if not (isinstance(value, np.ndarray) and value.dtype.kind == "f" and value.shape == (count, components)):
        raise MechanismError(
            f"must be {count} points of {components} numbers, one for each body in the order of bodies",
            value=_plain(value),
        )
    if not np.isfinite(value).all():
        raise MechanismError("must be finite", value=_plain(value))
    return value


def _wrenches(value: Any) -> Any:
    """Return rows of six numbers after a check."""
    if not isinstance(value, Tracer):
        rows = isinstance(value, np.ndarray) and value.dtype.kind == "f" and value.ndim == 2 and value.shape[1] == 6
        if not rows or not len(value):
            raise MechanismError("must be rows of six numbers, a force and a moment", value=_plain(value))
        if not np.isfinite(value).all():
            raise MechanismError("must be finite", value=_plain(value))
        if not np.abs(value).max(axis=1).all():
            raise MechanismError("a row must not vanish", value=_plain(value))
    return value


def _check_directions(values: Mapping[str, Any], never_parallel: Iterable[tuple[str, str]], name: str) -> None:
    """Raise MechanismError if two directions are parallel that must not be."""
    for field, other in never_parallel:
        vector, axis = values[field], values[other]
        if isinstance(axis, np.ndarray) and isinstance(vector, np.ndarray):
            (a, b, c), (x, y, z) = _of_size_one(axis), _of_size_one(vector)
            cross_size = math.hypot(b * z - c * y, c * x - a * z, a * y - b * x)
            if cross_size < 1e-9 * math.hypot(a, b, c) * math.hypot(x, y, z):
                message = f"must not be parallel to the {stem_of(other)}"
                raise MechanismError(message, name=f"{name}.{field}", value=_plain(vector))


def _of_size_one(vector: np.ndarray) -> list[float]:
    """Return the entries of a vector divided by the largest, so that no product overflows, as a list for speed."""
    entries = vector.tolist()
    size = max(map(abs, entries))
    return [entry / size for entry in (*entries, 0.0)[:3]]


@lru_cache(maxsize=1000)
def static_fields(kind: type[Element]) -> tuple[str, ...]:
    """Return the names of the static fields of a class except `bodies`."""
    return tuple(
        field.name
        for field in dataclasses.fields(kind)
        if field.metadata.get("static", False) and field.name != "bodies"
    )


def group_key(element: Element, values: Mapping[str, Any]) -> Any:
    """Return what instances must share to be stacked: class, static fields, and the structure of their values."""
    static = static_fields(type(element))
    static_values = (len(element.bodies), *(getattr(element, name) for name in static))
    numbers_only = {name: value for name, value in values.items() if name not in static}
    if all(type(value) in _NUMBERS or isinstance(value, jax.Array) for value in numbers_only.values()):  # traced, too
        shapes = tuple((name, np.shape(value)) for name, value in numbers_only.items())
        return type(element), static_values, shapes  # defines the structure without flattening
    leaves, structure = jax.tree.flatten(numbers_only)
    return type(element), static_values, structure, tuple(np.shape(leaf) for leaf in leaves)


def stack_elements(elements: Sequence[Element], values: Sequence[Mapping[str, Any]]) -> Any:
    """Return one element with the values of all instances, along an axis before the batch axis."""
    kind = type(elements[0])
    static = static_fields(kind)
    stacked: dict[str, Any] = {"bodies": (), **_found_later(kind)}
    for name in value_fields(kind):  # fields without `init` are set later, from the poses of the bodies
        field_values = [v[name] for v in values]
        if name in static or field_values[0] is None:
            stacked[name] = field_values[0]
        elif isinstance(field_values[0], float | np.ndarray):
            stacked[name] = along_instances(*field_values)
        else:
            stacked[name] = jax.tree.map(along_instances, *field_values)
    return unchecked(kind, stacked)  # each instance was checked


@lru_cache(maxsize=1000)
def _found_later(kind: type[Element]) -> Mapping[str, Any]:
    """Return the default values of the fields that are set later."""
    return {field.name: field.default for field in dataclasses.fields(kind) if not field.init}


def along_instances(*values: Any) -> Any:
    """Return values of one shape stacked along an axis of instances, (..., instances, 1); they may be traced."""
    if any(issubclass(kind, Tracer) for kind in set(map(type, values))):
        return jnp.stack([jnp.asarray(value) for value in values], axis=-1)[..., None]
    rows = np.array(values)  # faster than np.stack
    return np.ascontiguousarray(rows.transpose(*range(1, rows.ndim), 0))[..., None]
