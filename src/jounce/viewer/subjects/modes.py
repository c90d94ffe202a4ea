"""Modes in the viewer: a slider chooses one, and others change the parameters of the mechanism."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping
from typing import Any

from jounce.dynamics import equilibrium, linearize
from jounce.mechanism import Mechanism
from jounce.mechanism.mechanism import GROUND
from jounce.robot import Robot
from jounce.viewer.shapes.appearance import Appearance
from jounce.viewer.shapes.recording import Parameter, Recording
from jounce.viewer.subjects.mechanisms import mechanism_parameters, recorded

SWING = 2.0  # period on the page, s, whatever the frequency
MODE, AMPLITUDE = "mode", "amplitude"
GROUP = "Mode"
LARGEST = 0.5  # rad or sizes of the mechanism


class ModesSubject:
    """The modes of a mechanism or a robot about its equilibrium, one at a time, with a period of two seconds.

    Parameters
    ----------
    subject : Mechanism or Robot
        A mechanism or robot with masses.
    settings
        Settings of `jounce.equilibrium`: omitted drivers, or locked joints of a robot.
    appearance : Appearance, optional
        Shapes of the bodies, by default from the joints.

    Raises
    ------
    JounceError
        If the subject has no equilibrium, or nothing can move about it.
    """

    no_sliders = ""
    loaded = False  # a mode has an arbitrary amplitude, and thus arbitrary forces

    def __init__(self, subject: Mechanism | Robot, settings: Mapping[str, Any], appearance: Appearance | None = None):
        self.subject, self.settings, self.appearance = subject, settings, appearance
        robot = isinstance(subject, Robot)
        self.title, self.ground = (subject.name, subject.base) if robot else (subject.title, GROUND)
        self.name = f"Modes: {self.title or 'mechanism'}"
        count = len(linearize(equilibrium(subject, **settings)).modes)
        parameters = () if robot else mechanism_parameters(subject)
        names = {parameter.name for parameter in parameters}
        self._keys = _unused(names, MODE), _unused(names, AMPLITUDE)
        chosen = Parameter(self._keys[0], 1.0, 1.0, max(float(count), 1.0 + 1e-9), GROUP, whole=True)
        grouped = (dataclasses.replace(item, group="Parameters") for item in parameters)
        self.parameters = (chosen, Parameter(self._keys[1], 0.1, 0.01, LARGEST, GROUP), *grouped)

    def solve(self, values: Mapping[str, float], _order: int) -> Recording:
        """Return a mode for some values of the parameters.

        Raises
        ------
        JounceError
            If there is no equilibrium for these values, or joints cannot be closed at this amplitude.
        """
        parameters = {name: value for name, value in values.items() if name not in self._keys}
        mode, amplitude = (values[key] for key in self._keys)
        subject = self.subject.with_parameters(**parameters) if isinstance(self.subject, Mechanism) else self.subject
        state = equilibrium(subject, **self.settings)
        modes = linearize(state).modes
        number = min(max(round(mode), 1), len(modes))
        motion = modes.motion(number, amplitude, duration=SWING)
        recording = recorded(motion, self.appearance, self.title, self.ground)
        row = modes.rows[number - 1]
        swings = f"{row['frequency']:.4g} Hz, damping ratio {row['damping_ratio']:.3g}"
        kind = swings if row["damped_frequency"] else row["kind"]
        notice = f"mode {number} of {len(modes)}: {kind}; the equilibrium is {state.stability}"
        return dataclasses.replace(recording, notice=notice, values={**recording.values, **values})


def _unused(names: Collection[str], name: str) -> str:
    while name in names:
        name += "_"
    return name
