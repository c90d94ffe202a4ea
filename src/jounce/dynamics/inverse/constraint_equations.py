"""The equations of a mechanism as arrays: residual, Jacobian, right-hand sides, multipliers. Sommer 2024, 1-8.

They come from the same residuals on jets as those of the solver, but in SI units and in the order of the file; the
solver scales rows and columns, and groups joints by type.
"""

import dataclasses
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, cast

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.dynamics.forward.accelerations import Lanes, Rows
from jounce.dynamics.forward.loads import mass_matrices
from jounce.dynamics.forward.mechanism_state import MotionAtState, at_state
from jounce.dynamics.forward.saddle_point import Jacobian, MassMatrix, block_diagonal, even_scale, saddle_point
from jounce.dynamics.inverse.motion_forces import MotionForces
from jounce.dynamics.masses import Masses, masses_of
from jounce.dynamics.motion_values import Coordinates, cut, derivatives_along, pose_of
from jounce.errors import MechanismError
from jounce.execution.mapped import Mapped
from jounce.jet import Jet
from jounce.jet.derivatives import plain_derivatives
from jounce.kinematics import Motion, Status
from jounce.linear_algebra.host_jacobian import RANK_TOLERANCE
from jounce.mechanism import Mechanism, Model
from jounce.mechanism.building.element_indices import ElementIndex, element_indices
from jounce.mechanism.building.preconditions import concrete
from jounce.mechanism.system import System
from jounce.rigid.pose import Pose

if TYPE_CHECKING:
    import xarray

COLUMNS = {"planar": ("x", "y", "angle"), "spatial": ("x", "y", "z", "wx", "wy", "wz")}


