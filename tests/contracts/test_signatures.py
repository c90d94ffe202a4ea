"""Every function that `jounce` offers says what it takes and what it returns."""

import ast
import inspect
import sys
import typing

import pytest

from tests import public_names


def functions():
    """Return the functions that `jounce` offers, by name; classes and types are none."""
    offered = {name: inspect.unwrap(value) for name, value in public_names.offered().items()}
    return {name: value for name, value in offered.items() if inspect.isfunction(value)}


def definitions(function):
    """Return the definitions of a function in its file: overloads have several."""
    tree = ast.parse(inspect.getsource(sys.modules[function.__module__]))
    return [node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == function.__name__]


def annotations(definition):
    """Yield what is annotated: the names of parameters, and "return"."""
    given = definition.args
    every = [*given.posonlyargs, *given.args, *given.kwonlyargs, given.vararg, given.kwarg]
    yield from ((parameter.arg, parameter.annotation) for parameter in every if parameter is not None)
    yield "return", definition.returns


def says_nothing(annotation, names):
    """Tell whether an annotation is missing, or is `Any`: by itself, in a union, as text, or under another name."""
    if isinstance(annotation, ast.Constant) and isinstance(annotation.value, str):
        annotation = ast.parse(annotation.value, mode="eval").body
    if isinstance(annotation, ast.BinOp):
        return says_nothing(annotation.left, names) or says_nothing(annotation.right, names)
    word = annotation.id if isinstance(annotation, ast.Name) else getattr(annotation, "attr", "")
    return annotation is None or word == "Any" or names.get(word) is typing.Any


def open_places(function):
    """Return the parameters, or "return", of which a function does not say what they are."""
    names = vars(sys.modules[function.__module__])
    every = [part for definition in definitions(function) for part in annotations(definition)]
    return sorted({name for name, annotation in every if says_nothing(annotation, names)})


def test_functions_say_what_they_take_and_return():
    found = functions()
    assert len(found) > 50
    assert [f"{name}, {place}" for name, function in found.items() for place in open_places(function)] == []


def test_help_shows_short_types():
    signatures = {name: str(inspect.signature(function)) for name, function in functions().items()}
    long = ("jaxtyping.", "_jax.Array | numpy.ndarray | collections")
    assert [name for name, text in signatures.items() if "." not in name and any(part in text for part in long)] == []
    assert "q: ArrayLike" in signatures["inverse_dynamics"]
    assert signatures["inverse_dynamics"].endswith("-> Array")
    assert "time: Optional[TimeLike] = None" in signatures["solve"]


Anything = typing.Any


@typing.overload
def example(annotated: int, given: typing.Any) -> int: ...
@typing.overload
def example(annotated: str, given: int | typing.Any = 0) -> "Anything": ...
def example(annotated: int | str, given=0, *more: Anything, **others: list[typing.Any]) -> int | str:
    return annotated


def complete(annotated: "int | None", *, others: dict[str, typing.Any]) -> None:
    return None


@pytest.mark.parametrize("function, expected", [(example, ["given", "more", "return"]), (complete, [])])
def test_what_says_nothing_is_found(function, expected):
    assert open_places(function) == expected
