"""Motions of mechanisms with values traced by JAX, as functions of these values: design derivatives of any order.

Along a motion the residuals vanish with all their time derivatives. A change of a design value thus moves the bodies by
a series d with ``J d = -r``: J is the series of the Jacobian, and r the change of the residuals with the bodies held.
These linear equations are triangular in the orders, and have on their diagonal the same matrix that gives the time
derivatives. Their transpose gives gradients with a single solution for any number of values.

The path from the starting guess, steps, branches and whole turns are not functions of the design. The solver decides
them outside of the traced code, as for plain numbers.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.errors import ConcretizationTypeError
from jaxtyping import Float

from jounce.base.modules import with_fields
from jounce.base.shapes import Numbers
from jounce.errors import AssemblyError, MechanismError, MobilityError, SolveError, UnsupportedError
from jounce.execution.compilation import Compiled, compiled
from jounce.jet import Jet
from jounce.jet.algebra import stacked
from jounce.kinematics.continuation.instant_program import of_design
from jounce.kinematics.results.motion import Motion
from jounce.kinematics.sensitivity.jacobian_series import jacobian_series, solved_series
from jounce.kinematics.status import Status
from jounce.mechanism import Mechanism, Model, with_output_drivers
from jounce.mechanism.building.builder import grouped_elements
from jounce.mechanism.building.preconditions import holds_tracer
from jounce.mechanism.building.traced import Angles, Part, angles_of, template, traced_model
from jounce.mechanism.laws.output_drivers import output_laws, without_output_laws
from jounce.mechanism.system import System, movable
from jounce.mechanism.transmissions.axis_angles import measures_angle
from jounce.mechanism.user_code import holds_users_code, users_code
from jounce.rigid import PlanarPose, SpatialPose
from jounce.rigid.pose import Pose
from jounce.settings import called_back
from jounce.trajectory import Expression

Solve = Callable[[Mechanism, bool], Motion]
Values = tuple[Any, ...]
"""Values that JAX traces in a mechanism, in the order of `template`."""


class Solved(NamedTuple):
    """The arrays of a motion from its solver.

    Attributes
    ----------
    coordinates : dict of str to array
        Taylor coefficients of the coordinates of all bodies, the ground first, time last.
    status : array of shape (time,)
        Outcomes as floating-point numbers, which may be traced.
    length : array of shape ()
        Size of the mechanism, m.
    angles : Angles
        Angles about axes of the model that was solved.
    driven : tuple of array of shape (instances, 1)
        Angles about axes of the joints and drivers in the model of the drivers; they differ if outputs are held to
        laws.
    continued : tuple of array of shape (components, instances, time)
        Values of wrapped angles among the outputs, made continuous, for each group of them.
    """

    coordinates: dict[str, Any]
    status: Any
    length: Any
    angles: Angles
    driven: Part
    continued: tuple[Any, ...]


def differentiable_motion(
    mechanism: Mechanism, instants: Float[np.ndarray, " time"], levels: int, solve: Solve
) -> tuple[Solved, tuple[Model, Model]]:
    """Return the motion of a mechanism, and its models, as functions of the values that JAX traces in it.

    The first model is the one that is solved; it holds outputs to their laws if drivers follow from them. The second
    has the drivers, for their forces. Both are the same if no driver follows from an output.

    Parameters
    ----------
    mechanism : Mechanism
        A mechanism with traced values.
    instants : array of shape (time,)
        Time, s.
    levels : int
        Number of Taylor coefficients of a solution.
    solve : callable
        Solves a mechanism of plain numbers at the instants, strictly or not. Its errors are raised if JAX knows the
        numbers; otherwise a motion without a start is NaN.
    """
    (given, make_mechanism), driven = template(mechanism), _builder(mechanism, with_output_drivers)
    reported = _builder(mechanism, without_output_laws) if output_laws(mechanism) else driven
    values = tuple(x if x.dtype == np.float64 else x.astype(float) for x in given)
    shapes = solved_shapes(mechanism, len(instants), levels)

    def on_the_host(strict: bool, values: Values) -> Solved:
        motion = solve(make_mechanism(values), strict)
        if np.any(motion.status == Status.OK):  # otherwise drivers that follow from outputs are unknown
            return _solved(motion)
        return _failed(shapes, motion.status)

    @jax.custom_jvp
    def solution(values: Values) -> Solved:
        if not any(isinstance(value, Tracer) for value in values):
            return jax.tree.map(jnp.asarray, on_the_host(True, values))
        solve_one = partial(solved_or_failed, partial(on_the_host, False), shapes)
        solve_each = partial(_one_by_one, solve_one, shapes, [np.ndim(value) for value in values])
        return called_back(solve_each, shapes, values, vmap_method="broadcast_all")

    @solution.defjvp
    def along(primals: tuple[Values], tangents: tuple[Values]) -> tuple[Solved, Solved]:
        (values,), (changes,) = primals, tangents
        solved = solution(values)
        no_change = jax.tree.map(jnp.zeros_like, solved)
        return solved, no_change._replace(coordinates=driven.change(values, changes, solved, instants))

    solved = solution(values)
    model = driven(values, solved.length, solved.angles, solved.coordinates)
    if reported is driven:
        return solved, (model, model)
    angles = solved.angles._replace(angle=(solved.driven, *solved.angles.angle[1:]))
    return solved, (model, reported(values, solved.length, angles, solved.coordinates))


def solved_shapes(mechanism: Mechanism, count: int, levels: int) -> Solved:
    """Return the shapes of the arrays of a solution."""

    def of(*shape: int) -> jax.ShapeDtypeStruct:
        return jax.ShapeDtypeStruct(shape, np.float64)

    bodies = len(mechanism.bodies) + 1
    if mechanism.space == "planar":
        coordinates = {"position": of(levels, 2, bodies, count), "angle": of(levels, bodies, count)}
        return Solved(coordinates, of(count), of(), Angles(((), (), ()), ((), ())), (), ())
    coordinates = {
        "position": of(levels, 3, bodies, count),
        "quaternion": of(levels, 4, bodies, count),
        "angular_velocity": of(levels - 1, 3, bodies, count),
    }
    parts = [groups for groups, _ in grouped_elements(with_output_drivers(mechanism))]
    (driven, _), *_ = grouped_elements(without_output_laws(mechanism))
    measuring = [[group.instances for group in groups if measures_angle(group)] for groups in (*parts, driven)]
    angle: Any = tuple(tuple(of(n, 1) for n in part) for part in measuring)
    near: Any = tuple(tuple(of(n, count) for n in part) for part in measuring[1:3])
    wrapping = [group for group in parts[2] if getattr(group.element, "wraps", ())]
    continued = tuple(of(len(group.element.wraps), group.instances, count) for group in wrapping)
    return Solved(coordinates, of(count), of(), Angles(angle[:3], near), angle[3], continued)


def _failed(shapes: Solved, status: Any) -> Solved:
    """Return a solution with all values NaN except for the status."""
    unknown = jax.tree.map(lambda x: np.full(x.shape, np.nan), shapes)
    return unknown._replace(status=np.broadcast_to(np.asarray(status, float), shapes.status.shape))


def solved_or_failed(solve: Callable[[Values], Solved], shapes: Solved, values: Values) -> Solved:
    """Return the solution of a design; only its status if the motion has no start."""
    try:
        return solve(values)
    except (AssemblyError, MobilityError, SolveError) as error:
        return _failed(shapes, getattr(error, "status", None) or Status.NOT_REACHED)


def given_instants(mechanism: Mechanism, time: Any, read: Callable[..., np.ndarray]) -> Float[np.ndarray, " time"]:
    """Return the given instants, or the mechanism's own, which must not depend on values that JAX traces."""
    try:
        return read(mechanism.time if time is None else time, mechanism.parameter_values)
    except ConcretizationTypeError:
        message = "the instants depend on values that JAX traces, and are held where a motion is differentiated"
        raise UnsupportedError(f"{message}; give them", name="time") from None


