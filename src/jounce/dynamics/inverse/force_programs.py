"""Programs of inverse dynamics: functions of one instant."""

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
from jounce.dynamics.friction.coupling import friction_slope, has_friction, loses_torque, resisting
from jounce.dynamics.inverse import constraint_forces, redundant_forces
from jounce.dynamics.inverse.constraint_forces import Multipliers, Slope, Slopes
from jounce.dynamics.inverse.friction_of_motion import Rubbed, friction_groups, with_friction
from jounce.dynamics.inverse.tooth_flanks import with_flanks
from jounce.dynamics.motion_values import Coordinates, cut, in_small_chunks, pose_of
from jounce.execution.compilation import compiled
from jounce.execution.mapped import Mapped
from jounce.jet import Jet, cross
from jounce.jet.algebra import stacked, total
from jounce.kinematics.sensitivity.jacobian_series import along_displacements, slopes, slopes_of_groups
from jounce.linear_algebra.pattern import Pattern
from jounce.mechanism import Model
from jounce.mechanism.system import Group, System, movable, with_rows
from jounce.mechanism.transmissions.axis_angles import with_turns
from jounce.rigid.pose import Pose
from jounce.rigid.spatial import SpatialPose

SMALL, ALL = 16, 10_000  # numbers of the largest array that is single values in the machine code of a balance
MOST_COLUMNS = 48  # coordinates of a mechanism in space for which all arrays are single values
SMALL_CHUNK = 16  # number of instants whose dense matrices are factored together
Acting = tuple[Sequence[Coordinates], Sequence[Any]]  # poses of bodies, and the angles about axes between them


def element_slopes(
    element: Any, poses: Sequence[Coordinates], instants: Lanes, pose_type: type[Pose], slot: int, levels: int
) -> Any:
    """Return the derivative of the residual of a joint or driver by the body in a slot, as `slopes` does."""
    time = Jet.variable(instants[None], levels - 1)
    return slopes(element, [pose_of(pose, pose_type, levels - 1) for pose in poses], time, slot)


@Mapped
def friction_slopes(
    element: Any, poses: Sequence[Coordinates], *, pose_type: type[Pose], slot: int, levels: int
) -> Slope:
    """Return the wrench of friction on the body in a slot for a unit normal force, as `friction_slope` does."""
    return friction_slope(element, [pose_of(pose, pose_type, levels) for pose in poses], slot)


def slip_directions(element: Any, poses: Sequence[Coordinates], pose_type: type[Pose]) -> int:
    """Return the number of directions in which the surfaces of joints slip."""

    def slip(poses: Sequence[Coordinates]) -> Any:
        return slip_velocity(element, [pose_of(pose, pose_type, 1) for pose in poses]).coefficients[0]

    return jax.eval_shape(slip, poses).shape[0]


@Mapped
def resisted(element: Any, poses: Sequence[Coordinates], *, pose_type: type[Pose], levels: int) -> Any:
    """Return the friction power for a unit normal force, as Taylor coefficients, (levels, joints, time)."""
    slip = slip_velocity(element, [pose_of(pose, pose_type, levels) for pose in poses])
    return stacked(element.friction.resisting(slip).dot(slip))


@Mapped
def responses(system: System, lanes: tuple[Coordinates, Any, Lanes, Any], *, pose_type: type[Pose]) -> Any:
    """Return the multipliers that balance each of several loads, (loads, rows, time), in a fully driven system.

    `lanes` has the coordinates of all bodies, the loaded tooth flanks, the time, and the loads, of shape (loads,
    coordinates, bodies, batch).
    """
    bodies, flanks, instants, loads = lanes
    groups = with_flanks(system.groups, flanks)
    blocks = slopes_of_groups(groups, pose_of(bodies, pose_type, 0), Jet([instants[None]]))

    def of_chunk(blocks: Slopes, loads: Numbers) -> Any:
        return jax.vmap(constraint_forces.load_solver(system, blocks, None))(loads)

    return (
        of_chunk(blocks, loads) if system.fronts is not None else in_small_chunks(of_chunk, SMALL_CHUNK, blocks, loads)
    )


@Mapped
def pressing(
    element: Any,
    lanes: tuple[Sequence[Coordinates], Lanes, Any, Float[Numbers, "row instance batch"]],
    *,
    pose_type: type[Pose],
    slot: int,
) -> Any:
    """Return the normal forces of joints with friction, (components, instances, time), at order zero.

    For gears, return the transmitted torque. `lanes` has the poses of the bodies, the time, the loaded tooth flanks or
    None, and the multipliers of the rows of the joints.
    """
    poses, instants, flank, forces = lanes
    if loses_torque(element):
        return element.passed_on(Jet([forces[0]])).coefficients[0][None]
    positions = [cut(pose, 0) for pose in poses]
    wrench = joint_wrench.function(
        element, (positions, instants, flank, forces[None], None), pose_type=pose_type, slot=slot, levels=1
    )
    bodies = tuple(pose_of(pose, pose_type, 0) for pose in positions)
    return pressing_force(element, bodies, Jet([wrench[0, : bodies[0].shifts]])).coefficients[0]


