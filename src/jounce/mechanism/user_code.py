"""User-defined joints, drivers, forces and outputs: their methods are read as programs when a model is built.

An element of a user's class is replaced by one of a derived class, whose methods run the programs; see
`jounce.jet.programs.read_methods`. The replacement is an instance of the user's class, and unchanged otherwise.
"""

import dataclasses
import inspect
import itertools
import weakref
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from jounce.base.modules import belongs_to_package, changes_parts, field, unchecked, with_fields
from jounce.constraints import AbstractConstraint
from jounce.constraints.base import field_kinds, value_fields
from jounce.errors import JounceError, MechanismError, UnsupportedError
from jounce.forces import AbstractForce
from jounce.forces.laws import AbstractLaw, ReadLaw, is_users_law
from jounce.jet import Jet
from jounce.jet.programs.read_methods import Reading, Verbatim, read_method
from jounce.mechanism.outputs.base import AbstractOutput
from jounce.mechanism.resolve import stack_elements, static_fields
from jounce.rigid import PlanarPose, SpatialPose
from jounce.rigid.pose import Pose
from jounce.trajectory import AbstractMotion
from jounce.trajectory.laws.user_laws import ReadMotion

ORDER = 2  # of the comparison of methods with their programs
READINGS = "readings"  # field of the programs
_METHODS = {
    AbstractConstraint: ("residual", "evaluate", "admissible", "sense_at"),
    AbstractForce: ("displacement", "velocity", "force", "energy", "variation"),
    AbstractOutput: ("evaluate",),
}
_classes: weakref.WeakKeyDictionary[type, type] = weakref.WeakKeyDictionary()


def readings_of(element: Any, values: Mapping[str, Any], components: int) -> dict[str, Reading]:
    """Return the programs of the methods of a user's element, by name; empty for elements of this package.

    Parameters
    ----------
    element : AbstractConstraint, AbstractForce or AbstractOutput
        Element as the user gave it.
    values : mapping
        Values of its fields, from `resolve_element`.
    components : int
        Components of positions: 2 in the plane, 3 in space.
    """
    kind = type(element)
    names = _read_methods(kind)
    if not names:
        return {}
    reader = _Reader(element, values, components)
    if "force" in names:
        reader.check_forces()
    if "residual" in names and not kind.nonholonomic:
        reader.check_positions()
    return {name: reader.reading(name) for name in names} | {"": Verbatim(_class_description(kind), old=False)}


def has_own_methods(kind: type) -> bool:
    """Return whether a user may have written a method by which the elements of a class compute."""
    return bool(_read_methods(kind))


def with_readings(element: Any, readings: Mapping[str, Reading]) -> Any:
    """Return an element whose methods run given programs; its values may be those of stacked instances."""
    return unchecked(_class_for(type(element)), vars(element) | {READINGS: dict(readings)})


def holds_users_code(elements: Iterable[Any]) -> bool:
    """Return whether elements, as given, contain code of a user."""

    def is_code(value: Any) -> bool:
        if isinstance(value, list | tuple):
            return any(map(is_code, value))
        if isinstance(value, AbstractConstraint):
            return holds_users_code([value])
        if isinstance(value, AbstractMotion | AbstractLaw):
            return any(map(is_users_law, jax.tree.leaves(value, is_leaf=is_users_law)))
        return callable(value)

    return any(
        _read_methods(type(element)) or any(is_code(getattr(element, name)) for name in value_fields(type(element)))
        for element in elements
    )


def users_code(groups: Sequence[Any]) -> tuple[Any, ...] | None:
    """Return what distinguishes the user code in the elements of groups; None if JAX traces its numbers."""
    read = ReadMotion, ReadLaw
    parts_found: list[Any] = []
    for group in groups:
        parts_found.append(vars(group.element).get(READINGS))
        parts = jax.tree.leaves(group.element, is_leaf=lambda x: isinstance(x, read))
        parts_found += [part for part in parts if isinstance(part, read)]
    leaves, structure = jax.tree.flatten(parts_found)
    if any(isinstance(x, Tracer) for x in leaves):
        return None
    return structure, tuple((np.shape(x), np.asarray(x).tobytes()) for x in leaves)


def users_class(kind: type) -> type:
    """Return the class that a user wrote, given it or the class derived from it."""
    return vars(kind).get("stands_for", kind)


def _read_methods(kind: type) -> tuple[str, ...]:
    """Return the names of the methods of a class that a user may have written, or that call such methods."""
    methods = [(name, method) for name in _methods_of(kind) if (method := getattr(kind, name, None)) is not None]
    if (
        methods
        and not belongs_to_package(kind)
        and changes_parts(kind, tuple(_METHODS), names := [name for name, _ in methods])
    ):
        return tuple(names)
    return tuple([name for name, method in methods if not belongs_to_package(method)])


@lru_cache(maxsize=1000)
def _methods_of(kind: type) -> tuple[str, ...]:
    """Return the names of the methods by which the elements of a class compute; empty for other classes."""
    return next((names for role, names in _METHODS.items() if issubclass(kind, role)), ())


