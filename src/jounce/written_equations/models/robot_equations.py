"""Torques of a robot and their rates, mass matrix, regressor and energies, as operations on coordinates."""

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any

import jax
import numpy as np
from jaxtyping import Float

from jounce.dynamics.energy.energies import body_energy, energies_of_tree, rotors_of
from jounce.errors import RobotError
from jounce.robot import Robot
from jounce.robot.algorithms.equations_of_motion import mass_matrix_of_tree
from jounce.robot.algorithms.inverse_dynamics import generalized_forces
from jounce.written_equations.operations.functions import Argument, Code, Function
from jounce.written_equations.operations.graph import Graph
from jounce.written_equations.operations.reading import Entries, GraphReader, UnwritableOperationError

TORQUE, MASS_MATRIX, REGRESSOR, ENERGIES = "torque", "mass_matrix", "regressor", "energies"
QUANTITIES = (TORQUE, MASS_MATRIX, REGRESSOR, ENERGIES)
INERTIAL = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
OF_DRIVES = ("armature", "damping", "friction", "friction_skew")
_PLACE = "q holds coordinates and their derivatives, (order, JOINTS), rad or m by s."
_ABOUT = {
    TORQUE: "torque(k): the k-th rate of the torques, N m, or forces, N, that a motion needs.",
    MASS_MATRIX: "mass_matrix M: torque = M q'' + what it is without q''.",
    REGRESSOR: """torque = regressor @ PARAMETERS, and so for its rates. Of each moving link, with what is fixed to it:
mass, kg, first moments, kg m, and moments of inertia about its origin, kg m^2, Ixy = -sum x y dm, all in its own axes;
of each joint, what its drive adds. PARAMETER_VALUES are those of the robot.""",
    ENERGIES: """energy_p: the acceleration energy of order p of all links, J/s^(2 p), and its rates; energy_0 is the
kinetic energy. Negrean 2025, equations 65-122.""",
}


def robot_code(robot: Robot, order: int, quantities: Sequence[str], *, drives: bool) -> Code:
    """Return equations of a robot.

    Parameters
    ----------
    robot : Robot
    order : int
        Highest derivative of the coordinates, at least 2.
    quantities : sequence of str
        Names from `QUANTITIES`.
    drives : bool
        Whether to include armature, damping, friction and springs of the joints.

    Raises
    ------
    RobotError
        If the robot has no moving joint, or a feature that cannot be written out.
    """
    if not robot.joint_names:
        raise RobotError("no joint moves, so that there are no equations", name="robot", value=robot.name)
    if order < 2:
        raise RobotError("must be 2 or more: torques need accelerations", name="order", value=order)
    reading = _Reading(robot, order)
    functions, labels, values = [], {"JOINTS": tuple(robot.joint_names)}, {}
    try:
        if TORQUE in quantities:
            functions.append(_torque(reading, drives=drives))
        if MASS_MATRIX in quantities:
            functions.append(_mass_matrix(reading, drives=drives))
        if REGRESSOR in quantities:
            function, parameters = _regressor(reading, drives=drives)
            functions.append(function)
            labels["PARAMETERS"], values["PARAMETER_VALUES"] = tuple(parameters), tuple(parameters.values())
        if ENERGIES in quantities:
            functions += [_energy(reading, p, drives=drives) for p in range(order)]
    except UnwritableOperationError as error:
        raise RobotError(f"cannot be written out: {error}", name="robot", value=robot.name) from None
    notes = tuple(" ".join(text.split()) for text in (*(_ABOUT[x] for x in quantities), _PLACE, "SI units."))
    return Code(robot.name, "equations of motion", reading.graph, order, labels, notes, tuple(functions), values)


class _Reading:
    """The coordinates of a robot as inputs of a graph, and a reader of programs."""

    def __init__(self, robot: Robot, order: int):
        self.robot, self.order, self.graph = robot, order, Graph()
        names = robot.joint_names
        self.labels = tuple(tuple(f"{x}_d{k}" if k else x for x in names) for k in range(order + 1))
        levels = [
            [self.graph.apply("div", self.graph.input(x), self.graph.constant(float(math.factorial(k)))) for x in row]
            for k, row in enumerate(self.labels)
        ]
        self.q = Entries(np.array(levels, np.int64)[..., None], float)

    def argument(self, lead: int) -> Argument:
        """Return the coordinates as an argument; the first result needs `lead` of its orders."""
        return Argument("q", self.labels, "q, q', q'', ..., (order, joint)", lead)

    def read(self, function: Callable[[Any], Any], levels: int | None = None) -> np.ndarray:
        """Return the derivatives of the result of a function of Taylor coefficients of the coordinates."""
        given = Entries(self.q.numbers[:levels], float)
        (coefficients,) = GraphReader(self.graph).function(function, given)
        return np.array([self.times(row[..., 0], math.factorial(k)) for k, row in enumerate(coefficients.numbers)])

    def times(self, numbers: np.ndarray, factor: float | int) -> np.ndarray:
        """Return the nodes of products of a factor with nodes."""
        constant = self.graph.constant(float(factor))
        return np.asarray(np.frompyfunc(lambda x: self.graph.apply("mul", constant, int(x)), 1, 1)(numbers), np.int64)

    def minus(self, left: np.ndarray, right: np.ndarray) -> np.ndarray:
        """Return the nodes of differences."""
        return np.asarray(
            np.frompyfunc(lambda x, y: self.graph.apply("sub", int(x), int(y)), 2, 1)(left, right), np.int64
        )


