"""The equations of a mechanism as a graph of operations on its coordinates, from its residuals on jets."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from jounce.dynamics.inverse.constraint_equations import equation_labels, position_equations, right_sides, row_order
from jounce.errors import MechanismError, check_name
from jounce.kinematics import Motion
from jounce.kinematics.assembly.assemble import assemble
from jounce.kinematics.curves.choice import chosen
from jounce.linear_algebra.pattern import Pattern
from jounce.mechanism import Mechanism, Model, build
from jounce.mechanism.building.builder import group_rows
from jounce.mechanism.laws.output_drivers import with_output_drivers
from jounce.mechanism.system import Group, System
from jounce.mechanism.time import first_instant
from jounce.mechanism.transmissions.axis_angles import measures_angle
from jounce.written_equations.models.inputs import Inputs
from jounce.written_equations.models.mechanism_forces import check_forces, force_functions, output_function
from jounce.written_equations.operations.functions import Code, Function
from jounce.written_equations.operations.graph import Graph
from jounce.written_equations.operations.reading import GraphReader, UnwritableOperationError

TOLERANCE = 1e-12  # tolerance of the assembly, the reference of angles about axes


CONSTRAINTS, FORCES, OUTPUTS = "constraints", "forces", "outputs"
QUANTITIES = (CONSTRAINTS, FORCES, OUTPUTS)
_PLACE = """q, COORDINATES: global positions of the origins of the bodies, m, angles, rad, and in space Euler parameters
from the body to the global frame, the scalar first. COLUMNS are those of the Jacobian, and of velocities: derivatives
of positions and angles, and in space angular velocities along the axes of the body, rad/s, and their derivatives. ROWS
are those of the joints and drivers."""
_ABOUT = {
    CONSTRAINTS: "Phi(q, t) = 0, and each time derivative of it, Phi_q q^(k) = right_side(k), k = 1, 2, ...",
    FORCES: """M q^(k+2) + Phi_q^T lambda^(k) = forces(k), k = 0, 1, ...: with right_side(k+2) below it, one matrix
