"""The equations of a mechanism as numbers: residual, Jacobian, right sides, multipliers. Sommer 2024, 1-8.

Each is what the solver works with, read off the same residuals on jets, but in SI units and in the order of the file:
the solver scales rows and columns, and keeps joints of one type together.
"""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp
import numpy as np

from jounce.dynamics.energies import masses_of
from jounce.dynamics.inverse import MotionForces, in_chunks, places, pose_of
from jounce.dynamics.loads import mass_matrices
from jounce.dynamics.mechanism_state import State, at_state
from jounce.errors import MechanismError
from jounce.jet import Jet
from jounce.kinematics import Motion, Status
from jounce.kinematics.assembly import split
from jounce.kinematics.compilation import compiled
from jounce.mechanism import Mechanism, Model
from jounce.mechanism.preconditions import concrete
from jounce.mechanism.system import System

COLUMNS = {"planar": ("x", "y", "angle"), "spatial": ("x", "y", "z", "wx", "wy", "wz")}


@concrete
def constraint_equations(
    motion: Motion | Mechanism, state: Mapping[str, Any] | None = None, time: float | None = None
) -> Any:
    """Return the constraint equations of a mechanism along a motion, or at one state: Sommer 2024, equations 1-8.

    Joints and drivers are ``Phi(q, t) = 0``, and each time derivative of it is linear in the highest derivative of the
    coordinates, with one Jacobian for all orders: ``Phi_q q^(k) = right_side(k)``, S's nu, gamma, eta and sigma for
    k = 1 to 4. Forces follow from the transpose, ``M q'' + Phi_q^T lambda = Q``.

    Parameters
    ----------
    motion : Motion or Mechanism
        A motion that was solved or simulated; or a mechanism at a state, which need not be one that can be solved.
    state : mapping of str to mapping, optional
        For each moving body ``position``, m, and its derivatives, (n + 1, c), or the position alone, (c,). In the plane
        ``angle``, rad, and its derivatives, (n + 1,). In space ``orientation``, in any form that a `Body` takes, and
        from n = 1 on ``angular_velocity``, rad/s, along the axes of the body, and its derivatives, (n, 3). It need
        not fulfil the joints. For a mechanism the starting guess of its bodies unless given.
    time : float, optional
        When the drivers are looked at for a state, s; 0 unless given. A motion has its instants.

    Returns
    -------
    xarray.Dataset
        SI units, nothing is scaled. Rows are labelled "JOINT.1", "JOINT.2", ..., joints before drivers in the order of
        the mechanism; columns "BODY.x", "BODY.y", "BODY.angle", in space "BODY.x", "BODY.y", "BODY.z", "BODY.wx",
        "BODY.wy", "BODY.wz": the global position of the origin, and the angular velocity along the axes of the body.
        A variable has at ``derivative=k`` its k-th derivative, or what belongs to q^(k); NaN where it has none, as
        `right_side` at 0 where there are multipliers.

        ``residual`` (time, row)
            Phi; angles about axes within half a turn.
        ``jacobian`` (time, row, column)
            Phi_q; in space, by w instead of coordinates of attitude: there is no row of normalisation.
        ``right_side`` (time, derivative, row)
            Phi_q q^(k) for k = 1 to the order of the motion; at a state with n derivatives, to n + 1.
        ``velocities`` (time, derivative, column)
            q^(k) from k = 1 on; in space, r^(k) and w^(k-1).
        ``position`` (time, body, component), and ``angle`` (time, body) or ``attitude`` (time, body, euler_parameter)
            Where the bodies are, m; rad, or Euler parameters from the body to the global frame, the scalar first.
        ``mass_matrix`` (time, column, other_column)
            Where there are masses: M, symmetric, about the origins of the bodies.
        ``multipliers`` (time, derivative, row)
            Where there are masses or applied forces: lambda, lambda', ..., with ``M q'' + Phi_q^T lambda = Q``; Q holds
            forces, global, and moments about the origins, along the axes of the bodies, with the terms of inertia that
            have no q''. Two orders of the motion are used up. They are left out where accelerations are not known, or
            redundant rows leave them open.

    Raises
    ------
    MechanismError
        If a state is given that does not fit the mechanism, or a law has no finite value there.

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
        motion, known = at_state(motion, state, 0.0 if time is None else time)
        order = known + 1
    elif time is not None:
        raise MechanismError("goes with a state; a motion has its instants", name="time", value=time)
    elif isinstance(motion, Motion):
        order = known = motion.order
    else:
        raise MechanismError("must be a jn.Motion, or a jn.Mechanism with a state", name="motion", value=motion)
    labels = _labels(motion)
    numbers = _numbers(motion, order)
    if isinstance(motion, State):
        _check_finite(numbers, labels["row"], float(motion.time[0]))
    found = {
        "residual": (("time", "row"), numbers["residual"]),
        "jacobian": (("time", "row", "column"), numbers["jacobian"]),
        "right_side": (("time", "derivative", "row"), numbers["right_side"], 1),
        "velocities": (("time", "derivative", "column"), _velocities(motion, known), 1),
    }
    found |= _places(motion) | _forces(motion, numbers["jacobian"])
    solved = motion.status == Status.OK
    parts = []
    for name, (dims, values, *first) in found.items():
        coordinates = {dim: labels[dim] for dim in dims if dim != "derivative"}
        if first:
            coordinates["derivative"] = np.arange(first[0], first[0] + values.shape[1])
        values = np.where(solved.reshape(-1, *[1] * (values.ndim - 1)), values, np.nan)
        parts.append(xarray.DataArray(values, coordinates, dims, name))
    dataset = xarray.merge(parts, join="outer", compat="no_conflicts")
    dataset.attrs = {"title": motion.mechanism.title or "equations of a mechanism", "source": "jounce"}
    dataset["time"].attrs = {"units": "s", "long_name": "time"}
    dataset["derivative"].attrs = {"long_name": "order of the time derivative"}
    return dataset


def _labels(motion: Motion) -> dict[str, Any]:
    """Return the labels of all axes, rows in the order of the mechanism."""
    mechanism, found = motion.mechanism, places(motion.model)
    shifts = motion.model.pose_type.shifts
    columns = [f"{body}.{name}" for body in mechanism.bodies for name in COLUMNS[mechanism.space]]
    return {
        "time": motion.time,
        "row": _text(
            f"{name}.{k + 1}" for name in _elements(mechanism) for k in range(_rows(motion.model, found[name]))
        ),
        "column": _text(columns),
        "other_column": _text(columns),
        "body": _text(mechanism.bodies),
        "component": _text("xyz"[:shifts]),
        "euler_parameter": _text(["e0", "e1", "e2", "e3"]),
    }


def _text(names: Any) -> np.ndarray:
    return np.array(list(names), dtype=str)


def _elements(mechanism: Mechanism) -> list[str]:
    return [*mechanism.joints, *mechanism.drivers]


def _rows(model: Model, place: Any) -> int:
    return (place.rows.stop - place.rows.start) // model.system.groups[place.group].instances


def _row_order(motion: Motion) -> np.ndarray:
    """Return which row of the system each row is, in the order of the mechanism."""
    model, found = motion.model, places(motion.model)
    rows = [
        place.rows.start + k * model.system.groups[place.group].instances + place.instance
        for place in (found[name] for name in _elements(motion.mechanism))
        for k in range(_rows(model, place))
    ]
    return np.array(rows, int)


def _numbers(motion: Motion, order: int) -> dict[str, np.ndarray]:
    """Return residual, Jacobian and right sides at all instants, the time first."""
    pose_type, coordinates = motion.poses
    count = pose_type.shifts + pose_type.turns
    system = motion.model.system
    ones = np.ones((system.cells.shape[0], 1)), np.ones(count)
    plain = dataclasses.replace(system, outputs=(), forces=(), row_scale=ones[0], column_scale=ones[1])

    def chunk(lanes: np.ndarray) -> Any:
        bodies = {name: values[..., lanes] for name, values in coordinates.items()}
        still = {name: bodies[name][:1] for name in pose_type.predictor}
        residual, jacobian = _position_equations(plain, still, motion.time[lanes], pose_type)
        if not order:
            return residual, jacobian, np.zeros((0, *residual.shape))
        instants = np.tile(motion.time[lanes], order)
        rights = _right_sides(plain, _without_unknowns(bodies, order), instants, pose_type)
        return residual, jacobian, rights

    residual, jacobian, right_side = in_chunks(chunk, len(motion.time))
    chosen = _row_order(motion)
    return {
        "residual": residual[chosen].T,
        "jacobian": np.moveaxis(jacobian[chosen], -1, 0),
        "right_side": np.moveaxis(right_side[:, chosen], -1, 0) + 0.0,  # no zero is negative
    }


def _without_unknowns(coordinates: dict[str, Any], order: int) -> dict[str, np.ndarray]:
    """Return coordinates once for each order from 1 on, one after the other, with those of that order set to zero."""
    found = {}
    for name, values in coordinates.items():
        first = name == "angular_velocity"  # its coefficients are those of rates
        whole = np.zeros((order + 1 - first, *values.shape[1:-1], order, values.shape[-1]))
        known = np.asarray(values)[: len(whole)]
        whole[: len(known)] = known[..., None, :]
        if name != "quaternion":  # the attitude follows from where it is and from how it turns
            for k in range(1, order + 1):
                whole[k - first, ..., k - 1, :] = 0.0
        found[name] = whole.reshape(*whole.shape[:-2], -1)
    return found


@compiled("pose_type")
def _position_equations(system: System, bodies: dict[str, Any], instants: Any, pose_type: Any) -> tuple[Any, Any]:
    """Return the residual, (rows, batch), and the Jacobian, (rows, columns, batch)."""
    pose, time = pose_of(bodies, pose_type, 0), Jet([instants[None]])
    return system.residual(pose, time).coefficients[0], system.jacobian(pose, time)


@compiled("pose_type")
def _right_sides(system: System, bodies: dict[str, Any], instants: Any, pose_type: Any) -> Any:
    """Return the right sides, (order, rows, batch), from the states of `_without_unknowns`.

    The coefficient of order k of the residual is affine in that of the coordinates, with the Jacobian as its slope:
    what it is where that is zero is minus the right side, up to k!.
    """
    order = len(bodies["position"]) - 1
    residual = system.residual(pose_of(bodies, pose_type, order), Jet.variable(instants[None], order)).dense()
    parts = [c.reshape(len(c), order, c.shape[-1] // order)[:, k] for k, c in enumerate(residual.coefficients[1:])]
    factorials = np.array([math.factorial(k + 1) for k in range(order)], float)
    return -factorials[:, None, None] * jnp.stack(parts)


def _unknowns(coordinates: dict[str, Any], k: int) -> tuple[Any, Any]:
    """Return the k-th coefficients that `extended` takes: of positions, and of angles or w'[k-1] / k."""
    if "angle" in coordinates:
        return coordinates["position"][k], coordinates["angle"][k][None]
    return coordinates["position"][k], coordinates["angular_velocity"][k - 1] / k


