"""The power balance of a moving mechanism: a check of all its forces without a second solver."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.dynamics.forward.accelerations import Lanes
from jounce.dynamics.inverse.finite_forces import check_finite_values
from jounce.dynamics.inverse.motion_forces import MotionForces
from jounce.dynamics.masses import Gravity, Masses
from jounce.dynamics.motion_values import Coordinates, check_motion, labeled, pose_of
from jounce.execution.mapped import Mapped
from jounce.jet import Jet, dot
from jounce.jet.algebra import stacked, total
from jounce.kinematics import Motion
from jounce.mechanism.system import Group
from jounce.mechanism.transmissions.axis_angles import of_one_lane, with_turns
from jounce.rigid import PlanarPose
from jounce.rigid.pose import Pose

if TYPE_CHECKING:
    import xarray

FAINT = 1e-3  # share of the turning speeds in the scale: the rounding of vanishing coefficients is below 1e-12 of it


def power_balance(motion: Motion) -> "xarray.Dataset":
    """Return the power balance of a moving mechanism, with rates: a check of all its forces.

    The power of drivers and applied forces equals the rates of kinetic and potential energy plus the power that
    friction dissipates; joints do no other work. The two sides are computed independently, from multipliers and from
    energies.

    Parameters
    ----------
    motion : Motion
        Motion of a mechanism with masses or applied forces.

    Returns
    -------
    xarray.Dataset
        Dimensions time and derivative, in W, W/s, ...: ``drivers`` and ``forces``, their power; ``friction``, the
        power of joint friction, which is negative; ``kinetic`` and ``potential``, the rates of the energies;
        ``residual``, the first three less the other two, which is rounding; and ``scale``, the sum of the absolute
        values of all products in the balance, with which to compare the residual at each instant and order. The scale
        stays meaningful where the products cancel, as in the rates of a power that grows linearly.

    Raises
    ------
    MechanismError
        If no body has a mass and no force is applied, the motion has no accelerations, or the masses are not valid.

    Examples
    --------
    >>> import jounce as jn
    >>> wheel = jn.Mechanism(
    ...     space="planar",
    ...     bodies={"wheel": jn.Body([0, 0], mass=2.0, inertia=0.5)},
    ...     joints={"O": jn.planar.Revolute(("ground", "wheel"), [0, 0], [0, 0])},
    ...     drivers={"turn": jn.drivers.CoordinateDriver(("ground", "wheel"), "angle", motion="t**2")},
    ... )
    >>> balance = jn.energy.power_balance(jn.solve(wheel, [0.0, 3.0], order=4))
    >>> balance["drivers"].sel(derivative=0).values.tolist()  # 1 N m at 0 and 6 rad/s
    [0.0, 6.0]
    >>> bool((abs(balance["residual"]) <= 1e-12 * balance["scale"]).all())
    True
    """
    check_motion(motion)
    import xarray

    forces = MotionForces.of(motion)
    nothing = np.zeros((forces.levels, len(motion.time)))
    driver_powers = [(nothing, nothing), *(_driver_power(forces, name) for name in motion.mechanism.drivers)]
    shared = of_one_lane(forces.motion.forces), forces.masses, forces.gravity, forces.model.length
    applied, kinetic, potential, sizes = forces.along(_powers, shared, forces.acting, levels=forces.levels)
    check_finite_values(forces, applied)
    power, size = np.sum(driver_powers, axis=0)
    friction_power, friction_size = np.sum([(nothing, nothing), *_friction_powers(forces)], axis=0)
    size = size + friction_size
    terms = {"drivers": power, "forces": applied.sum(axis=1), "friction": friction_power}
    terms |= {"kinetic": kinetic.sum(axis=1), "potential": potential.sum(axis=1)}
    labeled_terms = {name: labeled(motion, term[: motion.order + 1], "W") for name, term in terms.items()}
    supplied, gained = (
        sum(labeled_terms[name] for name in names)
        for names in (("drivers", "forces", "friction"), ("kinetic", "potential"))
    )
    residual: Any = supplied - gained
    labeled_terms["residual"] = residual.assign_attrs(units="W")
    labeled_terms["scale"] = labeled(motion, (size + sizes.sum(axis=1))[: motion.order + 1], "W")
    return xarray.Dataset(labeled_terms)


def _friction_powers(forces: MotionForces) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the power of each joint with friction and the size of its products, (levels, time)."""
    for name in forces.friction.names:
        place = forces.indices[name]
        of_group = forces.friction.resisted(place.group)
        factor, normal = Jet(tuple(of_group[:, place.instance])), Jet(tuple(forces.friction.normal_force(name)[:, 0]))
        size = factor.map(np.abs) * normal.map(np.abs)
        yield np.stack((factor * normal).dense().coefficients) * -1.0, np.stack(size.dense().coefficients)


