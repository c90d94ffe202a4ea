"""The numeric model of a mechanism: names resolved to indices, and the origin of each row."""

import dataclasses
from collections.abc import Sequence
from functools import cached_property, lru_cache
from typing import Any

import jax
import numpy as np
from jax.core import Tracer
from jaxtyping import Float

from jounce.base.modules import unchecked, with_fields
from jounce.base.shapes import Numbers
from jounce.constraints.facts import facts_of, field_kinds
from jounce.execution.compilation import compiled
from jounce.jet import Jet
from jounce.linear_algebra.fronts import Fronts, elimination
from jounce.linear_algebra.pattern import Pattern
from jounce.mechanism.building.contents import contents_of, holds_numbers_only, made_or_stored, owned_arrays
from jounce.mechanism.building.derived_values import (
    counts_turns,
    with_derived_of,
    with_offsets,
    with_sense,
    with_turn_unit,
)
from jounce.mechanism.building.starting_guess import pose_at, starting_guess
from jounce.mechanism.carriages import ENDING
from jounce.mechanism.mechanism import Mechanism
from jounce.mechanism.outputs.base import AbstractMotionOutput
from jounce.mechanism.system import POSITION_COMPONENTS, Group, System, law_left_out
from jounce.mechanism.transmissions.axis_angles import (
    AttitudeHistory,
    PrescribedAngle,
    departure,
    measures_angle,
    prescribed_angles,
    with_angles,
    with_datums,
)
from jounce.mechanism.transmissions.gear_frames import Grouped, grouped_with_frames
from jounce.rigid import PlanarPose, SpatialPose
from jounce.rigid.pose import Pose
from jounce.trajectory import AbstractMotion
from jounce.trajectory.curves import CurveLaw

Shape = tuple[int, ...]


@dataclasses.dataclass(frozen=True)
class Model:
    """The numeric model of a mechanism.

    Parameters
    ----------
    system : System
        Residual, Jacobian and outputs as functions of the pose of all bodies.
    pose_type : type
        PlanarPose or SpatialPose.
    guess : dict of str to array
        Coordinates of the starting guess of all bodies, the ground first, shape (..., bodies, 1).
    rows : tuple of str
        Name of the joint or driver of each row of the residual.
    drivers : tuple of str
        Names of the drivers, in the order of `System.admissible`.
    forces : tuple of tuple of str
        Names of the applied forces in each group of the system, in the order of `System.finite_forces`.
    bodies : tuple of str
        Names of the moving bodies, in the order of the pose.
    outputs : tuple of tuple of str
        Names of the outputs in each group of the system.
    length : float
        Size of the mechanism, by which positions are scaled, m.
    reference : dict of str to array
        Coordinates from which angles about axes are counted: the starting guess until the mechanism is assembled.
    prescribed : tuple of PrescribedAngle
        Angles that drivers prescribe at the reference coordinates, with their whole turns.
    history : AttitudeHistory, optional
        Spatial attitudes on the way from the starting guess to the start of the driver laws, where that way exceeds
        half a turn.
    """

    system: System
    pose_type: type[Pose]
    guess: dict[str, Any]
    rows: tuple[str, ...]
    drivers: tuple[str, ...]
    forces: tuple[tuple[str, ...], ...]
    bodies: tuple[str, ...]
    outputs: tuple[tuple[str, ...], ...]
    length: float
    reference: dict[str, Any]
    prescribed: tuple[PrescribedAngle, ...] = ()
    history: AttitudeHistory | None = None

    @cached_property
    def released(self) -> "Model":
        """The model without the initial conditions with which it was built."""
        return _released(self)


def named_groups(model: Model) -> list[tuple[Group, tuple[str, ...]]]:
    """Return the groups of joints and drivers, each with the names of its instances as in `Model.rows`."""
    pairs = zip(model.system.groups, group_rows(model), strict=True)
    return [(group, model.rows[rows][: group.instances]) for group, rows in pairs]


def group_rows(model: Model) -> list[slice]:
    """Return the slice of rows of each group: one row of every instance in turn, repeated for each row of the joint."""
    return list(_group_rows(model.rows, tuple([group.instances for group in model.system.groups])))