def _velocities(motion: Motion, order: int) -> np.ndarray:
    """Return the derivatives of the coordinates, (time, order, columns), from the first on."""
    _, coordinates = motion.poses
    found = [np.zeros((0, _columns(motion), len(motion.time)))]
    for k in range(1, order + 1):
        parts = np.concatenate(list(map(np.asarray, _unknowns(coordinates, k))))[:, 1:]
        found.append(math.factorial(k) * np.swapaxes(parts, 0, 1).reshape(1, -1, parts.shape[-1]))
    return np.moveaxis(np.concatenate(found), -1, 0)


def _columns(motion: Motion) -> int:
    return len(motion.mechanism.bodies) * len(COLUMNS[motion.mechanism.space])


def _places(motion: Motion) -> dict[str, Any]:
    """Return where the bodies are at all instants."""
    pose_type, coordinates = motion.poses
    first = {name: np.moveaxis(np.asarray(coordinates[name][0])[..., 1:, :], -1, 0) for name in pose_type.predictor}
    found = {"position": (("time", "body", "component"), np.swapaxes(first["position"], 1, 2))}
    if "angle" in first:
        return found | {"angle": (("time", "body"), first["angle"])}
    return found | {"attitude": (("time", "body", "euler_parameter"), np.swapaxes(first["quaternion"], 1, 2))}


