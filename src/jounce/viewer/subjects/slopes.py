"""Exact sensitivities of a peak to each parameter, for the sliders of the page."""

from __future__ import annotations

import dataclasses
import html
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jounce.errors import JounceError, check_name
from jounce.kinematics import Motion, solve
from jounce.reporting.peaks import derivative_name, peaks, scalar_outputs
from jounce.settings import under_own_settings
from jounce.trajectory import Expression
from jounce.units.dimensions import ANGLE, LENGTH
from jounce.viewer.page.page import Observer, Page
from jounce.viewer.shapes.recording import Recording
from jounce.viewer.subjects.mechanisms import MechanismSubject

STEPS = {LENGTH: (1e-3, "1 mm"), ANGLE: (np.pi / 180, "1 deg")}
NONE = "none"


@dataclasses.dataclass(frozen=True)
class PeakSlopes:
    """The largest magnitude of a derivative of an output, and its derivative by each parameter.

    Parameters
    ----------
    peak : float
        Magnitude, in the unit.
    unit : str
    instant : float
        Instant of the peak, s.
    slopes : dict of str to float
        Slopes, in units of the peak per SI unit of the parameter.
    """

    peak: float
    unit: str
    instant: float
    slopes: dict[str, float]


@under_own_settings
def peak_slopes(motion: Motion, name: str, order: int) -> PeakSlopes:
    """Return the peak of a derivative of an output, also between the instants, and its slopes.

    The slope of a peak is that of the value at its instant, as the value is stationary in time at a peak; a peak at an
    end of the motion stays at that end.

    Parameters
    ----------
    motion : Motion
        Motion of a driven mechanism with parameters.
    name : str
        Output, with its component if it has any: ``C_x``.
    order : int
        Order of the derivative, up to that of the motion.

    Raises
    ------
    JounceError
        If the output does not exist, or the motion cannot be differentiated.

    Examples
    --------
    >>> import jounce as jn
    >>> found = peak_slopes(jn.solve(jn.load("examples/four_bar.yaml"), order=2), "psi", 1)
    >>> round(found.peak, 4), round(found.slopes["BC"], 2)  # rad/s, and for each meter of the coupler
    (1.5179, -10.69)
    """
    scalars = scalar_outputs(motion)
    check_name("output", name, scalars, JounceError, name="output")
    stem, _ = scalars[name]
    extreme = [peak for peak in peaks(motion) if peak.output == name][order]
    low = abs(extreme.minimum) > abs(extreme.maximum)
    instant, sign = (
        (extreme.minimum_at, np.sign(extreme.minimum)) if low else (extreme.maximum_at, np.sign(extreme.maximum))
    )
    mechanism, first = motion.mechanism, float(motion.time[0])
    times = [first] if instant == first else [first, instant]
    columns = [column for column, (output, _) in scalars.items() if output == stem]
    component = slice(None) if motion.outputs[stem].ndim == 2 else columns.index(name)

    def height(parameters: dict[str, Any]) -> Any:
        perturbed = solve(mechanism.with_parameters(**parameters), times, order=order).outputs[stem]
        return sign * jnp.reshape(perturbed[-1, order], -1)[component].sum()

    given = {k: x for k, x in mechanism.parameters.items() if not isinstance(x, str | Expression)}
    gradient = jax.grad(height)({name: jnp.asarray(mechanism.parameter_values[name], float) for name in given})
    unit, factor = mechanism.shown_units.of(extreme.unit, stem)
    slopes = {name: float(slope) * factor for name, slope in gradient.items()}
    return PeakSlopes(abs(extreme.minimum if low else extreme.maximum) * factor, unit, instant, slopes)


def can_be_differentiated(subject: Any) -> bool:
    """Return whether a subject is a driven mechanism with parameters and outputs."""
    if not isinstance(subject, MechanismSubject) or not subject.parameters:
        return False
    return bool(subject.mechanism.outputs) and not subject.mechanism.initial


class SlopesFolder(Observer):
    """A folder with the changes of a chosen peak for a step of each slider.

    Parameters
    ----------
    page : Page
        The page, in whose current GUI container the folder is created.
    """

    def __init__(self, page: Page):
        self.page = page
        recording: Any = page.recording
        orders = tuple(derivative_name(k) for k in range(recording.order + 1))
        with page.server.gui.add_folder("Slopes of a peak", expand_by_default=False):
            names = (NONE, *scalar_outputs(recording.solution))
            self.output = page.server.gui.add_dropdown("output", names, initial_value=NONE)
            self.order = page.server.gui.add_dropdown("derivative", orders, initial_value=orders[-1])
            self.text = page.server.gui.add_html("")
        for control in (self.output, self.order):
            control.on_update(lambda _: self._ask())

    def on_recording(self, recording: Recording) -> None:
        """Update the folder for a new motion, which may have other orders."""
        orders = tuple(derivative_name(k) for k in range(recording.order + 1))
        if self.order.options != orders:
            self.order.options = orders
        self._ask()

    def _ask(self) -> None:
        """Have the worker compute the slopes, unless a new motion has arrived since."""
        if self.output.value == NONE:
            self.text.content = ""
            return
        recording, name, order = self.page.recording, self.output.value, self.order.options.index(self.order.value)

        def job() -> None:
            if recording is self.page.recording:
                self.text.content = slopes_html(recording, name, order)

        self.text.content = "<em>finding slopes ...</em>"
        self.page.session.run_between_solves(job)


def slopes_html(recording: Any, name: str, order: int) -> str:
    """Return the peak and its change for a step of each parameter, as lines of HTML."""
    motion = recording.solution
    try:
        slopes = peak_slopes(motion, name, order)
    except JounceError as error:
        return html.escape(f"No slopes: {error}")
    lines = [f"peak {slopes.peak:.4g} {slopes.unit} at {slopes.instant:.4g} s"]
    for parameter, slope in slopes.slopes.items():
        allowed = motion.mechanism.dimensions.get(parameter, ())
        percent = 0.01 * float(motion.mechanism.parameter_values[parameter]), "1 %"
        step, label = STEPS.get(allowed[0], percent) if allowed else percent
        lines.append(f"{parameter} +{label}: {slope * step:+.3g} {slopes.unit}")
    return "<br>".join(map(html.escape, lines))
