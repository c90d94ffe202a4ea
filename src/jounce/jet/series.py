"""A program run on Taylor series one order at a time, for equations whose next coefficients are unknown until solved.

Jets evaluate an expression at all orders at once, from inputs that are known. The solution of a differential equation
is not: its coefficient k follows from the equation at order k, so that the equation is needed order after order, each
once. `Recursion` reads the program of any JAX-traceable function, keeps the coefficients of what is multiplied, and
gives the next coefficients of the outputs from the next ones of the inputs. The order may be the counter of a loop, so
that what is compiled does not grow with it.

In ``y = f(x)`` the newest coefficient of x enters the newest of y as in ``f'(x_0) x_k`` only. A solver may so advance
with zero for the unknown, solve its linear equations, and add what the unknown changes with `Recursion.corrected`.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax.extend.core import Literal

from jounce.jet.algebra import total


class _Node(NamedTuple):
    """One operation on series: the rule for its next coefficient, what it reads and what it makes."""

    rule: Callable[..., Any]
    slope: Callable[..., Any]  # the operation at order zero, for its derivative
    operands: tuple[Any, ...]  # numbers of variables, or arrays that do not change in time
    result: int


class Recursion:
    """A function on series, ready to be run order after order.

    Parameters
    ----------
    function : callable
        Maps arrays to a pytree of arrays by operations that have derivatives of every order: arithmetic, elementary
        functions, selections. Branches are all run; loops must be short and of known length.
    values : sequence of array
        Coefficients of order zero of its arguments.
    order : int
        Highest coefficient that will be wanted.

    Attributes
    ----------
    outputs
        Coefficients of order zero of the results, in the pytree that the function returns.
    history
        Coefficients known so far of what is multiplied: what `advanced` takes and returns, a pytree of arrays.

    Raises
    ------
    TypeError
        If the function uses an operation that has no rule.
    """

    def __init__(self, function: Callable[..., Any], values: Sequence[Any], order: int):
        self.order = order
        self._nodes: list[_Node] = []
        self._values: dict[int, Any] = {}  # of order zero, by number of the variable
        self._stored: dict[int, None] = {}  # variables whose history is needed, in order
        self._pairs: dict[Any, Any] = {}  # sine and cosine, or their hyperbolic likes, of the same angle
        self._inputs = [self._variable(value) for value in values]
        program, shape = jax.make_jaxpr(function, return_shape=True)(*values)
        self._structure = jax.tree.structure(shape)
        self._outputs = self._read(program.jaxpr, program.consts, self._inputs)
        self.outputs = self._collected([self._value(x) for x in self._outputs])
        self.history = tuple(self._first(self._values[number]) for number in self._stored)

    def advanced(self, history: Any, k: Any, coefficients: Sequence[Any]) -> tuple[Any, Any]:
        """Return the coefficients of order k of the outputs, and the history with them.

        Parameters
        ----------
        history
            To order k - 1.
        k : int
            At least 1.
        coefficients : sequence of array
            Of order k, of the arguments.
        """
        step = _Step(self, dict(zip(self._stored, history, strict=True)), {}, k)
        for number, coefficient in zip(self._inputs, coefficients, strict=True):
            step.set(number, coefficient)
        for node in self._nodes:
            step.set(node.result, node.rule(step, *node.operands))
        return self._collected([self._next(x, step.now) for x in self._outputs]), tuple(step.known.values())

    def corrected(self, history: Any, k: Any, changes: Sequence[Any]) -> Any:
        """Return the history of order k after a change of the coefficients of order k of the arguments.

        Parameters
        ----------
        history
            To order k.
        k : int
            The order.
        changes : sequence of array or None
            To add to the coefficients of order k of the arguments; None where there is no change.
        """
        change: dict[int, Any] = {n: c for n, c in zip(self._inputs, changes, strict=True) if c is not None}
        for node in self._nodes:
            moved = [i for i, x in enumerate(node.operands) if isinstance(x, int) and x in change]
            if moved:
                values = [self._value(x) for x in node.operands]

                def along(*parts: Any, node: _Node = node, moved: list[int] = moved, values: list[Any] = values) -> Any:
                    whole = list(values)
                    for i, part in zip(moved, parts, strict=True):
                        whole[i] = part
                    return node.slope(*whole)

                directions = tuple(change[node.operands[i]] for i in moved)
                _, change[node.result] = jax.jvp(along, tuple(values[i] for i in moved), directions)
        place = self.order - k

        def added(before: Any, c: Any) -> Any:
            c = c + jax.lax.dynamic_index_in_dim(before, place, 0, keepdims=False)
            return jax.lax.dynamic_update_index_in_dim(before, c, place, 0)

        places = zip(self._stored, history, strict=True)
        return tuple(added(h, change[n]) if n in change else h for n, h in places)

    # what is known of variables

    def _variable(self, value: Any) -> int:
        number = len(self._values)
        self._values[number] = value
        return number

    def _value(self, x: Any) -> Any:
        return self._values[x] if isinstance(x, int) else x.array

    def _next(self, x: Any, now: dict[int, Any]) -> Any:
        return now[x] if isinstance(x, int) else jnp.zeros_like(x.array)

    def _collected(self, leaves: list[Any]) -> Any:
        return jax.tree.unflatten(self._structure, leaves)

    # histories: arrays that hold the coefficients backwards and then zeros, so that a sum over products of
    # coefficients whose orders add up to k is the sum over one array and a slice of another

    def _first(self, value: Any) -> Any:
        size = 2 * self.order + 1
        return jnp.zeros((size, *jnp.shape(value))).at[self.order].set(value)

    # reading the program

    def _read(self, jaxpr: Any, constants: Sequence[Any], arguments: Sequence[Any]) -> list[Any]:
        found: dict[Any, Any] = dict(zip(jaxpr.constvars, map(_Constant, constants), strict=True))
        found.update(zip(jaxpr.invars, arguments, strict=True))

        def look(variable: Any) -> Any:
            return _Constant(variable.val) if isinstance(variable, Literal) else found[variable]

        for equation in jaxpr.eqns:
            operands = [look(v) for v in equation.invars]
            results = self._equation(equation.primitive, equation.params, operands, equation.outvars)
            found.update(zip(equation.outvars, results, strict=True))
        return [look(v) for v in jaxpr.outvars]

    def _equation(self, primitive: Any, parameters: dict, operands: list[Any], made: Sequence[Any]) -> list[Any]:
        name = primitive.name
        still = not any(isinstance(x, int) for x in operands)
        if still or not any(jnp.issubdtype(v.aval.dtype, jnp.floating) for v in made):  # decisions keep for a step
            results = primitive.bind(*map(self._value, operands), **parameters)
            return list(map(_Constant, results if primitive.multiple_results else [results]))
        inner = parameters.get("jaxpr", parameters.get("call_jaxpr"))
        if name == "cond":
            return self._branches(operands, parameters["branches"], made)
        if name == "scan":
            return self._unrolled(operands, parameters)
        if name != "while" and inner is not None:
            closed = hasattr(inner, "jaxpr")
            return self._read(inner.jaxpr if closed else inner, inner.consts if closed else (), operands)
        if name in _STEPWISE:
            return [_Constant(primitive.bind(*map(self._value, operands), **parameters))]
        if name in _COMPOSED:
            return [self._composed(lambda *xs: _COMPOSED[name](*xs, **parameters), operands)]
        if name in _SLOPES:
            return [self._by_slope(name, operands)]
        if name in _PAIRS:
            return [self._pair(name, operands[0])]
        if name in ("mul", "dot_general") and all(isinstance(x, int) for x in operands):
            return [self._product(lambda a, b: primitive.bind(a, b, **parameters), operands)]
        if name == "div" and isinstance(operands[1], int):
            return [self._quotient(operands)]
        if name in _LINEAR:
            return [self._linear(primitive, parameters, operands)]
        raise TypeError(f"the operation '{name}' of JAX has no rule for Taylor series")

    def _composed(self, function: Callable[..., Any], operands: list[Any]) -> Any:
        """Read a function of the operands in the place of an operation."""
        program = jax.make_jaxpr(function)(*map(self._value, operands))
        return self._read(program.jaxpr, program.consts, operands)[0]

    def _branches(self, operands: list[Any], branches: Any, made: Sequence[Any]) -> list[Any]:
        which, arguments = operands[0], operands[1:]
        outcomes = [self._read(b.jaxpr, b.consts, arguments) for b in branches]
        index = jnp.clip(self._value(which), 0, len(branches) - 1)
        return [
            self._composed(lambda *cases: jax.lax.select_n(jnp.broadcast_to(index, cases[0].shape), *cases), [*cases])
            if len(cases) <= 2 or index.dtype != bool
            else cases[0]
            for cases in zip(*outcomes, strict=True)
        ]

    def _unrolled(self, operands: list[Any], parameters: dict) -> list[Any]:
        inner, constants, carried = parameters["jaxpr"], parameters["num_consts"], parameters["num_carry"]
        fixed, carry = operands[:constants], operands[constants : constants + carried]
        sequences, collected = operands[constants + carried :], []
        steps = range(parameters["length"])
        for i in reversed(steps) if parameters["reverse"] else steps:
            here = [self._composed(lambda x, i=i: x[i], [x]) for x in sequences]
            results = self._read(inner.jaxpr, inner.consts, [*fixed, *carry, *here])
            carry = results[:carried]
            collected.append(results[carried:])
        if parameters["reverse"]:
            collected.reverse()
        stacked = [self._composed(lambda *xs: jnp.stack(xs), list(parts)) for parts in zip(*collected, strict=True)]
        return [*carry, *stacked]

    # nodes

    def _node(self, rule: Callable[..., Any], slope: Callable[..., Any], operands: Sequence[Any]) -> int:
        result = self._variable(slope(*map(self._value, operands)))
        self._nodes.append(_Node(rule, slope, tuple(operands), result))
        return result

    def _keep(self, *variables: Any) -> None:
        self._stored.update({x: None for x in variables if isinstance(x, int)})

    def _linear(self, primitive: Any, parameters: dict, operands: list[Any]) -> int:
        additive = primitive.name in _ADDITIVE
        zeros = {
            i
            for i, x in enumerate(operands)
            if not isinstance(x, int) and additive and jnp.issubdtype(x.array.dtype, jnp.floating)
        }

        def rule(step: _Step, *xs: Any) -> Any:
            parts = [step.now[x] if isinstance(x, int) else x.array for x in xs]
            parts = [jnp.zeros_like(p) if i in zeros else p for i, p in enumerate(parts)]
            return primitive.bind(*parts, **parameters)

        return self._node(rule, lambda *xs: primitive.bind(*xs, **parameters), operands)

    def _product(self, product: Callable[[Any, Any], Any], operands: list[Any]) -> int:
        self._keep(*operands)
        return self._node(lambda step, a, b: step.convolution(product, a, b), product, operands)

    def _quotient(self, operands: list[Any]) -> int:
        a, b = operands
        result = len(self._values)  # the node made next

        def rule(step: _Step, a: Any, b: int) -> Any:
            known = step.convolution(jnp.multiply, result, b)
            return (step.now[a] - known if isinstance(a, int) else -known) / self._value(b)

        self._keep(b, result)
        return self._node(rule, jnp.divide, [a, b])

    def _by_slope(self, name: str, operands: list[Any]) -> int:
        """Make the nodes of a function known by its derivatives: ``y' = sum g_i(x, y) x_i'``."""
        function, slopes = _SLOPES[name]
        moving = [i for i, x in enumerate(operands) if isinstance(x, int)]
        result, places = len(self._values), {}

        def rule(step: _Step, *xs: Any) -> Any:
            return total(step.chain(places[i], xs[i]) for i in moving)

        self._keep(result, *operands)
        self._node(rule, function, operands)
        for i in moving:  # read at each order after the function itself, and used at the next
            slope = self._composed(slopes[i], [*operands, result])
            places[i] = slope
            self._keep(slope)
        return result

    def _pair(self, name: str, x: int) -> int:
        """Make the nodes of two functions that are each other's derivative, up to a sign."""
        first, second, sign = _PAIRS[name]
        if (x, first) not in self._pairs:
            a, b = len(self._values), len(self._values) + 1
            self._keep(x, a, b)
            self._node(lambda step, x: step.chain(b, x), _PLAIN[first], [x])
            self._node(lambda step, x: sign * step.chain(a, x), _PLAIN[second], [x])
            self._pairs[x, first], self._pairs[x, second] = a, b
        return self._pairs[x, name]


