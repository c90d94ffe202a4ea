"""Interpreter of JAX programs, operation by operation, on values of another kind, such as jets."""

import abc
from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
from jax.extend.core import JaxprEqn, Literal

from jounce.base.jax_internals import sizes_of_scan
from jounce.jet.programs.operations import ADDITIVE, REARRANGING


class ProgramReader(abc.ABC):
    """Interpreter of programs on time-varying values and constants; all branches are run, and loops unrolled.

    A subclass defines the values and the rule of each operation.
    """

    moving: ClassVar[type]  # type of the values that change in time

    def constant(self, array: Any) -> Any:
        """Return the representation of a constant array."""
        return array

    @abc.abstractmethod
    def value(self, x: Any) -> Any:
        """Return the present array of a value or a constant."""

    @abc.abstractmethod
    def applied(self, equation: JaxprEqn, operands: list[Any]) -> list[Any]:
        """Return the results of an elementary operation."""

    def is_constant(self, equation: JaxprEqn, operands: list[Any]) -> bool:  # noqa: ARG002 - for subclasses
        """Return whether the results of an operation are constants, so that it applies to arrays."""
        return not any(isinstance(x, self.moving) for x in operands)

    def read(self, jaxpr: Any, constants: Sequence[Any], arguments: Sequence[Any]) -> list[Any]:
        """Return the results of a program for its arguments."""
        values: dict[Any, Any] = dict(zip(jaxpr.constvars, map(self.constant, constants), strict=True))
        values.update(zip(jaxpr.invars, arguments, strict=True))

        def look(variable: Any) -> Any:
            return self.constant(variable.val) if isinstance(variable, Literal) else values[variable]

        for equation in jaxpr.eqns:
            operands = [look(v) for v in equation.invars]
            results = self.results(equation, operands)
            values.update(zip(equation.outvars, results, strict=True))
        return [look(v) for v in jaxpr.outvars]

    def composed(self, function: Callable[..., Any], operands: Sequence[Any]) -> Any:
        """Interpret a function of the operands in place of an operation."""
        program = jax.make_jaxpr(function)(*map(self.value, operands))
        return self.read(program.jaxpr, program.consts, operands)[0]

    def results(self, equation: JaxprEqn, operands: list[Any]) -> list[Any]:
        """Return the results of one operation, which may contain programs."""
        name, parameters = equation.primitive.name, equation.params
        if self.is_constant(equation, operands):
            results = equation.primitive.bind(*map(self.value, operands), **parameters)
            return list(map(self.constant, results if equation.primitive.multiple_results else [results]))
        if name == "cond":
            return self._branches(operands[0], operands[1:], parameters["branches"])
        if name == "scan":
            return self._unrolled(equation, operands)
        inner = inner_program(parameters)
        if name == "while" or inner is None:
            return self.applied(equation, operands)
        closed = hasattr(inner, "jaxpr")
        return self.read(inner.jaxpr if closed else inner, inner.consts if closed else (), operands)

    def _branches(self, which: Any, operands: list[Any], branches: Sequence[Any]) -> list[Any]:
        """Run every branch of a conditional and select from the results."""
        outcomes = zip(*(self.read(branch.jaxpr, branch.consts, operands) for branch in branches), strict=True)
        index = jnp.clip(self.value(which), 0, len(branches) - 1)

        def selected(*cases: Any) -> Any:
            return jax.lax.select_n(jnp.broadcast_to(index, cases[0].shape), *cases)

        return [self.composed(selected, cases) for cases in outcomes]

    def _unrolled(self, equation: JaxprEqn, operands: list[Any]) -> list[Any]:
        """Run a loop of known length step by step."""
        parameters, inner = equation.params, equation.params["jaxpr"]
        constants, state = sizes_of_scan(equation)
        fixed, carry = operands[:constants], operands[constants : constants + state]
        sequences, collected = operands[constants + state :], []
        steps = range(parameters["length"])
        for i in reversed(steps) if parameters["reverse"] else steps:
            step_inputs = [self.composed(lambda x, i=i: x[i], [x]) for x in sequences]
            results = self.read(inner.jaxpr, inner.consts, [*fixed, *carry, *step_inputs])
            carry = results[:state]
            collected.append(results[state:])
        if parameters["reverse"]:
            collected.reverse()
        return [*carry, *(self.composed(lambda *xs: jnp.stack(xs), parts) for parts in zip(*collected, strict=True))]


def _is_floating(variable: Any) -> bool:
    return jnp.issubdtype(variable.aval.dtype, jnp.floating)


def only_adds(jaxpr: Any) -> bool:
    """Return whether a program only adds and moves numbers, so that it acts on each coefficient alike.

    Multiplications and added constants would act on coefficients differently than on values.
    """
    if jaxpr.constvars:
        return False
    for equation in jaxpr.eqns:
        if not any(map(_is_floating, equation.outvars)):
            continue
        if any(isinstance(x, Literal) and _is_floating(x) and x.val != 0 for x in equation.invars):
            return False
        inner = inner_program(equation.params)
        if inner is not None:
            if equation.primitive.name != "jit" or not only_adds(inner.jaxpr):
                return False
        elif equation.primitive.name not in ADDITIVE | REARRANGING:
            return False
    return True


def inner_program(parameters: dict[str, Any]) -> Any:
    """Return the program inside a call (jit, custom derivative) or a loop, or None for a plain operation."""
    return parameters.get("jaxpr", parameters.get("call_jaxpr"))