def largest_array(model: Model) -> int:
    """Return the largest array size that the machine code of a balance unrolls; larger arrays are loops.

    In space, most derivatives of residuals are known zeros, which unrolled code skips. Dense matrices take loops: those
    of redundant rows, and those with masses for free motions.
    """
    rows, columns = model.system.shape
    has_few_columns = model.pose_type is SpatialPose and columns <= MOST_COLUMNS
    return ALL if has_few_columns and rows == columns and model.system.rank is None else SMALL


@Mapped
def balanced(shared: Any, lanes: Any, *, pose_type: type[Pose]) -> tuple[Any, Any]:
    """Return the multipliers and normal forces of an instant for several cases, and which applied forces are finite.

    The multipliers are Taylor coefficients, (cases, levels, rows, time), with those of the normal forces below them.

    Parameters
    ----------
    shared : tuple
        The system, the system of its forces alone, masses and gravity. If rows are redundant, also the arguments of
        `_least_multipliers` other than the load; otherwise None, and there is one case.
    lanes : tuple
        Coordinates of all bodies, the angles about axes that forces measure, the loaded tooth flanks, and the time.
    pose_type
        Type of the poses.
    """
    (system, loaded, masses, gravity, choice), (bodies, angles, flanks, instants) = shared, lanes
    levels = len(bodies["position"]) - 2  # accelerations use up two
    loaded = dataclasses.replace(loaded, forces=with_turns(loaded.forces, angles))
    pose, time = pose_of(bodies, pose_type, levels + 1), Jet.variable(instants[None], levels + 1)
    load, finite = loads(loaded, pose, time, masses, gravity), loaded.finite_forces(pose, time)
    groups = with_flanks(system.groups, flanks)
    blocks = slopes_of_groups(groups, pose.truncate(levels - 1), Jet.variable(instants[None], levels - 1))
    if choice is not None:
        return _least_multipliers(system, blocks, load, *choice), finite
    square = system.shape[0] == system.shape[1]
    mass = None if square else mass_matrices(pose.truncate(0), masses)[:, :, 1:]

    def rubbed(group: Group) -> Rubbed:
        moving_poses = [pose.truncate(levels).take(indices) for indices in group.bodies]
        slopes = [friction_slope(group.element, moving_poses, slot) for slot in group.moving_slots]
        reduced = [body.truncate(levels - 1) for body in moving_poses]
        return slopes, reduced, stacked(resisting(group.element, moving_poses)) if loses_torque(group.element) else None

    def of_chunk(blocks: Slopes, load: Numbers, mass: Any, rubbed: Sequence[Rubbed]) -> Any:
        if not rubbed:
            return constraint_forces.multipliers(system, blocks, load, mass)
        return with_friction(system, blocks, load, mass, friction_groups(system, blocks, rubbed))

    arguments = blocks, load, mass, [rubbed(group) for group in system.groups if has_friction(group)]
    is_dense = mass is not None or system.fronts is None
    multipliers = in_small_chunks(of_chunk, SMALL_CHUNK, *arguments) if is_dense else of_chunk(*arguments)
    return multipliers[None], finite


def without_constraints(system: System, forces: tuple[Group, ...]) -> System:
    """Return the system of the forces alone, without constraints."""
    nothing = Pattern.of((), (), system.pattern.width, system.body_count)
    values = {"groups": (), "pattern": nothing, "row_scale": np.zeros((0, 1)), "rank": None, "fronts": None}
    return with_fields(system, **values, forces=forces)


