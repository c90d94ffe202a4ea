"""The seven simulations as cases of validation: mechanisms, explicit solutions, and the errors between the two."""

import dataclasses
from importlib.resources import as_file, files
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from jounce.io import load
from jounce.kinematics import solve
from jounce.mechanism import Mechanism
from jounce.papers.sommer_2024 import geometry
from jounce.papers.sommer_2024.differences import REACH, central_difference

MECHANISMS = files("jounce.papers.sommer_2024") / "mechanisms"
QUANTITIES = ("velocity", "acceleration", "jerk", "jounce")  # derivatives 1 to 4 of the output angle
CYCLE = 2.0  # s
STEP = 0.01  # s
TOLERANCE = 1e-12
TOLERANCES = tuple(float(f"1e{k}") for k in range(-14, -3))
Times = Float[np.ndarray, " time"]
Derivatives = Float[np.ndarray, "time 5"]
Table = Float[np.ndarray, "time column"]
Columns = Float[np.ndarray, " column"]
STEPS = (1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2, 1e-1)  # s; each divides the cycle


@dataclasses.dataclass(frozen=True)
class ValidationCase:
    """One driven mechanism with an explicit solution of one of its angles.

    Parameters
    ----------
    name : str
        Name in `errors.csv`, and of the mechanism file.
    title : str
        Title in figures.
    output : str
        Name of the output angle in the mechanism file.
    form : callable
        Explicit solution of the output angle, from `geometry`.
    """

    name: str
    title: str
    output: str
    form: geometry.Form

    def load(self) -> Mechanism:
        """Return the mechanism, loaded from its file in the package."""
        with as_file(MECHANISMS / f"{self.name}.yaml") as path:
            return load(path)

    def simulated(self, mechanism: Mechanism, time: Times, **settings: Any) -> Derivatives:
        """Return the output angle and its derivatives to jounce by `jounce.solve`, shape (time, 5), rad."""
        return solve(mechanism, time, order=len(QUANTITIES), **settings).outputs[self.output]

    def explicit(self, mechanism: Mechanism, time: Times) -> Derivatives:
        """Return the output angle and its derivatives from the explicit solution, without the solver."""
        return geometry.evaluate(self.form, time, mechanism.parameter_values, order=len(QUANTITIES))


CRANK = "Inverted slider-crank"
VALIDATION_CASES = {
    case.name: case
    for case in (
        ValidationCase("four_bar", "Four-bar", "psi", geometry.four_bar),
        ValidationCase("inverted_slider_crank_slide", f"{CRANK}, slide driver", "psi", geometry.inverted_slider_crank),
        ValidationCase(
            "inverted_slider_crank_distance", f"{CRANK}, distance driver", "psi", geometry.inverted_slider_crank
        ),
        ValidationCase("rsur", "RSUR", "psi", geometry.rsur),
        ValidationCase("rssr", "RSSR", "psi", geometry.rsur),
        ValidationCase("rspu_distance", "RSPU, distance driver", "theta", geometry.rspu),
        ValidationCase("rspu_slide", "RSPU, slide driver", "theta", geometry.rspu),
    )
}


HISTORIES = {2: "jerk", 3: "jounce"}  # figures of the four-bar and their quantity
TOLERANCE_SWEEPS = {  # figures and their cases; the sweep of time steps is the next figure
    4: ("four_bar",),
    6: ("inverted_slider_crank_slide", "inverted_slider_crank_distance"),
    10: ("rsur", "rssr"),
    12: ("rspu_distance", "rspu_slide"),
}
STEP_SWEEPS = {figure + 1: names for figure, names in TOLERANCE_SWEEPS.items()}