def _forces(motion: Motion, jacobian: np.ndarray) -> dict[str, Any]:
    """Return the mass matrix and the multipliers, where there are some."""
    mechanism, found = motion.mechanism, {}
    if any(body.mass is not None for body in mechanism.bodies.values()):
        found["mass_matrix"] = (("time", "column", "other_column"), _mass_matrix(motion))
    elif not mechanism.forces:
        return found
    _, coordinates = motion.poses
    levels = min(len(coordinates["position"]) - 2, motion.order + 1)
    mass = found["mass_matrix"][1] if found else np.zeros((1, _columns(motion), _columns(motion)))
    if levels < 1 or not jacobian.size or (isinstance(motion, State) and not _determined(motion, jacobian[0], mass[0])):
        return found
    coefficients = MotionForces.of(motion).multipliers[:levels][:, _row_order(motion)]
    factorials = np.array([math.factorial(k) for k in range(levels)], float)
    values = np.moveaxis(coefficients * factorials[:, None, None], -1, 0)
    return found | {"multipliers": (("time", "derivative", "row"), values, 0)}


def _determined(motion: Motion, jacobian: np.ndarray, mass: np.ndarray) -> bool:
    """Tell whether the multipliers are determined at a state: those of a motion are, a state may be anything."""
    scale = np.tile(motion.model.system.column_scale, len(motion.mechanism.bodies))
    sizes = np.max(np.abs(jacobian * scale), axis=1, keepdims=True)
    whole = jacobian * scale / np.where(sizes > 0, sizes, 1.0)
    if len(whole) != whole.shape[1]:
        mass = mass * scale[:, None] * scale
        mass = mass / (np.max(np.abs(mass)) or 1.0)
        whole = np.block([[mass, whole.T], [whole, np.zeros((len(whole), len(whole)))]])
    return split(whole)[1] == len(whole)


