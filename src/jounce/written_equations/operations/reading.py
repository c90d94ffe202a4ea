"""JAX programs read into a graph of operations on single numbers."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import JaxprEqn
from jaxtyping import Int

from jounce.jet.programs.operations import COMPOSED
from jounce.jet.programs.reader import ProgramReader
from jounce.written_equations.operations.graph import REAL, TRUTH, WHOLE, Graph

MOST_ENTRIES = 200_000  # limit on the entries of a table
_SAME = {
    "add": "add", "add_any": "add", "sub": "sub", "mul": "mul", "div": "div", "neg": "neg", "max": "max", "min": "min",
    "rem": "rem", "abs": "abs", "sign": "sign", "pow": "pow", "atan2": "atan2", "lt": "lt", "le": "le", "gt": "gt",
    "ge": "ge", "eq": "eq", "ne": "ne", "and": "and", "or": "or", "not": "not", "is_finite": "is_finite",
    "sqrt": "sqrt", "cbrt": "cbrt", "exp": "exp", "expm1": "expm1", "log": "log", "log1p": "log1p", "sin": "sin",
    "cos": "cos", "tan": "tan", "asin": "asin", "acos": "acos", "atan": "atan", "sinh": "sinh", "cosh": "cosh",
    "tanh": "tanh", "asinh": "asinh", "acosh": "acosh", "atanh": "atanh", "erf": "erf", "erfc": "erfc",
    "floor": "floor", "ceil": "ceil",
}  # fmt: skip
_MOVING = frozenset(
    "broadcast_in_dim concatenate copy expand_dims gather pad reshape rev slice split squeeze stack "
    "transpose dynamic_slice copy_p unstack".split()
)
_BY_NUMPY: dict[str, Callable[..., Any]] = {  # without compilation of a program for each shape
    "broadcast_in_dim": lambda x, *, shape, broadcast_dimensions, **_: np.broadcast_to(
        x.reshape(
            [x.shape[broadcast_dimensions.index(k)] if k in broadcast_dimensions else 1 for k in range(len(shape))]
        ),
        shape,
    ),
    "concatenate": lambda *xs, dimension, **_: np.concatenate(xs, dimension),
    "copy": lambda x, **_: x,
    "copy_p": lambda x, **_: x,
    "expand_dims": lambda x, *, dimensions, **_: np.expand_dims(x, dimensions),
    "reshape": lambda x, *, new_sizes, **_: x.reshape(new_sizes),
    "rev": lambda x, *, dimensions, **_: np.flip(x, dimensions),
    "slice": lambda x, *, start_indices, limit_indices, strides, **_: x[
        tuple(map(slice, start_indices, limit_indices, strides or (None,) * x.ndim))
    ],
    "squeeze": lambda x, *, dimensions, **_: np.squeeze(x, dimensions),
    "transpose": lambda x, *, permutation, **_: np.transpose(x, permutation),
}
_UNCHANGED = frozenset("optimization_barrier stop_gradient reduce_precision".split())
_REDUCED = {
    "reduce_sum": "add", "reduce_max": "max", "reduce_min": "min", "reduce_and": "and", "reduce_or": "or",
    "reduce_prod": "mul",
}  # fmt: skip
_COMPOSED = {name: COMPOSED[name] for name in ("dot_general", "integer_pow", "rsqrt", "exp2", "clamp", "square")} | {
    "logistic": lambda x, **_: 1.0 / (1.0 + jnp.exp(-x)),
}


class UnwritableOperationError(Exception):
    """An operation is not one on numbers, and cannot be written out."""


class Entries:
    """An array of numbers of a graph.

    Parameters
    ----------
    numbers : array of int
        Numbers of the nodes.
    dtype : dtype
        Type of the values of the nodes.
    """

    def __init__(self, numbers: Any, dtype: Any):
        self.numbers: Int[np.ndarray, "..."] = np.asarray(numbers, np.int64)
        self.dtype = np.dtype(dtype)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the array."""
        return self.numbers.shape