@dataclasses.dataclass(frozen=True)
class Cycle:
    """A simulation beside its explicit solution, over one cycle at nominal settings.

    Attributes
    ----------
    time : array of shape (time,)
        Instants, s.
    simulated, explicit : array of shape (time, 5)
        The output angle and its derivatives to jounce, rad to rad/s^4.
    """

    time: Times
    simulated: Derivatives
    explicit: Derivatives

    @property
    def rmse(self) -> Float[np.ndarray, "4"]:
        """Root-mean-square errors of velocity to jounce, rad/s to rad/s^4, shape (4,)."""
        return rmse(self.simulated, self.explicit)[1:]

    @property
    def peak(self) -> Float[np.ndarray, "4"]:
        """Largest absolute values of velocity to jounce, rad/s to rad/s^4, shape (4,)."""
        return np.max(np.abs(self.explicit), axis=0)[1:]

    @property
    def normalized_rmse(self) -> Float[np.ndarray, "4"]:
        """Root-mean-square errors divided by the largest absolute values, shape (4,)."""
        return normalized_rmse(self.simulated, self.explicit)[1:]


def rmse(computed: Table, expected: Table) -> Columns:
    """Return the root-mean-square error over time, the first axis."""
    return np.sqrt(np.mean((computed - expected) ** 2, axis=0))


def normalized_rmse(computed: Table, expected: Table) -> Columns:
    """Return the root-mean-square error over time divided by the largest absolute value (Sommer 2024, section 4)."""
    return rmse(computed, expected) / np.max(np.abs(expected), axis=0)


def nominal_time() -> Times:
    """Return one cycle of 2 s in steps of 0.01 s, both ends included: shape (201,)."""
    return STEP * np.arange(round(CYCLE / STEP) + 1)


def nominal_cycle(case: ValidationCase, mechanism: Mechanism) -> Cycle:
    """Return one cycle, simulated at an assembly tolerance of 1e-12, and explicit."""
    time = nominal_time()
    simulated = case.simulated(mechanism, time, tolerance=TOLERANCE)
    return Cycle(time, simulated, case.explicit(mechanism, time))


def tolerance_error(case: ValidationCase, mechanism: Mechanism, tolerance: float) -> Float[np.ndarray, "4"]:
    """Return the normalized RMSE of velocity to jounce, with positions only as accurate as an assembly tolerance."""
    time = nominal_time()
    computed = case.simulated(mechanism, time, tolerance=tolerance, refine=False)
    return normalized_rmse(computed, case.explicit(mechanism, time))[1:]


def step_errors(case: ValidationCase, mechanism: Mechanism, step: float) -> dict[str, Float[np.ndarray, "2"]]:
    """Return the normalized RMSE of jerk and jounce at one time step: simulated, and by differences of order 2 and 4.

    All three use the same instants over one whole cycle.
    """
    time, centers = stencil_instants(step)
    computed = case.simulated(mechanism, time)
    expected = case.explicit(mechanism, time[centers])[:, 3:]
    errors = {"simulation": normalized_rmse(computed[centers, 3:], expected)}
    for name, accuracy in (("second order", 2), ("fourth order", 4)):
        estimates = [
            central_difference(computed[:, 2], step, derivative=derivative, accuracy=accuracy, at=centers)
            for derivative in (1, 2)
        ]
        errors[name] = normalized_rmse(np.stack(estimates, axis=1), expected)
    return errors


def stencil_instants(step: float) -> tuple[Times, Int[np.ndarray, " centers"]]:
    """Return increasing instants, and the indices of those with two neighbors on either side, `step` apart.

    The instants are a grid of that step over one cycle. If the grid is too long, only the neighborhoods of the nominal
    201 instants remain: the mean square of an error over the cycle is the same.
    """
    if 2 * REACH * step < STEP:
        centers = REACH * step + nominal_time()
        time = (centers[:, None] + step * np.arange(-REACH, REACH + 1)).ravel()
        return time, np.arange(REACH, len(time), 2 * REACH + 1)
    count = round(CYCLE / step) + 1
    return step * np.arange(count + 2 * REACH), np.arange(REACH, REACH + count)