class _Constant(NamedTuple):
    """What does not change in time, or is kept for a step: the choice of a branch."""

    array: Any


class _Step(NamedTuple):
    """The sums over products of coefficients at one order."""

    recursion: Recursion
    known: dict[int, Any]
    now: dict[int, Any]
    k: Any

    def set(self, number: int, coefficient: Any) -> None:
        """Note the coefficient of order k of a variable."""
        self.now[number] = coefficient
        if number in self.known:
            place = self.recursion.order - self.k
            self.known[number] = jax.lax.dynamic_update_index_in_dim(self.known[number], coefficient, place, 0)

    def convolution(self, product: Callable[[Any, Any], Any], a: int, b: int) -> Any:
        """Return ``sum_j a[j] b[k-j]``; a coefficient of order k that is not known yet counts as zero."""
        return self._summed(product, self._forward(a), b)

    def chain(self, slope: Any, x: int) -> Any:
        """Return the coefficient k of y from ``y' = slope x'``."""
        if not isinstance(slope, int):
            return slope.array * self.now[x]
        forward = self._forward(x)
        weights = jnp.arange(self.recursion.order + 1.0).reshape((-1,) + (1,) * (forward.ndim - 1))
        return self._summed(jnp.multiply, forward * weights, slope) / self.k

    def _forward(self, a: int) -> Any:
        return self.known[a][self.recursion.order :: -1]

    def _summed(self, product: Callable[[Any, Any], Any], forward: Any, b: int) -> Any:
        order = self.recursion.order
        backward = jax.lax.dynamic_slice_in_dim(self.known[b], order - self.k, order + 1)
        return jnp.sum(jax.vmap(product)(forward, backward), axis=0)


