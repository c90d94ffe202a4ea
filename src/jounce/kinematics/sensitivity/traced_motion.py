"""A motion that JAX differentiates, maps or compiles, with the interface of `Motion` and arrays of JAX."""

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, NoReturn

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jounce.base.shapes import Numbers
from jounce.errors import UnsupportedError
from jounce.execution.compilation import compiled
from jounce.jet.derivatives import plain_derivatives
from jounce.jet.turns import shifted_by_turns
from jounce.kinematics.results.motion import Motion
from jounce.kinematics.results.pose_outputs import output_series
from jounce.kinematics.sensitivity.sensitivities import Solved
from jounce.kinematics.status import Status
from jounce.mechanism import AbstractMotionOutput, AbstractOutput, Mechanism, Model
from jounce.mechanism.laws.output_drivers import output_laws
from jounce.mechanism.system import Group

if TYPE_CHECKING:
    import xarray


class TracedMotion(Motion):
    """A motion with values that JAX traces.

    Outputs are arrays of JAX; labeled arrays hold them as ``.data``. `status` is an array of JAX, too: within `jax.jit`
    and `jax.vmap` no error can be raised for it, and a failed instant is NaN and adds nothing to derivatives. There is
    no dataset, and there are neither faults nor change points.
    """

    traced = True
    may_be_traced = ("mechanism",)  # attributes that are searched for traced values

    def __init__(self, mechanism: Mechanism, models: tuple[Model, Model], time: np.ndarray, order: int, solved: Solved):
        driven, model = models
        outputs = list(output_series(model.system.outputs, solved.coordinates, model.pose_type))
        wrapping = iter(solved.continued)
        for k, group in enumerate(model.system.outputs):
            if getattr(group.element, "wraps", ()):
                counted = shifted_by_turns(outputs[k][0], next(wrapping))
                outputs[k] = jnp.concatenate([counted[None], outputs[k][1:]])
        status: Any = solved.status.astype(int)
        values = tuple(map(plain_derivatives, outputs))
        super().__init__(mechanism, model, time, order, (solved.coordinates, values), status, {})
        self.solved_model, self.solved = driven, solved

    def __repr__(self) -> str:
        return f"<Motion of a design that JAX traces, {len(self.time)} instants, order {self.order}>"

    @cached_property
    def dataset(self) -> NoReturn:
        """Not available.

        Raises
        ------
        UnsupportedError
            Always, since a dataset holds numbers.
        """
        raise UnsupportedError("a dataset holds numbers, and JAX traces this motion; take motion.outputs[name]")

    @property
    def actuated(self) -> Mechanism:
        """The mechanism, unless drivers follow from outputs.

        Raises
        ------
        UnsupportedError
            If they do, since the laws found interpolate numbers.
        """
        if output_laws(self.mechanism):
            message = "the laws found go through numbers, and JAX traces this motion; solve it with numbers for them"
            raise UnsupportedError(message, name="motion.actuated")
        return self.mechanism

    def evaluate(self, output: AbstractOutput | AbstractMotionOutput, name: str = "output") -> "xarray.DataArray":
        """Return any output, as an `xarray.DataArray` whose ``.data`` is an array that JAX traces.

        Raises
        ------
        MechanismError
            If the output names a body, joint, driver or force that does not exist, or does not fit the mechanism.
        UnsupportedError
            If it is an angle counted over turns that is not an output of the mechanism.
        """
        if getattr(output, "turning", False) or getattr(output, "wraps", ()):
            message = "an angle that is counted over turns must be an output of a mechanism that JAX traces"
            raise UnsupportedError(message, name=name)
        return super().evaluate(output, name)

    def _counting(self, groups: tuple[Group, ...]) -> tuple[Group, ...]:
        return groups  # the groups of the model have the turns at all instants

    def _continued(
        self,
        group: Group,  # noqa: ARG002 - as in Motion
        coefficients: Float[Numbers, "order component instance time"],
    ) -> Float[Numbers, "order component instance time"]:
        return coefficients

    def _check_finite(self, values: Any, name: str) -> None:
        """Do nothing: traced values cannot be checked."""

    def _coefficients(self, group: Group) -> Float[Numbers, "order component instance time"]:
        return output_series((group,), self.poses[1], self.model.pose_type)[0]

    def _derivatives(
        self, coefficients: Float[Numbers, "order component time"]
    ) -> Float[Numbers, "time derivative *component"]:
        return self._shown(plain_derivatives(coefficients[: self.order + 1]))

    def _shown(self, values: Float[Numbers, "order component time"]) -> Float[Numbers, "time derivative *component"]:
        (shown,) = self._each_shown(values[:, :, None])
        return shown

    def _each_shown(self, values: Float[Numbers, "order component instance time"]) -> Sequence[Any]:
        return _each_shown(values[: self.order + 1], self.status == Status.OK)


@compiled()
def _each_shown(
    values: Float[Numbers, "derivative component instance time"], solved: Bool[Numbers, " time"]
) -> list[Float[Numbers, "time derivative *component"]]:
    """Return each output of a group; compiled, as JAX takes longer to differentiate single operations."""
    values = jnp.where(solved[:, None, None], jnp.transpose(values, (2, 3, 0, 1)), jnp.nan)
    return list(values[..., 0] if values.shape[-1] == 1 else values)