def _driver_power(forces: MotionForces, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the power of a driver and the size of its products, as Taylor coefficients, (levels, time)."""
    index = forces.indices[name]
    group = forces.model.system.groups[index.group]
    motion = forces.motion
    laws = _law.along(group.element, motion.time, levels=forces.levels)
    law = np.broadcast_to(laws, (len(laws), group.instances, laws.shape[-1]))[:, index.instance]  # equal: stored once
    rate, force = Jet(tuple(law)).differentiate(), Jet(tuple(forces.driver_force(name)[:, 0]))
    power, size = force * rate, force.map(np.abs) * rate.map(np.abs)
    return np.stack(power.dense().coefficients), np.stack(size.dense().coefficients)


@Mapped
def _law(driver: Any, instants: Lanes, *, levels: int) -> Float[Numbers, "_ instance batch"]:
    law = stacked(driver.motion(Jet.variable(instants[None], levels)))
    return law.reshape(levels + 1, -1, len(instants))


@Mapped
def _powers(
    shared: tuple[tuple[Group, ...], Masses, Gravity, float | Float[Numbers, ""]],
    lanes: tuple[Coordinates, Sequence[Any], Lanes],
    *,
    pose_type: type[Pose],
    levels: int,
) -> tuple[Float[Numbers, "{levels} _ batch"], ...]:
    """Return the power of each force, the rates of both energies of each body, and the sizes of all their products."""
    (groups, masses, gravity, length), (bodies, angles, instants) = shared, lanes
    groups = with_turns(groups, angles)
    order = levels + 1  # energies have one less, and their rates one less again
    pose, time = pose_of(bodies, pose_type, order), Jet.variable(instants[None], order)
    mass, center, moments = masses
    velocity, spin, tensor = pose.point(center).differentiate(), _spin(pose), _inertia(moments, pose.turns)
    axes = [axis.dense() for axis in (pose.axes if pose.turns == 3 else (pose.sine[None], pose.cosine[None]))]
    turn_rate = _largest(axes).differentiate()
    speed = _largest([pose.position.differentiate()]) + turn_rate * (jnp.max(jnp.abs(center), axis=0) + FAINT * length)
    momentum = [total(tensor[i][k] * spin[k] for k in range(pose.turns)) for i in range(pose.turns)]
    kinetic = dot(velocity, velocity) * (0.5 * mass) + total(a * b for a, b in zip(spin, momentum, strict=True)) * 0.5
    turns = _largest([w[None] for w in spin]) + turn_rate * FAINT
    sizes = speed * speed * mass + turns * turns * jnp.max(jnp.sum(jnp.abs(tensor), axis=1), axis=0)
    sizes = sizes.differentiate() + (speed * mass * jnp.sum(jnp.abs(gravity))).truncate(levels - 1)
    potential = (dot(velocity, gravity) * -mass).truncate(levels - 1)
    applied = [_applied(group, pose, time, turn_rate.map(lambda c: jnp.max(c, axis=0)), length) for group in groups]
    nothing = jnp.zeros((levels, 0, len(instants)))
    powers, products = (
        jnp.concatenate([*(stacked(pair[k].truncate(levels - 1)) for pair in applied), nothing], axis=1) for k in (0, 1)
    )
    products = jnp.concatenate([products, stacked(sizes)], axis=1)
    return powers, stacked(kinetic.differentiate()), stacked(potential), products


def _spin(pose: Pose) -> tuple[Jet, ...]:
    """Return the components of the angular velocities of bodies in body axes."""
    if isinstance(pose, PlanarPose):
        return (pose.angle.differentiate(),)
    assert pose.angular_velocity is not None  # there are accelerations
    return tuple(pose.angular_velocity)


def _inertia(
    moments: Float[Numbers, "component component body 1"], turns: int
) -> Float[Numbers, "{turns} {turns} body 1"]:
    """Return the tensors of inertia about the centers of mass from the second moments."""
    spread = total(moments[k][k] for k in range(len(moments)))
    if turns == 1:
        return spread[None, None]
    return spread[None, None] * jnp.eye(3)[:, :, None, None] - moments


def _applied(group: Group, pose: Pose, time: Jet, turning: Jet, length: float | Float[Numbers, ""]) -> tuple[Jet, Jet]:
    """Return the power of forces, (instances, batch), and the size of its products."""
    lever = length if group.element.unit == "N" else 1.0
    rates = group.velocity(pose, time).map(jnp.abs) + turning * (FAINT * lever)
    return group.power(pose, time), group.force(pose, time).map(jnp.abs).dot(rates)


def _largest(jets: Sequence[Jet]) -> Jet:
    """Return the largest component of vectors, coefficient by coefficient, (bodies, batch)."""
    levels = zip(*(jet.dense().coefficients for jet in jets), strict=True)
    return Jet(tuple(jnp.max(jnp.abs(jnp.concatenate(level)), axis=0) for level in levels))