def _whole_power(x: Any, *, y: int) -> Any:
    if y < 0:
        return 1.0 / _whole_power(x, y=-y)
    result, square = None, x
    while y:
        if y & 1:
            result = square if result is None else result * square
        y >>= 1
        if y:
            square = square * square
    return jnp.ones_like(x) if result is None else result


def _select_larger(a: Any, b: Any) -> Any:
    return jnp.where(a >= b, a, b)


def _square_root(x: Any) -> Any:
    return jnp.sqrt(x)


_PLAIN = {"sin": jnp.sin, "cos": jnp.cos, "sinh": jnp.sinh, "cosh": jnp.cosh}
_PAIRS = {
    "sin": ("sin", "cos", -1.0),
    "cos": ("sin", "cos", -1.0),
    "sinh": ("sinh", "cosh", 1.0),
    "cosh": ("sinh", "cosh", 1.0),
}
_ROOT_OF_PI = 1.7724538509055160273
# a function and its partial derivatives, which may use its value, the last argument
_SLOPES: dict[str, tuple[Callable[..., Any], tuple[Callable[..., Any], ...]]] = {
    "exp": (jnp.exp, (lambda x, y: y,)),
    "expm1": (jnp.expm1, (lambda x, y: y + 1.0,)),
    "log": (jnp.log, (lambda x, y: 1.0 / x,)),
    "log1p": (jnp.log1p, (lambda x, y: 1.0 / (1.0 + x),)),
    "sqrt": (_square_root, (lambda x, y: 0.5 / y,)),
    "cbrt": (jnp.cbrt, (lambda x, y: y / (3.0 * x),)),
    "pow": (jnp.power, (lambda x, p, y: p * y / x, lambda x, p, y: y * jnp.log(x))),
    "tan": (jnp.tan, (lambda x, y: 1.0 + y * y,)),
    "tanh": (jnp.tanh, (lambda x, y: 1.0 - y * y,)),
    "atan": (jnp.arctan, (lambda x, y: 1.0 / (1.0 + x * x),)),
    "asin": (jnp.arcsin, (lambda x, y: 1.0 / jnp.sqrt((1.0 - x) * (1.0 + x)),)),
    "acos": (jnp.arccos, (lambda x, y: -1.0 / jnp.sqrt((1.0 - x) * (1.0 + x)),)),
    "asinh": (jnp.arcsinh, (lambda x, y: 1.0 / jnp.sqrt(1.0 + x * x),)),
    "acosh": (jnp.arccosh, (lambda x, y: 1.0 / jnp.sqrt((x - 1.0) * (x + 1.0)),)),
    "atanh": (jnp.arctanh, (lambda x, y: 1.0 / ((1.0 - x) * (1.0 + x)),)),
    "atan2": (jnp.arctan2, (lambda y, x, z: x / (x * x + y * y), lambda y, x, z: -y / (x * x + y * y))),
    "erf": (jax.lax.erf, (lambda x, y: 2.0 / _ROOT_OF_PI * jnp.exp(-x * x),)),
    "logistic": (jax.lax.logistic, (lambda x, y: y * (1.0 - y),)),
}
_COMPOSED: dict[str, Callable[..., Any]] = {
    "square": lambda x: x * x,
    "integer_pow": _whole_power,
    "rsqrt": lambda x, **_: 1.0 / jnp.sqrt(x),
    "exp2": lambda x, **_: jnp.exp(x * 0.69314718055994530942),
    "erfc": lambda x: 1.0 - jax.lax.erf(x),
    "abs": lambda x: jnp.where(x < 0, -x, x),
    "max": _select_larger,
    "min": lambda a, b: jnp.where(a <= b, a, b),
    "clamp": lambda low, x, high: jnp.where(x < low, low, jnp.where(x > high, high, x)),
    "rem": lambda x, y: x - y * jnp.trunc(x / y),
}
_ADDITIVE = frozenset(
    "add add_any sub concatenate dynamic_update_slice pad scatter-add select_n stack".split()
)
_LINEAR = _ADDITIVE | frozenset(
    "broadcast_in_dim convert_element_type copy cumsum div dot_general dynamic_slice expand_dims gather mul neg "
    "optimization_barrier reduce_sum reshape rev scatter slice squeeze transpose unstack".split()
)
_STEPWISE = frozenset("ceil floor round sign stop_gradient".split())  # piecewise constant in time