def _torque(reading: _Reading, *, drives: bool) -> Function:
    tree = reading.robot.tree
    torques = reading.read(lambda q: generalized_forces.function(tree, (q,), (), (), drives))
    text = "Return the torques and their rates"
    return Function("torque", (reading.argument(3),), torques, ("order", "joint"), text)


def _mass_matrix(reading: _Reading, *, drives: bool) -> Function:
    tree = reading.robot.tree
    matrix = reading.read(lambda q: mass_matrix_of_tree.function(tree, (q,), (), drives), 1)[0]
    place = Argument("q", reading.labels[0], "q, (joint,)")
    return Function("mass_matrix", (place,), matrix, ("joint", "joint"), "Return the mass matrix")


def _energy(reading: _Reading, p: int, *, drives: bool) -> Function:
    robot = reading.robot
    static = (p, body_energy, *rotors_of(robot, drives=drives))
    rates = reading.read(lambda q: sum(x.sum(axis=1) for x in energies_of_tree.function(robot.tree, (q,), (), *static)))
    title = "kinetic energy" if p == 0 else f"acceleration energy of order {p}"
    return Function(f"energy_{p}", (reading.argument(p + 2),), rates, ("order",), f"Return the {title} and its rates")


def _regressor(reading: _Reading, *, drives: bool) -> tuple[Function, dict[str, float]]:
    """Return the function of the regressor, and its parameters with their values.

    A column is the torque of a robot with one nonzero parameter, by the program of torques. First moments alone have no
    center of mass; they are a unit mass at a distance minus a unit mass at the origin.
    """
    robot, tree = reading.robot, reading.robot.tree
    if tree.shape.lifted:
        raise RobotError("gravity pulls at some links in part, which is not linear in them", name=REGRESSOR)
    if drives and (tree.shape.tendons or tree.shape.balls):
        message = "springs, tendons and drives of balls are no parameters; take drives=False (--no-drives)"
        raise RobotError(message, name=REGRESSOR)
    units, values = _parameters(robot, drives=drives)
    stacked = {field: np.array([arrays[field] for arrays in units]) for field in units[0]}

    def columns(q: Any) -> Any:
        def column(arrays: dict[str, Any]) -> Any:
            return generalized_forces.function(dataclasses.replace(tree, **arrays), (q,), (), (), drives)

        return jax.vmap(column, out_axes=2)(stacked)  # levels, joints, parameters, batch

    regressor = reading.read(columns)
    for k in range(len(robot.moving_links)):
        for axis in range(1, 4):
            regressor[..., 10 * k + axis] = reading.minus(regressor[..., 10 * k + axis], regressor[..., 10 * k])
    text = "Return the matrix of the parameters, and its rates"
    return Function("regressor", (reading.argument(3),), regressor, ("order", "joint", "parameter"), text), values


def _parameters(robot: Robot, *, drives: bool) -> tuple[list[dict[str, Any]], dict[str, float]]:
    """Return arrays of robots with one nonzero parameter (first moments also have a mass), and the values."""
    tree, bodies, size = robot.tree, len(robot.moving_links), len(robot.joint_names)
    shapes = {"mass": (bodies,), "center": (bodies, 3), "inertia": (bodies, 3, 3)} | dict.fromkeys(OF_DRIVES, (size,))
    units: list[dict[str, Any]] = []
    values: dict[str, float] = {}

    def unit(**given: tuple[int, Any]) -> None:
        arrays = {field: np.zeros(shape) for field, shape in shapes.items()}
        for field, (k, value) in given.items():
            arrays[field][k] = value
        units.append(arrays)

    for k, link in enumerate(robot.moving_links):
        turn = robot.frames[link].rotation
        unit(mass=(k, 1.0))
        for place in turn.T:
            unit(mass=(k, 1.0), center=(k, place), inertia=(k, -_about_origin(place)))
        for i, j in zip(*(x.tolist() for x in np.triu_indices(3)), strict=True):
            unit(inertia=(k, turn @ _unit(i, j) @ turn.T))
        center, mass = turn.T @ tree.center[k], float(tree.mass[k])
        moments = turn.T @ tree.inertia[k] @ turn + mass * _about_origin(center)
        row = [mass, *(mass * center), *moments[np.triu_indices(3)]]
        values |= {f"{link}.{name}": float(x) for name, x in zip(INERTIAL, row, strict=True)}
    for field in OF_DRIVES if drives else ():
        given = np.asarray(getattr(tree, field))
        for k, joint in enumerate(robot.joint_names if field != "friction_skew" or given.any() else ()):
            unit(**{field: (k, 1.0)})
            values[f"{joint}.{field}"] = float(given[k])
    return units, values


def _unit(i: int, j: int) -> Float[np.ndarray, "3 3"]:
    """Return the symmetric matrix with ones at a place and at its mirror image."""
    tensor = np.zeros((3, 3))
    tensor[i, j] = tensor[j, i] = 1.0
    return tensor


def _about_origin(center: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "3 3"]:
    """Return the inertia matrix about the origin of a unit mass at a point."""
    return center @ center * np.eye(3) - np.outer(center, center)
