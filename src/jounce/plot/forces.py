"""Figures of forces: reactions of joints and forces of drivers, energies, and the balance of power."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from jounce.dynamics import kinetic_energy, potential_energy, power_balance, stored_energy
from jounce.dynamics.inverse.outputs import components as loads
from jounce.dynamics.masses import check_loads
from jounce.errors import MechanismError, check_name
from jounce.kinematics import Motion
from jounce.plot.drawings.geometry import skeleton
from jounce.plot.figure import draw_columns, finish
from jounce.plot.labels import scale_of, unit_label
from jounce.plot.style import BLUE, GREEN, ORANGE, PURPLE, VERMILION, blank_figure, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NOTHING = 1e-9  # fraction of the largest force times the size: smaller moments are rounding
LINES = {
    "kinetic": BLUE,
    "potential": VERMILION,
    "springs": GREEN,
    "drivers": GREEN,
    "forces": ORANGE,
    "friction": PURPLE,
    "total": "#000000",
}
WORDS = {"drivers": "put in by drivers", "forces": "put in by forces", "friction": "put in by friction",
         "kinetic": "gain of kinetic energy", "potential": "gain of potential energy"}  # fmt: skip
PANEL = (6.4, 1.9)  # inches


def draw_reactions(motion: Motion, names: Sequence[str] | None = None) -> Figure:
    """Draw the reactions of joints, the forces of drivers and the applied forces, with their rates.

    Parameters
    ----------
    motion : Motion
        Motion of a mechanism with masses or applied forces, solved to order 2 at least.
    names : sequence of str, optional
        Names of joints, drivers and forces; all by default.

    Returns
    -------
    matplotlib.figure.Figure
        One column for each force, and one for each moment that a joint carries, in the global frame and on the second
        body of the joint; rows are force, yank, second rate, ...

    Raises
    ------
    MechanismError
        If a name does not exist, no body has a mass, or the order is too low.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.plot import draw_reactions
    >>> press = jn.solve(jn.load("examples/press.yaml"), [0.0, 0.01, 0.02], order=2)
    >>> figure = draw_reactions(press, ["main", "motor"])
    >>> [axes.get_title(loc="left") for axes in figure.axes]
    ['main', 'motor (driver)']
    """
    mechanism = motion.mechanism
    check_loads(mechanism, "joint")
    if motion.order < 2:
        message = "forces need accelerations; solve to order 2 or more"
        raise MechanismError(message, name="order", value=motion.order)
    valid_names = [*mechanism.joints, *mechanism.drivers, *mechanism.forces]
    for name in names or ():
        check_name("joint, driver or force", name, valid_names, MechanismError, name="output")
    selected = names or valid_names
    reactions: dict[str, Any] = {}
    for name in mechanism.joints:
        if name in selected:
            reactions |= {name: loads.JointForceOutput(name), f"{name} (moment)": loads.JointTorqueOutput(name)}
    for name, driver in mechanism.drivers.items():
        if name in selected:
            reactions[f"{name} (driver)"] = (
                loads.DriverTorqueOutput if loads.is_turning(driver) else loads.DriverForceOutput
            )(name)
    for name, force in mechanism.forces.items():
        if name in selected:
            reactions[f"{name} (applied)"] = (
                loads.AppliedForceOutput if force.unit == "N" else loads.AppliedTorqueOutput
            )(name)
    columns = {name: (output, motion.evaluate(output).values) for name, output in reactions.items()}
    sizes = {name: _largest(values[:, 0]) for name, (_, values) in columns.items()}
    moments = {name for name, output in reactions.items() if isinstance(output, loads.JointTorqueOutput)}
    threshold = NOTHING * skeleton(mechanism).size * max(size for name, size in sizes.items() if name not in moments)
    significant = {name: column for name, column in columns.items() if name not in moments or sizes[name] > threshold}
    return draw_columns(motion, significant)


def _largest(values: Float[np.ndarray, "..."]) -> float:
    return float(np.max(np.abs(values), initial=0.0, where=np.isfinite(values)))


def draw_energy(motion: Motion) -> Figure:
    """Draw the energies of a mechanism: kinetic, gravitational, elastic, and total.

    Parameters
    ----------
    motion : Motion
        Motion of a mechanism with masses, solved to order 1 at least.

    Returns
    -------
    matplotlib.figure.Figure
        The energies, without that of springs if there are none.

    Raises
    ------
    MechanismError
        If no body has a mass, or the order is too low.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.plot import draw_energy
    >>> press = jn.solve(jn.load("examples/press.yaml"), [0.0, 0.01, 0.02], order=1)
    >>> [line.get_label() for line in draw_energy(press).axes[0].get_lines()][:2]
    ['kinetic', 'potential']
    """
    energies = {
        "kinetic": kinetic_energy(motion).total.values[:, 0],
        "potential": potential_energy(motion).values[:, 0],
    }
    stored = stored_energy(motion).values
    if _largest(stored):
        energies["springs"] = stored
    energies["total"] = np.sum(list(energies.values()), axis=0)
    with style():
        figure = blank_figure(PANEL[0], 2.9, motion.mechanism.title)
        axes = figure.subplots()
        _draw_lines(axes, motion, energies, "energy", ("J", 0))
        axes.set_xlabel("time  $t$  (s)")
        figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=len(energies))
    return figure


def draw_power(motion: Motion) -> Figure:
    """Draw the power balance of a mechanism, with its rates.

    Parameters
    ----------
    motion : Motion
        Motion of a mechanism with masses or applied forces, solved to order 2 at least.

    Returns
    -------
    matplotlib.figure.Figure
        Power of drivers and applied forces, and rates of kinetic and potential energy; rows are derivatives.

    Raises
    ------
    MechanismError
        If no body has a mass and no force is applied, or the order is too low.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.plot import draw_power
    >>> press = jn.solve(jn.load("examples/press.yaml"), [0.0, 0.01, 0.02], order=3)
    >>> [axes.get_ylabel() for axes in draw_power(press).axes]
    ['power  (W)', 'rate  ($10^{3}$ W/s)']
    """
    balance = power_balance(motion)
    rows = min(balance.sizes["derivative"], max(motion.order - 1, 1))
    kinds = [name for name in WORDS if _largest(balance[name].values[:, 0])] or list(WORDS)  # all if none has power
    with style():
        figure = blank_figure(PANEL[0], PANEL[1] * rows + 0.9, motion.mechanism.title)
        panels = np.atleast_1d(figure.subplots(rows, 1, sharex=True))
        for order, axes in enumerate(panels):
            powers = {name: balance[name].values[:, order] for name in kinds}
            word = ("power", "rate", "second rate", "third rate")[order] if order < 4 else f"rate {order}"
            _draw_lines(axes, motion, powers, word, ("W", order))
        panels[-1].set_xlabel("time  $t$  (s)")
        figure.align_ylabels()
        handles, labels = panels[0].get_legend_handles_labels()
        legends = [WORDS[label] for label in labels]
        figure.legend(handles, legends, loc="outside lower center", ncols=min(len(legends), 2))
    return figure


def _draw_lines(
    axes: Any, motion: Motion, lines: dict[str, Float[np.ndarray, " time"]], word: str, unit: tuple[str, int]
) -> None:
    """Draw quantities over time in one panel."""
    values = np.stack(list(lines.values()), axis=-1)
    exponent = scale_of(values)
    values = values * 10.0**-exponent
    for k, name in enumerate(lines):
        dashes = (0, (4, 1.5)) if name == "total" else "-"
        axes.plot(motion.time, values[:, k], color=LINES[name], linestyle=dashes, label=name)
    finish(axes, motion, values)
    axes.set_ylabel(f"{word}  ({unit_label(*unit, exponent)})")