def _mass_matrix(motion: Motion) -> np.ndarray:
    """Return the mass matrix at all instants, (time, columns, columns)."""
    pose_type, coordinates = motion.poses
    masses = masses_of(motion.mechanism)

    def chunk(lanes: np.ndarray) -> Any:
        bodies = {name: values[:1][..., lanes] for name, values in coordinates.items() if name in pose_type.predictor}
        return _body_masses(bodies, masses, pose_type)

    blocks = np.moveaxis(in_chunks(chunk, len(motion.time)), (3, 2), (0, 1))[:, 1:]
    count, columns = len(motion.mechanism.bodies), _columns(motion)
    return np.einsum("ab,tacd->tacbd", np.eye(count), blocks).reshape(len(motion.time), columns, columns)


@compiled("pose_type")
def _body_masses(bodies: dict[str, Any], masses: Any, pose_type: Any) -> Any:
    return mass_matrices(pose_of(bodies, pose_type, 0), *masses)


def _check_finite(numbers: dict[str, np.ndarray], rows: np.ndarray, instant: float) -> None:
    """Raise MechanismError for a state at which a row is not a finite number."""
    for name, values in numbers.items() if len(rows) else ():
        bad = ~np.isfinite(np.moveaxis(values[0], -1 if name == "right_side" else 0, 0).reshape(len(rows), -1))
        if bad.any():
            row, k = np.argwhere(bad)[0]
            what = f"its derivative {k + 1}" if name == "right_side" else f"its {name}"
            message = f"{what} has no finite value at t = {instant:g} s; check its law, and its points, there"
            raise MechanismError(message, name=str(rows[row]).rpartition(".")[0])
