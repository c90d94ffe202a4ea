"""Events of robots: crossings of a value by a joint coordinate, its derivative, or a function of the state."""

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.polynomial.polynomial import polyder, polyval

from jounce.errors import RobotError, check_name
from jounce.execution.chunks import in_chunks
from jounce.integrate.marching.robot_marching import RobotSteps
from jounce.integrate.steps.events import NODES, WIDTHS, AbstractDetector, check_crossing
from jounce.jet.programs.composition import SampleFunction
from jounce.robot.robot import Robot


@dataclasses.dataclass(frozen=True, eq=False)
class JointEvent:
    """A crossing of a value by a joint coordinate of a robot, by its derivative, or by a function of the state.

    A quantity that begins at the value, or touches it and turns back, does not cross it.

    Parameters
    ----------
    of : str or callable
        Name of a joint; or a JAX function of time, q and rates of one sample that returns a number.
    value : float, default 0
        The value that is crossed.
    derivative : int, default 0
        Order of the time derivative of a joint coordinate that crosses the value, up to 4; order 1 with value 0 finds
        turning points.
    direction : int, default 0
        1 for rising crossings only, -1 for falling ones, 0 for both; with increasing time, also in a run backward.
    terminal : bool, default False
        Whether the simulation ends at the first crossing.

    Raises
    ------
    RobotError
        If a value is not valid.

    Examples
    --------
    >>> import jounce as jn
    >>> jn.integrate.JointEvent("shoulder", 0.5, direction=1).terminal
    False
    """

    of: str | Callable[..., Any]
    value: Any = 0.0
    derivative: int = 0
    direction: int = 0
    terminal: bool = False

    def __post_init__(self) -> None:
        if not (isinstance(self.of, str) or callable(self.of)):
            message = "must be the name of a joint, or a function of time, q and rates"
            raise RobotError(message, name="of", value=self.of)
        check_crossing(self, RobotError, derivative=0 if callable(self.of) else 4)


class JointEventDetector(AbstractDetector):
    """The detector of one event of a robot."""

    def __init__(self, event: JointEvent, robot: Robot):
        super().__init__(event)
        self._function: SampleFunction | None = None
        if isinstance(event.of, str):
            check_name("moving joint", event.of, robot.joint_names, RobotError, name="events.of")
        else:
            n, function = len(robot.joint_names), event.of
            self._function = SampleFunction.of(function, jnp.zeros(()), jnp.zeros(n), jnp.zeros(n))
            if self._function.shape != ():
                message = f"the function must return one number, not the shape {self._function.shape}"
                raise RobotError(message, name="events.of")
        self._names = robot.joint_names

    def _values(self, steps: RobotSteps) -> np.ndarray:
        """Return the quantity at the nodes of steps, (steps, nodes)."""
        elapsed = steps.length[:, None] * NODES
        derivative = self.event.derivative
        if isinstance(self.event.of, str):
            series = np.asarray(steps.polynomial.coordinates)[:, :, self._names.index(self.event.of)]
            return _at(series, elapsed, derivative)
        parts = [np.moveaxis(np.asarray(part), -1, 0) for part in steps.polynomial[:2]]
        q, rates = (np.stack([_at(x, elapsed, 0) for x in part], axis=-1) for part in parts)
        time = steps.start[:, None] + elapsed
        n = len(self._names)
        given = time.ravel(), q.reshape(-1, n).T, rates.reshape(-1, n).T

        def chunk(lanes: np.ndarray) -> Any:
            return _at_samples(self._function, *(x[..., lanes] for x in given))

        values = in_chunks(chunk, time.size, WIDTHS)
        return np.asarray(values).reshape(time.shape)

    def detect(self, steps: RobotSteps) -> list[tuple[int, float]]:
        """See `AbstractDetector`."""
        return self._crossings(self._values(steps), ((k, 0.0, 1.0) for k in range(len(steps.length))), steps)


@jax.jit
def _at_samples(function: SampleFunction | None, time: Any, q: Any, rates: Any) -> Any:
    """Return the values of a function of the state at samples; the sample axis is last."""
    assert function is not None
    return function(time, q, rates)


def _at(coefficients: np.ndarray, elapsed: np.ndarray, derivative: int) -> np.ndarray:
    """Return the values of a derivative of polynomials, (steps, order + 1), at times from their beginnings."""
    return np.asarray(polyval(elapsed, polyder(coefficients.T, derivative)[..., None], tensor=False))