@lru_cache(maxsize=100)
def _group_rows(rows: tuple[str, ...], instances: tuple[int, ...]) -> tuple[slice, ...]:
    slices, first = [], 0
    for count in instances:
        names, last = rows[first : first + count], first
        while rows[last : last + count] == names:
            last += count
        slices.append(slice(first, last))
        first = last
    return tuple(slices)


def build(mechanism: Mechanism, like: Model | None = None, *, initial: bool = False) -> Model:
    """Return the numeric model of a mechanism.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism to be solved.
    like : Model, optional
        Model of the same mechanism with other parameter values; those of `mechanism` may then be traced by JAX. The
        starting guess, the size, and the offsets that follow from them, are taken over.
    initial : bool, default False
        Whether the initial conditions hold, beside the drivers.

    Raises
    ------
    MechanismError
        If a value does not fit: a vector of wrong length, a zero axis, a negative length, a number not finite.
    ExpressionError
        If an expression uses a name that is not a parameter.
    """
    if like is not None:
        return _built(mechanism, like, initial=initial)
    contents = contents_of(mechanism, initial)
    return made_or_stored(contents, lambda: _built(mechanism, None, initial=initial), _owned)


def _owned(model: Model) -> Model | None:
    """Return a copy of a model that shares no arrays, so that it may be stored; None for a model with curves."""
    system = model.system
    if not all(holds_numbers_only(group.element) for group in (*system.groups, *system.forces, *system.outputs)):
        return None
    system, guess = owned_arrays((system, model.guess))
    history = None if model.history is None else AttitudeHistory(guess["quaternion"], np.zeros(1))
    return dataclasses.replace(model, system=system, guess=guess, reference=guess, history=history)


def _built(mechanism: Mechanism, like: Model | None, *, initial: bool) -> Model:
    parameters, components = mechanism.parameter_values, POSITION_COMPONENTS[mechanism.space]
    (groups, names), (forces, force_names), (outputs, output_names) = grouped_elements(mechanism, initial=initial)
    if like is not None:
        parts = {"groups": groups, "forces": forces, "outputs": outputs}
        derived = {name: tuple(map(with_derived_of, part, getattr(like.system, name))) for name, part in parts.items()}
        return dataclasses.replace(like, system=with_fields(like.system, **derived))

    pose_type = PlanarPose if components == 2 else SpatialPose
    guess = starting_guess(mechanism, parameters, components)
    groups = tuple(with_sense(with_offsets(group, pose_type, guess), pose_type, guess) for group in groups)
    groups, forces, outputs = (with_datums(part, guess) for part in (groups, forces, outputs))
    length = _size(groups, guess["position"][:, : 1 + len(mechanism.rigid_bodies)])
    groups = tuple(with_turn_unit(group, length) for group in groups)
    for group in filter(counts_turns, groups):
        guess["position"][2, list(group.bodies[-1])] = length
    history = AttitudeHistory(guess["quaternion"], np.zeros(1)) if components == 3 else None
    parts = ((groups, names), (forces, force_names), (outputs, output_names))
    return model_of(tuple(mechanism.bodies), parts, guess, length, history)


def _released(model: Model) -> Model:
    system, groups, names = model.system, [], []
    for group, members in named_groups(model):
        indices = [k for k, name in enumerate(members) if not name.startswith("initial.")]
        if len(indices) < len(members):  # drivers of the same kind may be among them
            element = jax.tree.map(lambda values, indices=indices: values[..., indices, :], group.element)
            group = with_fields(
                group, element=element, bodies=tuple(tuple(s[k] for k in indices) for s in group.bodies)
            )
        if indices:
            groups.append(group)
            names.append(tuple(members[k] for k in indices))
    parts = ((tuple(groups), tuple(names)), ((), ()), ((), ()))
    count = sum(not name.endswith(ENDING) for name in model.bodies) + 1  # carriages follow the bodies
    length = _size(tuple(groups), model.guess["position"][:, :count])
    base = model_of(model.bodies, parts, model.guess, length, model.history)
    system = with_fields(base.system, forces=system.forces, outputs=system.outputs)
    return dataclasses.replace(base, system=system, forces=model.forces, outputs=model.outputs)