[[M, Phi_q^T], [Phi_q, 0]] gives accelerations and multipliers, and their rates, order after order.""",
    OUTPUTS: "OUTPUTS are those of the mechanism that places and motions of bodies determine, and their derivatives.",
}


def mechanism_code(given: Mechanism | Motion, joint: str | None, order: int, quantities: Sequence[str]) -> Code:
    """Return the equations of a mechanism, or of one of its joints or drivers.

    Parameters
    ----------
    given : Mechanism or Motion
        A mechanism, with angles about axes relative to its assembled position, or a motion, with its angles.
    joint : str, optional
        Name of a joint or driver.
    order : int
        Highest derivative, at least 1.
    quantities : sequence of str
        Names from `QUANTITIES`.

    Raises
    ------
    MechanismError
        If the joint does not exist, or an operation cannot be written out; or, for forces, if the mechanism has no
        mass or force, or the order is below 2.
    UnsupportedError
        If forces are requested and a joint has friction.
    """
    mechanism = given.mechanism if isinstance(given, Motion) else given
    if joint is not None:
        check_name("joint or driver", joint, (*mechanism.joints, *mechanism.drivers), MechanismError, name="joint")
    if FORCES in quantities:
        check_forces(mechanism, order)
    model = given.model if isinstance(given, Motion) else model_of_equations(mechanism)
    graph = Graph()
    inputs = Inputs(graph, mechanism, model, order)
    rows, functions, labels = rows_of(mechanism, model, joint), [], {}
    if CONSTRAINTS in quantities:
        functions += _constraints(mechanism, model, inputs, rows)
    if FORCES in quantities:
        functions += force_functions(mechanism, model, inputs)
    if OUTPUTS in quantities:
        function, names = output_function(mechanism, model, inputs)
        functions, labels = [*functions, function], {"OUTPUTS": names}
    constants = {"COORDINATES": tuple(inputs.coordinates), "COLUMNS": inputs.columns, "ROWS": rows} | labels
    notes = tuple(" ".join(text.split()) for text in (*(_ABOUT[x] for x in quantities), _PLACE, "SI units."))
    subject = "constraint equations" if quantities == (CONSTRAINTS,) else "equations"
    return Code(mechanism.title or "", subject, graph, order, constants, notes, tuple(functions))


def rows_of(mechanism: Mechanism, model: Model, joint: str | None) -> tuple[str, ...]:
    """Return the labels of the rows of a mechanism, or of one of its joints or drivers."""
    rows = equation_labels(mechanism, model)["row"].tolist()
    return tuple(row for row in rows if joint is None or row.rpartition(".")[0] == joint)


def _constraints(mechanism: Mechanism, model: Model, inputs: Inputs, names: tuple[str, ...]) -> list[Function]:
    """Return residual, Jacobian and right sides."""
    rows = equation_labels(mechanism, model)["row"].tolist()
    order_of_rows, rows_of_groups = row_order(mechanism, model).tolist(), group_rows(model)
    chosen = [order_of_rows[rows.index(row)] for row in names]
    numbers: dict[int, tuple[Any, Any, Any]] = {}
    for group, part in zip(model.system.groups, rows_of_groups, strict=True):
        if any(row in range(part.start, part.stop) for row in chosen):
            residual, jacobian, sides = _read(of_one_group(model, group, part), model, inputs, part)
            for k, row in enumerate(range(part.start, part.stop)):
                numbers[row] = residual[k], jacobian[k], sides[:, k]
    residual, jacobian, sides = (np.array([numbers[row][k] for row in chosen], np.int64) for k in range(3))
    place, moving = (inputs.t, inputs.q), inputs.velocities(0)
    return [
        Function("residual", place, residual, ("row",), "Return Phi"),
        Function("jacobian", place, jacobian.reshape(-1, len(inputs.columns)), ("row", "column"), "Return Phi_q"),
        Function(
            "right_side", (*place, moving), sides.reshape(-1, inputs.order).T, ("order", "row"),
            "Return Phi_q q^(k) for k = 1, 2, ...: nu, gamma, eta, sigma and those beyond",
        ),
    ]  # fmt: skip


def model_of_equations(mechanism: Mechanism) -> Model:
    """Return the model of a mechanism, with angles about axes relative to its assembled position."""
    instant = first_instant(mechanism.time, mechanism.parameter_values)
    model = build(chosen(with_output_drivers(mechanism), instant))
    if not any(map(measures_angle, model.system.groups)):
        return model
    return assemble(model, instant, TOLERANCE, free=True)[0]


def of_one_group(model: Model, group: Group, rows: slice) -> System:
    """Return the system of the joints of one group."""
    count = rows.stop - rows.start
    width = model.pose_type.shifts + model.pose_type.turns
    pattern = Pattern.of([group], (count // group.instances,), width, len(model.bodies))
    return dataclasses.replace(
        model.system, groups=(group,), pattern=pattern, fronts=None, rank=None, outputs=(), forces=(),
        row_scale=np.ones((count, 1)), column_scale=np.ones(width),
    )  # fmt: skip


def _read(system: System, model: Model, inputs: Inputs, rows: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the nodes of residual, Jacobian and right sides of the joints of one group."""
    reader, pose_type = GraphReader(inputs.graph), model.pose_type
    try:
        residual, jacobian = reader.function(
            lambda bodies, t: position_equations(system, bodies, t, pose_type), inputs.place(), inputs.instants(1)
        )
        (sides,) = reader.function(
            lambda bodies, t: right_sides(system, bodies, t, pose_type),
            inputs.series(range(1, inputs.order + 1)),
            inputs.instants(inputs.order),
        )
    except UnwritableOperationError as error:
        name = model.rows[rows][0].partition(".")[2]
        message = f"cannot be written out: {error}; write its residual, or its law, without that"
        raise MechanismError(message, name=name) from None
    return residual.numbers[:, 0], jacobian.numbers[..., 0], sides.numbers[..., 0]