def _solved(motion: Motion) -> Solved:
    """Return the arrays of a motion that derivatives need, as NumPy arrays."""
    coordinates = jax.tree.map(np.asarray, dict(motion.poses[1]))
    counted = motion.forces, motion.counted_outputs
    angles, driven = angles_of(motion.solved_model, counted), angles_of(motion.model, counted).angle[0]
    near = jax.tree.map(lambda x: np.broadcast_to(x, (x.shape[0], len(motion.time))), angles.near)
    length, angles = np.float64(motion.model.length), angles._replace(near=near)
    return Solved(coordinates, motion.status.astype(float), length, angles, driven, motion.continued_outputs)


def _one_by_one(solve: Callable[[Values], Solved], shapes: Solved, sizes: Sequence[int], values: Values) -> Solved:
    """Solve one design, or many with the designs on the first axes; JAX calls this function back.

    `sizes` are the numbers of axes of the values of one design.
    """
    batch = np.shape(values[0])[: np.ndim(values[0]) - sizes[0]]
    if not batch:
        return solve(values)
    solutions = [solve(tuple(np.asarray(value)[index] for value in values)) for index in np.ndindex(*batch)]
    return jax.tree.map(lambda shape, *xs: np.stack(xs).reshape(*batch, *shape.shape), shapes, *solutions)


