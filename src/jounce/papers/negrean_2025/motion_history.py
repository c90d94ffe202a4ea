"""Results of the library for a motion of the arm, beside the closed forms of the paper."""

import dataclasses

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.dynamics import acceleration_energy, gravity_forces, higher_order
from jounce.jet import Jet
from jounce.papers.negrean_2025 import closed_forms
from jounce.papers.negrean_2025.case import Case
from jounce.robot import inverse_dynamics

ORDER = 6  # highest derivative of the angle, as equation 131 with m = 4 needs
STEPS = 20  # instants in each segment
Table = Float[np.ndarray, "time 3"]


@dataclasses.dataclass(frozen=True)
class History:
    """A motion of the arm over time.

    Attributes
    ----------
    case : Case
        The motion.
    time : array of shape (time,)
        Instants, s.
    motion : array of shape (time, 7)
        Angle and its derivatives, rad by s.
    energies, closed_energies : array of shape (time, 3)
        Acceleration energies of orders 1 to 3, by the library and by equations 141-143, kg m^2 / s^(2 p + 2).
    torques, closed_torques, equation_torques : array of shape (time, 3)
        Torque and its two rates: by the library (Newton-Euler), by equations 144-146, and by the higher-order
        equations 129-131 with the share of gravity, N m by s.
    gravity : array of shape (time, 3)
        Share of gravity in the torques, N m by s.
    """

    case: Case
    time: Float[np.ndarray, " time"]
    motion: Float[np.ndarray, "time 7"]
    energies: Table
    closed_energies: Table
    torques: Table
    closed_torques: Table
    equation_torques: Table
    gravity: Table


def history(case: Case) -> History:
    """Return the history of a motion, at 20 instants in each segment and at the end.

    Parameters
    ----------
    case : Case
        The motion.

    Returns
    -------
    History
        The history. At a knot, derivatives above the fourth are those of the segment that begins at the knot.
    """
    link, knots = case.link, case.knots
    robot, inertia = link.robot(), link.inertia_about_axis
    time = np.interp(np.arange(STEPS * (len(knots) - 1) + 1) / STEPS, np.arange(len(knots)), knots)
    motion = np.asarray(case.motion(Jet.variable(jnp.asarray(time), ORDER)).derivatives()).T
    q = motion[:, :, None]
    energies = [acceleration_energy(robot, q[:, : p + 2], order=p).total[..., 0] for p in (1, 2, 3)]
    gravity_torques = np.asarray(gravity_forces(robot, q, rates=2))[..., 0]
    inertial = [np.asarray(higher_order(robot, q, k))[..., 0] for k in (1, 2, 3)]
    weight = -float(robot.gravity[2])
    closed_gravity = closed_forms.gravity_torques(link.mass, (link.center_x, link.center_z), weight, motion)
    return History(
        case,
        time,
        motion,
        np.stack([np.asarray(energy) for energy in energies], axis=-1),
        closed_forms.energies(inertia, motion),
        np.asarray(inverse_dynamics(robot, q[:, :5]))[..., 0],
        closed_forms.torques(inertia, motion, closed_gravity),
        np.stack(inertial, axis=-1) + gravity_torques,
        closed_gravity,
    )


def difference(
    computed: Float[np.ndarray, "time column"], expected: Float[np.ndarray, "time column"]
) -> Float[np.ndarray, " column"]:
    """Return the largest differences over time, divided by the largest values, one for each column."""
    return np.max(np.abs(computed - expected), axis=0) / np.max(np.abs(expected), axis=0)
