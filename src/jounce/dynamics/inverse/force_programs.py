"""What is compiled of inverse dynamics.

What differs between mechanisms, the residuals, is compiled type by type on the poses of the bodies that it joins, so
that all mechanisms share it.
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
from jounce.execution.store.programs import is_wanted_soon
from jounce.jet import Jet, cross
from jounce.jet.algebra import stacked, total
from jounce.kinematics.sensitivity.jacobian_series import along_displacements, slopes
from jounce.linear_algebra.pattern import Pattern
from jounce.mechanism.system import Group, System, movable, with_rows
from jounce.mechanism.transmissions.axis_angles import with_turns
from jounce.rigid.pose import Pose

LARGE = 16  # numbers of an array that stays in memory in machine code of an instant
SMALL_CHUNK = 16  # instants whose dense matrices are factored together


@compiled("pose_type", "slot", "levels", brief=True)
def element_slopes(
    element: Any, poses: Sequence[Coordinates], instants: Lanes, pose_type: type[Pose], slot: int, levels: int
) -> Any:
    """Return how the residual of a joint or driver changes with the body in a slot, as `slopes` does."""
    time = Jet.variable(instants[None], levels - 1)
    return slopes(element, [pose_of(pose, pose_type, levels - 1) for pose in poses], time, slot)


@compiled("pose_type", "slot", "levels", brief=True)
def friction_slopes(element: Any, poses: Sequence[Coordinates], pose_type: type[Pose], slot: int, levels: int) -> Any:
    """Return what the friction of a normal force of one does to the body in a slot, as `friction_slope` does."""
    return friction_slope(element, [pose_of(pose, pose_type, levels) for pose in poses], slot)


def slip_directions(element: Any, poses: Sequence[Coordinates], pose_type: type[Pose]) -> int:
    """Return in how many directions the surfaces of joints slip."""

    def slip(poses: Sequence[Coordinates]) -> Any:
        return slip_velocity(element, [pose_of(pose, pose_type, 1) for pose in poses]).coefficients[0]

    return jax.eval_shape(slip, poses).shape[0]


@compiled("pose_type", "levels", brief=True)
def resisting(element: Any, poses: Sequence[Coordinates], pose_type: type[Pose], levels: int) -> Any:
    """Return which part of what presses resists slip, Taylor coefficients, (levels, directions, joints, time)."""
    return stacked(coupling.resisting(element, [pose_of(pose, pose_type, levels) for pose in poses]))


@compiled("pose_type", "levels", brief=True)
def resisted(element: Any, poses: Sequence[Coordinates], pose_type: type[Pose], levels: int) -> Any:
    """Return the power that friction takes for a normal force of one, Taylor coefficients, (levels, joints, time)."""
    slip = slip_velocity(element, [pose_of(pose, pose_type, levels) for pose in poses])
    return stacked(element.friction.resisting(slip).dot(slip))


@compiled(brief=True)
def responses(system: System, blocks: Slopes, loads: Float[Numbers, "load coordinate body batch"]) -> Any:
    """Return the multipliers that balance each of some loads, (loads, rows, time), of a system that is driven whole."""

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
    """Return what presses joints with friction, (components, instances, time), for multipliers of order zero.

    Of gears it is the torque that they pass on.
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
    """Return what the constraints have to balance, and at which instants each applied force is finite."""
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
    """Return multipliers of one instant for some cases, and which applied forces are finite there.

    Parameters
    ----------
    shared : tuple
        The system, one of its forces alone, masses and gravity; and, where rows are redundant, what `least_multipliers`
        takes beside the load, else None: then there is one case, that of `multipliers`.
    lanes : tuple
        Of the instant: the coordinates of all bodies, the angles about axes that forces measure, the flanks on which
        teeth press, and its time.
    pose_type
        Of the coordinates.
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
    """Return a system with forces and nothing that joins its bodies."""
    nothing = Pattern.of((), (), system.pattern.width, system.body_count)
    values = {"groups": (), "pattern": nothing, "row_scale": np.zeros((0, 1)), "rank": None, "fronts": None}
    return with_fields(system, **values, forces=forces)


def balance_of_instant(shared: Any, lanes: Any, pose_type: type[Pose]) -> OnLlvm | None:
    """Return machine code for `_balanced`, None where there is none; any instant serves as an example."""
    program = _balanced.program(shared, lanes, large=LARGE, hasty=is_wanted_soon(), pose_type=pose_type)
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
    """Return multipliers of redundant rows for some cases: a weight of the load, and what is bent, in each."""

    def of_chunk(blocks: Slopes, load: Numbers) -> Any:
        def of_case(weight: Any, bent: Numbers) -> Any:
            return redundant_forces.least_multipliers(system, blocks, weight * load, compliance, bent)

        return jax.vmap(of_case)(weights, bent)  # all cases by one factorization

    return in_small_chunks(of_chunk, SMALL_CHUNK, blocks, load)


@compiled(brief=True)
def scaled_jacobian(system: System, blocks: Slopes) -> Any:
    """Return the Jacobian of scaled rows and columns."""
    return constraint_forces.jacobian_of(system, blocks)


@compiled("pose_type", brief=True)
def exerted(
    driver: Any, poses: Sequence[Coordinates], instants: Lanes, forces: Multipliers, pose_type: type[Pose]
) -> Any:
    """Return what drivers exert along what they prescribe, Taylor coefficients."""
    order = len(forces) - 1
    built = [pose_of(pose, pose_type, order) for pose in poses]
    return constraint_forces.exerted(driver, built, Jet.variable(instants[None], order), forces)


@compiled("pose_type", "levels", brief=True)
def applied(force: Any, poses: Sequence[Coordinates], instants: Lanes, pose_type: type[Pose], levels: int) -> Any:
    """Return what applied forces exert, Taylor coefficients."""
    built = [pose_of(pose, pose_type, levels) for pose in poses]
    time = Jet.variable(instants[None], levels)
    exerted = force.force(force.displacement(*built, time), force.velocity(*built, time), time).truncate(levels - 1)
    return stacked(with_rows(exerted))


@compiled("pose_type", "slot", "levels", brief=True)
def force_slopes(
    force: Any, poses: Sequence[Coordinates], instants: Lanes, pose_type: type[Pose], slot: int, levels: int
) -> Any:
    """Return how far applied forces act along as the body in a slot is displaced, as `slopes` does for residuals."""
    time = Jet.variable(instants[None], levels - 1)
    built = tuple(movable(pose_of(pose, pose_type, levels - 1)) for pose in poses)
    unchanged = [jax.tree.map(jnp.zeros_like, pose) for pose in built]

    def acting(change: Any) -> Any:
        changes = (*unchanged[:slot], change, *unchanged[slot + 1 :])
        return stacked(with_rows(force.variation(built, changes, time)))

    return along_displacements(built[slot], acting)


@compiled(brief=True)
def wrenches(slope: Slope, forces: Multipliers) -> Any:
    """Return what joints do to the body in a slot: force, global, and moment about its origin, in its axes."""
    return constraint_forces.wrench(slope, forces)


@compiled("pose_type", brief=True)
def passed_on(
    works: Sequence[Float[Numbers, "levels coordinate batch"]],
    bodies: Sequence[Coordinates],
    point: Float[Numbers, "component 1 1"],
    pose_type: type[Pose],
) -> Any:
    """Return the counterpart of what acts on some bodies: force, and moment about a point, both global."""
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
    """Return force and moment about a point of a body, in its axes or in those of another one."""
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