def model_of(
    bodies: tuple[str, ...],
    parts: tuple[Grouped, Grouped, Grouped],
    guess: dict[str, Any],
    length: Any,
    history: AttitudeHistory | None,
) -> Model:
    """Return the model of complete groups of joints and drivers, of forces and of outputs, with their names."""
    (groups, names), (forces, force_names), (outputs, output_names) = parts
    pose_type = PlanarPose if "angle" in guess else SpatialPose
    row_counts = [_row_count(group, pose_type, guess) for group in groups]
    rows = [n for members, count in zip(names, row_counts, strict=True) for _ in range(count) for n in members]
    drivers = tuple(n for group, members in zip(groups, names, strict=True) if group.is_driver for n in members)
    slots = tuple(group.bodies for group in groups)
    pattern, fronts = _layout(slots, tuple(row_counts), pose_type.shifts + pose_type.turns, len(bodies))
    system = {
        "groups": groups,
        "outputs": outputs,
        "pattern": pattern,
        "row_scale": np.ones((len(rows), 1)),
        "column_scale": np.array([length] * pose_type.shifts + [1.0] * pose_type.turns),
        "body_count": len(bodies),
        "forces": forces,
        "fronts": fronts,
        "rank": None,
    }
    return Model(
        unchecked(System, system),
        pose_type,
        guess,
        tuple(rows),
        drivers,
        _plain(force_names),
        bodies,
        _plain(output_names),
        length,
        reference=guess,
        history=history,
    )


def grouped_elements(mechanism: Mechanism, *, initial: bool = False) -> tuple[Grouped, Grouped, Grouped]:
    """Return the groups of joints and drivers, of forces and of outputs; values may be traced by JAX.

    With `initial`, the initial conditions are among the drivers.
    """

    def grouped(*kinds: str) -> Grouped:
        elements = {f"{kind}.{k}": v for kind in kinds for k, v in mechanism.elements[kind].items()}
        return grouped_with_frames(
            mechanism, {name: v for name, v in elements.items() if not isinstance(v, AbstractMotionOutput)}
        )

    restricted = grouped("joints", "drivers", "initial") if initial else grouped("joints", "drivers")
    return restricted, grouped("forces"), grouped("outputs")


def with_reference(
    model: Model,
    coordinates: dict[str, Any],
    instant: float,
    prescribed: tuple[PrescribedAngle, ...] = (),
    *,
    keep: bool = False,
    laws: Sequence[np.ndarray] | None = None,
) -> tuple[Model, float]:
    """Return the model with angles about axes counted from a position, and the error of the driver angles before, rad.

    Parameters
    ----------
    model : Model
        Model of a mechanism.
    coordinates : dict of str to array
        Assembled coordinates of all bodies, the ground first.
    instant : float
        Instant of the coordinates, s.
    prescribed : tuple of PrescribedAngle
        Angles that other elements than drivers prescribe at the instant, such as initial conditions.
    keep : bool, default False
        Whether angles continue those counted so far, instead of following from the body frames.
    laws : sequence of array, optional
        Result of `law_values` at the instant, if known.
    """
    system = model.system
    if not any(map(measures_angle, (*system.groups, *system.forces, *system.outputs))):
        return with_fields(model, reference=coordinates, prescribed=prescribed), 0.0
    groups = with_datums(system.groups, coordinates, keep=keep)
    laws = law_values(groups, instant) if laws is None else laws
    prescribed = (*prescribed_angles(groups, coordinates, laws), *prescribed)
    forces, outputs = (with_datums(part, coordinates, prescribed) for part in (system.forces, system.outputs))
    system = with_fields(system, groups=groups, forces=forces, outputs=outputs)
    driver_error = departure(model.system.groups, groups)
    return with_fields(model, system=system, reference=coordinates, prescribed=prescribed), driver_error


