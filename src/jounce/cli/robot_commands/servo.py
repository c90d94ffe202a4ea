"""The command that writes the motion of drivers at the rate of a servo drive, from position to jerk."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from jounce.base.activity import Count
from jounce.cli.mechanism_commands.mechanisms import outcome
from jounce.cli.options import (
    NO_TABLE,
    PLAIN,
    PLAIN_MECHANISM,
    Heading,
    MechanismReading,
    TableOutput,
    errors_about,
    positive_quantity,
    spare_inputs,
)
from jounce.errors import JounceError, check_name
from jounce.reporting.terminal import print_text, show_peaks

if TYPE_CHECKING:
    from jounce.kinematics import Motion
    from jounce.mechanism import Mechanism
    from jounce.units.shown_units import ShownUnits

PER_TIME = (("time", -1),)


def servo(
    file: Path,
    /,
    *,
    rate: str = "1 kHz",
    order: int = 3,
    driver: list[str] | None = None,
    reading: MechanismReading = PLAIN_MECHANISM,
    heading: Heading = PLAIN,
    output: TableOutput = NO_TABLE,
) -> int:
    r"""Compute the motion of drivers at the rate of a servo, to jerk.

    The motion of a driver with the law of an output is found by
    inversion. The command prints the peaks and the highest continuous
    derivative of each law; --out writes a row for each period.

    Parameters
    ----------
    file
        Mechanism file: .yaml, .yml, .toml or .json.
    rate
        Rate of the rows, such as 1kHz; a plain number is in Hz.
    order
        Highest derivative, 0 to 30; 3 is jerk.
    driver
        Driver to compute; repeatable [all].

    Examples
    --------
      jounce servo examples/servo_press.yaml --out drive.csv
      jounce servo examples/servo_press.yaml --rate 2kHz --out drive.csv \
        --units angle=deg --header-units
    """
    from jounce.io import in_units
    from jounce.mechanism.time import last_step_words
    from jounce.reporting.peaks import shown_peaks, table_peaks
    from jounce.reporting.text.law_facts import law_facts, law_words

    output.check()
    frequency, units = frequency_of(rate), heading.units
    mechanism = reading.mechanism(file)
    spare_inputs(output.out, overwrite=output.overwrite)
    names = list(dict.fromkeys(driver or mechanism.drivers))
    for name in names:
        check_name("driver", name, mechanism.drivers, JounceError, name="--driver")
    shown_units = _units_of(mechanism, names)
    with errors_about(file), Count("solving") as bar:
        if not names:
            raise JounceError("there is no driver", name="drivers")
        motion = _at_rate(mechanism, frequency, order, bar)
        dataset, one_sided = _driven(motion, names), _values_at_breaks(mechanism, motion, names)
    first, last = float(motion.time[0]), float(motion.time[-1])
    laws = [law for law in law_facts(mechanism, first, last) if law["driver"] in names]
    peaks = table_peaks(dataset, one_sided)
    if not output.json:
        count = f"{len(motion.time)} rows from {first:g} s to {last:g} s, {frequency:g} a second"
        remarks = filter(None, [last_step_words(motion.time)])
        print_text("\n".join([mechanism.title or file.name, count, *remarks, *law_words(laws)]))
        show_peaks(shown_peaks(peaks, shown_units))
    output.write(lambda: in_units(dataset, shown_units), header_units=units)
    output.tell("servo", lambda: _result(file, frequency, names, laws, peaks, output.out))
    return outcome(motion, file)


def frequency_of(text: str) -> float:
    """Return the frequency in a text, 1/s."""
    return positive_quantity("--rate", text, (PER_TIME,), "a frequency, such as 1kHz")


def _at_rate(mechanism: Mechanism, frequency: float, order: int, count: Count) -> Motion:
    """Return the motion of a mechanism at every period of the drive, over the time of its file."""
    from jounce.kinematics import solve
    from jounce.mechanism import TimeGrid
    from jounce.mechanism.time import instants_of

    instants = instants_of(mechanism.time, mechanism.parameter_values)
    first, last = float(instants[0]), float(instants[-1])
    grid = TimeGrid(first, last, 1 / frequency)
    return solve(mechanism, grid, order, strict=False, progress=count, keep=True)


def _values_at_breaks(mechanism: Mechanism, motion: Motion, names: list[str]) -> Any:
    """Return the coordinates of drivers on both sides of breaks of laws; None if there are none."""
    import numpy as np

    from jounce.kinematics import solve
    from jounce.mechanism.laws.law_breaks import breaks_of_laws
    from jounce.trajectory.law_checks.breaks import both_sides

    first, last = float(motion.time[0]), float(motion.time[-1])
    breaks = breaks_of_laws(mechanism, first, last, motion.order)
    sides, indices = both_sides(breaks, first, last)
    if not len(sides):
        return None
    solved = solve(mechanism, np.append(first, sides), motion.order, strict=False)  # from the same start
    return _driven(solved, names).isel(time=slice(1, None)).assign_coords(time=breaks[indices])


def _driven(motion: Motion, names: list[str]) -> Any:
    """Return the coordinates of drivers as a dataset."""
    import xarray

    variables = {name: motion.driver(name) for name in names}
    dataset = xarray.Dataset(variables, attrs={"title": motion.mechanism.title, "source": "jounce"})
    dataset["time"].attrs = {"units": "s", "long_name": "time"}
    return dataset


def _units_of(mechanism: Mechanism, names: list[str]) -> ShownUnits:
    """Return the units of a file for its drivers: by kind, or by the name of an output with the same name."""
    from jounce.mechanism.laws.driver_outputs import is_turning
    from jounce.units.shown_units import QUANTITIES, ShownUnits

    base_units = {name: "rad" if is_turning(mechanism.drivers[name]) else "m" for name in names}
    chosen = {name: unit for name, unit in mechanism.units.items() if name in QUANTITIES or name in base_units}
    return ShownUnits(chosen, base_units)


def _result(
    file: Path, frequency: float, names: list[str], laws: Any, peaks_found: Any, out: Path | None
) -> dict[str, Any]:
    from jounce.reporting.json.results import peak_facts

    peaks = [peak_facts(peak) for peak in peaks_found]
    return {"file": file, "rate": frequency, "drivers": names, "laws": laws, "peaks": peaks, "written": out}
