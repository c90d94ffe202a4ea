"""Programs run on Taylor series one order at a time, for equations whose next coefficients are unknown until solved.

Jets evaluate an expression at all orders at once, from known inputs. For a differential equation, coefficient k of the
solution follows from the equation at order k, so the equation is evaluated order after order, each order once.
`Recursion` traces a JAX-traceable function, stores the coefficients of the factors of products, and computes the next
coefficients of the outputs from those of the inputs, in a loop over the orders.

In ``y = f(x)``, the newest coefficient of x enters that of y only as ``f'(x_0) x_k``. A solver may thus advance with
zero for the unknown, solve its linear equations, and add the effect of the unknown with `Recursion.corrected`. All
other products are of known coefficients: one sum over the orders for all of them side by side.
"""

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from functools import partial, reduce
from itertools import accumulate, pairwise
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import JaxprEqn

from jounce.base.jax_internals import by_certain_entries, is_by_certain_entries
from jounce.jet.coefficients import minus, plus, total
from jounce.jet.programs.operations import (
    ADDITIVE,
    BROADCASTING,
    COMPOSED,
    LINEAR,
    PAIRS,
    PLAIN,
    SLOPES,
    STEPWISE,
    times,
)
from jounce.jet.programs.product_history import ProductHistory
from jounce.jet.programs.reader import ProgramReader, only_adds


class _Pair(NamedTuple):
    """Two variables with a Cauchy product: ``sum_j left[j] right[k-j]``, or with the weight j."""

    left: int
    right: int
    weighted: bool


class _Node(NamedTuple):
    """One operation on series: the rule for its next coefficient, its operands and its result."""

    rule: Callable[..., Any]  # function of the coefficients of the operands, and of the sum over the pairs
    operands: tuple[Any, ...]  # numbers of variables, or constant arrays
    pairs: list[_Pair]
    result: int
    sparse: bool  # whether it runs under `by_certain_entries`


