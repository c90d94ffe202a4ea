"""Functions of coordinates in code, with their arguments and results as node numbers of a graph."""

import dataclasses
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Int

from jounce.written_equations.operations.graph import Graph

Row = tuple["Argument", int | None]
"""An argument, and the order of a row if the argument has one for each order."""


@dataclasses.dataclass(frozen=True)
class Argument:
    """An argument of a function.

    Parameters
    ----------
    name : str
        Name in code.
    labels : str, tuple of str, or tuple of tuple of str
        Labels of the inputs of the graph in the argument: of one, of several, or of several for each order.
    text : str
        Description for readers.
    lead : int, default 0
        Number of orders that the first result needs of an argument by order; each further result needs one more.
    """

    name: str
    labels: Any
    text: str
    lead: int = 0

    @property
    def by_order(self) -> bool:
        """Whether the argument has a row of labels for each order."""
        return isinstance(self.labels, tuple) and isinstance(self.labels[0] if self.labels else "", tuple)

    def row(self, order: int | None) -> tuple[str, ...]:
        """Return the labels of a row, or of the whole argument."""
        if order is not None:
            return self.labels[order]
        return (self.labels,) if isinstance(self.labels, str) else self.labels


@dataclasses.dataclass(frozen=True)
class Function:
    """A function of coordinates.

    Parameters
    ----------
    name : str
        Name in code.
    arguments : tuple of Argument
    results : array of int
        Numbers of nodes.
    axes : tuple of str
        Names of the axes of the result; the first is ``order`` if each order has a result.
    text : str
        Description of the result, one sentence.
    """

    name: str
    arguments: tuple[Argument, ...]
    results: Int[np.ndarray, "..."]
    axes: tuple[str, ...]
    text: str

    @property
    def by_order(self) -> bool:
        """Whether each order has a result; a caller may then request the first orders only."""
        return self.axes[0] == "order"

    @property
    def roots(self) -> list[int]:
        """All results as a list."""
        return [int(x) for x in self.results.ravel()]


class Stage(NamedTuple):
    """A stage of a function: the rows of arguments that the stage reads first, and its results."""

    rows: list[Row]
    results: Int[np.ndarray, "..."]


def stages(function: Function) -> Iterator[Stage]:
    """Return the stages of a function, one for each order, or a single one."""
    whole: list[Row] = [(argument, None) for argument in function.arguments if not argument.by_order]
    tables = [argument for argument in function.arguments if argument.by_order]
    if not function.by_order:
        yield Stage(whole + [(x, k) for x in tables for k in range(len(x.labels))], function.results)
        return
    for k, results in enumerate(function.results):
        rows: list[Row] = [(x, n) for x in tables for n in range(0 if k == 0 else x.lead + k - 1, x.lead + k)]
        yield Stage(whole + rows if k == 0 else rows, results)


@dataclasses.dataclass(frozen=True)
class Code:
    """The content of a file of equations.

    Parameters
    ----------
    title : str
        Title of the model.
    subject : str
        Description of the functions.
    graph : Graph
        Operations of all functions.
    order : int
        Highest derivative of the coordinates.
    labels : dict of str to tuple of str
        Labels of axes, by their name in code.
    about : tuple of str
        Notes for readers, in sentences.
    functions : tuple of Function
    values : dict of str to tuple of float
        Constants, by their name in code.
    """

    title: str
    subject: str
    graph: Graph
    order: int
    labels: dict[str, tuple[str, ...]]
    about: tuple[str, ...]
    functions: tuple[Function, ...]
    values: dict[str, tuple[float, ...]] = dataclasses.field(default_factory=dict)

    @property
    def size(self) -> int:
        """Number of operations of all functions."""
        return sum(len(self.graph.reached(function.roots)) for function in self.functions)

    @property
    def names(self) -> set[str]:
        """Names of arguments and functions."""
        return {f.name for f in self.functions} | {x.name for f in self.functions for x in f.arguments}
