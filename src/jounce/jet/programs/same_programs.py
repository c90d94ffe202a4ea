"""Equality of JAX programs: the same operations on the same numbers, in any order."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jax.core import Tracer
from jax.extend.core import ClosedJaxpr, JaxprEqn

from jounce.jet.programs.captured import Pass, array_digest, parameters_of

_SPREADING = frozenset("add add_any sub mul div max min pow atan2 select_n".split())  # broadcast scalars


def is_same(first: ClosedJaxpr, second: ClosedJaxpr, captured: Sequence[Any]) -> bool:
    """Return whether a program equals another one that takes the captured values as its first arguments.

    The first may have more arguments at its end, but must not use them.
    """
    nodes: dict[Any, Any] = {}
    one, two = _Nodes(nodes), _Nodes(nodes)
    arguments = [("argument", k) for k in range(len(first.jaxpr.invars))]
    values = [one.fixed(value, np.asarray(value).dtype) for value in captured]
    common = arguments[: len(second.jaxpr.invars) - len(values)]
    return one.of(first, arguments) == two.of(second, [*values, *common])


class _Nodes(Pass):
    """Value numbering of programs: equal computations get equal numbers."""

    def __init__(self, nodes: dict[Any, Any]):
        self._nodes = nodes

    def captured(self, value: Any, dtype: np.dtype) -> Any:
        return self.fixed(value, dtype)

    def fixed(self, value: Any, dtype: np.dtype) -> Any:
        if isinstance(value, Tracer):
            return self._node(("held", id(value)))
        return self._node(("number", array_digest(np.asarray(value, dtype))))

    def applied(self, equation: JaxprEqn, operands: list[Any]) -> Sequence[Any]:
        given: list[Any] = [v.aval for v in equation.invars]
        avals: list[Any] = [v.aval for v in equation.outvars]
        name, shapes = equation.primitive.name, [(aval.shape, str(aval.dtype)) for aval in avals]
        if name in _SPREADING:
            operands = [self._without_broadcast(x) for x in operands]
        if name == "reshape" and given[0].shape == avals[0].shape:
            return operands
        parameters, nameless = parameters_of(equation)
        key = name, tuple(parameters), tuple(map(id, nameless)), tuple(operands), tuple(shapes)
        node = self._node(key)
        if name in ("broadcast_in_dim", "reshape") and not given[0].shape:
            self._nodes[("spread", node)] = operands[0]
        return [(node, k) for k in range(len(shapes))]

    def _without_broadcast(self, x: Any) -> Any:
        return self._nodes.get(("spread", x[0]), x) if isinstance(x, tuple) else x

    def _node(self, key: Any) -> int:
        return self._nodes.setdefault(key, len(self._nodes))