def first_of(coordinates: Mapping[str, Any]) -> dict[str, Any]:
    """Return the coordinates at the first instant, (..., bodies, 1)."""
    return {name: coordinates[name][0, ..., :1] for name in coordinates if name != "angular_velocity"}


def check_not_redundant(model: Model) -> None:
    """Raise MechanismError if constraints are redundant, by the rank or by more equations than unknowns."""
    rows, columns = model.system.shape
    if rows > columns or model.system.rank is not None:
        raise MechanismError(
            "gradients of mechanisms with redundant constraints are not supported yet; use joints without "
            "the equations that follow from others, which jn.mobility lists",
            name="joints",
        )


class _Builder:
    """Builder of the model of a mechanism from its traced values: operation by operation, or compiled once.

    Parameters
    ----------
    mechanism : Mechanism
        A mechanism with traced values.
    made_of : callable
        Transforms the mechanism before the model is built.
    again : bool
        Whether the builder is used again, so that compilation pays.

    Attributes
    ----------
    change : callable
        Returns the change of the coordinates of a motion with the values of the design.
    """

    def __init__(self, mechanism: Mechanism, made_of: Callable[[Mechanism], Mechanism], *, again: bool):
        (_, self._made), self._made_of, self._models = template(mechanism), made_of, {}
        self._make, self.change = self._numbers, self._change
        if again:
            self._make = jax.jit(self._numbers, static_argnames="counted")
            self.change = Compiled(self._change, ())

    def __call__(self, values: Values, length: Any, angles: Angles | None, coordinates: Any) -> Model:
        """Return the model; see `traced_model`, and `numbers`."""
        numbers, indices = self.numbers(values, length, angles, coordinates)
        return self.model(numbers, indices, angles is not None)

    def numbers(self, values: Values, length: Any, angles: Angles | None, coordinates: Any) -> tuple[list[Any], Any]:
        """Return the numbers of a system that depend on traced values, and the indices of these leaves.

        `coordinates` are the Taylor coefficients of a motion, whose first position is used. They are passed whole,
        since JAX takes longer to slice an array than to call a program with it.
        """
        numbers = self._make(values, length, angles, coordinates, counted=angles is not None)
        return numbers, self._models[angles is not None][2]

    def model(self, numbers: Sequence[Any], indices: tuple[int, ...], counted: bool) -> Model:
        """Return the model with given numbers."""
        model, leaves, _, structure = self._models[counted]
        replaced = dict(zip(indices, numbers, strict=True))
        all_leaves = [replaced.get(k, leaf) for k, leaf in enumerate(leaves)]
        return dataclasses.replace(model, system=jax.tree.unflatten(structure, all_leaves))

    def _numbers(self, values: Values, length: Any, angles: Any, coordinates: Any, *, counted: bool) -> list[Any]:
        model = traced_model(self._made_of(self._made(values)), length, angles, first_of(coordinates))
        check_not_redundant(model)
        leaves, structure = jax.tree.flatten(model.system)
        indices = tuple(k for k, leaf in enumerate(leaves) if isinstance(leaf, Tracer))
        fixed = [None if k in indices else leaf for k, leaf in enumerate(leaves)]
        system = with_fields(model.system, groups=(), forces=(), outputs=(), column_scale=np.ones(1))  # nothing traced
        template_model = dataclasses.replace(model, system=system, guess={}, reference={})
        self._models[counted] = template_model, fixed, indices, structure
        return [leaves[k] for k in indices]

    def _change(self, values: Values, changes: Values, solved: Solved, instants: Any) -> dict[str, Any]:
        """Return the Taylor coefficients of the change of the coordinates of a motion with the values of the design."""
        regular = solved.status == int(Status.OK)
        coordinates = {name: _where(regular, c, c[..., :1]) for name, c in solved.coordinates.items()}
        instants = jnp.where(regular, instants, instants[0])
        first_position = {name: x[:1, ..., :1] for name, x in coordinates.items() if name != "angular_velocity"}
        shift = jax.tree.map(jnp.zeros_like, first_position)
        if any(solved.angles.angle):  # the angles are counted from the first position, which moves too
            system, slope, indices = _linear(self, (solved.length, None), values, changes, first_position, shift)
            changed = _moved(system, slope, indices, first_position, instants[:1])
            shift = {name: changed[name] for name in first_position}
        system, slope, indices = _linear(self, (solved.length, solved.angles), values, changes, first_position, shift)
        change = _moved(system, slope, indices, coordinates, instants)
        return {name: _where(regular, c, jnp.zeros_like(c)) for name, c in change.items()}


