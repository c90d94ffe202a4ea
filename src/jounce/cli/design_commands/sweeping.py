"""The command that computes up to millions of designs, and resumes interrupted sweeps."""

from __future__ import annotations

import math
import os
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from jounce.base.activity import Count
from jounce.cli.mechanism_commands.mechanisms import method_of
from jounce.cli.options import PLAIN_MECHANISM, MechanismReading, RobotReading, errors_about
from jounce.errors import JounceError
from jounce.reporting.terminal import print_text, say_json, show_table

if TYPE_CHECKING:
    from jounce.sweeps.problems import Problem


def sweep(
    file: Path,
    trajectory: Path | None = None,
    /,
    *,
    vary: list[str],
    out: Path,
    sample: str | None = None,
    order: int = 4,
    simulate: bool = False,
    method: str | None = None,
    tolerance: float | None = None,
    longest_step: float = math.inf,
    histories: bool = False,
    payload: list[str] | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    timeout: float = 10.0,
    chunk: int | None = None,
    reading: MechanismReading = PLAIN_MECHANISM,
    json: Annotated[bool, Parameter(name="--json")] = False,
) -> int:
    r"""Compute many designs, on all cores or a cluster, to a Zarr folder.

    The folder stores peaks, their times, rms, minima and maxima of all
    outputs and derivatives for each design. Run the same command again
    to resume an interrupted sweep.

    Parameters
    ----------
    file
        Mechanism file, or robot file with a trajectory.
    trajectory
        Motion of a robot: .csv, .yaml, .toml or .json.
    vary
        NAME=LOW:HIGH:COUNT, with units; with --sample NAME=LOW:HIGH,
        NAME=normal:SIGMA or NAME=uniform:HALFWIDTH; repeatable. For robots
        payload.LINK, armature.JOINT, damping.JOINT, friction.JOINT, speed.
    out
        Folder of the results, its name ending in .zarr.
    sample
        sobol:COUNT samples the ranges [default: all combinations].
    order
        Highest derivative; torques of robots have two fewer.
    simulate
        Simulate the mechanism under forces instead of its drivers.
    method
        Integrator: taylor, obreshkov-4, obreshkov-6 or obreshkov-8.
    tolerance
        Tolerance, as for jounce run or jounce simulate.
    longest_step
        Largest step of a simulation, s.
    histories
        Store all instants too.
    payload
        LINK=MASS with a unit, at the origin of the link; repeatable.
    workers
        Worker processes [all cores]; 0 uses this one, without Dask.
    scheduler
        Address of a Dask cluster, such as tcp://host:8786.
    timeout
        Time to wait for an answer of the cluster, s.
    chunk
        Number of designs that are computed together.
    json
        Print the result as JSON.

    Examples
    --------
      jounce sweep examples/four_bar.yaml --vary AB=3cm:5cm:101 \
        --vary BC=13cm:15cm:101 --out sweep.zarr
      jounce sweep examples/four_bar.yaml --vary BC=normal:0.1mm \
        --vary CD=normal:0.1mm --sample sobol:4096 --out spread.zarr
      jounce sweep examples/robots/panda.urdf \
        examples/trajectories/panda_wave.yaml \
        --vary "payload.panda_hand=0kg:3kg:31" --vary speed=0.5:1.5:11 \
        --out loads.zarr
    """
    from jounce.cli.compiled_programs import use_compilation_cache
    from jounce.design.tolerances.variations import named_forms
    from jounce.io.files.reading import recording
    from jounce.io.mechanisms.schema.unit_hints import warn_of_variations
    from jounce.sweeps.facts import sweep_facts, sweep_summary, sweep_table
    from jounce.sweeps.store import find
    from jounce.sweeps.sweeping import prepare, run

    forms = named_forms(vary)
    find(out)  # checks the folder before anything is read
    with recording() as files:
        problem = _problem(file, trajectory, order, reading, payload, simulate, (method, tolerance, longest_step))
    if (mechanism := getattr(problem, "mechanism", None)) is not None:
        warn_of_variations(mechanism, forms, "--vary")
    user_files = {str(path.absolute()): files[os.path.realpath(path)] for path in reading.import_ or ()}
    with errors_about(file):
        plan = prepare(
            problem, forms, out, _title(problem, file), files, sample=sample, histories=histories, chunk=chunk
        )
        with Count("sweeping", "designs") as bar:
            checksum = run(
                plan,
                workers=workers,
                scheduler=scheduler,
                timeout=timeout,
                progress=bar,
                user_files=user_files,
                prepare_worker=partial(use_compilation_cache, quiet=True),
            )
    facts = sweep_facts(plan, checksum)
    if json:
        say_json("sweep", {"file": file, **facts, "written": out})
        return 0
    print_text(sweep_summary(facts, file.name))
    show_table(sweep_table(facts))
    print_text(f"\nWritten to {out}")
    return 0


def _problem(
    file: Path,
    trajectory: Path | None,
    order: int,
    reading: MechanismReading,
    payload: list[str] | None,
    simulate: bool,
    integration: tuple[str | None, float | None, float],
) -> Problem:
    """Return the problem of a sweep."""
    from jounce.io.files import ROBOT_FILES
    from jounce.sweeps.problems import Motions, Simulations
    from jounce.sweeps.sweeping import robot_problem

    method, tolerance, longest_step = integration
    given: dict[str, Any] = {} if tolerance is None else {"tolerance": tolerance}
    if not simulate and (method is not None or longest_step != math.inf):
        raise JounceError("goes with a simulation: give --simulate", name="--method" if method else "--longest-step")
    if file.suffix.lower() in ROBOT_FILES:
        reading.refuse_times(file)
        if simulate or reading.set_ or given:
            raise JounceError(
                "a sweep of a robot computes torques; --simulate, --set and --tolerance are for mechanisms", path=file
            )
        robot = RobotReading(payload=payload, allow=reading.allow)
        model = robot.robot(file)
        with errors_about(file):
            return robot_problem(
                model, None if trajectory is None else robot.trajectory(trajectory, model), None, order
            )
    if trajectory is not None or payload:
        raise JounceError("a trajectory and payloads go with a robot, not with a mechanism", path=file)
    mechanism = reading.mechanism(file)
    with errors_about(file):
        if not simulate:
            return Motions(mechanism, None, order, **given)
        chosen = None if method is None else method_of(method, None)
        return Simulations(mechanism, None, order, **given, method=chosen, longest_step=longest_step)


def _title(problem: Any, file: Path) -> str:
    return getattr(getattr(problem, "mechanism", None), "title", "") or file.stem
