"""Dataclasses that are pytrees of JAX, and fast copies of them with other values, without checks.

A model is built from modules that were checked already, and every solution makes several copies of each: one call of
`dataclasses.replace` takes longer than a step of Newton's method.
"""

import dataclasses
import inspect
import operator
from abc import ABCMeta
from collections.abc import Callable, Iterable, Mapping, Set
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar, dataclass_transform, overload

import jax
import numpy as np

from jounce.errors import MechanismError

if TYPE_CHECKING:

    class Names:
        """Names in a tuple, for which one name may be given: a descriptor, as mypy reads no converters."""

        @overload
        def __get__(self, instance: None, owner: Any) -> "Names": ...
        @overload
        def __get__(self, instance: object, owner: Any) -> tuple[str, ...]: ...
        def __get__(self, instance: Any, owner: Any) -> Any: ...
        def __set__(self, instance: Any, value: str | Iterable[str]) -> None: ...
else:
    Names = tuple[str, ...]

_being_made: set[int] = set()  # identities of modules in `__init__`


def as_names(given: str | Iterable[str]) -> tuple[str, ...]:
    """Return one name of a body, or several in their order, as a tuple."""
    if isinstance(given, str):
        return (given,)
    ordered = isinstance(given, Iterable) and not isinstance(given, Set)
    names = tuple(given) if ordered else ()
    if not ordered or not all(isinstance(name, str) for name in names):
        raise MechanismError("must be names of bodies in their order", name="bodies", value=given)
    return names


def field(*, static: bool = False, converter: Callable[[Any], Any] | None = None, **options: Any) -> Any:
    """Return a field of a module, as `dataclasses.field` does, with metadata compatible with Equinox.

    Parameters
    ----------
    static : bool, default False
        Whether the value is a constant for JAX: programs are compiled for each different value.
    converter : callable, optional
        Function from the given value to the stored one.
    **options
        Options of `dataclasses.field`.
    """
    metadata = dict(options.pop("metadata", {}))
    if static:
        metadata["static"] = True
    if converter is not None:
        metadata["converter"] = converter
    return dataclasses.field(metadata=metadata, **options)


class _Layout(NamedTuple):
    """The layout of a class of modules: fields by kind, converters and checks."""

    own_init: bool  # whether `__init__` is not generated
    traced: tuple[str, ...]
    static: tuple[str, ...]
    converters: tuple[tuple[str, Callable[[Any], Any]], ...]
    checks: tuple[Callable[[Any], None], ...]


@dataclass_transform(field_specifiers=(dataclasses.field, field))
class _ModuleType(ABCMeta):
    """Metaclass of dataclasses that are pytrees of JAX.

    There are no virtual subclasses, so `isinstance` need not search for them.
    """

    __layout__: _Layout

    def __new__(mcs, name: str, bases: tuple[type, ...], namespace: dict[str, Any], /, **keywords: Any) -> Any:
        kind: Any = super().__new__(mcs, name, bases, namespace, **keywords)
        own_init = "__init__" in namespace or any(_has_own_init(base) for base in bases)
        kind = dataclasses.dataclass(eq=False, repr=False, init=not own_init)(kind)
        fields = dataclasses.fields(kind)
        layout = kind.__layout__ = _Layout(
            own_init,
            traced=tuple(f.name for f in fields if not f.metadata.get("static", False)),
            static=tuple(f.name for f in fields if f.metadata.get("static", False)),
            converters=tuple((f.name, f.metadata["converter"]) for f in fields if f.metadata.get("converter")),
            checks=tuple(vars(base)["__check_init__"] for base in kind.__mro__ if "__check_init__" in vars(base)),
        )
        for converted, _ in layout.converters:  # type checkers see the given value, which may have any type
            if converted in kind.__init__.__annotations__:
                kind.__init__.__annotations__[converted] = Any
        _register(kind, layout)
        return kind

    @property
    def __signature__(cls) -> inspect.Signature:
        """The signature of `__init__`, for `help`, instead of that of `__call__`."""
        signature = inspect.signature(cls.__init__)
        return signature.replace(parameters=list(signature.parameters.values())[1:])

    if not TYPE_CHECKING:  # type checkers see plain dataclasses
        __instancecheck__ = type.__instancecheck__

        def __call__(cls, *arguments, **keywords):
            module, layout = cls.__new__(cls, *arguments, **keywords), cls.__layout__
            _being_made.add(id(module))
            try:
                cls.__init__(module, *arguments, **keywords)
            finally:
                _being_made.discard(id(module))
            namespace = vars(module)
            for name in (*layout.traced, *layout.static):
                if name not in namespace and not hasattr(cls, name):
                    raise TypeError(f"{cls.__qualname__}: __init__ gives the field {name!r} no value")
            for name, converter in layout.converters:
                namespace[name] = converter(namespace[name])
            for name in layout.static:
                if isinstance(namespace.get(name), jax.Array):
                    raise TypeError(f"{cls.__qualname__}.{name}: a static field cannot hold an array of JAX")
            for check in layout.checks:
                check(module)
            return module