MOST_BUILDERS = 16
_builders: dict[Any, _Builder] = {}


def _builder(mechanism: Mechanism, made_of: Callable[[Mechanism], Mechanism]) -> _Builder:
    """Return the builder for a mechanism, shared by mechanisms that differ in parameters only.

    If joints are new objects in each call, the builder is not compiled, as this would happen every time.
    """
    numbers = {name: value for name, value in mechanism.parameters.items() if not isinstance(value, Tracer)}
    parameters = tuple((n, x if isinstance(x, str | Expression) else float(x)) for n, x in numbers.items())
    fields = [field.name for field in dataclasses.fields(mechanism) if field.name != "parameters"]
    given = {name: getattr(mechanism, name) for name in fields}
    if holds_tracer(given) or (own := _users_code(mechanism)) is None:
        return _Builder(mechanism, made_of, again=False)
    key = (made_of, tuple(map(id, given.values())), tuple(mechanism.parameters), parameters, own)
    if key not in _builders:
        while len(_builders) >= MOST_BUILDERS:
            _builders.pop(next(iter(_builders)))
        _builders[key] = _Builder(mechanism, made_of, again=True)  # holds the objects whose ids are in the key
    return _builders[key]


def _users_code(mechanism: Mechanism) -> tuple[Any, ...] | None:
    """Return a key of the users' code in a mechanism; None if it holds values that JAX traces."""
    if not holds_users_code(element for part in mechanism.elements.values() for element in part.values()):
        return ()
    return users_code([group for groups, _ in grouped_elements(mechanism, initial=True) for group in groups])


def _where(regular: Any, values: Any, others: Any) -> Any:
    return jnp.where(regular.reshape(*[1] * (values.ndim - 1), -1), values, others)


def _linear(
    built: _Builder, known: tuple[Any, Angles | None], values: Values, changes: Values, first: Any, shift: Any
) -> tuple[System, list[Any], tuple[int, ...]]:
    """Return the system of a model, the changes of its numbers, and the indices of those that change."""
    indices: list[tuple[int, ...]] = []

    def numbers(values: Values, first: Any) -> list[Any]:
        made, which = built.numbers(values, *known, first)
        indices.append(which)
        return made

    primal, slope = jax.jvp(numbers, (values, first), (changes, shift))
    system = built.model(primal, indices[0], known[1] is not None).system
    leaves, structure = jax.tree.flatten(system)
    numbered = jax.tree.unflatten(structure, range(len(leaves)))
    numbers_used = jax.tree.leaves(with_fields(numbered, forces=(), outputs=()))  # leaves that residuals need
    changes_at = dict(zip(indices[0], slope, strict=True))
    changing = [(position, changes_at[k]) for position, k in enumerate(numbers_used) if k in changes_at]
    motion_system = with_fields(system, forces=(), outputs=())
    return motion_system, [change for _, change in changing], tuple(position for position, _ in changing)


def _moved(
    system: System, slope: list[Any], indices: tuple[int, ...], coordinates: dict[str, Any], instants: Any
) -> dict[str, Any]:
    pose_type = PlanarPose if "angle" in coordinates else SpatialPose
    return _change_along(system, slope, coordinates, instants, pose_type=pose_type, which=indices)


@compiled("pose_type", "which")
def _change_along(
    system: System,
    slope: Sequence[Numbers],
    coordinates: dict[str, Numbers],
    instants: Float[Numbers, " batch"],
    pose_type: type[Pose],
    which: tuple[int, ...],
) -> dict[str, Any]:
    """Return the change of the coordinates of a motion with the numbers of a system; `which` are its leaves."""
    order = len(coordinates["position"]) - 1
    pose = pose_type.from_coordinates({name: Jet(tuple(c)) for name, c in coordinates.items()})
    pose = movable(jax.lax.optimization_barrier(pose))  # otherwise XLA recomputes it wherever it is used
    time = Jet.variable(instants[None], order)
    leaves = jax.tree.leaves(system)

    def residual(numbers: Sequence[Any]) -> Any:
        return stacked(of_design(system, dict(zip(which, numbers, strict=True))).residual(pose, time))

    _, missing = jax.jvp(residual, ([leaves[k] for k in which],), (list(slope),))
    rates = solved_series(system, jacobian_series(system, pose, time), -missing)
    parts = [system.coordinates(level, pose.shifts) for level in rates]
    shift, turn = (Jet(tuple(part)) for part in zip(*parts, strict=True))
    return {name: stacked(jet) for name, jet in pose.varied(shift, turn).coordinates().items()}