def counted_as_in(groups: tuple[Group, ...], model: Model) -> tuple[Group, ...]:
    """Return groups whose angles about axes are counted as if the groups had been in the assembled model."""
    if model.history is None or not any(map(measures_angle, groups)):
        return groups
    first, last = ({"quaternion": model.history.quaternion[..., instant]} for instant in (slice(1), slice(-1, None)))
    groups = with_datums(groups, first)
    groups = with_angles(with_datums(groups, last), model.history.last_angles(groups))
    return with_datums(groups, model.reference, model.prescribed)


def law_values(groups: tuple[Group, ...], instant: float) -> list[np.ndarray]:
    """Return the angles about axes that drivers of groups prescribe at an instant, s, with their whole turns."""
    motions = [group.element.motion for group in groups if measures_angle(group)]
    return list(map(np.asarray, _law_values(motions, np.full((1, 1), instant)))) if motions else []


@compiled(narrow=True, brief=True)
def _law_values(motions: list[AbstractMotion], instant: Float[Numbers, "1 1"]) -> list[Numbers]:
    return [motion(Jet([instant])).coefficients[0] for motion in motions]


def _plain(names: tuple[tuple[str, ...], ...]) -> tuple[tuple[str, ...], ...]:
    """Return grouped names without the prefix of their kind."""
    return tuple(tuple(name.partition(".")[2] for name in members) for members in names)


@lru_cache(maxsize=32)
def _layout(
    bodies: tuple[tuple[tuple[int, ...], ...], ...], row_counts: tuple[int, ...], width: int, body_count: int
) -> tuple[Pattern, Fronts | None]:
    """Return the sparsity pattern of the Jacobian and its elimination order, which are the same for all values."""
    pattern = Pattern.of([Group(None, slots) for slots in bodies], row_counts, width, body_count)
    fronts = elimination(pattern)
    for array in jax.tree.leaves((pattern, fronts)):
        array.setflags(write=False)  # many models share it
    return pattern, fronts


def _row_count(group: Group, pose_type: type[Pose], guess: dict[str, Any]) -> int:
    leaves, structure = jax.tree.flatten(law_left_out(group))
    poses = tuple([(name, np.shape(x)) for name, x in sorted(guess.items())])  # JAX sorts names, too
    return _row_count_of(structure, tuple(map(np.shape, leaves)), pose_type, poses)


@lru_cache(maxsize=1000)
def _row_count_of(
    structure: Any, shapes: tuple[Shape, ...], pose_type: type[Pose], poses: tuple[tuple[str, Shape], ...]
) -> int:
    """Return the number of rows of the residual, which depends on the structure of the group only."""

    def residual(leaves: tuple[Any, ...], guess: dict[str, Any], time: Any) -> Any:
        group = jax.tree.unflatten(structure, leaves)
        return group.residual(pose_at(guess, pose_type), Jet([time])).coefficients[0]

    leaves = tuple(jax.ShapeDtypeStruct(shape, np.float64) for shape in shapes)
    guess = {name: jax.ShapeDtypeStruct(shape, np.float64) for name, shape in poses}
    return jax.eval_shape(residual, leaves, guess, np.zeros((1, 1))).shape[0]


def _size(groups: tuple[Group, ...], positions: Float[Numbers, "component body 1"]) -> float:
    """Return the largest distance among the points of the joints and the bodies of the guess, 1 if there is none."""
    points, sizes = [positions[..., 0]], []
    for group in groups:
        facts = facts_of(type(group.element))
        for name, kind in field_kinds(type(group.element)).items():
            value: Any = getattr(group.element, name)
            if isinstance(value, CurveLaw):
                sizes += [] if isinstance(value.unit, Tracer) else [np.max(value.unit)]
                continue
            if value is None or facts.dimensions[name] != "length" or isinstance(value, Tracer):
                continue
            if kind == "vector" and name.startswith("point"):
                points.append(value[..., 0])
            elif kind == "points":
                points += list(value[..., 0])
            elif kind == "scalar" and facts.signs[name] == "positive":
                sizes.append(np.max(value))
    farthest = np.linalg.norm(np.concatenate(points, axis=1), axis=0).max()
    return float(max([farthest, *sizes])) or 1.0
