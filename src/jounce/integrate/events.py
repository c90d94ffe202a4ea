"""Events: instants at which a quantity of the motion crosses a value, found on the polynomials of the steps."""

import dataclasses
import math
from typing import Any

import jax.numpy as jnp
import numpy as np

from jounce.errors import MechanismError
from jounce.jet import Jet
from jounce.kinematics.compilation import compiled
from jounce.mechanism import AbstractOutput
from jounce.mechanism.system import Group

REAL = 1e-7  # of a root's size: an imaginary part below is that of a real root, blurred by rounding


@dataclasses.dataclass(frozen=True)
class Event:
    """A crossing of a value by an output, or by one of its derivatives.

    Parameters
    ----------
    output : AbstractOutput
        Any output, also one of a user's own: its value is a function on the jets of bodies.
    value : float, default 0
        That is crossed, in the unit of the output (of its derivative).
    derivative : int, default 0
        Which time derivative crosses it: 1 with value 0 finds turning points.
    component : int, default 0
        Of a vector output.
    direction : int, default 0
        1 for rising crossings only, -1 for falling ones, 0 for both; as time goes on, also in a run backward.
    terminal : bool, default False
        Whether the simulation ends at the first crossing.

    Raises
    ------
    MechanismError
        If a value is not valid.

    Examples
    --------
    >>> import jounce as jn
    >>> jn.Event(jn.AngleOutput("rod"), direction=1).terminal
    False
    """

    output: AbstractOutput
    value: float = 0.0
    derivative: int = 0
    component: int = 0
    direction: int = 0
    terminal: bool = False

    def __post_init__(self):
        if not isinstance(self.output, AbstractOutput):
            message = "an event watches an output of the poses of bodies, such as AngleOutput"
            raise MechanismError(message, name="output", value=self.output)
        if not (isinstance(self.value, int | float) and math.isfinite(self.value)):
            raise MechanismError("must be a finite number", name="value", value=self.value)
        for name in ("derivative", "component"):
            number = getattr(self, name)
            if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number <= 4:
                raise MechanismError("must be a whole number from 0 to 4", name=name, value=number)
        if self.direction not in (-1, 0, 1):
            raise MechanismError("must be -1, 0 or 1", name="direction", value=self.direction)


@compiled("pose_type")
def output_series(group: Group, coordinates: dict[str, Any], pose_type: type) -> Any:
    """Return the Taylor coefficients of outputs, (order + 1, components, instances, batch)."""
    pose = pose_type.from_coordinates({name: Jet(tuple(c)) for name, c in coordinates.items()})
    return jnp.stack(group.evaluate(pose).dense().coefficients)


def crossings(event: Event, series: np.ndarray, lengths: np.ndarray) -> list[tuple[int, float]]:
    """Return the crossings in steps, each as the number of the step and the time from its beginning.

    Parameters
    ----------
    event : Event
        What is looked for.
    series : array of shape (order + 1, steps)
        Taylor coefficients of the watched component.
    lengths : array of shape (steps,)
        Of the steps, s; negative backward in time.
    """
    for _ in range(event.derivative):
        series = series[1:] * np.arange(1.0, len(series))[:, None]
    scaled = series * lengths ** np.arange(len(series))[:, None]  # the step goes from 0 to 1
    scaled[0] -= event.value
    found = []
    reachable = np.abs(scaled[0]) <= np.abs(scaled[1:]).sum(axis=0)
    for k in np.flatnonzero(reachable):
        polynomial = np.polynomial.Polynomial(scaled[:, k])
        slope = polynomial.deriv()
        for root in _real_roots(scaled[:, k]):
            rising = slope(root) * np.sign(lengths[k])
            if 0 <= root < 1 and rising != 0 and event.direction * rising >= 0:
                found.append((int(k), float(root * lengths[k])))
    return sorted(found, key=lambda x: (x[0], abs(x[1])))


def _real_roots(coefficients: np.ndarray) -> np.ndarray:
    """Return the real roots of a polynomial in and about [0, 1], each corrected by Newton's method."""
    size = np.abs(coefficients).max()
    if not size:
        return np.zeros(0)
    last = np.flatnonzero(np.abs(coefficients) > 1e-17 * size)[-1]  # what is below rounding has no root near
    polynomial = np.polynomial.Polynomial(coefficients[: last + 1])
    roots = polynomial.roots() if last else np.zeros(0)
    real = np.real(roots[np.abs(np.imag(roots)) <= REAL * np.maximum(1.0, np.abs(roots))])
    slope = polynomial.deriv()
    for _ in range(2):
        rate = slope(real)
        real = real - np.where(rate != 0, polynomial(real) / np.where(rate == 0, 1.0, rate), 0.0)
    return np.unique(real[(real > -1e-12) & (real < 1 + 1e-12)])
