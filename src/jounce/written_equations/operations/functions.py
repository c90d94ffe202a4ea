"""What code is made of: functions of coordinates, their arguments and results as numbers of the nodes of a graph."""

import dataclasses
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Int

from jounce.written_equations.operations.graph import Graph

Row = tuple["Argument", int | None]
"""An argument, and which of its rows, where it has one for each order."""


@dataclasses.dataclass(frozen=True)
class Argument:
    """An argument of a function.

    Parameters
    ----------
    name : str
        In code.
    labels : str, tuple of str, or tuple of tuple of str
        Of the inputs of the graph that it holds: of one, of several, or of several for each order.
    text : str
        What it is, for its readers.
    lead : int, default 0
        Of one by order: how many of its orders the first result needs; each further result needs one more.
    """

    name: str
    labels: Any
    text: str
    lead: int = 0

    @property
    def by_order(self) -> bool:
        """Whether it has a row of labels for each order."""
        return isinstance(self.labels, tuple) and isinstance(self.labels[0] if self.labels else "", tuple)

    def row(self, order: int | None) -> tuple[str, ...]:
        """Return the labels of a row, or of the whole."""
        if order is not None:
            return self.labels[order]
        return (self.labels,) if isinstance(self.labels, str) else self.labels


@dataclasses.dataclass(frozen=True)
class Function:
    """A function of coordinates.

    Parameters
    ----------
    name : str
        In code.
    arguments : tuple of Argument
    results : array of int
        Numbers of nodes.
    axes : tuple of str
        What the axes of the result are; the first is ``order`` where there is a result for each.
    text : str
        What it returns, one sentence.
    """

    name: str
    arguments: tuple[Argument, ...]
    results: Int[np.ndarray, "..."]
    axes: tuple[str, ...]
    text: str

    @property
    def by_order(self) -> bool:
        """Whether there is a result for each order, of which a caller may want the first ones alone."""
        return self.axes[0] == "order"

    @property
    def roots(self) -> list[int]:
        """All results, one after the other."""
        return [int(x) for x in self.results.ravel()]


class Stage(NamedTuple):
    """What a function computes together: the rows of its arguments that are read first here, and the results."""

    rows: list[Row]
    results: Int[np.ndarray, "..."]


def stages(function: Function) -> Iterator[Stage]:
    """Return what a function computes, one order after the other, or all at once."""
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
    """What a file holds.

    Parameters
    ----------
    title : str
        Of the model.
    subject : str
        What the functions are of it.
    graph : Graph
        Of all functions.
    order : int
        Highest derivative of the coordinates.
    labels : dict of str to tuple of str
        The labels of axes, by the name that they have in code.
    about : tuple of str
        What a reader must know, in sentences.
    functions : tuple of Function
    values : dict of str to tuple of float
        Constants by the name that they have in code.
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
        """How many operations the functions take."""
        return sum(len(self.graph.reached(function.roots)) for function in self.functions)

    @property
    def names(self) -> set[str]:
        """What arguments and functions are called."""
        return {f.name for f in self.functions} | {x.name for f in self.functions for x in f.arguments}
