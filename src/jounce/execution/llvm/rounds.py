"""A function of one instant run for many in rounds, where later rounds start from the results of earlier ones.

A round has as many instants as a vector has lanes. The machine code gathers their arguments from the sources in the
caller's arrays, solves them, and scatters the results to their own places. There is no Python call and no new array for
a round, and Python's lock is not held. Arguments from the previous round are copied from its results, a vector at a
time, without the caller's arrays.
"""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Int

from jounce.execution.buffer_pool import address_of

LINE = 64  # bytes of a cache line, at which vectors begin
ENTRY = 8  # bytes of a copied number


class Column(NamedTuple):
    """An argument or a result of an instant, and its array for all instants, time last.

    The array is None for a result that is not needed.
    """

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    whole: np.ndarray | None

    def addresses(self, count: int) -> list[int]:
        """Return the addresses of the numbers of the first instant in an array of at least `count` instants.

        Raises
        ------
        ValueError
            If the machine code cannot read the array.
        """
        array: Any = self.whole
        result = array.shape[:-1], array.dtype, array.dtype.itemsize, array.strides[-1]
        if result != (self.shape, self.dtype, ENTRY, ENTRY) or array.shape[-1] < count:
            raise ValueError(
                f"an array of {array.dtype}{array.shape}, for {self.dtype}{self.shape} of {count} instants"
            )
        indices = [address_of(array)]
        for size, step in zip(array.shape[:-1], array.strides[:-1], strict=True):
            indices = [index + k * step for index in indices for k in range(size)]
        return indices

    @property
    def size(self) -> int:
        """Number of entries of an instant."""
        return math.prod(self.shape)

    def room(self, width: int) -> int:
        """Return the number of bytes of a round, in whole cache lines."""
        return -(-self.size * width * self.dtype.itemsize // LINE) * LINE


def rounds_text(width: int) -> str:
    """Return the text of a function `rounds`, which calls `run` for one round after another.

    Its arguments are: the addresses for `run`; pairs of addresses, each of a number of the first instant and of the
    same number in the first lane, in the order of copying, preceded by as many pairs for numbers read at sources, each
    of the result and of the argument in the first lane; the numbers of pairs read at sources, read at targets, and
    written at targets; the sources of all instants; the targets of all rounds; and the number of rounds.

    Parameters
    ----------
    width : int
        Lanes of a vector.
    """
    lines = [
        "define void @rounds(ptr %addresses, ptr %pairs, i64 %linked, i64 %own, i64 %kept, "
        "ptr %sources, ptr %targets, i64 %rounds) #1 {",
        "start:",
        "%has_rounds = icmp sgt i64 %rounds, 0",
        "br i1 %has_rounds, label %round, label %end",
        "round:",
        "%turn = phi i64 [0, %start], [%following, %written]",
        f"%first = mul i64 %turn, {width}",
        "%round_targets = getelementptr i64, ptr %targets, i64 %first",
    ]
    for lane in range(width):
        minimum = f"%least{lane - 1}" if lane else "0"
        lines += [
            f"%place{lane} = getelementptr i64, ptr %round_targets, i64 {lane}",
            f"%target{lane} = load i64, ptr %place{lane}",
            f"%from{lane} = getelementptr i64, ptr %sources, i64 %target{lane}",
            f"%source{lane} = load i64, ptr %from{lane}",
            f"%less{lane} = icmp slt i64 %source{lane}, {minimum}",
            f"%least{lane} = select i1 %less{lane}, i64 %source{lane}, i64 {minimum}",
        ]
    lines += [
        "%firsts = add i64 %linked, %linked",
        "%owns = add i64 %firsts, %own",
        "%ends = add i64 %owns, %kept",
        f"%carries = icmp slt i64 %least{width - 1}, 0",
        "br i1 %carries, label %carried, label %at_source",
        *_copies("carried", ("round", "0", "%linked"), "lane0", _vector("carried", width)),
        *(line for lane in range(width) for line in _started(lane, width)),
        *_copies("at_source", ("round", "%linked", "%firsts"), "known", _gathered("at_source", "source", width)),
        "known:",
        "br label %at_target",
        *_copies("at_target", ("known", "%firsts", "%owns"), "solve", _gathered("at_target", "target", width)),
        "solve:",
        f"call void @run(ptr %addresses, i64 {width})",
        "br label %found",
        *_copies("found", ("solve", "%owns", "%ends"), "written", _scattered("found", width)),
        "written:",
        "%following = add i64 %turn, 1",
        "%more = icmp slt i64 %following, %rounds",
        "br i1 %more, label %round, label %end",
        "end:",
        "ret void",
        "}",
    ]
    return "\n".join(lines)


def _copies(name: str, limits: tuple[str, str, str], after: str, copy: Sequence[str]) -> list[str]:
    """Return a loop over pairs; limits are the block before the loop, the first pair and the end of the pairs."""
    before, first, stop = limits
    return [
        f"{name}:",
        f"%{name}_pair = phi i64 [{first}, %{before}], [%{name}_next, %{name}_copy]",
        f"%{name}_left = icmp slt i64 %{name}_pair, {stop}",
        f"br i1 %{name}_left, label %{name}_copy, label %{after}",
        f"{name}_copy:",
        f"%{name}_at = getelementptr {{ptr, ptr}}, ptr %pairs, i64 %{name}_pair",
        f"%{name}_whole = load ptr, ptr %{name}_at",
        f"%{name}_second = getelementptr ptr, ptr %{name}_at, i64 1",
        f"%{name}_round = load ptr, ptr %{name}_second",
        *copy,
        f"%{name}_next = add i64 %{name}_pair, 1",
        f"br label %{name}",
    ]


def _vector(name: str, width: int) -> list[str]:
    """Return code that copies a result of all lanes to the argument of the next round."""
    llvm_type = f"<{width} x i64>"
    return [
        f"%{name}_all = load {llvm_type}, ptr %{name}_whole, align 8",
        f"store {llvm_type} %{name}_all, ptr %{name}_round, align 8",
    ]


def _started(lane: int, width: int) -> list[str]:
    """Return code that copies the numbers of the source of a lane, if it has one, and continues with the next lane."""
    name, after = f"start{lane}", f"lane{lane + 1}" if lane + 1 < width else "known"
    copy = [
        f"%{name}_from = getelementptr i64, ptr %{name}_whole, i64 %source{lane}",
        f"%{name}_to = getelementptr i64, ptr %{name}_round, i64 {lane}",
        f"%{name}_number = load i64, ptr %{name}_from",
        f"store i64 %{name}_number, ptr %{name}_to",
    ]
    return [
        f"lane{lane}:",
        f"%starts{lane} = icmp sge i64 %source{lane}, 0",
        f"br i1 %starts{lane}, label %{name}, label %{after}",
        *_copies(name, (f"lane{lane}", "%linked", "%firsts"), after, copy),
    ]


def _gathered(name: str, index: str, width: int) -> list[str]:
    """Return code that gathers a number of the instants of a round into its vector."""
    llvm_type, lines, vector = f"<{width} x i64>", [], "poison"
    for lane in range(width):
        prefix = f"%{name}_{lane}"
        lines += [
            f"{prefix}p = getelementptr i64, ptr %{name}_whole, i64 %{index}{lane}",
            f"{prefix}v = load i64, ptr {prefix}p",
            f"{prefix}w = insertelement {llvm_type} {vector}, i64 {prefix}v, i64 {lane}",
        ]
        vector = f"{prefix}w"
    return [*lines, f"store {llvm_type} {vector}, ptr %{name}_round, align 8"]


def _scattered(name: str, width: int) -> list[str]:
    """Return code that scatters a number of the instants of a round to their places."""
    llvm_type = f"<{width} x i64>"
    lines = [f"%{name}_all = load {llvm_type}, ptr %{name}_round, align 8"]
    for lane in range(width):
        prefix = f"%{name}_{lane}"
        lines += [
            f"{prefix}v = extractelement {llvm_type} %{name}_all, i64 {lane}",
            f"{prefix}p = getelementptr i64, ptr %{name}_whole, i64 %target{lane}",
            f"store i64 {prefix}v, ptr {prefix}p",
        ]
    return lines


class RoundRunner:
    """Machine code that solves instants in rounds, directly from and into arrays of all instants.

    Parameters
    ----------
    run : callable
        The function `rounds` of machine code.
    shared : sequence of array
        Shared arguments.
    linked, own, held, results : sequence of Column
        Arguments of an instant in their order: those linked to results of its source, its own, and those held for all
        instants, from arrays of one instant; and the results.
    sources : array of shape (time,)
        Index of the source of each instant, contiguous; negative for the same lane of the previous round.
    links : sequence of int
        For each linked argument, the index of the result that it is taken from.
    width : int
        Lanes of a vector.

    Raises
    ------
    ValueError
        If the machine code would access memory outside of the arrays.
    """

    def __init__(
        self,
        run: Callable[..., None],
        shared: Sequence[np.ndarray],
        linked: Sequence[Column],
        own: Sequence[Column],
        held: Sequence[Column],
        results: Sequence[Column],
        sources: Int[np.ndarray, " time"],
        links: Sequence[int],
        width: int,
    ):
        columns = [*linked, *own, *held, *results]
        self._run, self.width, self._sources = run, width, sources
        self._known = min((column.whole.shape[-1] for column in linked if column.whole is not None), default=0)
        self._check_sources()
        self._arrays = [np.ascontiguousarray(x) for x in shared], columns  # kept alive: addresses do not
        self._common = np.array([address_of(x) for x in self._arrays[0]], np.int64)
        ends = np.cumsum([0, *(column.room(width) for column in columns)])
        self._begins, self._blank = ends[:-1], np.zeros(ends[-1], np.uint8)
        offsets = iter(self._begins.tolist())
        at_source = _pairs(linked, offsets, width, self._known)
        at_target = _pairs(own, offsets, width, len(sources))
        for column, offset in zip(held, offsets, strict=False):
            numbers = np.repeat(np.asarray(column.whole, column.dtype).reshape(*column.shape, 1), width, axis=-1)
            self._blank[offset : offset + numbers.nbytes] = numbers.ravel().view(np.uint8)
        offsets = list(offsets)
        result = _pairs(results, iter(offsets), width, len(sources))
        self._counts = len(at_source), len(at_target), len(result)
        starts = (offsets[k] + width * ENTRY * n for k, x in zip(links, linked, strict=True) for n in range(x.size))
        copies = [(offset, given) for offset, (_, given) in zip(starts, at_source, strict=True)]
        self._pairs = np.array([*copies, *at_source, *at_target, *result], np.int64).reshape(-1, 2)
        self._within = np.array([[1, 1]] * len(copies) + [[0, 1]] * (len(self._pairs) - len(copies)))

    def __call__(self, targets: Int[np.ndarray, "round lane"]) -> None:
        """Solve the instants of given indices; several threads may solve disjoint instants at once.

        The sources of a round must be solved already, or be in an earlier round. The current contents of the arrays are
        read.
        """
        self._check_sources()
        count, width = len(self._sources), self.width
        in_range = targets.min(initial=0) >= 0 and targets.max(initial=-1) < count
        if in_range and self._sources[targets[:1]].min(initial=0) < 0:
            raise ValueError("sources in a round before the first one")
        if targets.dtype != np.int64 or targets.shape[1:] != (width,) or not in_range:
            raise ValueError(f"targets that are not {width} indices below {count} for each round")
        targets = np.ascontiguousarray(targets)
        memory = np.empty(len(self._blank) + LINE, np.uint8)  # a new block for each call, and so for each thread
        margin = -address_of(memory) % LINE
        memory[margin : margin + len(self._blank)] = self._blank
        start = address_of(memory) + margin
        addresses, pairs = np.concatenate([self._common, start + self._begins]), self._pairs + start * self._within
        indices = address_of(self._sources), address_of(targets)
        self._run(address_of(addresses), address_of(pairs), *self._counts, *indices, len(targets))

    def _check_sources(self) -> None:
        """Raise ValueError unless all sources are valid indices of the linked arrays."""
        result = self._sources
        if result.dtype != np.int64 or result.max(initial=-1) >= self._known or not result.flags.c_contiguous:
            raise ValueError(f"sources that are no indices below {self._known}")


def _pairs(columns: Sequence[Column], offsets: Iterator[int], width: int, count: int) -> list[tuple[int, int]]:
    """Return pairs of addresses: each number of the first of `count` instants, and its vector in a round."""
    result: list[tuple[int, int]] = []
    for column, offset in zip(columns, offsets, strict=False):
        if column.whole is not None:
            result += zip(column.addresses(count), itertools.count(offset, width * ENTRY), strict=False)
    return result