class GraphReader(ProgramReader):
    """A reader of programs into a graph.

    Parameters
    ----------
    graph : Graph
        The graph, to which the reader adds nodes.

    Raises
    ------
    UnwritableOperationError
        If a program holds an operation that is not one on numbers: a loop of unknown length, a linear solve.
    """

    moving = Entries

    def __init__(self, graph: Graph):
        self.graph = graph

    def function(self, function: Callable[..., Any], *arguments: Any) -> list[Entries]:
        """Return the results of a function of pytrees with `Entries` or arrays as leaves, as a list."""
        leaves, structure = jax.tree.flatten(arguments, is_leaf=lambda x: isinstance(x, Entries))
        shapes = [jax.ShapeDtypeStruct(np.shape(x), x.dtype) for x in map(self._array_or_entries, leaves)]
        program = jax.make_jaxpr(lambda *given: function(*jax.tree.unflatten(structure, given)))(*shapes)
        results = self.read(program.jaxpr, program.consts, leaves)
        return [self.entries(x) for x in results]

    def results(self, equation: JaxprEqn, operands: list[Any]) -> list[Any]:
        """Return the results of one operation, which may contain programs."""
        name = equation.primitive.name
        if name in _BY_NUMPY and not any(isinstance(x, Entries) for x in operands):
            return [_BY_NUMPY[name](*map(np.asarray, operands), **equation.params)]
        return super().results(equation, operands)

    def value(self, x: Any) -> Any:
        """Return the array of a constant, or the shape of another value."""
        return jax.ShapeDtypeStruct(x.shape, x.dtype) if isinstance(x, Entries) else x

    def entries(self, x: Any) -> Entries:
        """Return a value as entries of the graph."""
        if isinstance(x, Entries):
            return x
        array = np.asarray(x)
        numbers = [self.graph.constant(value) for value in array.ravel().tolist()]
        return Entries(np.array(numbers, np.int64).reshape(array.shape), array.dtype)

    def applied(self, equation: JaxprEqn, operands: list[Any]) -> list[Any]:
        """Return the results of an operation on values."""
        name, parameters = equation.primitive.name, equation.params
        avals: list[Any] = [v.aval for v in equation.outvars]
        dtypes = [aval.dtype for aval in avals]
        if name in _UNCHANGED:
            return operands[: len(dtypes)]
        if name in _COMPOSED:
            return [self.composed(lambda *xs: _COMPOSED[name](*xs, **parameters), operands)]
        given = [self.entries(x) for x in operands]
        if name == "convert_element_type":
            return [self._converted(given[0], parameters["new_dtype"])]
        if name == "round":
            return [self._each(dtypes[0], self._rounded(parameters), *given)]
        if name in _SAME:
            return [self._each(dtypes[0], lambda *xs: self.graph.apply(_SAME[name], *xs), *given)]
        if name == "select_n":
            return [self._each(dtypes[0], self._selected, *given)]
        if name in _REDUCED:
            return [self._reduced(_REDUCED[name], given[0], list(map(int, parameters["axes"])), dtypes[0])]
        if name == "cumsum":
            return [self._summed_up(given[0], parameters["axis"], reverse=parameters["reverse"])]
        if name == "dynamic_update_slice":
            return [self._updated(given)]
        if name in ("scatter", "scatter-add"):
            return [self._scatter_entries(equation, given)]
        if name in _MOVING:
            return self._moved(equation, operands, given, dtypes)
        raise UnwritableOperationError(f"it has the operation '{name}' of JAX, which is none on numbers")

    def _array_or_entries(self, leaf: Any) -> Any:
        return leaf if isinstance(leaf, Entries) else np.asarray(leaf)

    def _each(self, dtype: Any, function: Callable[..., int], *given: Entries) -> Entries:
        with np.errstate(all="ignore"):  # of folded constants, such as comparisons with NaN
            numbers = np.frompyfunc(function, len(given), 1)(*(x.numbers for x in given))
        return Entries(np.asarray(numbers, np.int64), dtype)

    def _converted(self, given: Entries, dtype: Any) -> Entries:
        kind = TRUTH if np.issubdtype(dtype, np.bool_) else WHOLE if np.issubdtype(dtype, np.integer) else REAL

        def converted(number: int) -> int:
            if kind == TRUTH:
                zero = self.graph.constant(0 if self.graph.nodes[number].kind == WHOLE else 0.0)
                return number if self.graph.nodes[number].kind == TRUTH else self.graph.apply("ne", number, zero)
            return self.graph.apply(kind, number)

        return self._each(dtype, converted, given)

    def _rounded(self, parameters: dict[str, Any]) -> Callable[[int], int]:
        if parameters["rounding_method"] == jax.lax.RoundingMethod.TO_NEAREST_EVEN:
            return lambda x: self.graph.apply("round", x)

        def away(x: int) -> int:  # from zero
            size = self.graph.apply(
                "floor", self.graph.apply("add", self.graph.apply("abs", x), self.graph.constant(0.5))
            )
            return self.graph.apply("mul", self.graph.apply("sign", x), size)

        return away

    def _selected(self, choice: int, *cases: int) -> int:
        selected = cases[-1]
        if self.graph.nodes[choice].kind == TRUTH:
            return self.graph.apply("where", choice, cases[1], cases[0])
        for k in reversed(range(len(cases) - 1)):
            selected = self.graph.apply(
                "where", self.graph.apply("eq", choice, self.graph.constant(k)), cases[k], selected
            )
        return selected

    def _reduced(self, name: str, given: Entries, axes: Sequence[int], dtype: Any) -> Entries:
        remaining = [axis for axis in range(given.numbers.ndim) if axis not in axes]
        shape = [given.shape[axis] for axis in remaining]
        rows = np.transpose(given.numbers, [*remaining, *axes]).reshape(math.prod(shape), -1).tolist()
        totals = []
        for row in rows:
            result = row[0] if row else self.graph.constant(np.zeros((), dtype).item())
            for number in row[1:]:
                result = self.graph.apply(name, result, number)
            totals.append(result)
        return Entries(np.array(totals, np.int64).reshape(shape), dtype)

    def _summed_up(self, given: Entries, axis: int, *, reverse: bool) -> Entries:
        rows = np.moveaxis(given.numbers, axis, 0)
        rows = rows[::-1] if reverse else rows
        sums = [rows[:1]]
        for k in range(1, len(rows)):
            sums.append(self._each(given.dtype, lambda a, b: self.graph.apply("add", a, b), *(
                Entries(x, given.dtype) for x in (sums[-1], rows[k : k + 1])
            )).numbers)  # fmt: skip
        totals = np.concatenate(sums[::-1] if reverse else sums)
        return Entries(np.moveaxis(totals, 0, axis), given.dtype)

    def _updated(self, given: list[Entries]) -> Entries:
        target, part, *starts = given
        if not self.graph.is_constant(*(int(s.numbers) for s in starts)):
            raise UnwritableOperationError("it replaces an entry of an array at an index that changes")
        offsets = [self.graph.value(int(s.numbers)) for s in starts]
        offsets = [min(max(b, 0), n - m) for b, n, m in zip(offsets, target.shape, part.shape, strict=True)]
        numbers = target.numbers.copy()
        numbers[tuple(slice(b, b + m) for b, m in zip(offsets, part.shape, strict=True))] = part.numbers
        return Entries(numbers, target.dtype)

    def _scatter_entries(self, equation: JaxprEqn, given: list[Entries]) -> Entries:
        """Return an array with entries at known places replaced, or with values added to them."""
        target, indices, parts = given
        if not self.graph.is_constant(*indices.numbers.ravel().tolist()):
            raise UnwritableOperationError("it writes at an index that changes")
        values = np.array([self.graph.value(n) for n in indices.numbers.ravel().tolist()], indices.dtype)
        values = jnp.asarray(values.reshape(indices.shape))

        def added(updates: Any) -> Any:
            names = ("dimension_numbers", "indices_are_sorted", "unique_indices", "mode")
            options = {word: equation.params[word] for word in names}
            return jax.lax.scatter_add(jnp.zeros(target.shape), values, updates, **options)

        # the transpose gives each update the number of the place to which it is added, 0 for none
        numbered = jnp.arange(1.0, target.numbers.size + 1).reshape(target.shape)
        (owners,) = jax.linear_transpose(added, jax.ShapeDtypeStruct(parts.shape, jnp.float64))(numbered)
        numbers = target.numbers.copy()
        for owner, part in zip(np.asarray(owners, int).ravel().tolist(), parts.numbers.ravel().tolist(), strict=True):
            if owner:
                place = np.unravel_index(owner - 1, target.shape)
                adds = equation.primitive.name == "scatter-add"
                numbers[place] = self.graph.apply("add", int(numbers[place]), part) if adds else part
        return Entries(numbers, target.dtype)

    def _moved(self, equation: JaxprEqn, operands: list[Any], given: list[Entries], dtypes: list[Any]) -> list[Any]:
        """Return the results of an operation that moves entries, by moving the numbers of nodes."""
        name = equation.primitive.name
        indices = {"gather": given[1:2], "dynamic_slice": given[1:]}.get(name, [])
        if not self.graph.is_constant(*(int(n) for x in indices for n in x.numbers.ravel())):
            return [self._looked_up(equation, operands[0], indices, dtypes[0])]
        values = [np.array([self.graph.value(int(n)) for n in x.numbers.ravel()]).reshape(x.shape) for x in indices]
        values = [np.asarray(x, i.dtype) for x, i in zip(values, indices, strict=True)]
        positions = [x.numbers for x in given[: len(given) - len(indices)]]
        if name in _BY_NUMPY:
            return [Entries(_BY_NUMPY[name](*positions, **equation.params), dtypes[0])]
        filled = {"fill_value": 0} if name == "gather" else {}  # beyond the ends: the number of no operation
        results = equation.primitive.bind(*map(jnp.asarray, [*positions, *values]), **(equation.params | filled))
        results = [np.asarray(x) for x in (results if equation.primitive.multiple_results else [results])]
        if name == "gather" and (results[0] == 0).any():
            fill_value = self.graph.constant(np.full((), np.nan, dtypes[0]).item() if dtypes[0].kind == "f" else 0)
            results = [np.where(results[0] == 0, fill_value, results[0])]
        return [Entries(x, dtype) for x, dtype in zip(results, dtypes, strict=True)]

    def _looked_up(self, equation: JaxprEqn, table: Any, indices: list[Entries], dtype: Any) -> Entries:
        """Return entries of a table at indices unknown in advance."""
        if isinstance(table, Entries):
            if not self.graph.is_constant(*table.numbers.ravel().tolist()):
                raise UnwritableOperationError("it reads a table whose entries change at an index that changes")
            table = np.array([self.graph.value(n) for n in table.numbers.ravel().tolist()]).reshape(table.shape)
        symbols = [n for x in indices for n in x.numbers.ravel().tolist() if not self.graph.is_constant(n)]
        ranges = {n: self.graph.ranges[n] for n in symbols}
        count = max(high - low + 1 for low, high in ranges.values())
        tried = [np.zeros((count, *x.shape), x.dtype) for x in indices]
        for x, values in zip(indices, tried, strict=True):
            for place in np.ndindex(*x.shape):
                number = int(x.numbers[place])
                if number in ranges:
                    low, high = ranges[number]
                    values[(slice(None), *place)] = np.minimum(np.arange(low, low + count), high)
                else:
                    values[(slice(None), *place)] = self.graph.value(number)
        function = jax.vmap(lambda *at: equation.primitive.bind(table, *at, **equation.params))
        entries = np.asarray(function(*tried))
        if entries.size > MOST_ENTRIES:
            raise UnwritableOperationError(f"it has a table of {entries.size} numbers, more than {MOST_ENTRIES}")
        owners = self._owners(equation, indices, entries.shape[1:])
        numbers = np.zeros(entries.shape[1:], np.int64)
        for place in np.ndindex(*numbers.shape):
            row = sorted({n for n in owners[place] if n in ranges})
            if len(row) > 1:
                raise UnwritableOperationError("it reads a table at two indices that change")
            column = entries[(slice(None), *place)]
            if not row:
                numbers[place] = self.graph.constant(column[0].item())
                continue
            low, high = ranges[row[0]]
            column = column[: high - low + 1].tolist()
            index = self.graph.apply("sub", row[0], self.graph.constant(low)) if low else row[0]
            numbers[place] = self.graph.lookup(column, index)
        return Entries(numbers, dtype)

    def _owners(self, equation: JaxprEqn, indices: list[Entries], shape: tuple[int, ...]) -> np.ndarray:
        """Return the indices by which each result is looked up."""
        owners = np.empty(shape, object)
        if equation.primitive.name == "dynamic_slice":
            numbers = [int(x.numbers) for x in indices]
            for place in np.ndindex(*shape):
                owners[place] = numbers
            return owners
        rows = indices[0].numbers
        offsets = equation.params["dimension_numbers"].offset_dims
        for place in np.ndindex(*shape):
            batch = tuple(k for axis, k in enumerate(place) if axis not in offsets)
            owners[place] = rows[batch].tolist()
        return owners