def _class_description(kind: type) -> tuple[str, ...]:
    """Return the facts that a class states beside its methods."""
    bases = [base for base in kind.__mro__ if belongs_to_package(base)]
    names = {name for base in bases for name, value in vars(base).items() if name[0] != "_" and not callable(value)}
    fields = {field.name for field in dataclasses.fields(kind)}
    return tuple(f"{name}={getattr(kind, name, None)!r}" for name in sorted(names - fields))


def _class_for(kind: type) -> type:
    """Return the derived class of a user's class whose methods run programs."""
    if kind not in _classes:
        role = next(role for role in _METHODS if issubclass(kind, role))
        namespace: dict[str, Any] = {name: _dispatched(name) for name in _METHODS[role] if hasattr(kind, name)}
        namespace |= {
            "__module__": kind.__module__,
            "__qualname__": kind.__qualname__,
            "__annotations__": {READINGS: Any},
            READINGS: field(default=None, init=False),
            "stands_for": kind,
        }
        _classes[kind] = type(kind)(kind.__name__, (kind,), namespace)
    return _classes[kind]


def _dispatched(name: str) -> Callable[..., Any]:
    def method(self: Any, *arguments: Any) -> Any:
        user_method = getattr(users_class(type(self)), name)
        reading = vars(self)[READINGS].get(name)
        if reading is None:
            return user_method(self, *arguments)
        return reading(lambda: user_method(_plain(self), *arguments), lambda: _inputs(self, arguments))

    method.__name__ = name
    return method


def _plain(element: Any) -> Any:
    """Return an element as an instance of the user's own class."""
    kind = users_class(type(element))
    return unchecked(kind, {name: value for name, value in vars(element).items() if name != READINGS})


class _Prescribed(AbstractMotion):
    """A law of which the value at one time is known, and nothing else."""

    time: Jet
    value: Jet

    def __call__(self, time: Jet) -> Jet:
        if time.coefficients[0] is not self.time.coefficients[0]:
            raise ValueError("the law is asked at another time")
        return self.value.truncate(time.order)


def _laws(element: Any) -> list[str]:
    kinds = field_kinds(users_class(type(element)))
    return [
        name for name, kind in kinds.items() if kind == "motion" and isinstance(getattr(element, name), AbstractMotion)
    ]


def _inputs(element: Any, arguments: tuple[Any, ...]) -> list[Any]:
    """Return the jets and arrays on which a method depends: its arguments, the laws at its time, and fields."""
    jets = [jet for argument in arguments for jet in _jets(argument)]
    laws = _laws(element)
    if isinstance(arguments[-1], Jet):
        jets += [getattr(element, name)(arguments[-1]) for name in laws]
    names = _fields_with_numbers(users_class(type(element)), laws)
    return [*jets, *jax.tree.leaves([getattr(element, name) for name in names])]


def _fields_with_numbers(kind: type, laws: Sequence[str]) -> list[str]:
    """Return the fields of a class except laws and static fields, which are constants of a program."""
    return [name for name in value_fields(kind) if name not in (*laws, *static_fields(kind))]


def _jets(argument: Any) -> list[Jet]:
    """Return the jets of an argument that have values of order zero."""
    if isinstance(argument, SpatialPose):
        return [argument.position, argument.quaternion, *argument.spins, *argument.axes]
    if isinstance(argument, PlanarPose):
        return [argument.position, argument.angle, argument.sine, argument.cosine]
    return [argument] if isinstance(argument, Jet) else []


