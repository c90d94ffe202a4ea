"""The mass matrix, forces with their rates, and outputs of a mechanism, as operations."""

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from jounce.dynamics.forward.loads import constraint_loads, loads, mass_matrices
from jounce.dynamics.forward.saddle_point import block_diagonal
from jounce.dynamics.friction.coupling import check_no_friction
from jounce.dynamics.inverse.constraint_equations import equation_labels, in_si_units, row_order
from jounce.dynamics.masses import check_loads, gravity_of, masses_of
from jounce.dynamics.motion_values import pose_of
from jounce.errors import MechanismError
from jounce.jet import Jet
from jounce.mechanism import Mechanism, Model
from jounce.mechanism.outputs.base import AbstractMotionOutput
from jounce.written_equations.models.inputs import Inputs
from jounce.written_equations.operations.functions import Argument, Function
from jounce.written_equations.operations.reading import Entries, GraphReader, UnwritableOperationError


def check_forces(mechanism: Mechanism, order: int) -> None:
    """Check that a mechanism has forces that can be written as code.

    Raises
    ------
    MechanismError
        If the mechanism has no mass or force, or if the order is below 2.
    UnsupportedError
        If a joint has friction, which depends on the multipliers of the same instant.
    """
    check_loads(mechanism)
    check_no_friction(mechanism, "forces as code")
    if order < 2:
        raise MechanismError("must be 2 or more: forces give accelerations", name="order", value=order)


def force_functions(mechanism: Mechanism, model: Model, inputs: Inputs) -> list[Function]:
    """Return the functions of the mass matrix, and of the forces and their rates without terms of the unknowns.

    Raises
    ------
    MechanismError
        If a force cannot be written out.
    """
    masses, gravity, pose_type = masses_of(mechanism), gravity_of(mechanism), model.pose_type
    system, levels = in_si_units(model), inputs.order - 1
    loaded = dataclasses.replace(system, forces=model.system.forces)
    reader = GraphReader(inputs.graph)
    multipliers = _multipliers(mechanism, model, inputs, levels)

    def mass_matrix(bodies: Any) -> Any:
        blocks = mass_matrices(pose_of(bodies, pose_type, 0), masses)[:, :, 1:]
        return block_diagonal(blocks, np.ones(len(blocks)))

    def known(bodies: Any, instants: Any, forces: Any) -> Any:
        pose, time = pose_of(bodies, pose_type, inputs.order), Jet.variable(instants[None], inputs.order)
        load = loads(loaded, pose, time, masses, gravity)  # of the order of accelerations
        return load - constraint_loads(system, pose.truncate(levels - 1), time.truncate(levels - 1), forces)

    (matrix,) = _read(reader, model, mass_matrix, inputs.place())
    series = inputs.series(range(2, inputs.order + 1))
    (sides,) = _read(reader, model, known, series, inputs.instants(levels), multipliers[1])
    columns = len(inputs.columns)
    scaled = [_times(inputs, sides.numbers[k, ..., k].T.reshape(columns), math.factorial(k)) for k in range(levels)]
    place = (inputs.t, inputs.q)
    return [
        Function(
            "mass_matrix", place, matrix.numbers[..., 0], ("column", "column"),
            "Return M, about the origins of the bodies",
        ),
        Function(
            "forces", (*place, inputs.velocities(1), multipliers[0]), np.array(scaled, np.int64), ("order", "column"),
            "Return M q^(k+2) + Phi_q^T lambda^(k) for k = 0, 1, ...: forces, N, and moments, N m, and their rates",
        ),
    ]  # fmt: skip


def _multipliers(mechanism: Mechanism, model: Model, inputs: Inputs, levels: int) -> tuple[Argument, Entries]:
    """Return the multipliers as an argument, and their coefficients, one instant for each order, with lower orders."""
    rows, order = equation_labels(mechanism, model)["row"].tolist(), row_order(mechanism, model)
    labels = tuple(tuple(f"{row}_lambda{k}" for row in rows) for k in range(max(1, levels - 1)))
    graph, zero = inputs.graph, inputs.graph.constant(0.0)
    array = np.full((levels, len(rows), levels), zero, np.int64)
    for k in range(levels - 1):
        given = np.zeros(len(rows), np.int64)
        given[order] = [graph.input(label) for label in labels[k]]
        array[k, :, k + 1 :] = _times(inputs, given, 1 / math.factorial(k))[:, None]
    text = "lambda, lambda', ..., (order, row), as far as known: the first result needs none"
    return Argument("multipliers", labels, text), Entries(array, float)


def _times(inputs: Inputs, numbers: np.ndarray, factor: float | int) -> np.ndarray:
    graph = inputs.graph
    constant = graph.constant(float(factor))
    return np.asarray(np.frompyfunc(lambda x: graph.apply("mul", constant, int(x)), 1, 1)(numbers), np.int64)


def output_function(mechanism: Mechanism, model: Model, inputs: Inputs) -> tuple[Function, tuple[str, ...]]:
    """Return the function of outputs that follow from the motion of bodies, with derivatives, and their labels.

    Raises
    ------
    MechanismError
        If the mechanism has no such output, or an output cannot be written out.
    """
    columns: dict[str, list[int]] = {}
    extra = max((group.element.lost_orders for group in model.system.outputs), default=0)
    for group, names in zip(model.system.outputs, model.outputs, strict=True):
        rows = [_output_labels(mechanism, name) for name in names]
        for k in range(inputs.order + 1 - extra):  # whether an angle is defined is judged by all rates that are given
            order = k + group.element.lost_orders

            def value(bodies: Any, group: Any = group, order: int = order, k: int = k) -> Any:
                return group.evaluate(pose_of(bodies, model.pose_type, order)).dense().coefficients[k]

            series = inputs.series([order + 1], order)
            (entries,) = _read(GraphReader(inputs.graph), model, value, series, names=names)
            values = _times(inputs, entries.numbers[..., 0], math.factorial(k))
            for i, components in enumerate(rows):
                for c, row in enumerate(components):
                    columns.setdefault(row, []).append(int(values[c, i]))
    if not columns:
        message = "no output of this mechanism follows from places and motions of bodies alone"
        raise MechanismError(message, name="outputs", value=[*mechanism.outputs])
    known = [name for name, output in mechanism.outputs.items() if not isinstance(output, AbstractMotionOutput)]
    labels = tuple(row for name in known for row in _output_labels(mechanism, name))
    table = np.array([columns[row] for row in labels], np.int64).T
    text = "Return OUTPUTS and their derivatives, k = 0, 1, ..., in SI units"
    return Function("outputs", (inputs.t, inputs.q, inputs.velocities(extra)), table, ("order", "output"), text), labels


def _output_labels(mechanism: Mechanism, name: str) -> list[str]:
    return [f"{name}.{part}" for part in mechanism.outputs[name].component_labels(mechanism)] or [name]


def _read(
    reader: GraphReader, model: Model, function: Callable[..., Any], *arguments: Any, names: Sequence[str] = ()
) -> list[Entries]:
    """Return the nodes of the results of a function.

    Raises
    ------
    MechanismError
        If an operation cannot be written out; the message has the names of its possible owners.
    """
    try:
        return reader.function(function, *arguments)
    except UnwritableOperationError as error:
        forces = [name for group in model.forces for name in group]
        name = ", ".join(names) or ("forces." + ", ".join(forces) if forces else "joints")
        raise MechanismError(f"cannot be written out: {error}; write it without that", name=name) from None
