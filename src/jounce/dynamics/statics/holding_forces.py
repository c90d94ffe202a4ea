"""The driver force that holds a mechanism at rest; with friction, a range of forces."""

import copy
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.constraints.spin_hold import SpinHold
from jounce.dynamics.friction.coupling import loses_torque
from jounce.dynamics.friction.extreme_friction import ExtremeFriction
from jounce.dynamics.inverse.joint_friction import JointFriction
from jounce.dynamics.inverse.motion_forces import MotionForces
from jounce.dynamics.inverse.tooth_flanks import listed
from jounce.dynamics.motion_values import check_motion
from jounce.dynamics.statics.variations import at_rest
from jounce.errors import MechanismError, UnsupportedError
from jounce.kinematics import Motion, Status
from jounce.mechanism.laws.driver_outputs import is_turning
from jounce.units.shown_units import time_axes

if TYPE_CHECKING:
    import xarray

SMALLEST = 1e-12  # determinant: friction locks if it is smaller
BOUNDS = ("least", "frictionless", "greatest")
PROVEN = np.empty(0, int)  # no instants with an unproven range


def holding_forces(motion: Motion) -> "xarray.Dataset":
    """Return the range of each driver force in which a mechanism stays at rest, in the positions of a motion.

    The mechanism is at rest in each position, under weight and the applied forces of that instant at zero velocity. The
    static friction of each joint lies anywhere in its cone, ``|f| <= mu |R|``, and the torque loss of gears anywhere
    between their backward and forward losses. The bounds of the driver force are optimal over all joints together. If
    zero is within the range, the mechanism is self-locking: it stays at rest without the driver. A force outside the
    range moves it.

    Each of several drivers has its own range, for any forces of the others. The bounds are mostly the driver forces of
    slow motions in both directions, but not if a joint hardly slips in these motions.

    Parameters
    ----------
    motion : Motion
        Motion from `solve` or `Equilibrium.motion` of a fully driven mechanism with masses or applied forces.

    Returns
    -------
    xarray.Dataset
        One variable for each driver, N m if its law is an angle, otherwise N; dimensions time and bound: ``least``,
        ``frictionless`` and ``greatest``. Infinite where friction locks, so that no force moves the mechanism in that
        direction. NaN at instants that were not solved, and where the range is not known, with the reason as the
        attribute ``comment``.

    Raises
    ------
    MechanismError
        If the mechanism has neither masses nor applied forces, or no driver.
    UnsupportedError
        If joints have friction and a motion is free, constraints are redundant, or teeth have a pressure angle.

    Examples
    --------
    >>> import jounce as jn
    >>> guide = jn.joints.Friction(coefficient=0.5, speed=1e-3)
    >>> sled = jn.Mechanism(
    ...     space="planar",
    ...     gravity=[0, -10.0],
    ...     bodies={"sled": jn.Body([0, 0], mass=5.0)},
    ...     joints={"G": jn.planar.Prismatic(("ground", "sled"), [0, 0], [0, 0], [4, 3], [1, 0], friction=guide)},
    ...     drivers={"push": jn.drivers.SlideDriver(("ground", "sled"), [0, 0], [0, 0], [4, 3], "0*t")},
    ... )
    >>> found = jn.dynamics.holding_forces(jn.solve(sled, [0.0], order=0))  # on a slope of 3 in 4: 30 N and 0.5 * 40 N
    >>> found["push"].values.round(9).tolist()
    [[10.0, 30.0, 50.0]]
    """
    import xarray

    check_motion(motion)
    mechanism = motion.mechanism
    if motion.traced:
        raise UnsupportedError("holding forces have kinks: they are not differentiated by JAX", name="motion")
    if not mechanism.drivers:
        raise MechanismError("holding forces are those of drivers, and there are none", name="drivers")
    forces = MotionForces.of(_at_rest(motion))
    joints = forces.friction.names
    if joints:
        _check_determined(forces, f"joints.{joints[0]}.friction")
    ideal = {name: forces.driver_force(name)[0, 0] for name in mechanism.drivers}
    ranges = _ranges(forces, ideal) if joints else {name: ([x, x, x], PROVEN) for name, x in ideal.items()}
    is_unsolved = motion.status != Status.OK
    variables = {}
    for name, (bounds, unproven) in ranges.items():
        values = np.where(is_unsolved, np.nan, np.asarray(bounds, float)).T
        attributes = {"units": "N*m" if is_turning(mechanism.drivers[name]) else "N"}
        solved = np.flatnonzero(~is_unsolved)
        if comment := _comment(motion.time, values, np.intersect1d(unproven, solved), solved):
            attributes["comment"] = comment
        variables[name] = (("time", "bound"), values, attributes)
    time = time_axes(motion.time, 1)["time"]
    title = {"title": mechanism.title} if mechanism.title else {}
    return xarray.Dataset(variables, {"time": time, "bound": list(BOUNDS)}, title)