class _Reader:
    """Reads the methods of an element as programs."""

    def __init__(self, element: Any, values: Mapping[str, Any], components: int):
        self.kind = type(element)
        stacked = stack_elements([element], [values])
        if "offset" in value_fields(self.kind) and stacked.offset is None:
            stacked = with_fields(stacked, offset=np.zeros((1, 1)))  # set later, from the poses of the bodies
        self.element, self.laws = stacked, _laws(stacked)
        self.settled = all(field.init for field in dataclasses.fields(self.kind))
        self.poses = [_example(components) for _ in element.bodies]
        self.time = _series((), ORDER)

    def check_positions(self) -> None:
        """Raise UnsupportedError if a residual uses velocities, and so has fewer derivatives than its bodies."""
        example = (*self.poses, self.time)
        try:
            inspect.signature(self.kind.residual).bind(self.element, *example)
        except TypeError:
            message = (
                f"the residual of {self.kind.__qualname__} must take the poses of {len(self.poses)} bodies and the "
                "time: residual(self, body_i, body_j, time); a class for another number of bodies states body_count"
            )
            raise MechanismError(message) from None

        def residual() -> Any:
            poses = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), example)
            return self.kind.residual(self.element, *poses)

        try:
            shape = jax.eval_shape(residual)
        except JounceError:
            raise
        except Exception as failure:
            if not self.settled:
                return  # a field that is set later may be missing
            message = (
                f"the residual of {self.kind.__qualname__} cannot be evaluated ({type(failure).__name__}: "
                f"{str(failure).strip().partition(chr(10))[0]}): it must consist of operators and functions of "
                "jounce.jet on points, directions and angles of its bodies, without decisions by their values"
            )
            raise MechanismError(message) from failure
        if not isinstance(shape, Jet):
            message = (
                f"the residual of {self.kind.__qualname__} must return a jet, computed from those of its bodies; "
                "several equations are one jet by jn.joints.rows(first, second), not a list"
            )
            raise MechanismError(message)
        if shape.order < ORDER:
            message = (
                f"the residual of {self.kind.__qualname__} uses velocities, which no joint of your own may: it must "
                "be a function of the positions and attitudes of its bodies and of time, such as body.point, "
                "body.direction and body.angle; write a condition on velocities by its integral, if it has one"
            )
            raise UnsupportedError(message)

    def check_forces(self) -> None:
        """Raise MechanismError if a force is no jet, or its shape is not that of the displacement."""
        try:
            displacement, velocity = self._displacement()
            force = jax.eval_shape(self.element.force, displacement, velocity, self.time)
        except Exception:  # noqa: BLE001 - raised again when the force is used
            return
        if not isinstance(force, Jet) or force.shape != velocity.shape:
            message = (
                f"the force of {self.kind.__qualname__} must return a jet of the shape of its displacement, computed "
                "from displacement, velocity and time; a constant is 0*displacement + value"
            )
            raise MechanismError(message)

    def reading(self, name: str) -> Reading:
        user_method, arguments = getattr(self.kind, name), self._arguments(name)
        of_time = [name for name in self.laws if isinstance(arguments[-1], Jet)]
        law_series = {law: _series((), ORDER) for law in of_time}
        fields = _fields_with_numbers(self.kind, self.laws)
        leaves, tree = jax.tree.flatten([getattr(self.element, n) for n in fields])
        jets = [*(x for argument in arguments for x in _jets(argument)), *law_series.values(), *leaves]
        rates = [a.angular_velocity for a in arguments if isinstance(a, SpatialPose)]

        def called(given: Sequence[Any], rates: Iterator[Any]) -> Any:
            parts = iter(given[: len(given) - len(leaves)])
            poses = [_rebuilt(argument, parts, rates) for argument in arguments]
            laws = {law: _Prescribed(poses[-1], next(parts)) for law in of_time}
            numbers = jax.tree.unflatten(tree, given[len(given) - len(leaves) :])
            return user_method(with_fields(self.element, **dict(zip(fields, numbers, strict=True)), **laws), *poses)

        def on_values(*values: Any) -> Any:
            if not self.settled:
                raise ValueError("fields that are found later")
            jet_values, numbers = values[: len(values) - len(leaves)], values[len(values) - len(leaves) :]
            outcome = called([*(Jet([x]) for x in jet_values), *numbers], itertools.repeat(None))
            return outcome.coefficients[0] if isinstance(outcome, Jet) else outcome

        def whole() -> Any:
            return user_method(self.element, *jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), arguments))

        return read_method(on_values, lambda given, rates: called(given, iter(rates)), jets, rates, whole)

    def _arguments(self, name: str) -> tuple[Any, ...]:
        """Return examples of the arguments of a method."""
        if name == "admissible":
            return (self.time,)
        if name == "evaluate":
            return tuple(self.poses)
        if name in ("force", "energy"):
            x, v = self._displacement()
            return (x, v, self.time) if name == "force" else (x,)
        if name == "variation":
            return tuple(self.poses), tuple(self.poses), self.time
        return (*self.poses, self.time)

    def _displacement(self) -> tuple[Jet, Jet]:
        """Return shapes that represent the displacement of a force and its velocity."""

        def both(*given: Any) -> Any:
            return self.element.displacement(*given), self.element.velocity(*given)

        shapes = [x.coefficients[0].shape for x in jax.eval_shape(both, *self.poses, self.time)]
        return tuple(_series(shape[:-2], ORDER - k) for k, shape in enumerate(shapes))  # pyright: ignore


def _series(shape: tuple[int, ...], order: int) -> Jet:
    """Return shapes that represent a jet of one instance at one instant."""
    return Jet([jax.ShapeDtypeStruct((*shape, 1, 1), float)] * (order + 1))


def _example(components: int) -> Pose:
    """Return shapes that represent the pose of a body."""
    if components == 2:
        return PlanarPose(_series((2,), ORDER), *(_series((), ORDER) for _ in range(3)))
    spins, axes = (tuple(_series((size,), ORDER) for _ in range(3)) for size in (4, 3))
    return SpatialPose(_series((3,), ORDER), _series((4,), ORDER), spins, axes, _series((3,), ORDER - 1))


def _rebuilt(argument: Any, jets: Iterator[Jet], rates: Iterator[Any]) -> Any:
    """Return an argument with its jets replaced."""
    if isinstance(argument, SpatialPose):
        position, quaternion, *parts = (next(jets) for _ in range(8))
        return SpatialPose(position, quaternion, tuple(parts[:3]), tuple(parts[3:]), next(rates))
    if isinstance(argument, PlanarPose):
        return PlanarPose(*(next(jets) for _ in range(4)))
    if not isinstance(argument, Jet):
        raise TypeError("several poses in one argument")
    return next(jets)