@concrete
def constraint_equations(
    motion: Motion | Mechanism, state: Mapping[str, Any] | None = None, time: float | None = None
) -> "xarray.Dataset":
    """Return the constraint equations of a mechanism along a motion, or at one state: Sommer 2024, equations 1-8.

    Joints and drivers are ``Phi(q, t) = 0``, and each time derivative of it is linear in the highest derivative of the
    coordinates, with one Jacobian for all orders: ``Phi_q q^(k) = right_side(k)``, S's nu, gamma, eta and sigma for
    k = 1 to 4. Forces follow from the transpose, ``M q'' + Phi_q^T lambda = Q``.

    Parameters
    ----------
    motion : Motion or Mechanism
        A solved or simulated motion, or a mechanism at a state, for which no motion needs to exist.
    state : mapping of str to mapping, optional
        For each moving body ``position``, m, and its derivatives, (n + 1, c), or the position alone, (c,). In the plane
        ``angle``, rad, and its derivatives, (n + 1,). In space ``orientation``, in any form that a `Body` takes, and
        for n = 1 and above ``angular_velocity``, rad/s, along the axes of the body, and its derivatives, (n, 3). The
        state need not satisfy the constraints. By default, the starting guess of the bodies of the mechanism.
    time : float, optional
        Instant at which the drivers are evaluated for a state, s; 0 by default. A motion has its own instants.

    Returns
    -------
    xarray.Dataset
        In SI units, unscaled. Rows are labeled "JOINT.1", "JOINT.2", ..., joints before drivers in the order of
        the mechanism; columns "BODY.x", "BODY.y", "BODY.angle", in space "BODY.x", "BODY.y", "BODY.z", "BODY.wx",
        "BODY.wy", "BODY.wz": the global position of the origin, and the angular velocity along the axes of the body.
        At ``derivative=k`` a variable contains its k-th derivative, or its value for q^(k), and NaN if there is none,
        such as `right_side` at 0 if there are multipliers. The coordinate ``column_unit`` contains the units of the
        columns, m or rad.

        ``residual`` (time, row)
            Phi; angles about axes are within half a turn.
        ``jacobian`` (time, row, column)
            Phi_q; in space, with respect to w instead of attitude parameters, so no row for normalization is needed.
        ``right_side`` (time, derivative, row)
            Phi_q q^(k) for k = 1 to the order of the motion; at a state with n derivatives, to n + 1.
        ``velocities`` (time, derivative, column)
            q^(k) for k = 1 and above; in space, r^(k) and w^(k-1).
        ``position`` (time, body, component), and ``angle`` (time, body) or ``attitude`` (time, body, euler_parameter)
            Positions of the bodies, m; angles, rad, or Euler parameters, body to global frame, scalar first.
        ``mass_matrix`` (time, column, other_column)
            If there are masses: M, symmetric, about the origins of the bodies.
        ``multipliers`` (time, derivative, row)
            If there are masses or applied forces: lambda, lambda', ..., with ``M q'' + Phi_q^T lambda = Q``. Q consists
            of forces along the global axes and moments about the origins along the axes of the bodies, including joint
            friction and the inertia terms without q''. They require accelerations, and have two derivatives fewer than
            the motion. Multipliers that redundant rows leave undetermined are NaN, or chosen by
            `Mechanism.redundant_reactions`.

    Raises
    ------
    MechanismError
        If the state does not fit the mechanism, or a law has no finite value there.

    Examples
    --------
    >>> import jounce as jn
    >>> equations = jn.constraint_equations(jn.solve(jn.load("examples/four_bar.yaml"), [0.0, 0.5], order=4))
    >>> equations.row.values.tolist(), equations.column.values.tolist()[:3]
    (['A.1', 'A.2', 'D.1', 'D.2', 'BC.1', 'theta.1'], ['crank.x', 'crank.y', 'crank.angle'])
    >>> along = equations.jacobian.dot(equations.velocities, dim="column")  # Phi_q q^(k), at every instant and order
    >>> bool((abs(along - equations.right_side) < 1e-10).all())
    True

    At a state of one's own, a pendulum that points along x, has left its pin by 1 mm, and turns by 2 rad/s:

    >>> pendulum = jn.Mechanism(
    ...     space="planar",
    ...     bodies={"arm": jn.Body([0, 0])},
    ...     joints={"O": jn.planar.Revolute(("ground", "arm"), [0, 0], [-0.5, 0])},
    ... )
    >>> state = {"arm": {"position": [[0.501, 0], [0, 1]], "angle": [0, 2]}}
    >>> equations = jn.constraint_equations(pendulum, state)
    >>> equations.residual.values.round(12).tolist(), equations.right_side.sel(derivative=2).values.tolist()
    ([[0.001, 0.0]], [[-2.0, 0.0]])
    """
    import xarray

    if isinstance(motion, Mechanism) or state is not None:
        motion, known_order = at_state(motion, state, 0.0 if time is None else time)
        order = known_order + 1
    elif time is not None:
        raise MechanismError("goes with a state; a motion has its instants", name="time", value=time)
    elif isinstance(motion, Motion):
        order = known_order = motion.order
    else:
        raise MechanismError("must be a jn.Motion, or a jn.Mechanism with a state", name="motion", value=motion)
    labels = {"time": motion.time} | equation_labels(motion.mechanism, motion.model)
    numbers = _numbers(motion, order)
    if isinstance(motion, MotionAtState):
        _check_finite(numbers, labels["row"], float(motion.time[0]))
    variables = {
        "residual": (("time", "row"), numbers["residual"]),
        "jacobian": (("time", "row", "column"), numbers["jacobian"]),
        "right_side": (("time", "derivative", "row"), numbers["right_side"], 1),
        "velocities": (("time", "derivative", "column"), _velocities(motion, known_order), 1),
    }
    variables |= _positions(motion) | _forces(motion, numbers["jacobian"])
    solved = motion.status == Status.OK
    arrays = []
    for name, (dims, values, *first) in variables.items():
        coordinates = {dim: labels[dim] for dim in dims if dim != "derivative"}
        if first:
            coordinates["derivative"] = np.arange(first[0], first[0] + values.shape[1])
        values = np.where(solved.reshape(-1, *[1] * (values.ndim - 1)), values, np.nan)
        arrays.append(xarray.DataArray(values, coordinates, dims, name))
    dataset = cast("xarray.Dataset", xarray.merge(arrays, join="outer", compat="no_conflicts"))  # not a DataTree
    dataset.attrs = {"title": motion.mechanism.title or "equations of a mechanism", "source": "jounce"}
    dataset["time"].attrs = {"units": "s", "long_name": "time"}
    dataset["derivative"].attrs = {"long_name": "order of the time derivative"}
    for name, unit in (("position", "m"), ("angle", "rad"), ("attitude", "1")):
        if name in dataset:
            dataset[name].attrs["units"] = unit
    turns = motion.model.pose_type.turns
    units = (["m"] * motion.model.pose_type.shifts + ["rad"] * turns) * len(motion.mechanism.bodies)
    return dataset.assign_coords(column_unit=("column", units))


def equation_labels(mechanism: Mechanism, model: Model) -> dict[str, np.ndarray]:
    """Return the labels of all axes but the time, rows in the order of the mechanism."""
    columns = [f"{body}.{name}" for body in mechanism.bodies for name in COLUMNS[mechanism.space]]
    rows = [f"{name}.{k + 1}" for name, index in _in_order(mechanism, model) for k in range(len(index.own_rows))]
    labels = {
        "row": rows,
        "column": columns,
        "other_column": columns,
        "body": list(mechanism.bodies),
        "component": list("xyz"[: model.pose_type.shifts]),
        "euler_parameter": ["e0", "e1", "e2", "e3"],
    }
    return {axis: np.array(names, dtype=str) for axis, names in labels.items()}


