"""Forces of joints as functions of time and state: feedback, expressions, motion laws and constants."""

import abc
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.modules import Module, field
from jounce.base.shapes import ArrayLike, Numbers
from jounce.errors import JounceError, RobotError, check_name
from jounce.jet import Jet
from jounce.jet.programs.composition import SampleFunction
from jounce.robot.model.arguments import floats
from jounce.trajectory.joint_trajectory import JointTrajectory
from jounce.trajectory.labels import in_order
from jounce.trajectory.laws.user_laws import read_laws
from jounce.trajectory.motion import AbstractMotion
from jounce.units.expression import Expression

RATE = "_d1"  # as columns of files name rates


class _Expressed(Module):
    """A force given by an expression of time and of coordinates and rates, by the names of joints."""

    expression: Expression = field(static=True)
    names: tuple[str, ...] = field(static=True)

    def __call__(self, time: Any, q: Any, rate: Any) -> Any:
        values = {name: q[k] for k, name in enumerate(self.names)}
        values |= {name + RATE: rate[k] for k, name in enumerate(self.names)}
        return self.expression.evaluate({"t": time, **values})


class _ForceOfTime(Module):
    """A force as a function of time, given by a motion law."""

    law: AbstractMotion

    def __call__(self, time: Any, *_: Any) -> Any:
        return self.law(Jet([time])).coefficients[0]


class AbstractJointLaws(Module):
    """Forces of all joints, for whole batches at once."""

    @property
    @abc.abstractmethod
    def changing(self) -> bool:
        """Whether the forces depend on time or state."""

    @abc.abstractmethod
    def __call__(
        self, time: Float[Numbers, "1 batch"], q: Float[Numbers, "n batch"], rate: Float[Numbers, "n batch"]
    ) -> Float[Numbers, "n batch"]:
        """Return the forces of the joints, N m or N."""


class JointLaws(AbstractJointLaws):
    """Forces of all joints; see `joint_laws`.

    Attributes
    ----------
    constant : array of shape (coordinates,)
        Constant forces.
    whole : callable or None
        Function that returns the forces of all joints at once.
    single : tuple of callable
        Functions that return the force of one joint each.
    columns : tuple of int
        Numbers of these joints.
    """

    constant: Any
    whole: SampleFunction | None
    single: tuple[Any, ...]
    columns: tuple[int, ...] = field(static=True)

    @property
    def changing(self) -> bool:
        """Whether the forces depend on time or state."""
        return self.whole is not None or bool(self.single)

    def __call__(
        self, time: Float[Numbers, "1 batch"], q: Float[Numbers, "n batch"], rate: Float[Numbers, "n batch"]
    ) -> Float[Numbers, "n batch"]:
        """Return the forces of the joints, N m or N."""
        values = jnp.broadcast_to(jnp.asarray(self.constant)[:, None], q.shape)
        if self.whole is not None:
            return values + self.whole(time[0], q, rate)
        rows = {k: law(time[0], q, rate) for k, law in zip(self.columns, self.single, strict=True)}
        if not rows:
            return values
        shape = time[0].shape
        return jnp.stack([jnp.broadcast_to(rows[k], shape) if k in rows else values[k] for k in range(len(values))])


GivenLaws = ArrayLike | Callable[..., Any] | Mapping[str, Any] | JointTrajectory | AbstractJointLaws
"""Forces of joints: constants, a function of time and state, or one law for each joint by its name."""


def joint_laws(names: Sequence[str], user_laws: GivenLaws | None, argument: str = "torque") -> AbstractJointLaws:
    """Return the checked laws of the joint forces that a user gives.

    Parameters
    ----------
    names : sequence of str
        Names of the joints, in the order of q.
    user_laws : None, array_like of shape (n,), callable, mapping, JointTrajectory or AbstractJointLaws
        None for no forces; constants; a function of time, q and rates of one sample, by operations of JAX, that
        returns n forces; or one law for each joint that has a force: a number, an expression of ``t``, of the names of
        joints and of their rates as ``NAME_d1``, a motion law, or a function that returns one force.
    argument : str
        Name of the argument, for messages.

    Raises
    ------
    RobotError
        If a joint does not exist, or a law is not valid or returns another shape.
    """
    count, nothing = len(names), np.zeros(len(names))
    if user_laws is None:
        return JointLaws(nothing, None, (), ())
    if isinstance(user_laws, AbstractJointLaws):
        return user_laws
    if isinstance(user_laws, JointTrajectory):
        user_laws = user_laws.laws
    if callable(user_laws):
        return JointLaws(nothing, _read(user_laws, count, (count,), argument), (), ())
    if not isinstance(user_laws, Mapping):
        constant = np.asarray(floats(argument, in_order(argument, user_laws, names, RobotError)))
        if constant.shape != (count,) or not np.isfinite(constant).all():
            message = f"must hold {count} finite numbers, one for each joint, or be a function, or a mapping of names"
            raise RobotError(message, name=argument, value=constant.tolist())
        return JointLaws(constant, None, (), ())
    laws: dict[int, Any] = {}
    for name, law in user_laws.items():
        check_name("moving joint", name, names, RobotError, name=argument)
        laws[names.index(name)] = _single(law, tuple(names), f"{argument}.{name}")
    for k in [k for k, law in laws.items() if isinstance(law, float)]:
        nothing[k] = laws.pop(k)
    return JointLaws(nothing, None, tuple(laws.values()), tuple(laws))


def _single(law: Any, names: tuple[str, ...], location: str) -> Any:
    if isinstance(law, str):
        try:
            expression = Expression(law)
            expression.check({"t", *names, *(name + RATE for name in names)})
        except JounceError as error:
            error.name = location
            raise
        return _Expressed(expression, names)
    if isinstance(law, AbstractMotion):
        return _ForceOfTime(read_laws(law))
    if callable(law):
        return _read(law, len(names), (), location)
    value = float(floats(location, law)) if np.ndim(law) == 0 else np.nan
    if not np.isfinite(value):
        message = "must be a finite number, an expression, a motion law or a function of time, q and rates"
        raise RobotError(message, name=location, value=law)
    return value


def _read(function: Callable[..., Any], count: int, shape: tuple[int, ...], location: str) -> SampleFunction:
    return read_forces(function, location, shape, (jnp.zeros(()), jnp.zeros(count), jnp.zeros(count)))


def read_forces(
    function: Callable[..., Any],
    location: str,
    shape: tuple[int, ...],
    state: Sequence[Any],
    arguments: str = "time, q and rates",
) -> SampleFunction:
    """Return the program that a function of a user computes now, checked.

    Parameters
    ----------
    function : callable
        Function of arrays of one sample.
    location : str
        Argument that gave the function, for messages.
    shape : tuple of int
        Shape that the function must return.
    state : sequence of array
        Arguments; only their shapes and types matter.
    arguments : str
        Description of the arguments, for messages.

    Raises
    ------
    RobotError
        If JAX cannot trace the function, or it returns another shape.
    """
    try:
        sampled = SampleFunction.of(function, *state)
    except TypeError as error:
        message = f"must be a function of {arguments}, by operations of JAX: {str(error).splitlines()[0]}"
        raise RobotError(message, name=location) from error
    if sampled.shape != shape:
        noun = f"an array of {shape[0]} forces" if shape else "one number"
        raise RobotError(f"the function must return {noun}, the shape {shape}, not {sampled.shape}", name=location)
    return sampled
