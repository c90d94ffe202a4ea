"""The equations of a mechanism as a graph of operations on its coordinates, from its residuals on jets."""

import dataclasses
import math
from typing import Any

import numpy as np
from jaxtyping import Int

from jounce.dynamics.inverse.constraint_equations import equation_labels, position_equations, right_sides, row_order
from jounce.errors import MechanismError, check_name
from jounce.kinematics import Motion
from jounce.kinematics.assembly.assemble import assemble
from jounce.kinematics.curves.choice import chosen
from jounce.linear_algebra.pattern import Pattern
from jounce.mechanism import Mechanism, Model, build
from jounce.mechanism.axis_angles import measures_angle
from jounce.mechanism.builder import group_rows
from jounce.mechanism.output_drivers import with_output_drivers
from jounce.mechanism.system import Group, System
from jounce.mechanism.time import time_grid
from jounce.written_equations.graph import Graph
from jounce.written_equations.reading import Entries, GraphReader, NotWrittenError

TOLERANCE = 1e-12  # of the assembly from which angles about axes are counted
EULER_PARAMETERS = ("e0", "e1", "e2", "e3")


@dataclasses.dataclass(frozen=True)
class MechanismEquations:
    """The equations of a mechanism, or of some of its joints, as numbers of the nodes of a graph.

    Parameters
    ----------
    title : str
        Of the mechanism.
    graph : Graph
        With the inputs ``t``, those of `coordinates`, and those of `velocities`.
    coordinates, columns, rows : tuple of str
        Labels, as `constraint_equations` has them; in space a body has seven coordinates and six columns.
    velocities : tuple of tuple of str, (order, column)
        Names of the inputs that are derivatives of the coordinates, from the first on.
    residual : array of int, (row,)
        Phi.
    jacobian : array of int, (row, column)
        Phi_q.
    right_side : array of int, (order, row)
        nu, gamma, eta, sigma and those beyond.
    """

    title: str
    graph: Graph
    coordinates: tuple[str, ...]
    columns: tuple[str, ...]
    rows: tuple[str, ...]
    velocities: tuple[tuple[str, ...], ...]
    residual: Int[np.ndarray, " row"]
    jacobian: Int[np.ndarray, "row column"]
    right_side: Int[np.ndarray, "order row"]

    @property
    def order(self) -> int:
        """The highest derivative that has a right side."""
        return len(self.right_side)

    @property
    def size(self) -> int:
        """How many operations the equations take."""
        parts = (self.residual, self.jacobian, self.right_side)
        return sum(len(self.graph.reached(part.ravel().tolist())) for part in parts)


def equations_of(given: Mechanism | Motion, joint: str | None, order: int) -> MechanismEquations:
    """Return the equations of a mechanism, or of one of its joints or drivers.

    Parameters
    ----------
    given : Mechanism or Motion
        A mechanism, whose angles about axes are counted from where it is put together, or as along a motion.
    joint : str, optional
        Name of a joint or a driver.
    order : int
        Of the highest derivative, from 1.

    Raises
    ------
    MechanismError
        If there is no such joint, or it has an operation that cannot be written out.
    """
    mechanism = given.mechanism if isinstance(given, Motion) else given
    if joint is not None:
        check_name("joint or driver", joint, (*mechanism.joints, *mechanism.drivers), MechanismError, name="joint")
    model = given.model if isinstance(given, Motion) else put_together(mechanism)
    labels = {axis: names.tolist() for axis, names in equation_labels(mechanism, model).items()}
    order_of_rows, places = row_order(mechanism, model).tolist(), group_rows(model)
    graph = Graph()
    inputs = _Inputs(graph, mechanism, model, order)
    own = [k for k, row in enumerate(labels["row"]) if joint is None or row.rpartition(".")[0] == joint]
    numbers: dict[int, tuple[Any, Any, Any]] = {}
    for group, rows in zip(model.system.groups, places, strict=True):
        if any(order_of_rows[k] in range(rows.start, rows.stop) for k in own):
            residual, jacobian, sides = _read(_alone(model, group, rows), model, inputs, rows)
            for k, row in enumerate(range(rows.start, rows.stop)):
                numbers[row] = residual[k], jacobian[k], sides[:, k]
    found = [numbers[order_of_rows[k]] for k in own]
    width = len(labels["column"])
    return MechanismEquations(
        mechanism.title or "",
        graph,
        tuple(inputs.coordinates),
        tuple(labels["column"]),
        tuple(labels["row"][k] for k in own),
        inputs.velocities,
        np.array([row[0] for row in found], np.int64),
        np.array([row[1] for row in found], np.int64).reshape(-1, width),
        np.array([row[2] for row in found], np.int64).reshape(-1, order).T,
    )


def put_together(mechanism: Mechanism) -> Model:
    """Return the model of a mechanism, with angles about axes counted from where it is put together."""
    instant = 0.0
    if mechanism.time is not None:
        instant = float(time_grid(mechanism.time, mechanism.parameter_values)[0])
    model = build(chosen(with_output_drivers(mechanism), instant))
    if not any(map(measures_angle, model.system.groups)):
        return model
    return assemble(model, instant, TOLERANCE, free=True)[0]