def _in_order(mechanism: Mechanism, model: Model) -> list[tuple[str, ElementIndex]]:
    """Return joints and drivers by name, in the order of the mechanism."""
    indices = element_indices(model)
    return [(name, indices[name]) for name in (*mechanism.joints, *mechanism.drivers)]


def row_order(mechanism: Mechanism, model: Model) -> np.ndarray:
    """Return the indices of the rows within the system, in the order of the mechanism."""
    return np.array([row for _, index in _in_order(mechanism, model) for row in index.own_rows], int)


def in_si_units(model: Model) -> System:
    """Return the constraints of a model without forces, rows and columns unscaled."""
    system = model.system
    count = model.pose_type.shifts + model.pose_type.turns
    unit_scales = np.ones((system.shape[0], 1)), np.ones(count)
    return dataclasses.replace(system, outputs=(), forces=(), row_scale=unit_scales[0], column_scale=unit_scales[1])


def _numbers(motion: Motion, order: int) -> dict[str, np.ndarray]:
    """Return residual, Jacobian and right-hand sides at all instants, the time first."""
    pose_type, coordinates = motion.poses
    unscaled = in_si_units(motion.model)

    residual, jacobian = _position_equations.along(unscaled, (cut(coordinates, 0), motion.time), pose_type=pose_type)
    right_side = np.zeros((0, *residual.shape))
    if order:
        right_side = _right_sides.along(unscaled, (coordinates, motion.time), pose_type=pose_type, order=order)
    chosen = row_order(motion.mechanism, motion.model)
    return {
        "residual": residual[chosen].T,
        "jacobian": np.moveaxis(jacobian[chosen], -1, 0),
        "right_side": np.moveaxis(right_side[:, chosen], -1, 0) + 0.0,  # no zero is negative
    }


def _without_unknowns(coordinates: Coordinates, order: int) -> Coordinates:
    """Return copies of the coordinates along the batch; the k-th copy has zero coefficients of order k."""
    elements = {}
    for name, values in coordinates.items():
        first = name == "angular_velocity"  # its coefficients begin with the rate
        levels = list(values[: order + 1 - first])
        levels += [jnp.zeros(values.shape[1:])] * (order + 1 - first - len(levels))
        is_unknown = name != "quaternion"  # the attitude follows from its value and the angular velocity
        copies = [
            [jnp.zeros_like(level) if is_unknown and k + first == copy else level for copy in range(1, order + 1)]
            for k, level in enumerate(levels)
        ]
        elements[name] = jnp.stack([jnp.concatenate(copy, axis=-1) for copy in copies])
    return elements


def position_equations(
    system: System, bodies: Coordinates, instants: Lanes, pose_type: type[Pose]
) -> tuple[Rows, Jacobian]:
    """Return the residual and the Jacobian."""
    pose, time = pose_of(bodies, pose_type, 0), Jet([instants[None]])
    return system.residual(pose, time).coefficients[0], system.jacobian(pose, time)


@Mapped
def _position_equations(
    system: System, lanes: tuple[Coordinates, Lanes], *, pose_type: type[Pose]
) -> tuple[Rows, Jacobian]:
    return position_equations(system, *lanes, pose_type)


