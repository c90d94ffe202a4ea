"""Modes as the view sees them: a slider chooses one, others change the parameters of the mechanism."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

from jounce.dynamics import equilibrium, linearise
from jounce.mechanism import Mechanism
from jounce.viewer.mechanisms import mechanism_parameters, recorded
from jounce.viewer.recording import Parameter, Recording

__all__ = ["ModesSubject"]

SWING = 2.0  # s, that one takes on the page, however fast it is
MODE, AMPLITUDE = "mode", "amplitude"
GROUP = "Mode"
LARGEST = 0.5  # rad or sizes of the mechanism


class ModesSubject:
    """The modes of a mechanism about its equilibrium, one at a time, in swings of two seconds.

    Parameters
    ----------
    mechanism : Mechanism
        With masses.
    without : sequence of str
        Drivers that are left out.

    Raises
    ------
    JounceError
        If it has no equilibrium, or nothing can move about it.
    """

    no_sliders = ""
    loaded = False  # a mode is a shape: its size is free, and so are its forces

    def __init__(self, mechanism: Mechanism, without: tuple[str, ...] = ()):
        self.mechanism, self.without = mechanism, without
        self.name = f"Modes: {mechanism.title or 'mechanism'}"
        count = len(linearise(equilibrium(mechanism, without=without)).modes)
        own = tuple(dataclasses.replace(each, group="Parameters") for each in mechanism_parameters(mechanism))
        self._keys = self._unused(mechanism, MODE), self._unused(mechanism, AMPLITUDE)
        chosen = Parameter(self._keys[0], 1.0, 1.0, max(float(count), 1.0 + 1e-9), GROUP)
        self.parameters = (chosen, Parameter(self._keys[1], 0.1, 0.01, LARGEST, GROUP), *own)

    def _unused(self, mechanism: Mechanism, name: str) -> str:
        while name in mechanism.parameters:
            name += "_"
        return name

    def solve(self, values: Mapping[str, float], _order: int) -> Recording:
        """Return a mode for some values of the parameters.

        Raises
        ------
        JounceError
            If there is no equilibrium for these values, or joints cannot be closed so far from it.
        """
        own = {name: value for name, value in values.items() if name not in self._keys}
        mode, amplitude = (values[key] for key in self._keys)
        rest = equilibrium(self.mechanism.with_parameters(**own), without=self.without)
        modes = linearise(rest).modes
        number = min(max(round(mode), 1), len(modes))
        found = recorded(modes.motion(number, amplitude, duration=SWING))
        row = modes.rows[number - 1]
        swings = f"{row['frequency']:.4g} Hz, damping ratio {row['damping_ratio']:.3g}"
        told = swings if row["damped_frequency"] else row["kind"]
        notice = f"mode {number} of {len(modes)}: {told}; the equilibrium is {rest.stability}"
        return dataclasses.replace(found, notice=notice, values={**found.values, **values})