def _alone(model: Model, group: Group, rows: slice) -> System:
    """Return the system of the joints of one group."""
    count = rows.stop - rows.start
    width = model.pose_type.shifts + model.pose_type.turns
    pattern = Pattern.of([group], (count // group.instances,), width, len(model.bodies))
    return dataclasses.replace(
        model.system, groups=(group,), pattern=pattern, fronts=None, rank=None, outputs=(), forces=(),
        row_scale=np.ones((count, 1)), column_scale=np.ones(width),
    )  # fmt: skip


class _Inputs:
    """The coordinates of all bodies and their derivatives, as inputs of a graph."""

    def __init__(self, graph: Graph, mechanism: Mechanism, model: Model, order: int):
        self.graph, self.order = graph, order
        shifts, spatial = model.pose_type.shifts, mechanism.space == "spatial"
        names, bodies = "xyz"[:shifts], list(mechanism.bodies)
        attitude = EULER_PARAMETERS if spatial else ("angle",)
        turns = ("wx", "wy", "wz") if spatial else ("angle",)
        self.coordinates = [f"{body}.{name}" for body in bodies for name in (*names, *attitude)]
        columns = [f"{body}.{name}" for body in bodies for name in (*names, *turns)]
        self.velocities = tuple(tuple(f"{c}_d{k}" for c in columns) for k in range(1, order + 1))
        self.time = graph.input("t")
        width, spins = shifts + len(attitude), shifts + len(turns)
        ground = [0.0] * shifts + ([1.0, 0.0, 0.0, 0.0] if spatial else [0.0])
        at_rest = list(map(graph.constant, ground))
        self._place = np.array(at_rest + list(map(graph.input, self.coordinates)), np.int64).reshape(-1, width)
        still = np.full(spins, graph.constant(0.0))
        moving = [[graph.input(name) for name in row] for row in self.velocities]
        self._moving = [np.concatenate([still, row]).reshape(-1, spins) for row in moving]
        self._shifts, self._attitude = shifts, "quaternion" if spatial else "angle"

    def place(self) -> dict[str, Entries]:
        """Return the coordinates of a place, as `Motion.poses` has them: the ground first, one instant."""
        position, attitude = self._place[:, : self._shifts], self._place[:, self._shifts :]
        found = {"position": position.T, self._attitude: attitude.T if attitude.shape[1] > 1 else attitude[:, 0]}
        return {name: Entries(x[None, ..., None], float) for name, x in found.items()}

    def without_unknowns(self) -> dict[str, Entries]:
        """Return the coordinates once for each order, the coefficients from that order on set to zero."""
        graph, order = self.graph, self.order
        zero = graph.constant(0.0)

        def level(k: int, own: int, moving: np.ndarray) -> np.ndarray:
            """Return the coefficients of order k where those of order `own` are not known."""
            if k >= own:
                return np.full(moving.shape, zero)
            factor = graph.constant(math.factorial(k))
            return np.asarray(np.frompyfunc(lambda x: graph.apply("div", x, factor), 1, 1)(moving), np.int64)

        place, elements = self.place(), {}
        lanes = range(1, order + 1)
        repeated = {name: np.repeat(x.numbers, order, axis=-1) for name, x in place.items()}
        shifts = [[level(k, own, self._moving[k - 1][:, : self._shifts].T) for own in lanes] for k in lanes]
        turns = [[level(k, own, self._moving[k - 1][:, self._shifts :].T) for own in lanes] for k in lanes]
        elements["position"] = np.concatenate([repeated["position"], np.moveaxis(np.array(shifts), 1, -1)])
        if self._attitude == "angle":
            elements["angle"] = np.concatenate([repeated["angle"], np.moveaxis(np.array(turns), 1, -1)[:, 0]])
        else:
            elements["quaternion"] = repeated["quaternion"]
            rates = [[level(k - 1, own - 1, self._moving[k - 1][:, self._shifts :].T) for own in lanes] for k in lanes]
            elements["angular_velocity"] = np.moveaxis(np.array(rates), 1, -1)
        return {name: Entries(x, float) for name, x in elements.items()}


def _read(system: System, model: Model, inputs: _Inputs, rows: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the nodes of residual, Jacobian and right sides of the joints of one group."""
    reader, pose_type = GraphReader(inputs.graph), model.pose_type
    instant = Entries(np.full(1, inputs.time), float)
    instants = Entries(np.full(inputs.order, inputs.time), float)
    try:
        residual, jacobian = reader.function(
            lambda bodies, t: position_equations(system, bodies, t, pose_type), inputs.place(), instant
        )
        (sides,) = reader.function(
            lambda bodies, t: right_sides(system, bodies, t, pose_type), inputs.without_unknowns(), instants
        )
    except NotWrittenError as error:
        name = model.rows[rows][0].partition(".")[2]
        message = f"cannot be written out: {error}; write its residual, or its law, without that"
        raise MechanismError(message, name=name) from None
    return residual.numbers[:, 0], jacobian.numbers[..., 0], sides.numbers[..., 0]
