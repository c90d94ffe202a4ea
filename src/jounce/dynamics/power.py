"""The power balance of a mechanism in motion: a check of all forces that needs no second solver."""

import math
from typing import Any

import jax.numpy as jnp
import numpy as np

from jounce.dynamics.energies import body_energy
from jounce.dynamics.inverse import MotionForces, pose_of
from jounce.jet import Jet, dot
from jounce.kinematics import Motion, Status
from jounce.kinematics.compilation import compiled
from jounce.robot.scan import stacked


def power_balance(motion: Motion) -> Any:
    """Return where the power in a moving mechanism comes from and goes to, with rates: a check of all its forces.

    What drivers and applied forces put in is what the kinetic energy of the bodies, and their potential energy in
    gravity, gain; the joints do no work. Both sides are computed apart: one from multipliers, one from energies.

    Parameters
    ----------
    motion : Motion
        Of a mechanism with masses or applied forces.

    Returns
    -------
    xarray.Dataset
        With dimensions time and derivative, in W, W/s, ...: ``drivers`` and ``forces``, the power that they put in;
        ``kinetic`` and ``potential``, the rates of the energies; ``residual``, the first two less the others, which is
        rounding; and ``scale``, the largest power of any one driver, force or body, by which to judge it.

    Raises
    ------
    MechanismError
        If nothing has a mass and no force is applied, the motion has no accelerations, or the masses are not valid.

    Examples
    --------
    >>> import jounce as jn
    >>> wheel = jn.Mechanism(
    ...     space="planar",
    ...     bodies={"wheel": jn.Body([0, 0], mass=2.0, inertia=0.5)},
    ...     joints={"O": jn.planar.Revolute(("ground", "wheel"), [0, 0], [0, 0])},
    ...     drivers={"turn": jn.drivers.CoordinateDriver(("ground", "wheel"), "angle", motion="t**2")},
    ... )
    >>> balance = jn.power_balance(jn.solve(wheel, [0.0, 3.0], order=4))
    >>> balance["drivers"].sel(derivative=0).values.tolist()  # 1 N m at 0 and 6 rad/s
    [0.0, 6.0]
    >>> bool((abs(balance["residual"]) <= 1e-12 * balance["scale"]).all())
    True
    """
    import xarray

    forces = MotionForces.of(motion)
    driven = [_driver_power(forces, name) for name in motion.mechanism.drivers]
    rest = forces.in_chunks(lambda lanes: _powers(*_of_chunk(forces, lanes), forces.pose_type, forces.levels))
    applied, kinetic, potential = (np.asarray(part) for part in rest)
    factorials = np.array([math.factorial(k) for k in range(forces.levels)], float)[:, None]
    bad = (motion.status != Status.OK)[:, None]

    def derivatives(parts: Any) -> np.ndarray:
        values = np.asarray(parts).reshape(-1, forces.levels, len(motion.time)) * factorials
        return np.where(bad, np.nan, np.swapaxes(values, 1, 2))[..., : motion.order + 1]

    terms = {
        "drivers": derivatives(driven),
        "forces": derivatives(np.moveaxis(applied, 1, 0)),
        "kinetic": derivatives(np.moveaxis(kinetic, 1, 0)),
        "potential": derivatives(np.moveaxis(potential, 1, 0)),
    }
    found = {name: part.sum(axis=0) for name, part in terms.items()}
    found["residual"] = found["drivers"] + found["forces"] - found["kinetic"] - found["potential"]
    found["scale"] = np.max(np.abs(np.concatenate(list(terms.values()))), axis=0)
    axes = {"time": motion.time, "derivative": np.arange(found["scale"].shape[1])}
    variables = {name: (("time", "derivative"), values, {"units": "W"}) for name, values in found.items()}
    return xarray.Dataset(variables, coords=axes)


def _driver_power(forces: MotionForces, name: str) -> np.ndarray:
    """Return the power of a driver, as Taylor coefficients, (levels, time)."""
    place = forces.places[name]
    element = forces.model.system.groups[place.group].element
    law = forces.in_chunks(lambda lanes: _law(element, forces.motion.time[lanes], forces.levels))[:, place.instance]
    rate, force = Jet(tuple(law)).differentiate(), Jet(tuple(forces.driver_force(name)[:, 0]))
    return np.stack((force * rate).dense().coefficients)


@compiled("levels")
def _law(driver: Any, instants: Any, levels: int) -> Any:
    law = stacked(driver.motion(Jet.variable(instants[None], levels)))
    return law.reshape(levels + 1, -1, len(instants))


def _of_chunk(forces: MotionForces, lanes: np.ndarray) -> tuple[Any, ...]:
    bodies = forces.taken(None, lanes, forces.levels + 2)
    return forces.model.system.forces, bodies, forces.motion.time[lanes], forces.masses, forces.gravity


@compiled("pose_type", "levels")
def _powers(groups: Any, bodies: Any, instants: Any, masses: Any, gravity: Any, pose_type: Any, levels: int) -> Any:
    """Return the power of each force, and the rates of kinetic and potential energy of each body."""
    order = levels + 1  # energies have one less, and their rates one less again
    pose, time = pose_of(bodies, pose_type, order), Jet.variable(instants[None], order)
    applied = [stacked(group.power(pose, time).truncate(levels - 1)) for group in groups]
    mass, center, moments = masses
    translation, rotation = body_energy(pose, mass, center, moments, 0)
    height = dot(pose.point(center), gravity)
    potential = (height.differentiate() * -mass).truncate(levels - 1)
    kinetic = (translation + rotation).differentiate()
    nothing = jnp.zeros((levels, 0, len(instants)))
    return jnp.concatenate([*applied, nothing], axis=1), stacked(kinetic), stacked(potential)