class Recursion(ProgramReader):
    """A function on series that runs order after order.

    Parameters
    ----------
    function : callable
        Maps arrays to a pytree of arrays by operations with derivatives of every order: arithmetic, elementary
        functions, selections. All branches are run; loops must be short and of known length.
    values : sequence of array
        Coefficients of order zero of the arguments.
    order : int
        Highest coefficient that will be requested.
    reversible : bool, default False
        Whether loops have a known length, as reverse-mode differentiation in JAX requires; they are slower then.
    unrolled : bool, default False
        Whether orders are Python integers, each with its own code, which is faster if there is not too much of it.
    still : ConstantEntries, optional
        Entries of the arguments, and of the factors, that do not change in time.

    Attributes
    ----------
    form : tuple
        Key of the program: the operations, the shapes of the factors of products, and for each product the indices of
        its two factors.
    outputs
        Coefficients of order zero of the results, in the pytree that the function returns.
    history
        Known coefficients of the factors, a pytree of arrays: the input of `advanced`, and the output of `noted`.

    Raises
    ------
    TypeError
        If the function uses an operation that has no rule.
    """

    moving = int  # the number of a variable

    def __init__(
        self,
        function: Callable[..., Any],
        values: Sequence[Any],
        order: int,
        *,
        reversible: bool = False,
        unrolled: bool = False,
        still: Any = None,
    ):
        self._nodes: list[_Node] = []
        self._values: dict[int, Any] = {}  # coefficients of order zero, by number of the variable
        self._known: dict[Any, Any] = {}  # results of operations already interpreted, as programs often repeat them
        self._names: list[str] = []  # names of the operations
        self._sparse = False  # whether the present operation runs under `by_certain_entries`
        self._pairs: dict[Any, Any] = {}  # sine and cosine, or their hyperbolic counterparts, by argument
        self._inputs = [self._variable(value) for value in values]
        program, shape = jax.make_jaxpr(function, return_shape=True)(*values)
        self._structure = jax.tree.structure(shape)
        self._outputs = self.read(program.jaxpr, program.consts, self._inputs)
        self.outputs = self._collected([self.value(x) for x in self._outputs])
        self._nodes = self._needed()
        self._products = list(dict.fromkeys(pair for node in self._nodes for pair in node.pairs))
        self._stored = list(dict.fromkeys(x for pair in self._products for x in pair[:2]))
        numbers = {x: k for k, x in enumerate(self._stored)}
        pairs = [(numbers[pair.left], numbers[pair.right], pair.weighted) for pair in self._products]
        shapes = [jnp.shape(self._values[x]) for x in self._stored]
        self.form = self._names, shapes, pairs
        self._still = still if still is not None and still.form == self.form else None
        factors = None if self._still is None else self._still.factors
        self._rows = ProductHistory(shapes, pairs, order, factors, reversible=reversible, unrolled=unrolled)
        self.history = self._rows.initial

    @property
    def uses_still(self) -> bool:
        """Whether constant entries are skipped, which requires that they were found for this program."""
        return self._still is not None

    def advanced(self, history: Any, k: Any, coefficients: Sequence[Any]) -> tuple[Any, tuple[Any, ...]]:
        """Return the coefficients of order k of the outputs, and those of the factors, for `noted`.

        Parameters
        ----------
        history
            History to order k - 1.
        k : int
            Order, at least 1.
        coefficients : sequence of array or None
            Coefficients of order k of the arguments; None is zero.
        """
        if self._still is not None:
            pairs = zip(self._still.given, coefficients, strict=True)
            coefficients = [c if c is None else jnp.where(still, 0.0, c) for still, c in pairs]
        return self.swept(coefficients, self._rows.sums(history, k))

    def swept(self, coefficients: Sequence[Any], sums: Sequence[Any]) -> tuple[Any, tuple[Any, ...]]:
        """Return the next coefficients of the outputs and of the factors.

        Parameters
        ----------
        coefficients : sequence of array or None
            Next coefficients of the arguments; None is zero.
        sums : sequence of array
            Sums of the products of known coefficients, in the order of `form`.
        """
        values = self._swept(coefficients, dict(zip(self._products, sums, strict=True)))

        def value_of(x: Any) -> Any:
            c = values[x] if isinstance(x, int) else None
            return jnp.zeros_like(self.value(x)) if c is None else c

        return self._collected([value_of(x) for x in self._outputs]), tuple(map(value_of, self._stored))

    def corrected(self, newest: Sequence[Any], changes: Sequence[Any]) -> tuple[Any, ...]:
        """Return the `newest` coefficients of the factors after changes (None is zero) of those of the arguments."""
        change = self._swept(changes, None)
        return tuple(plus(c, change.get(x)) for x, c in zip(self._stored, newest, strict=True))

    def noted(self, history: Any, k: Any, newest: Sequence[Any]) -> Any:
        """Return the history with the `newest` coefficients, of order k, of the factors."""
        return self._rows.noted(history, k, newest)

    def _swept(self, coefficients: Sequence[Any], sums: dict[_Pair, Any] | None) -> dict[int, Any]:
        """Return the coefficients of order k of all variables, from those of the arguments; None is zero."""
        values: dict[int, Any] = dict(zip(self._inputs, coefficients, strict=True))
        for node in self._nodes:
            parts = [values[x] if isinstance(x, int) else None for x in node.operands]
            swept = None if sums is None or not node.pairs else total(sums[pair] for pair in node.pairs)
            with by_certain_entries() if node.sparse else nullcontext():
                values[node.result] = node.rule(parts, swept)
        return values

    # variables

    def _variable(self, value: Any) -> int:
        number = len(self._values)
        self._values[number] = value
        return number

    def _collected(self, leaves: list[Any]) -> Any:
        return jax.tree.unflatten(self._structure, leaves)

    def _needed(self) -> list[_Node]:
        """Return the nodes on which the outputs depend."""
        makers = {node.result: node for node in self._nodes}
        used: set[int] = set()
        pending = [x for x in self._outputs if isinstance(x, int)]
        while pending:
            number = pending.pop()
            if number in makers and number not in used:
                used.add(number)
                node = makers[number]
                pending += [x for x in node.operands if isinstance(x, int)]
                pending += [x for pair in node.pairs for x in pair[:2]]
        return [node for node in self._nodes if node.result in used]

    # interpretation of the program

    def results(self, equation: JaxprEqn, operands: list[Any]) -> list[Any]:
        """Return the results of one operation; repeated operations are interpreted once."""
        outer, self._sparse = self._sparse, self._sparse or is_by_certain_entries(equation)
        try:
            with by_certain_entries() if self._sparse else nullcontext():
                key = self._key(equation, operands)
                if key is None:
                    return self._read(equation, operands)
                if key not in self._known:  # keeps the operands alive, since keys contain their ids
                    self._known[key] = self._read(equation, operands), operands
                return self._known[key][0]
        finally:
            self._sparse = outer

    def _read(self, equation: JaxprEqn, operands: list[Any]) -> list[Any]:
        """Return the results of one operation; a loop that only adds is run unchanged at every order."""
        self._names.append(equation.primitive.name)
        scanned = equation.primitive.name == "scan" and not self.is_constant(equation, operands)
        if not scanned or not only_adds(equation.params["jaxpr"].jaxpr):
            return super().results(equation, operands)
        bind = partial(equation.primitive.bind, **equation.params)

        def of(index: int) -> Callable[..., Any]:
            def rule(parts: list[Any], _: Any) -> Any:
                results = self._passed(bind, operands, parts, additive=True)
                return None if results is None else results[index]

            return rule

        return [self._node(of(i), value, operands) for i, value in enumerate(bind(*map(self.value, operands)))]

    def _passed(self, bind: Callable[..., Any], operands: list[Any], parts: list[Any], *, additive: bool) -> Any:
        """Return a linear operation on next coefficients; constants are zero if they are added, else unchanged."""
        if all(part is None for part in parts):
            return None
        values = []
        for x, part in zip(operands, parts, strict=True):
            fixed = self.value(x)
            adds = isinstance(x, int) or (additive and jnp.issubdtype(jnp.result_type(fixed), jnp.floating))
            values.append(part if part is not None else jnp.zeros_like(fixed) if adds else fixed)
        return bind(*values)

    def _key(self, equation: JaxprEqn, operands: list[Any]) -> Any:
        """Return a key of an operation, or None if its parameters cannot be hashed."""
        names = [x if isinstance(x, int) else x.key() for x in operands]
        if equation.primitive.name in ("mul", "add", "add_any"):
            names.sort(key=str)
        key = (equation.primitive.name, self._sparse, *sorted(equation.params.items()), *names)
        try:
            hash(key)
        except TypeError:
            return None
        return key

    def constant(self, array: Any) -> "_Constant":
        """Return the representation of a constant array."""
        return _Constant(array)

    def value(self, x: Any) -> Any:
        """Return the coefficient of order zero of a variable, or the array of a constant."""
        return self._values[x] if isinstance(x, int) else x.array

    def is_constant(self, equation: JaxprEqn, operands: list[Any]) -> bool:
        """Return whether the results are constant; selections are constant within a step."""
        avals: Any = [variable.aval for variable in equation.outvars]
        floating = any(jnp.issubdtype(aval.dtype, jnp.floating) for aval in avals)
        return not floating or super().is_constant(equation, operands)

    def applied(self, equation: JaxprEqn, operands: list[Any]) -> list[Any]:
        """Return the variables that are the results of an operation."""
        primitive, parameters, name = equation.primitive, equation.params, equation.primitive.name
        if name == "optimization_barrier":
            return operands
        if name in BROADCASTING:  # JAX broadcasts scalars and axes of length one
            aval: Any = equation.outvars[0].aval
            operands = [self._widened(x, aval.shape) for x in operands]
        if name in STEPWISE:
            return [_Constant(primitive.bind(*map(self.value, operands), **parameters))]
        if name in COMPOSED:
            return [self.composed(lambda *xs: COMPOSED[name](*xs, **parameters), operands)]
        if name in SLOPES:
            return [self._by_slope(name, operands)]
        if name in PAIRS:
            return [self._pair(name, operands[0])]
        if name == "mul" and all(isinstance(x, int) for x in operands):
            return [self._product(*operands)]
        if name == "div" and isinstance(operands[1], int):
            return [self._quotient(*operands)]
        if name in ("split", "unstack"):
            return self._separated(name, parameters, operands)
        if name in LINEAR:
            return [self._linear(primitive, parameters, operands)]
        raise TypeError(f"the operation '{name}' of JAX has no rule for Taylor series")

    def _widened(self, x: Any, shape: tuple[int, ...]) -> Any:
        if not isinstance(x, int) or jnp.shape(self._values[x]) == shape:
            return x
        return self.composed(lambda value: jnp.broadcast_to(value, shape), [x])

    def _separated(self, name: str, parameters: dict, operands: list[Any]) -> list[Any]:
        axis = parameters["axis"]
        sizes = parameters["sizes"] if name == "split" else [1] * jnp.shape(self.value(operands[0]))[axis]
        bounds = pairwise(accumulate(map(int, sizes), initial=0))

        def part(x: Any, start: int, stop: int) -> Any:
            cut = jax.lax.slice_in_dim(x, start, stop, axis=axis)
            return cut if name == "split" else jnp.squeeze(cut, axis)

        return [self.composed(lambda x, a=start, b=stop: part(x, a, b), operands) for start, stop in bounds]

    # nodes

    def _node(self, rule: Callable[..., Any], value: Any, operands: Sequence[Any], pairs: Sequence[_Pair] = ()) -> int:
        result = self._variable(value)
        self._nodes.append(_Node(rule, tuple(operands), list(pairs), result, self._sparse))
        return result

    def _linear(self, primitive: Any, parameters: dict, operands: list[Any]) -> int:
        bind = partial(primitive.bind, **parameters)

        def rule(parts: list[Any], _: Any) -> Any:
            return self._passed(bind, operands, parts, additive=primitive.name in ADDITIVE)

        return self._node(rule, bind(*map(self.value, operands)), operands)

    def _product(self, a: int, b: int) -> int:
        first, second = self.value(a), self.value(b)

        def rule(parts: list[Any], sums: Any) -> Any:
            return plus(sums, plus(times(parts[0], second), times(first, parts[1])))

        return self._node(rule, first * second, [a, b], [_Pair(a, b, False)])

    def _quotient(self, a: Any, b: int) -> int:
        divisor, value = self.value(b), self.value(a) / self.value(b)
        result = len(self._values)  # number of the node made below

        def rule(parts: list[Any], sums: Any) -> Any:
            remainder = minus(minus(parts[0], sums), times(value, parts[1]))
            return None if remainder is None else remainder / divisor

        return self._node(rule, value, [a, b], [_Pair(result, b, False)])

    def _by_slope(self, name: str, operands: list[Any]) -> int:
        """Make the nodes of a function from its partial derivatives: ``y' = sum g_i(x, y) x_i'``."""
        function, slopes = SLOPES[name]
        values: list[Any] = [None] * len(operands)

        def rule(parts: list[Any], sums: Any) -> Any:
            return reduce(plus, map(times, values, parts), sums)

        result = self._node(rule, function(*map(self.value, operands)), operands)
        node = self._nodes[-1]
        for i, x in enumerate(operands):  # nodes after that of the function, whose values serve at the next order
            if isinstance(x, int):
                slope = self.composed(slopes[i], [*operands, result])
                values[i] = self.value(slope)
                if isinstance(slope, int):
                    node.pairs.append(_Pair(x, slope, True))
        return result

    def _pair(self, name: str, x: int) -> int:
        """Make the nodes of two functions, each the derivative of the other up to a sign."""
        first, second, sign = PAIRS[name]
        if (x, first) not in self._pairs:
            a, b = len(self._values), len(self._values) + 1
            values = PLAIN[first](self.value(x)), PLAIN[second](self.value(x))

            def rule(slope: Any) -> Callable[..., Any]:
                return lambda parts, sums: plus(sums, times(slope, parts[0]))

            self._node(rule(values[1]), values[0], [x], [_Pair(x, b, True)])
            self._node(lambda *given: times(sign, rule(values[0])(*given)), values[1], [x], [_Pair(x, a, True)])
            self._pairs[x, first], self._pairs[x, second] = a, b
        return self._pairs[x, name]


class _Constant(NamedTuple):
    """An array that is constant in time, or within a step, such as the choice of a branch."""

    array: Any

    def key(self) -> Any:
        """Return a key: small numbers by value, results by identity."""
        if isinstance(self.array, bool | int | float | np.generic):
            return str(jnp.result_type(self.array)), np.asarray(self.array).tobytes()
        return "array", id(self.array)