def _least_multipliers(
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


@compiled("pose_type", brief=True)
def scaled_jacobian(system: System, bodies: Coordinates, instants: Lanes, pose_type: type[Pose]) -> Any:
    """Return the Jacobian with scaled rows and columns."""
    return system.jacobian(pose_of(bodies, pose_type, 0), Jet([instants[None]]))


@Mapped
def exerted(driver: Any, lanes: tuple[Sequence[Coordinates], Lanes, Multipliers], *, pose_type: type[Pose]) -> Any:
    """Return the forces of drivers along their prescribed coordinates, as Taylor coefficients."""
    poses, instants, forces = lanes
    order = len(forces) - 1
    jets = [pose_of(pose, pose_type, order) for pose in poses]
    return constraint_forces.exerted(driver, jets, Jet.variable(instants[None], order), forces)


@Mapped
def applied(force: Group, lanes: tuple[Acting, Lanes], *, pose_type: type[Pose], levels: int) -> Any:
    """Return the applied forces, as Taylor coefficients."""
    element, poses, time = force_at(force, lanes, pose_type, levels)
    exerted = element.force(element.displacement(*poses, time), element.velocity(*poses, time), time)
    return stacked(with_rows(exerted.truncate(levels - 1)))


def force_at(force: Group, lanes: tuple[Acting, Lanes], pose_type: type[Pose], order: int) -> tuple[Any, Any, Jet]:
    """Return forces with the turns of the angles that they measure, the poses of their bodies, and the time."""
    (poses, angles), instants = lanes
    (group,) = with_turns((force,), angles)
    return group.element, [pose_of(pose, pose_type, order) for pose in poses], Jet.variable(instants[None], order)


Pressing = Float[Numbers, "order 1 instance batch"]
"""Taylor coefficients of the normal forces of joints with friction."""


@Mapped
def joint_wrench(
    element: Any,
    lanes: tuple[Sequence[Coordinates], Lanes, Any, Multipliers, tuple[Sequence[Coordinates], Pressing] | None],
    *,
    pose_type: type[Pose],
    slot: int,
    levels: int,
) -> Any:
    """Return the wrenches of joints on the body in a slot: global force, and moment about its origin in its axes.

    Parameters
    ----------
    element : AbstractConstraint
        The joints.
    lanes : tuple
        Poses of the bodies, the time, the loaded tooth flanks or None, the multipliers of the rows of the joints, and
        for joints with friction the poses to one more order and the normal forces, otherwise None.
    pose_type, slot, levels
        Type of the poses, the slot of the body, and the number of Taylor coefficients.
    """
    poses, instants, flank, forces, rubbed = lanes
    if flank is not None:
        element = with_fields(element, flank=flank)
    slope = element_slopes(element, poses, instants, pose_type, slot, levels)
    wrench = constraint_forces.wrench(slope, forces)
    if rubbed is None:
        return wrench
    rubbing_poses, pressing = rubbed
    slope = friction_slopes.function(element, rubbing_poses, pose_type=pose_type, slot=slot, levels=levels)
    return wrench + constraint_forces.wrench(slope, pressing)


@Mapped
def force_wrench(
    force: Group, lanes: tuple[Acting, Lanes, Multipliers], *, pose_type: type[Pose], slot: int, levels: int
) -> Any:
    """Return the wrenches of applied forces on the body in a slot, as `joint_wrench` does."""
    acting, instants, sizes = lanes
    element, poses, time = force_at(force, (acting, instants), pose_type, levels - 1)
    movables = tuple(map(movable, poses))
    unchanged = [jax.tree.map(jnp.zeros_like, pose) for pose in movables]

    def displaced(change: Any) -> Any:
        changes = (*unchanged[:slot], change, *unchanged[slot + 1 :])
        return stacked(with_rows(element.variation(movables, changes, time)))

    return constraint_forces.wrench(along_displacements(movables[slot], displaced), -sizes)  # opposite to a multiplier


@Mapped
def transmitted_wrench(
    point: Float[Numbers, "component 1 1"],
    lanes: tuple[Sequence[Float[Numbers, "levels coordinate batch"]], Sequence[Coordinates]],
    *,
    pose_type: type[Pose],
) -> Any:
    """Return the opposite of the wrenches on several bodies: force, and moment about a point, both global."""
    works, bodies = lanes
    order, wrenches = len(works[0]) - 1, []
    for work, body in zip(works, bodies, strict=True):
        pose = pose_of(body, pose_type, order)
        force, moment = (Jet(tuple(x[:, :, None])) for x in (work[:, : pose.shifts], work[:, pose.shifts :]))
        lever = cross(pose.position - point, force)
        moment = moment + lever[None] if pose.turns == 1 else pose.direction(moment) + lever
        wrenches.append(jnp.concatenate([stacked(force), stacked(moment)], axis=1)[:, :, 0])
    return -total(wrenches)


@Mapped
def expressed(
    point: Float[Numbers, "component 1 1"],
    lanes: tuple[Float[Numbers, "levels coordinate batch"], Sequence[Coordinates]],
    *,
    pose_type: type[Pose],
) -> tuple[Any, Any]:
    """Return force and moment about a point of a body, along its axes or those of another body."""
    work, bodies = lanes
    order = len(work) - 1
    pose, *frame = (pose_of(body, pose_type, order) for body in bodies)
    force, moment = (Jet(tuple(x[:, :, None])) for x in (work[:, : pose.shifts], work[:, pose.shifts :]))
    if pose.turns == 1:
        moment = moment - cross(pose.direction(point), force)[None]
    else:
        moment = pose.direction(moment - cross(point, pose.to_body(force)))
    for target in frame:
        force = target.to_body(force)
        moment = moment if pose.turns == 1 else target.to_body(moment)
    return stacked(force)[:, :, 0], stacked(moment)[:, :, 0]