def _has_own_init(base: type) -> bool:
    return base.__layout__.own_init if isinstance(base, _ModuleType) else base.__init__ is not object.__init__


def _register(kind: type, layout: _Layout) -> None:
    """Register a class of modules as a pytree of JAX whose children are the fields that are not static."""
    traced, static = _getter(layout.traced), _getter(layout.static)
    keys, names = tuple(map(jax.tree_util.GetAttrKey, layout.traced)), (*layout.traced, *layout.static)

    def flatten(module: Any) -> tuple[Any, Any]:
        return traced(module), static(module)

    def flatten_with_keys(module: Any) -> tuple[Any, Any]:
        return tuple(zip(keys, traced(module), strict=True)), static(module)

    def unflatten(constants: Any, values: Any) -> Any:
        module = object.__new__(kind)
        vars(module).update(zip(names, (*values, *constants), strict=True))
        return module

    jax.tree_util.register_pytree_with_keys(kind, flatten_with_keys, unflatten, flatten)


def _getter(names: tuple[str, ...]) -> Callable[[Any], tuple[Any, ...]]:
    """Return a function that returns the values of attributes as a tuple."""
    if len(names) > 1:
        return operator.attrgetter(*names)
    getter = operator.attrgetter(*names) if names else None
    return (lambda _: ()) if getter is None else lambda module: (getter(module),)


class Module(metaclass=_ModuleType):
    """An immutable dataclass that is a pytree of JAX.

    Subclasses declare fields, as dataclasses do, with `field(static=True)` for constants of JAX. After `__init__`,
    converters run, and then `__check_init__` of its class and of each of its bases.
    """

    if TYPE_CHECKING:  # classes of joints, laws and outputs have facts as attributes, too

        def __getattr__(self, name: str) -> Any: ...

    else:

        def __setattr__(self, name, value):
            if id(self) in _being_made and name in field_names(type(self)):
                object.__setattr__(self, name, value)
                return
            kind = type(self).__qualname__
            if id(self) in _being_made:
                message = f"{kind} has no field {name!r}: declare it in the class, as in `{name}: float`"
            else:
                message = f"cannot assign to field {name!r} of {kind}: make a copy by dataclasses.replace"
            raise dataclasses.FrozenInstanceError(message)

        def __delattr__(self, name):
            raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r} of {type(self).__qualname__}")

    def __repr__(self) -> str:
        given = {f.name: getattr(self, f.name) for f in dataclasses.fields(self) if f.repr and not _is_default(self, f)}
        return f"{type(self).__qualname__}({', '.join(f'{name}={_shown(value)}' for name, value in given.items())})"

    def __hash__(self) -> int:
        return hash((type(self), *(getattr(self, name) for name in field_names(type(self)))))

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return False
        (a, structure), (b, other_structure) = jax.tree.flatten(self), jax.tree.flatten(other)
        return structure == other_structure and all(map(_is_same, a, b))


def _is_default(module: Module, field: dataclasses.Field) -> bool:
    value = getattr(module, field.name)
    return value is field.default or (isinstance(value, bool | int | float | str) and value == field.default)


def _shown(value: Any) -> str:
    """Return the text of a value; a large array is shown by its type and shape."""
    if isinstance(value, np.ndarray | jax.Array) and value.size > 12:
        return f"{value.dtype}{list(value.shape)}"
    return repr(value)


def _is_same(a: Any, b: Any) -> bool:
    """Return whether leaves have the same type and are equal, arrays in all entries."""
    if a is b:
        return True
    if isinstance(a, np.ndarray | np.generic | jax.Array):
        is_alike = type(a) is type(b) and a.shape == b.shape and a.dtype == b.dtype
        return is_alike and bool((np.asarray(a) == np.asarray(b)).all())
    return type(a) is type(b) and bool(a == b)


