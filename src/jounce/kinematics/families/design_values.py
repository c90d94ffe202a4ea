"""Many designs of one mechanism as one system whose values have a lane for each design, and their assemblies."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jounce.base.modules import with_fields
from jounce.constraints.facts import facts_of, field_kinds, has_other_sign
from jounce.kinematics.families.design_assembly import AssemblyAttempts, assemble_from_guess
from jounce.kinematics.families.varied_tree import VariedTree
from jounce.mechanism import Mechanism, Model
from jounce.mechanism.building.starting_guess import starting_guess
from jounce.mechanism.building.traced import traced_model
from jounce.mechanism.system import POSITION_COMPONENTS, System


def assembled_designs(
    mechanism: Mechanism,
    model: Model,
    names: tuple[str, ...],
    rows: Float[np.ndarray, "design parameter"],
    instant: float,
    tolerance: float,
) -> tuple[VariedTree, AssemblyAttempts]:
    """Assemble designs with different parameters side by side at an instant; return their systems, and the attempts.

    Parameters
    ----------
    mechanism : Mechanism
        Any of the designs.
    model : Model
        Model of an assembled design, whose size is the unit of length.
    names : tuple of str
        Names of the parameters that vary.
    rows : array of shape (designs, parameters)
        Values of the parameters.
    instant : float
        Time, s.
    tolerance : float
        Largest last correction, rad or sizes of the mechanism.
    """

    def design(row: Any) -> Mechanism:
        return mechanism.with_parameters(**dict(zip(names, row, strict=True)))

    def made(row: Any) -> System:
        return _with_values_of(traced_model(design(row), model.length), model)

    def guessed(row: Any) -> Any:
        varied = design(row)
        guess = starting_guess(varied, varied.parameter_values, POSITION_COMPONENTS[varied.space])
        return jax.tree.map(jnp.asarray, guess)

    systems = VariedTree.traced(made, rows)
    guess = {name: np.asarray(x)[..., 0, :] for name, x in jax.vmap(guessed, out_axes=-1)(rows).items()}
    driven = np.array([[name.startswith("drivers.")] for name in model.rows])
    designs = guess, np.full(len(rows), instant), systems.own(slice(None))
    shared, first_design = (model.system, np.asarray(tolerance), driven), jax.tree.map(lambda x: x[..., :1], designs)
    attempts = assemble_from_guess.program(shared, first_design, pose_type=model.pose_type)(designs)
    return systems, attempts._replace(plain=np.asarray(attempts.plain) & ~_unfit(systems, len(rows)))


def joined_designs(common: Model, models: Sequence[Model]) -> VariedTree:
    """Return the systems of designs that were assembled one by one, with their counts of angles about axes."""
    return VariedTree.joined([_with_values_of(model, common) for model in models])


def without_forces(model: Model) -> Model:
    """Return a model without its forces, which do not affect a driven motion."""
    return dataclasses.replace(model, system=with_fields(model.system, forces=()))


def _with_values_of(model: Model, common: Model) -> System:
    """Return the common system with the values of the joints, drivers and outputs of a design."""
    return with_fields(common.system, groups=model.system.groups, outputs=model.system.outputs)


def _unfit(systems: VariedTree, count: int) -> Bool[np.ndarray, " design"]:
    """Return which designs have an invalid value; solved individually, they raise an error in words."""
    invalid, system = np.zeros(count, bool), systems.at(slice(None))
    for group in (*system.groups, *system.outputs):
        signs = facts_of(type(group.element)).signs
        for name, kind in field_kinds(type(group.element)).items():
            value = getattr(group.element, name)
            if kind not in ("scalar", "vector", "points") or value is None:
                continue
            entries = np.asarray(value)
            entries = entries if kind == "vector" else entries.reshape(-1, *entries.shape[-2:])
            entries = np.broadcast_to(entries, (*np.shape(entries)[:-1], count))
            unfit = has_other_sign(signs[name], entries.min(axis=0), np.abs(entries).max(axis=0))  # see `check_value`
            invalid |= (unfit | ~np.isfinite(entries).all(axis=0)).any(axis=0)
    return invalid