def right_sides(
    system: System, bodies: Coordinates, instants: Lanes, pose_type: type[Pose]
) -> Float[Numbers, "derivative row instant"]:
    """Return the right-hand sides, from states in which the coefficient of the respective order is zero.

    The coefficient of order k of the residual is affine in that of the coordinates, and the Jacobian is its slope. Its
    value for a coefficient of zero is minus the right-hand side divided by k!.
    """
    order = len(bodies["position"]) - 1
    residual = system.residual(pose_of(bodies, pose_type, order), Jet.variable(instants[None], order)).dense()
    levels = [c.reshape(len(c), order, c.shape[-1] // order)[:, k] for k, c in enumerate(residual.coefficients[1:])]
    factorials = np.array([math.factorial(k + 1) for k in range(order)], float)
    return -factorials[:, None, None] * jnp.stack(levels)


@Mapped
def _right_sides(
    system: System, lanes: tuple[Coordinates, Lanes], *, pose_type: type[Pose], order: int
) -> Float[Numbers, "derivative row instant"]:
    bodies, instants = lanes
    return right_sides(system, _without_unknowns(bodies, order), jnp.tile(instants, order), pose_type)


def _velocities(motion: Motion, order: int) -> Float[np.ndarray, "time derivative column"]:
    """Return the derivatives of the coordinates, beginning with the first."""
    _, coordinates = motion.poses
    moving_bodies = {name: np.asarray(values)[..., 1:, :] for name, values in coordinates.items()}  # without the ground
    derivatives = {name: plain_derivatives(values) for name, values in moving_bodies.items()}
    turns = derivatives["angle"][1:, None] if "angle" in derivatives else derivatives["angular_velocity"]
    rates = np.concatenate([derivatives["position"][1 : order + 1], turns[:order]], axis=1)
    columns = motion.model.system.shape[1]
    return np.transpose(rates, (3, 0, 2, 1)).reshape(len(motion.time), order, columns)


def _positions(motion: Motion) -> dict[str, Any]:
    """Return the positions and attitudes of the bodies at all instants."""
    coordinates = cut(motion.poses[1], 0)
    first = {name: np.moveaxis(np.asarray(values[0])[..., 1:, :], -1, 0) for name, values in coordinates.items()}
    variables = {"position": (("time", "body", "component"), np.swapaxes(first["position"], 1, 2))}
    if "angle" in first:
        return variables | {"angle": (("time", "body"), first["angle"])}
    return variables | {"attitude": (("time", "body", "euler_parameter"), np.swapaxes(first["quaternion"], 1, 2))}


def _forces(motion: Motion, jacobian: Float[np.ndarray, "time row column"]) -> dict[str, Any]:
    """Return the mass matrix and the multipliers, if there are any."""
    mechanism, forces = motion.mechanism, {}
    if any(body.mass is not None for body in mechanism.bodies.values()):
        forces["mass_matrix"] = (("time", "column", "other_column"), _mass_matrix(motion))
    elif not mechanism.forces:
        return forces
    _, coordinates = motion.poses
    levels = min(len(coordinates["position"]) - 2, motion.order + 1)
    columns = jacobian.shape[-1]
    mass = forces["mass_matrix"][1] if forces else np.zeros((1, columns, columns))
    if (
        levels < 1
        or not jacobian.size
        or (isinstance(motion, MotionAtState) and not _determined(motion, jacobian[0], mass[0]))
    ):
        return forces
    motion_forces = MotionForces.of(motion)
    if motion_forces.flanks:  # not in the equations: the radial force between teeth does no work
        motion_forces = MotionForces(motion, flanks=False)
    values = derivatives_along(
        motion, motion_forces.unique_multipliers[:levels][:, row_order(motion.mechanism, motion.model)]
    )
    return forces | {"multipliers": (("time", "derivative", "row"), values, 0)}


def _determined(
    motion: Motion, jacobian: Float[np.ndarray, "row column"], mass: Float[np.ndarray, "column column"]
) -> bool:
    """Return whether the equations determine the multipliers at a state; for a motion they always do."""
    scale = np.tile(motion.model.system.column_scale, len(motion.mechanism.bodies))
    sizes = np.max(np.abs(jacobian * scale), axis=1, keepdims=True)
    matrix = jacobian * scale / np.where(sizes > 0, sizes, 1.0)
    if len(matrix) != matrix.shape[1]:
        mass = mass * scale[:, None] * scale
        mass = mass / (np.max(np.abs(mass)) or 1.0)
        matrix = np.asarray(saddle_point(mass[..., None], matrix[..., None]))[..., 0]
        even = even_scale(matrix, len(scale))
        matrix = matrix * even * even[:, None]
    return int(np.linalg.matrix_rank(matrix, rtol=RANK_TOLERANCE)) == len(matrix)


def _mass_matrix(motion: Motion) -> Float[np.ndarray, "time column column"]:
    """Return the mass matrix at all instants."""
    pose_type, coordinates = motion.poses
    masses = masses_of(motion.mechanism)
    matrices = _body_masses.along(masses, cut(coordinates, 0), pose_type=pose_type)
    return np.moveaxis(matrices, -1, 0)


@Mapped
def _body_masses(masses: Masses, bodies: Coordinates, *, pose_type: type[Pose]) -> MassMatrix:
    blocks = mass_matrices(pose_of(bodies, pose_type, 0), masses)[:, :, 1:]
    return block_diagonal(blocks, np.ones(len(blocks)))


def _check_finite(numbers: dict[str, np.ndarray], rows: np.ndarray, instant: float) -> None:
    """Raise MechanismError if a row is not finite at a state."""
    for name, values in numbers.items() if len(rows) else ():
        is_bad = ~np.isfinite(np.moveaxis(values[0], -1 if name == "right_side" else 0, 0).reshape(len(rows), -1))
        if is_bad.any():
            row, k = np.argwhere(is_bad)[0]
            phrase = f"its derivative {k + 1}" if name == "right_side" else f"its {name}"
            message = f"{phrase} has no finite value at t = {instant:g} s; check its law and its points there"
            raise MechanismError(message, name=str(rows[row]).rpartition(".")[0])