@dataclasses.dataclass(unsafe_hash=True)
class Untraced:
    """Data of a module that JAX ignores: all instances are equal, so that compiled programs do not depend on them."""

    value: Any = dataclasses.field(compare=False)
    derived: Any = dataclasses.field(default=None, compare=False)


M = TypeVar("M")


def with_fields(module: M, **values: Any) -> M:
    """Return a module or dataclass with new values of some fields, without converters and checks.

    Examples
    --------
    >>> from jounce.base.modules import Module, with_fields
    >>> class Spring(Module):
    ...     stiffness: float
    ...     length: float
    >>> with_fields(Spring(3.0, 0.1), length=0.2)
    Spring(stiffness=3.0, length=0.2)
    """
    names, contents = field_names(type(module)), vars(module)
    if not values.keys() <= names:
        raise TypeError(f"{type(module).__name__} has no field {sorted(values.keys() - names)}")
    own = contents if contents.keys() <= names else {name: contents[name] for name in names if name in contents}
    return unchecked(type(module), {**own, **values})


def unchecked(kind: type[M], values: Mapping[str, Any]) -> M:
    """Return a module with given values of all fields, without converters and checks."""
    module = object.__new__(kind)
    vars(module).update(values)
    return module


@lru_cache(maxsize=1000)
def field_names(kind: type[Any]) -> Set[str]:
    """Return the names of the fields of a dataclass, in their order."""
    return dict.fromkeys(field.name for field in dataclasses.fields(kind)).keys()


@jax.tree_util.register_pytree_node_class
class ReadOnlyDict(dict):
    """An immutable dictionary whose errors name the alternative; for JAX a pytree, like a dictionary.

    Examples
    --------
    >>> ReadOnlyDict({"a": 1}, "make another one")["a"] = 2
    Traceback (most recent call last):
    TypeError: these entries do not change: make another one
    """

    def __init__(self, entries: Mapping[str, Any], instead: str) -> None:
        super().__init__(entries)
        self.instead = instead

    def __reduce__(self) -> Any:
        return ReadOnlyDict, (dict(self), self.instead)

    def tree_flatten(self) -> tuple[list[Any], tuple[tuple[str, ...], str]]:
        """See `jax.tree_util.register_pytree_node_class`."""
        names = tuple(sorted(self))
        return [self[name] for name in names], (names, self.instead)

    @classmethod
    def tree_unflatten(cls, form: tuple[tuple[str, ...], str], values: Iterable[Any]) -> "ReadOnlyDict":
        """See `jax.tree_util.register_pytree_node_class`."""
        names, instead = form
        return cls(dict(zip(names, values, strict=True)), instead)

    def _refuse(self, *_: Any, **__: Any) -> Any:
        raise TypeError(f"these entries do not change: {self.instead}")

    __setitem__ = __delitem__ = __ior__ = update = pop = popitem = clear = setdefault = _refuse  # type: ignore[assignment]


def read_only(entries: Mapping[str, Any], instead: str) -> ReadOnlyDict:
    """Return entries as a `ReadOnlyDict`, the same object if they are one."""
    return entries if isinstance(entries, ReadOnlyDict) else ReadOnlyDict(entries, instead)


def belongs_to_package(thing: Any) -> bool:
    """Return whether a class or function belongs to this package, by the name of its module.

    Examples
    --------
    >>> from jounce.base.modules import Module, belongs_to_package
    >>> belongs_to_package(Module), belongs_to_package(print)
    (True, False)
    """
    module = getattr(thing, "__module__", None)
    return type(module) is str and (module.startswith("jounce.") or module == "jounce")


def changes_parts(kind: type, general: tuple[type, ...], known: Iterable[str] = ()) -> bool:
    """Return whether a user's class overrides an attribute that methods of this package may use.

    Parameters
    ----------
    kind : type
        A class derived from one of this package.
    general : tuple of type
        Abstract classes of this package, whose attributes are meant to be overridden.
    known : iterable of str, optional
        Names that may be overridden.
    """
    if belongs_to_package(kind):
        return False
    bases = [base for base in kind.__mro__ if belongs_to_package(base) and base not in (*general, Module)]
    names = {name for base in bases for name in vars(base) if name[:2] != "__" and name[:4] != "_abc"}
    return any(
        name in names.difference(known) for base in kind.__mro__ if not belongs_to_package(base) for name in vars(base)
    )
