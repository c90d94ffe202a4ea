"""Many designs of one mechanism as one system whose values have a lane for each, and where each is assembled."""

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
    systems : VariedTree
        The systems of all, a lane for each.
    guess : dict of str to array
        Starting guess of the coordinates of all bodies, (..., bodies, designs).
    """

    def __init__(
        self, mechanism: Mechanism, model: Model, names: tuple[str, ...], rows: Float[np.ndarray, "design parameter"]
    ):
        self.mechanism, self.model, self.names, self.rows = mechanism, without_forces(model), names, rows

        def made(row: Any) -> System:
            return self._with_values_of(traced_model(self.design(row), model.length))

        def guess(row: Any) -> Any:
            varied = self.design(row)
            guess = starting_guess(varied, varied.parameter_values, POSITION_COMPONENTS[varied.space])
            return jax.tree.map(jnp.asarray, guess)

        self.systems = VariedTree.traced(made, rows)
        self.guess = {name: np.asarray(x)[..., 0, :] for name, x in jax.vmap(guess, out_axes=-1)(rows).items()}

    @classmethod
    def of_models(
        cls, mechanism: Mechanism, models: Sequence[Model], names: tuple[str, ...], rows: np.ndarray
    ) -> "Designs":
        """Return designs that were assembled one by one, with the angles about axes that each counts."""
        self = object.__new__(cls)
        self.mechanism, self.model, self.names, self.rows = mechanism, without_forces(models[0]), names, rows
        self.systems = VariedTree.joined([self._with_values_of(model) for model in models])
        return self

    def _with_values_of(self, model: Model) -> System:
        """Return the common system with the values of the joints, drivers and outputs of a design."""
        return with_fields(self.model.system, groups=model.system.groups, outputs=model.system.outputs)

    def design(self, row: Any) -> Mechanism:
        """Return the mechanism with the values of a design."""
        return self.mechanism.with_parameters(**dict(zip(self.names, row, strict=True)))

    def assembled(self, instant: float, tolerance: float) -> AssemblyAttempts:
        """Assemble all designs at an instant, s, to a tolerance, rad or sizes of the mechanism."""
        count, model = len(self.rows), self.model
        driven = np.array([[name.startswith("drivers.")] for name in model.rows])
        designs = self.guess, np.full(count, instant), self.systems.own(slice(None))
        shared = model.system, np.asarray(tolerance), driven
        one = jax.tree.map(lambda x: x[..., :1], designs)
        return assemble_from_guess.program(shared, one, pose_type=model.pose_type)(designs)

    def unfit(self) -> Bool[np.ndarray, " design"]:
        """Tell which designs have a value that no mechanism may have: they are refused in words when solved alone."""
        bad, system = np.zeros(len(self.rows), bool), self.systems.at(slice(None))
        for group in (*system.groups, *system.outputs):
            signs = facts_of(type(group.element)).signs
            for name, kind in field_kinds(type(group.element)).items():
                value = getattr(group.element, name)
                if kind not in ("scalar", "vector", "points") or value is None:
                    continue
                entries = np.asarray(value)
                entries = entries if kind == "vector" else entries.reshape(-1, *entries.shape[-2:])
                entries = np.broadcast_to(entries, (*np.shape(entries)[:-1], len(bad)))
                bad |= _unfit(signs[name], entries)
        return bad


def without_forces(model: Model) -> Model:
    """Return a model without its forces, on which a driven motion does not depend."""
    return dataclasses.replace(model, system=with_fields(model.system, forces=()))


def _unfit(sign: str, value: Float[np.ndarray, "component instance design"]) -> Bool[np.ndarray, " design"]:
    """Tell which designs have a value that does not fit a field; see `check_value`."""
    unfit = has_other_sign(sign, value.min(axis=0), np.abs(value).max(axis=0))
    return (unfit | ~np.isfinite(value).all(axis=0)).any(axis=0)
