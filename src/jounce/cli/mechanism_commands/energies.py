"""The command for energies: kinetic and acceleration energies of robots and mechanisms, with their rates."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jounce.cli.arguments import check_ending
from jounce.cli.file_kinds import explaining_other_kinds
from jounce.cli.options import MechanismReading, RobotReading, errors_about, print_result, spare_inputs, written
from jounce.errors import JounceError, SampleWarning
from jounce.io.files import DATA_FILES, ROBOT_FILES
from jounce.reporting.terminal import print_text

if TYPE_CHECKING:
    import xarray

MOST = 28  # largest sum of order and rates: the highest derivative is 30


def energies(
    file: Path,
    trajectory: Path | None = None,
    /,
    *,
    order: int = 1,
    rates: int = 2,
    no_drives: bool = False,
    set_: list[str] | None = None,
    import_: list[Path] | None = None,
    allow: list[Path] | None = None,
    out: Path | None = None,
    json: bool = False,
    overwrite: bool = False,
) -> int:
    r"""Compute acceleration energies of any order, and their rates.

    Order 0 is the kinetic energy, order 1 Gibbs' energy of accelerations.
    Negrean 2025, equations 65-122. Of a robot, the extreme values are
    those at 2000 instants or more, and on both sides of jumps and kinks.

    Parameters
    ----------
    file
        Robot file, .urdf, .xml or .sdf; or a mechanism file with masses.
    trajectory
        Motion of a robot: samples (.csv) or laws (.yaml, .toml, .json).
    order
        Order p of the energy: of the derivatives of order p + 1.
    rates
        Highest rate of the energies.
    no_drives
        Omit the rotors of a robot.
    set_
        NAME=VALUE of a parameter of a mechanism, with a unit; repeatable.
    import_
        Python file with your own joints and forces; repeatable.
    allow
        Another folder from which the file may read others; repeatable.
    out
        Write all values to this .csv or .nc (NetCDF) file.
    json
        Print extreme values as JSON instead, SI.
    overwrite
        Let --out replace a file that is read here.

    Examples
    --------
      jounce energies examples/robots/panda.urdf \
        examples/trajectories/panda_wave.yaml --order 2 --rates 1
      jounce energies examples/double_pendulum.yaml --order 1 --out energies.csv
    """
    from jounce.io import check_writable, write
    from jounce.reporting.facts.mechanism.mechanism_facts import grid_facts
    from jounce.reporting.text.summaries import count
    from jounce.units.instants import interval_text

    for name, value in (("--order", order), ("--rates", rates)):
        if not 0 <= value <= MOST - (order if name == "--rates" else 0):
            highest = MOST - (order if name == "--rates" else 0)
            raise JounceError(f"must be a whole number from 0 to {highest}", name=name, value=value)
    with explaining_other_kinds(file, "mechanism", "robot"):
        check_ending(file, (*DATA_FILES, *ROBOT_FILES))
    if out is not None:
        check_writable(out, overwrite=overwrite)
    if file.suffix.lower() in ROBOT_FILES:
        dataset, between = _of_robot(RobotReading(allow=allow), file, trajectory, order, rates, drives=not no_drives)
    elif trajectory is not None:
        raise JounceError("is for robots; a mechanism file has its motion", name="trajectory", path=trajectory)
    else:
        reading = MechanismReading(set_=set_, import_=import_, allow=allow)
        dataset, between = _of_mechanism(reading, file, order, rates), None
    spare_inputs(out, overwrite=overwrite)
    if out is not None:
        written(lambda: write(dataset, out, overwrite=overwrite))
    extremes = _peaks(dataset, between, order)
    if not json:
        times = dataset["time"].values
        title = "Kinetic energy" if order == 0 else f"Acceleration energy of order {order}"
        counted = count(len(times), "instant") + ("" if between is None else " and between them")
        print_text(f"{title}, t = {interval_text(times[0], times[-1])}, at {counted}")
        for row in extremes[: rates + 1]:
            name = "energy" if row["rate"] == 0 else f"rate {row['rate']}"
            print_text(f"  {name}: from {row['minimum']:.9g} to {row['maximum']:.9g} {row['unit']}")
    facts = {"file": str(file), "trajectory": None if trajectory is None else str(trajectory)}
    facts |= {"order": order, "rates": rates, "time": grid_facts(dataset["time"].values)}
    print_result("energies", lambda: {**facts, "peaks": extremes, "written": out}, out, json=json)
    return 0


def _peaks(dataset: xarray.Dataset, between: xarray.Dataset | None, order: int) -> list[dict[str, Any]]:
    """Return the extreme values of the energies, and of their rates, of all bodies together first, and of each."""
    import numpy as np
    import xarray

    from jounce.units.shown_units import derivative_unit

    if between is not None:
        dataset = xarray.concat([dataset, between], "time").sortby("time")
    times, arrays = dataset["time"].values, []
    for name, variable in dataset.data_vars.items():
        body = None if name == "energy" else str(name).removeprefix("energy_of_")
        for k, values in enumerate(variable.values.T):
            row: dict[str, Any] = {"body": body, "rate": k, "unit": derivative_unit("J", 2 * order + k)}
            for word, place in (("minimum", np.argmin(values)), ("maximum", np.argmax(values))):
                row |= {word: float(values[place]), f"{word}_at": float(times[place])}
            arrays.append(row)
    return arrays


def _of_robot(
    reading: RobotReading, file: Path, trajectory: Path | None, order: int, rates: int, *, drives: bool
) -> tuple[xarray.Dataset, xarray.Dataset | None]:
    """Return the energies at the instants of a trajectory, and between these, of a robot."""
    from jounce.dynamics.energy.energies import acceleration_energy
    from jounce.dynamics.limits.check_limits import instants_between
    from jounce.dynamics.limits.trajectories import FollowedTrajectory

    robot = reading.robot(file)
    if trajectory is None:
        raise JounceError("a robot needs a trajectory: name it after the robot", name="trajectory", path=file)
    motion = reading.trajectory(trajectory, robot)

    def energies_at(times: Any, named: Any) -> xarray.Dataset:
        q = followed.coordinates(times, order + 1 + rates)
        return _dataset(named, acceleration_energy(robot, q, order=order, drives=drives))

    with errors_about(trajectory, file):
        followed = FollowedTrajectory(robot, motion)
        dataset = energies_at(motion.times, motion.times)
        times, named = instants_between(motion, order + 1 + rates)
        if not len(times):
            return dataset, None
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SampleWarning)  # the message covers all instants
            return dataset, energies_at(times, named)


def _of_mechanism(reading: MechanismReading, file: Path, order: int, rates: int) -> xarray.Dataset:
    from jounce.cli.mechanism_commands.mechanisms import solve_or_simulate
    from jounce.dynamics.energy.energies import acceleration_energy
    from jounce.kinematics import raise_for_status

    motion = solve_or_simulate(reading.mechanism(file), file, order + 1 + rates)
    with errors_about(file):
        raise_for_status(motion)
        energy = acceleration_energy(motion, order=order)
    return _dataset(motion.time, energy)


def _dataset(times: Any, energy: Any) -> xarray.Dataset:
    """Return the dataset of the energy of all bodies and of each, with rates."""
    import numpy as np
    import xarray

    from jounce.dynamics.energy.energies import energy_unit

    parts = np.asarray(energy.translation) + np.asarray(energy.rotation)
    arrays = {"energy": parts.sum(axis=-1)} | {f"energy_of_{n}": parts[..., k] for k, n in enumerate(energy.bodies)}
    units = {"units": energy_unit(energy.order)}
    variables = {name: (("time", "derivative"), values, units) for name, values in arrays.items()}
    return xarray.Dataset(variables, {"time": times, "derivative": np.arange(parts.shape[-2])})
