"""The phase lag of backward differences, their drawback in section 7 of the paper: measured, and by theory.

In real time only samples of the past are known. A backward difference of the acceleration over a step h is the mean of
the jerk over that step, and a second difference is the mean of the jounce over two steps, weighted by a triangle. So
the differences multiply a harmonic with angular frequency w by ``sinc(w h / 2) exp(-i w h / 2)`` and by its square:
all harmonics are late by h / 2 and by h, and smaller.
"""

import dataclasses

import numpy as np
from jaxtyping import Float

from jounce.mechanism import Mechanism
from jounce.papers.sommer_2024.cases import CYCLE, QUANTITIES, STEP, ValidationCase, normalized_rmse
from jounce.papers.sommer_2024.differences import backward_difference

STEPS = (STEP, 0.02, 0.05, 0.1)  # s; each divides the cycle
Series = Float[np.ndarray, " time"]
FINE = 2000  # instants of the cycle for the spectrum of the explicit solution


@dataclasses.dataclass(frozen=True)
class Lag:
    """Jerk or jounce by backward differences over one cycle, and by the simulation.

    Attributes
    ----------
    quantity : str
        ``"jerk"`` or ``"jounce"``.
    step : float
        Time step, s.
    time : array of shape (time,)
        Instants of one cycle, s.
    explicit, simulated, difference : array of shape (time,)
        The quantity by the explicit solution, by the simulation and by backward differences of its acceleration.
    error : float
        Theoretical normalized RMSE of backward differences with this step, from the spectrum of the explicit solution.
    """

    quantity: str
    step: float
    time: Series
    explicit: Series
    simulated: Series
    difference: Series
    error: float

    @property
    def expected(self) -> float:
        """Theoretical delay of the differences, s: h / 2 for the jerk, h for the jounce."""
        return self.step * (0.5 if self.quantity == "jerk" else 1.0)

    def late(self, computed: Series) -> float:
        """Return the delay of a quantity, s, in the largest harmonic of the explicit solution."""
        expected = np.fft.rfft(self.explicit)
        n = 1 + int(np.argmax(np.abs(expected[1:])))
        return -float(np.angle(np.fft.rfft(computed)[n] / expected[n])) * CYCLE / (2 * np.pi * n)

    def measured_error(self, computed: Series) -> float:
        """Return the normalized RMSE of a quantity."""
        return float(normalized_rmse(computed[:, None], self.explicit[:, None])[0])


def lags(case: ValidationCase, mechanism: Mechanism, step: float) -> list[Lag]:
    """Return jerk and jounce of one cycle with the lag of their backward differences.

    Parameters
    ----------
    case : ValidationCase
        The simulation.
    mechanism : Mechanism
        The mechanism of the simulation.
    step : float
        Time step that divides the cycle, s.
    """
    count = round(CYCLE / step)
    time = step * np.arange(count + 2)  # two samples before the first difference
    computed, expected = case.simulated(mechanism, time), case.explicit(mechanism, time)
    dense = case.explicit(mechanism, CYCLE / FINE * np.arange(FINE))
    frequency = 2 * np.pi / CYCLE * np.arange(FINE // 2 + 1)
    transfer = np.sinc(frequency * step / (2 * np.pi)) * np.exp(-0.5j * frequency * step)
    all_lags = []
    for derivative, quantity in ((1, "jerk"), (2, "jounce")):
        k = 1 + QUANTITIES.index(quantity)
        spectrum = np.fft.rfft(dense[:, k]) / FINE
        loss = np.abs((1 - transfer**derivative) * spectrum) ** 2
        error = float(np.sqrt(loss[0] + 2 * loss[1:].sum()) / np.abs(expected[2:, k]).max())
        difference = backward_difference(computed[:, 2], step, derivative=derivative)[2 - derivative :]
        all_lags.append(Lag(quantity, step, time[2:], expected[2:, k], computed[2:, k], difference, error))
    return all_lags
