"""Compiled programs of inverse dynamics.

Residuals are compiled for each type of joint, on the poses of the bodies that it connects, so that all mechanisms share
these programs.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.modules import with_fields
from jounce.base.shapes import Numbers
from jounce.constraints.friction import pressing_force, slip_velocity
from jounce.dynamics.forward.accelerations import Lanes
from jounce.dynamics.forward.loads import loads, mass_matrices
from jounce.dynamics.friction import coupling
from jounce.dynamics.friction.coupling import friction_slope, loses_torque, rubs
from jounce.dynamics.inverse import constraint_forces, redundant_forces
from jounce.dynamics.inverse.constraint_forces import Multipliers, Slope, Slopes
from jounce.dynamics.inverse.friction_of_motion import Rubbed, rubbing_of, with_friction
from jounce.dynamics.inverse.tooth_flanks import with_flanks
from jounce.dynamics.masses import Gravity, Masses
from jounce.dynamics.motion_values import Coordinates, in_small_chunks, part_of, pose_of
from jounce.execution.compilation import compiled
from jounce.execution.mapped import Mapped, OnLlvm
from jounce.execution.store.programs import is_in_haste
from jounce.jet import Jet, cross
from jounce.jet.algebra import stacked, total
from jounce.kinematics.sensitivity.jacobian_series import along_displacements, slopes
from jounce.linear_algebra.pattern import Pattern
from jounce.mechanism.system import Group, System, movable, with_rows
from jounce.mechanism.transmissions.axis_angles import with_turns
from jounce.rigid.pose import Pose

LARGE = 16  # largest size of an array that is kept in memory by the machine code of an instant
SMALL_CHUNK = 16  # number of instants whose dense matrices are factored together


@compiled("pose_type", "slot", "levels", brief=True)
def element_slopes(
    element: Any, poses: Sequence[Coordinates], instants: Lanes, pose_type: type[Pose], slot: int, levels: int
) -> Any:
    """Return the derivative of the residual of a joint or driver by the body in a slot, as `slopes` does."""
    time = Jet.variable(instants[None], levels - 1)
    return slopes(element, [pose_of(pose, pose_type, levels - 1) for pose in poses], time, slot)


@compiled("pose_type", "slot", "levels", brief=True)
def friction_slopes(element: Any, poses: Sequence[Coordinates], pose_type: type[Pose], slot: int, levels: int) -> Any:
    """Return the wrench of friction on the body in a slot for a unit normal force, as `friction_slope` does."""
    return friction_slope(element, [pose_of(pose, pose_type, levels) for pose in poses], slot)


def slip_directions(element: Any, poses: Sequence[Coordinates], pose_type: type[Pose]) -> int:
    """Return the number of directions in which the surfaces of joints slip."""

    def slip(poses: Sequence[Coordinates]) -> Any:
        return slip_velocity(element, [pose_of(pose, pose_type, 1) for pose in poses]).coefficients[0]

    return jax.eval_shape(slip, poses).shape[0]


@compiled("pose_type", "levels", brief=True)
def resisting(element: Any, poses: Sequence[Coordinates], pose_type: type[Pose], levels: int) -> Any:
    """Return the fraction of the normal force that resists slip, (levels, directions, joints, time)."""
    return stacked(coupling.resisting(element, [pose_of(pose, pose_type, levels) for pose in poses]))


@compiled("pose_type", "levels", brief=True)
def resisted(element: Any, poses: Sequence[Coordinates], pose_type: type[Pose], levels: int) -> Any:
    """Return the friction power for a unit normal force, as Taylor coefficients, (levels, joints, time)."""
    slip = slip_velocity(element, [pose_of(pose, pose_type, levels) for pose in poses])
    return stacked(element.friction.resisting(slip).dot(slip))


@compiled(brief=True)
def responses(system: System, blocks: Slopes, loads: Float[Numbers, "load coordinate body batch"]) -> Any:
    """Return the multipliers that balance each of several loads, (loads, rows, time), in a fully driven system."""

    def of_chunk(blocks: Slopes, loads: Numbers) -> Any:
        return jax.vmap(constraint_forces.load_solver(system, blocks, None))(loads)

    return (
        of_chunk(blocks, loads) if system.fronts is not None else in_small_chunks(of_chunk, SMALL_CHUNK, blocks, loads)
    )


@compiled("pose_type", brief=True)
def pressing(
    element: Any,
    poses: Sequence[Coordinates],
    slope: Slope,
    forces: Float[Numbers, "row instance batch"],
    pose_type: type[Pose],
) -> Any:
    """Return the normal forces of joints with friction, (components, instances, time), at order zero.

    For gears, return the torque that they transmit.
    """
    if loses_torque(element):
        return element.passed_on(Jet([forces[0]])).coefficients[0][None]
    bodies = tuple(pose_of(pose, pose_type, 0) for pose in poses)
    held = constraint_forces.wrench(slope[:1], forces[None])[0][: bodies[0].shifts]
    return pressing_force(element, bodies, Jet([held])).coefficients[0]


@compiled("pose_type", brief=True)
def body_loads(
    system: System, bodies: Coordinates, instants: Lanes, masses: Masses, gravity: Gravity, pose_type: type[Pose]
) -> tuple[Any, Any]:
    """Return the loads that the constraints balance, and at which instants each applied force is finite."""
    order = len(bodies["position"]) - 1
    pose = pose_of(bodies, pose_type, order)
    time = Jet.variable(instants[None], order)
    return loads(system, pose, time, masses, gravity), system.finite_forces(pose, time)


@compiled("pose_type", brief=True)
def multipliers(
    system: System,
    blocks: Slopes,
    load: Float[Numbers, "levels coordinate body batch"],
    at_rest: Coordinates | None,
    masses: Masses,
    pose_type: type[Pose],
    rubbed: Sequence[Rubbed] = (),
) -> Any:
    """Return the multipliers that balance a load, and normal forces, Taylor coefficients, (levels, rows, time)."""
    mass = None if at_rest is None else mass_matrices(pose_of(at_rest, pose_type, 0), masses)[:, :, 1:]

    def of_chunk(blocks: Slopes, load: Numbers, mass: Any, rubbed: Sequence[Rubbed]) -> Any:
        if not rubbed:
            return constraint_forces.multipliers(system, blocks, load, mass)
        return with_friction(system, blocks, load, mass, rubbing_of(system, blocks, rubbed, pose_type))

    dense = mass is not None or system.fronts is None
    return (
        in_small_chunks(of_chunk, SMALL_CHUNK, blocks, load, mass, rubbed)
        if dense
        else of_chunk(blocks, load, mass, rubbed)
    )


@Mapped
def _balanced(shared: Any, lanes: Any, *, pose_type: type[Pose]) -> tuple[Any, Any]:
    """Return the multipliers of one instant for several cases, and which applied forces are finite there.

    Parameters
    ----------
    shared : tuple
        The system, the system of its forces alone, masses and gravity. If rows are redundant, also the arguments of
        `least_multipliers` other than the load; otherwise None, and the single case is that of `multipliers`.
    lanes : tuple
        For the instant: the coordinates of all bodies, the angles about axes that forces measure, the loaded tooth
        flanks, and the time.
    pose_type
        Type of the poses.
    """
    (system, loaded, masses, gravity, choice), (bodies, angles, flanks, instants) = shared, lanes
    system = with_fields(system, groups=with_flanks(system.groups, flanks))
    levels = len(bodies["position"]) - 2  # accelerations use up two
    loaded = dataclasses.replace(loaded, forces=with_turns(loaded.forces, angles))
    load, finite = body_loads.function(loaded, bodies, instants, masses, gravity, pose_type)

    def slope(group: Group, slot: int) -> Any:
        poses = [part_of(bodies, its, levels) for its in group.bodies]
        return element_slopes.function(group.element, poses, instants, pose_type, slot, levels)

    blocks = [[slope(group, slot) for slot in group.moving_slots] for group in system.groups]
    if choice is not None:
        return least_multipliers.function(system, blocks, load, *choice), finite
    still = None if system.shape[0] == system.shape[1] else part_of(bodies, None, 1)

    def rubbed(group: Group) -> Rubbed:
        moving, placed = ([part_of(bodies, its, n) for its in group.bodies] for n in (levels + 1, levels))
        slopes = [friction_slopes.function(group.element, moving, pose_type, s, levels) for s in group.moving_slots]
        part = resisting.function(group.element, moving, pose_type, levels) if loses_torque(group.element) else None
        return slopes, placed, part

    rubbing = [rubbed(group) for group in system.groups if rubs(group)]
    return multipliers.function(system, blocks, load, still, masses, pose_type, rubbing)[None], finite


def without_constraints(system: System, forces: tuple[Group, ...]) -> System:
    """Return the system of the forces alone, without constraints."""
    nothing = Pattern.of((), (), system.pattern.width, system.body_count)
    values = {"groups": (), "pattern": nothing, "row_scale": np.zeros((0, 1)), "rank": None, "fronts": None}
    return with_fields(system, **values, forces=forces)


def balance_of_instant(shared: Any, lanes: Any, pose_type: type[Pose]) -> OnLlvm | None:
    """Return machine code for `_balanced`, or None if there is none; any instant serves as an example."""
    program = _balanced.program(shared, lanes, large=LARGE, hasty=is_in_haste(), pose_type=pose_type)
    return program if isinstance(program, OnLlvm) else None  # XLA's programs are those of each kind of joint


@compiled(brief=True)
def least_multipliers(
    system: System,
    blocks: Slopes,
    load: Float[Numbers, "levels coordinate body batch"],
    compliance: Float[Numbers, " row"],
    weights: Float[Numbers, " case"],
    bent: Float[Numbers, "case row"],
) -> Any:
    """Return multipliers of redundant rows for several cases, each a factor of the load and a misalignment."""

    def of_chunk(blocks: Slopes, load: Numbers) -> Any:
        def of_case(weight: Any, bent: Numbers) -> Any:
            return redundant_forces.least_multipliers(system, blocks, weight * load, compliance, bent)

        return jax.vmap(of_case)(weights, bent)  # one factorization for all cases

    return in_small_chunks(of_chunk, SMALL_CHUNK, blocks, load)


@compiled(brief=True)
def scaled_jacobian(system: System, blocks: Slopes) -> Any:
    """Return the Jacobian with scaled rows and columns."""
    return constraint_forces.jacobian_of(system, blocks)


@compiled("pose_type", brief=True)
def exerted(
    driver: Any, poses: Sequence[Coordinates], instants: Lanes, forces: Multipliers, pose_type: type[Pose]
) -> Any:
    """Return the forces of drivers along their prescribed coordinates, as Taylor coefficients."""
    order = len(forces) - 1
    built = [pose_of(pose, pose_type, order) for pose in poses]
    return constraint_forces.exerted(driver, built, Jet.variable(instants[None], order), forces)


@compiled("pose_type", "levels", brief=True)
def applied(force: Any, poses: Sequence[Coordinates], instants: Lanes, pose_type: type[Pose], levels: int) -> Any:
    """Return the applied forces, as Taylor coefficients."""
    built = [pose_of(pose, pose_type, levels) for pose in poses]
    time = Jet.variable(instants[None], levels)
    exerted = force.force(force.displacement(*built, time), force.velocity(*built, time), time).truncate(levels - 1)
    return stacked(with_rows(exerted))


@compiled("pose_type", "slot", "levels", brief=True)
def force_slopes(
    force: Any, poses: Sequence[Coordinates], instants: Lanes, pose_type: type[Pose], slot: int, levels: int
) -> Any:
    """Return the derivative of the displacements of applied forces by the body in a slot, as `slopes` does."""
    time = Jet.variable(instants[None], levels - 1)
    built = tuple(movable(pose_of(pose, pose_type, levels - 1)) for pose in poses)
    unchanged = [jax.tree.map(jnp.zeros_like, pose) for pose in built]

    def acting(change: Any) -> Any:
        changes = (*unchanged[:slot], change, *unchanged[slot + 1 :])
        return stacked(with_rows(force.variation(built, changes, time)))

    return along_displacements(built[slot], acting)


@compiled(brief=True)
def wrenches(slope: Slope, forces: Multipliers) -> Any:
    """Return the wrenches of joints on the body in a slot: global force, and moment about its origin in its axes."""
    return constraint_forces.wrench(slope, forces)


@compiled("pose_type", brief=True)
def passed_on(
    works: Sequence[Float[Numbers, "levels coordinate batch"]],
    bodies: Sequence[Coordinates],
    point: Float[Numbers, "component 1 1"],
    pose_type: type[Pose],
) -> Any:
    """Return the opposite of the wrenches on several bodies: force, and moment about a point, both global."""
    order, wrenches = len(works[0]) - 1, []
    for work, body in zip(works, bodies, strict=True):
        pose = pose_of(body, pose_type, order)
        force, moment = (Jet(tuple(part[:, :, None])) for part in (work[:, : pose.shifts], work[:, pose.shifts :]))
        lever = cross(pose.position - point, force)
        moment = moment + lever[None] if pose.turns == 1 else pose.direction(moment) + lever
        wrenches.append(jnp.concatenate([stacked(force), stacked(moment)], axis=1)[:, :, 0])
    return -total(wrenches)


@compiled("pose_type", brief=True)
def expressed(
    work: Float[Numbers, "levels coordinate batch"],
    bodies: Sequence[Coordinates],
    point: Float[Numbers, "component 1 1"],
    pose_type: type[Pose],
) -> tuple[Any, Any]:
    """Return force and moment about a point of a body, along its axes or those of another body."""
    order = len(work) - 1
    pose, *frame = (pose_of(body, pose_type, order) for body in bodies)
    force, moment = (Jet(tuple(part[:, :, None])) for part in (work[:, : pose.shifts], work[:, pose.shifts :]))
    if pose.turns == 1:
        moment = moment - cross(pose.direction(point), force)[None]
    else:
        moment = pose.direction(moment - cross(point, pose.to_body(force)))
    for other in frame:
        force = other.to_body(force)
        moment = moment if pose.turns == 1 else other.to_body(moment)
    return stacked(force)[:, :, 0], stacked(moment)[:, :, 0]
