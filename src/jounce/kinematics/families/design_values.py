"""Many designs of one mechanism as one system whose values have a lane for each, and where each is put together."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Bool, Float, Int

from jounce.constraints.facts import facts_of, field_kinds, has_other_sign
from jounce.execution.compilation import compiled
from jounce.jet import Jet
from jounce.kinematics.assembly.gauss_newton import MAX_STEPS
from jounce.kinematics.continuation.jacobian_factors import factored
from jounce.mechanism import Mechanism, Model
from jounce.mechanism.builder import pose_at, starting_guess
from jounce.mechanism.system import POSITION_COMPONENTS, System
from jounce.mechanism.traced import traced_model
from jounce.modules import with_fields
from jounce.rigid.pose import Pose
from jounce.shapes import Numbers

HALVINGS = 12
CLEARLY_REGULAR = 1e-6  # smallest pivot over the largest of a Jacobian that is looked at no closer

Coordinates = dict[str, Float[Numbers, "_ ... _"]]


class Designs:
    """Designs that differ in parameters, as one system: values that differ have one entry for each, last.

    Parameters
    ----------
    mechanism : Mechanism
        Any of them.
    model : Model
        Of one that was put together: sizes are measured by it.
    names : tuple of str
        Parameters in which they differ.
    rows : array of shape (designs, parameters)
        Their values.

    Attributes
    ----------
    guess : dict of str to array
        Starting guess of the coordinates of all bodies, (..., bodies, designs).
    """

    def __init__(
        self, mechanism: Mechanism, model: Model, names: tuple[str, ...], rows: Float[np.ndarray, "design parameter"]
    ):
        self.mechanism, self.model, self.names, self.rows = mechanism, model, names, rows
        fixed: list[Any] = []

        def one(row: Any) -> tuple[list[Any], Any]:
            varied = self.design(row)
            found = traced_model(varied, model.length).system
            leaves = jax.tree.leaves((found.groups, found.outputs))
            fixed[:] = [None if isinstance(leaf, Tracer) else leaf for leaf in leaves]
            guess = starting_guess(varied, varied.parameter_values, POSITION_COMPONENTS[varied.space])
            return [leaf for leaf in leaves if isinstance(leaf, Tracer)], jax.tree.map(jnp.asarray, guess)

        values, guess = jax.vmap(one, out_axes=-1)(rows)
        self.guess = {name: np.asarray(x)[..., 0, :] for name, x in guess.items()}
        self._set(fixed, [np.asarray(value)[..., 0, :] for value in values])

    @classmethod
    def of_models(
        cls, mechanism: Mechanism, models: Sequence[Model], names: tuple[str, ...], rows: np.ndarray
    ) -> "Designs":
        """Return designs that were put together one by one, with the angles about axes that each counts."""
        self = object.__new__(cls)
        self.mechanism, self.model, self.names, self.rows = mechanism, models[0], names, rows
        whole = [jax.tree.leaves((model.system.groups, model.system.outputs)) for model in models]
        columns = [[np.asarray(leaf, float) for leaf in column] for column in zip(*whole, strict=True)]
        same = [all(np.array_equal(leaf, column[0]) for leaf in column) for column in columns]
        fixed = [leaf if held else None for leaf, held in zip(whole[0], same, strict=True)]
        self._set(fixed, [np.concatenate(c, axis=-1) for c, held in zip(columns, same, strict=True) if not held])
        return self

    def _set(self, fixed: list[Any], values: list[np.ndarray]) -> None:
        self._fixed, self._values = fixed, values
        system = self.model.system
        self._structure = jax.tree.structure((system.groups, system.outputs))

    def design(self, row: Any) -> Mechanism:
        """Return the mechanism with the values of a design."""
        return self.mechanism.with_parameters(**dict(zip(self.names, row, strict=True)))

    def system(self, lanes: Int[np.ndarray, " lane"]) -> System:
        """Return the system of some designs, a lane for each."""
        values = iter(self._values)
        leaves = [next(values)[..., lanes] if leaf is None else leaf for leaf in self._fixed]
        groups, outputs = jax.tree.unflatten(self._structure, leaves)
        return with_fields(self.model.system, groups=groups, outputs=outputs, forces=())

    @cached_property
    def varied(self) -> tuple[int, ...]:
        """Which leaves of their system have an entry for each lane."""
        groups, outputs = jax.tree.unflatten(self._structure, [leaf is None for leaf in self._fixed])
        held = jax.tree.map(lambda _: False, with_fields(self.model.system, forces=()))
        return tuple(np.flatnonzero(jax.tree.leaves(with_fields(held, groups=groups, outputs=outputs))).tolist())

    def unfit(self) -> Bool[np.ndarray, " design"]:
        """Tell which designs have a value that no mechanism may have: they are refused in words when solved alone."""
        lanes = np.arange(len(self.rows))
        bad = np.zeros(len(lanes), bool)
        for group in (*self.system(lanes).groups, *self.system(lanes).outputs):
            signs = facts_of(type(group.element)).signs
            for name, kind in field_kinds(type(group.element)).items():
                value = getattr(group.element, name)
                if kind not in ("scalar", "vector") or value is None:
                    continue
                entries = value if kind == "vector" else np.asarray(value)[None]
                entries = np.broadcast_to(entries, (*np.shape(entries)[:-1], len(lanes)))
                bad |= _unfit(signs[name], entries)
        return bad


def _unfit(sign: str, value: Float[np.ndarray, "component instance design"]) -> Bool[np.ndarray, " design"]:
    """Tell which designs have a value that does not fit a field; see `check_value`."""
    unfit = has_other_sign(sign, value.min(axis=0), np.abs(value).max(axis=0))
    return (unfit | ~np.isfinite(value).all(axis=0)).any(axis=0)


class Trials(NamedTuple):
    """How designs could be put together, each from its own starting guess.

    Attributes
    ----------
    coordinates : dict of str to array
        Of all bodies, (..., bodies, designs).
    plain : array of bool, shape (designs,)
        Whether there is nothing to it but Gauss-Newton: all is closed, no body turned by more than half a turn, and the
        Jacobian is regular by far. What is not plain is looked at alone.
    """

    coordinates: Coordinates
    plain: Bool[Numbers, " design"]


@compiled("pose_type")
def assemble_from_guess(
    system: System,
    guess: Coordinates,
    instant: Float[Numbers, " design"],
    tolerance: Float[Numbers, ""],
    driven: Bool[Numbers, "row 1"],
    pose_type: type[Pose],
) -> Trials:
    """Put designs together side by side, by the steps that each would take alone; see `assembly.assemble_from_guess`.

    Parameters
    ----------
    system : System
        A lane for each design.
    guess : dict of str to array
        Coordinates of all bodies, (..., bodies, designs).
    instant : array of shape (designs,)
        s.
    tolerance : float
        Of the last correction, rad or sizes of the mechanism.
    driven : array of bool, shape (rows, 1)
        Which rows are those of drivers.
    pose_type : type
        PlanarPose or SpatialPose.
    """
    time = Jet([instant[None]])
    unscaled = with_fields(system, row_scale=np.ones(system.row_scale.shape))

    def gaps(pose: Any, scale: Any) -> Any:
        return jnp.sqrt(jnp.sum((scale * unscaled.residual(pose, time).coefficients[0]) ** 2, axis=0))

    def scale_at(pose: Any) -> Any:
        entries = jnp.abs(unscaled.entries(pose, time))
        padded = jnp.concatenate([entries, jnp.zeros((1, entries.shape[-1]))])
        largest = jnp.max(padded[system.pattern.places], axis=(1, 2))
        return 1 / jnp.where((largest > 0) & jnp.isfinite(largest), largest, 1.0)

    def going(state: Any) -> Any:
        return jnp.any(state[1]) & (state[2] < MAX_STEPS)

    def correct(state: Any) -> Any:
        coordinates, moving, count = state
        pose = pose_at(coordinates, pose_type)
        scale = scale_at(pose)
        step = factored(system, pose, time).solve(-system.residual(pose, time).coefficients[0])
        size = jnp.max(jnp.abs(step), axis=0)
        step, now = step * jnp.minimum(1.0, 0.5 / jnp.maximum(size, 1e-300))[None], gaps(pose, scale)

        def displaced(part: Any) -> Any:
            return pose.displaced(*system.coordinates(step * part[None], pose.shifts))

        def better(part: Any) -> Any:
            return (gaps(displaced(part), scale) < now) | (size <= tolerance)

        def halve(state: Any) -> Any:
            part, good, tried = state
            part = jnp.where(good, part, 0.5 * part)
            return part, good | better(part), tried + 1

        whole = jnp.ones_like(size)
        part, good, _ = jax.lax.while_loop(
            lambda s: jnp.any(moving & ~s[1]) & (s[2] < HALVINGS), halve, (whole, better(whole), jnp.zeros((), int))
        )
        found = {name: jet.coefficients[0] for name, jet in displaced(part).coordinates().items()}
        take = moving & good
        coordinates = {name: jnp.where(_wide(take, x), found[name], x) for name, x in coordinates.items()}
        return coordinates, take & (size > tolerance), count + 1

    lag = jnp.where(driven, jnp.abs(unscaled.residual(pose_at(guess, pose_type), time).coefficients[0]), 0.0)
    start = (guess, jnp.isfinite(instant), jnp.zeros((), int))
    coordinates, moving, _ = jax.lax.while_loop(going, correct, start)
    pose = pose_at(coordinates, pose_type)
    scale = scale_at(pose)
    open_by = jnp.max(jnp.abs(scale * unscaled.residual(pose, time).coefficients[0]), axis=0)
    plain = ~moving & (open_by <= jnp.maximum(1e3 * tolerance, 1e-9)) & (jnp.max(lag, axis=0) < np.pi)
    plain &= factored(system, pose, time).pivot_ratio() > CLEARLY_REGULAR
    if "angle" in coordinates:
        plain &= jnp.max(jnp.abs(coordinates["angle"] - guess["angle"]), axis=0) < np.pi
    return Trials(coordinates, plain)


def _wide(lanes: Any, values: Any) -> Any:
    return lanes.reshape(*[1] * (values.ndim - 1), -1)