def _comment(time: np.ndarray, values: np.ndarray, unproven: np.ndarray, solved: np.ndarray) -> str:
    """Return a text on the instants at which a range is infinite or not known; empty if there are none."""
    is_unknown = np.isnan(values[unproven]).any(axis=1)
    cases = {
        "friction locks, no force moves it one way": np.flatnonzero(np.isinf(values).any(axis=1)),
        "forces are not determined": solved[np.isnan(values[solved, 1])],
        "not determined, as friction locks for some of its signs": unproven[is_unknown],
        "the widest that a search found, which does not prove that there is none wider": unproven[~is_unknown],
    }
    return "; ".join(f"{phrase}, at t = {listed(time[lanes])}" for phrase, lanes in cases.items() if len(lanes))


def _at_rest(motion: Motion) -> Motion:
    """Return a motion at rest in all positions of another motion."""
    rest_pose = at_rest({name: values[0] for name, values in motion.poses[1].items() if name != "angular_velocity"})
    nothing = tuple(() for _ in motion.model.outputs)
    return Motion(
        motion.mechanism, motion.model, motion.time, 2, (rest_pose, nothing), motion.status, motion.faults,
        motion.passages, motion.history, motion.backend,
    )  # fmt: skip


def _check_determined(forces: MotionForces, name: str) -> None:
    """Raise UnsupportedError, with the name of a friction, if friction alone does not determine holding forces."""
    model, reasons = forces.model, []
    if forces.joined.shape[0] != forces.joined.shape[1]:
        reasons.append("drivers do not hold all that can move: drive it, and look whether zero is within the range")
    groups = forces.joined.groups
    if forces.flanks and not all(loses_torque(groups[k].element) for k in forces.friction.first_rows):
        reasons.append(
            "teeth press on either flank, which loads joints with friction: give gears without pressure_angle"
        )
    spinning = [group.element.bodies[0] for group in model.system.groups if isinstance(group.element, SpinHold)]
    if spinning:
        reasons.append(
            f"nothing prescribes the spin of {' and '.join(spinning)}: put a universal joint in the place of a "
            "spherical one"
        )
    if reasons:
        raise UnsupportedError(
            f"the range of holding forces cannot be computed where {'; and '.join(reasons)}", name=name
        )


def _ranges(forces: MotionForces, ideal_forces: dict[str, Numbers]) -> dict[str, Any]:
    """Return the bounds of each driver force, and the instants at which they are not proven."""
    friction = forces.friction
    middle, responses = _about_the_middle(forces.friction, np.asarray(forces.multipliers[0]))
    changes = np.array([friction.pressing(response) for response in responses])
    extreme = ExtremeFriction(friction.pressing(middle), changes, friction.directions(), friction.coefficients)
    columns = [_with_multipliers(forces, response) for response in responses]
    ranges = {}
    for name, ideal in ideal_forces.items():
        center = np.asarray(_with_multipliers(forces, middle).driver_force(name)[0, 0])
        contributions = -np.array([balance.driver_force(name)[0, 0] for balance in columns])
        (rise, rise_proven), (fall, fall_proven) = extreme.most(contributions), extreme.most(-contributions)
        ranges[name] = [center - fall, ideal, center + rise], np.flatnonzero(~(rise_proven & fall_proven))
    return ranges


def _about_the_middle(
    friction: JointFriction, ideal: Float[np.ndarray, "row time"]
) -> tuple[Float[np.ndarray, "row time"], Float[np.ndarray, "direction row time"]]:
    """Return multipliers with all friction in the middle of its range, and their decrease for unit friction.

    The middle is zero; for gears it is a share d of the transmitted torque T, half the difference of forward and
    backward losses. So ``T = (1 + R d)^-1 (T_0 - R f)`` with the frictionless torque T_0, the response R of the torques
    to losses, and the further loss f.
    """
    responses, differences = friction.responses(), friction.differences
    if not differences.any():
        return ideal, responses
    joints = np.array(friction.directions())
    gears = np.flatnonzero(differences[joints])  # each slips in one direction
    slopes = differences[joints[gears]]
    torques = np.array([friction.pressing(x)[joints[gears], 0].T for x in (ideal, *responses)])  # (.., time, gear)
    matrix = np.einsum("gtk,g->tkg", torques[1 + gears], slopes) + np.eye(len(gears))
    regular = np.abs(np.linalg.det(matrix)) > SMALLEST
    matrix = np.where(regular[:, None, None], matrix, np.nan)
    losses = np.linalg.solve(matrix, torques[..., None])[..., 0].swapaxes(1, 2) * slopes[:, None]
    middle = ideal - np.einsum("et,ert->rt", losses[0], responses[gears])
    return middle, responses - np.einsum("det,ert->drt", losses[1:], responses[gears])


def _with_multipliers(forces: MotionForces, multipliers: Numbers) -> MotionForces:
    """Return the forces in a mechanism at rest for given multipliers, (rows, time)."""
    twin = copy.copy(forces)
    twin._numbers = {}
    twin.__dict__["multipliers"] = multipliers[None]
    return twin
