"""Many designs of one mechanism as one system whose values have a lane for each, and where each is assembled."""

import dataclasses
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Bool, Float, Int

from jounce.base.modules import with_fields
from jounce.constraints.facts import facts_of, field_kinds, has_other_sign
from jounce.kinematics.families.design_assembly import AssemblyAttempts, assemble_from_guess
from jounce.mechanism import Mechanism, Model
from jounce.mechanism.building.starting_guess import starting_guess
from jounce.mechanism.building.traced import traced_model
from jounce.mechanism.system import POSITION_COMPONENTS, System


class Designs:
    """Designs that differ in parameters, as one system: values that differ have one entry for each, last.

    Parameters
    ----------
    mechanism : Mechanism
        Any of them.
    model : Model
        Of one that was assembled: sizes are measured by it.
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
        self.mechanism, self.model, self.names, self.rows = mechanism, without_forces(model), names, rows
        fixed: list[Any] = []

        def one(row: Any) -> tuple[list[Any], Any]:
            varied = self.design(row)
            system = traced_model(varied, model.length).system
            leaves = jax.tree.leaves((system.groups, system.outputs))
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
        """Return designs that were assembled one by one, with the angles about axes that each counts."""
        self = object.__new__(cls)
        self.mechanism, self.model, self.names, self.rows = mechanism, without_forces(models[0]), names, rows
        whole = [jax.tree.leaves((model.system.groups, model.system.outputs)) for model in models]
        differing = differing_leaves(whole)
        fixed = [leaf if joined is None else None for leaf, joined in zip(whole[0], differing, strict=True)]
        self._set(fixed, [joined for joined in differing if joined is not None])
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
        return with_fields(self.model.system, groups=groups, outputs=outputs)

    def own(self, lanes: slice | Int[np.ndarray, " lane"]) -> dict[int, np.ndarray]:
        """Return the values in which some designs differ, by the index of their leaf of the system, a lane for each."""
        return {k: value[..., lanes] for k, value in zip(self._varied, self._values, strict=True)}

    @cached_property
    def _varied(self) -> tuple[int, ...]:
        """Which leaves of their system have an entry for each lane."""
        groups, outputs = jax.tree.unflatten(self._structure, [leaf is None for leaf in self._fixed])
        constant = jax.tree.map(lambda _: False, self.model.system)
        return tuple(np.flatnonzero(jax.tree.leaves(with_fields(constant, groups=groups, outputs=outputs))).tolist())

    def assembled(self, instant: float, tolerance: float) -> AssemblyAttempts:
        """Assemble all designs at an instant, s, to a tolerance, rad or sizes of the mechanism."""
        count, model = len(self.rows), self.model
        driven = np.array([[name.startswith("drivers.")] for name in model.rows])
        designs = self.guess, np.full(count, instant), self.own(slice(None))
        shared = model.system, np.asarray(tolerance), driven
        one = jax.tree.map(lambda x: x[..., :1], designs)
        return assemble_from_guess.program(shared, one, pose_type=model.pose_type)(designs)

    def unfit(self) -> Bool[np.ndarray, " design"]:
        """Tell which designs have a value that no mechanism may have: they are refused in words when solved alone."""
        lanes = np.arange(len(self.rows))
        bad = np.zeros(len(lanes), bool)
        for group in (*self.system(lanes).groups, *self.system(lanes).outputs):
            signs = facts_of(type(group.element)).signs
            for name, kind in field_kinds(type(group.element)).items():
                value = getattr(group.element, name)
                if kind not in ("scalar", "vector", "points") or value is None:
                    continue
                entries = np.asarray(value)
                entries = entries if kind == "vector" else entries.reshape(-1, *entries.shape[-2:])
                entries = np.broadcast_to(entries, (*np.shape(entries)[:-1], len(lanes)))
                bad |= _unfit(signs[name], entries)
        return bad


def differing_leaves(trees: Sequence[Sequence[Any]]) -> list[np.ndarray | None]:
    """Return the leaves of some trees, lane after lane; None for those that are the same in all of them."""
    columns = [[np.asarray(leaf, float) for leaf in column] for column in zip(*trees, strict=True)]
    same = [all(np.array_equal(leaf, column[0]) for leaf in column) for column in columns]
    return [None if fixes else np.concatenate(c, axis=-1) for c, fixes in zip(columns, same, strict=True)]


def without_forces(model: Model) -> Model:
    """Return a model without its forces, on which a driven motion does not depend."""
    return dataclasses.replace(model, system=with_fields(model.system, forces=()))


def _unfit(sign: str, value: Float[np.ndarray, "component instance design"]) -> Bool[np.ndarray, " design"]:
    """Tell which designs have a value that does not fit a field; see `check_value`."""
    unfit = has_other_sign(sign, value.min(axis=0), np.abs(value).max(axis=0))
    return (unfit | ~np.isfinite(value).all(axis=0)).any(axis=0)
