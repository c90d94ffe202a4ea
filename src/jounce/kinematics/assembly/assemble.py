"""The first assembly from the starting guess, with checks of its gaps and of the degrees of freedom left."""

import dataclasses
import itertools
import warnings

import numpy as np
from jaxtyping import Float

from jounce.base.modules import with_fields
from jounce.constraints.facts import facts_of
from jounce.errors import AssemblyError, AssemblyWarning, MobilityError
from jounce.execution.device import resident
from jounce.jet import Jet
from jounce.kinematics.assembly.axis_directions import (
    axis_signs,
    axis_signs_to_try,
    drawn_axis_signs,
    mirrored_discs,
    pair_names,
    signs_of,
    starts_with_axis_signs,
)
from jounce.kinematics.assembly.gauss_newton import AssemblyAttempt, Displacements, assemble_from_guess
from jounce.kinematics.assembly.idle_motions import idle_motions
from jounce.kinematics.assembly.initial_revolutions import (
    Coordinates,
    DriverLag,
    driver_lag,
    nearest_turns,
    turned_to_laws,
)
from jounce.kinematics.assembly.loose_bodies import missing_joint_words
from jounce.kinematics.assembly.redundancy import Redundancy, redundancy
from jounce.kinematics.status import Status
from jounce.mechanism import Model
from jounce.mechanism.building.builder import group_rows, law_values, named_groups, with_reference
from jounce.mechanism.carriages import ENDING
from jounce.mechanism.transmissions.axis_angles import measures_angle, with_angles, with_datums
from jounce.mechanism.transmissions.gear_checks import check_gears, check_wheels
from jounce.trajectory import AbstractMotion

MAX_DATUMS = 100
TIGHT = 1e-12  # rad or sizes of the mechanism: the tolerance of an assembly to rounding
SETTLED = 1e-12  # rad: largest change of the drivers' reference angles after convergence


def assemble(model: Model, instant: float, tolerance: float, *, free: bool = False) -> tuple[Model, Coordinates]:
    """Assemble the bodies at one instant from the starting guess by damped Gauss-Newton.

    Parameters
    ----------
    model : Model
        The mechanism.
    instant : float
        Time, s.
    tolerance : float
        Largest last correction, rad or sizes of the mechanism.
    free : bool, default False
        Whether degrees of freedom may be left. The result is then the position nearest to the guess.

    Returns
    -------
    model : Model
        The model with its rows scaled by the size of their derivatives at the assembled position.
    coordinates : dict of str to array
        The assembled coordinates of all bodies.

    Raises
    ------
    AssemblyError
        If no position near the guess fulfills all joints; the message names the joints that stay open.
    MobilityError
        If joints and drivers leave degrees of freedom, or the position is singular.
    MechanismError
        If no body carries the centers of toothed gears, or a frame does not hold the axis of a shaft.
    """
    columns = model.system.shape[1]
    if not model.rows and not free:
        noun = "degree of freedom" if columns == 1 else "degrees of freedom"
        raise MobilityError(f"the mechanism has no joints and no drivers: {columns} {noun} are left")
    if not model.rows:  # free bodies are assembled as they are
        model, _ = with_reference(model, model.guess, instant, model.prescribed)
        return dataclasses.replace(model, system=resident(model.system)), model.guess
    model, attempt = find_assembly(model, instant, tolerance)
    check_assembled(model, attempt, instant, free=free)
    warn_of_parts_turned_over(model, attempt)
    model, redundant = redundancy_of(model, _assembled_to_rounding(model, attempt, instant, tolerance), instant)
    try:
        check_mobility(model, redundant, free=free)
    except MobilityError as error:
        error.idle = idle_motions(model, redundant, attempt.coordinates, Displacements(model, instant))
        raise
    return model, attempt.coordinates


def _assembled_to_rounding(model: Model, attempt: AssemblyAttempt, instant: float, tolerance: float) -> AssemblyAttempt:
    """Return an attempt near a singular position assembled again to rounding; others unchanged."""
    if tolerance <= TIGHT or not attempt.jacobian.smallest[1].size:
        return attempt
    exact = assemble_from_guess(model, instant, TIGHT, attempt.coordinates)
    return exact if exact.closed else attempt


def find_assembly(model: Model, instant: float, tolerance: float) -> tuple[Model, AssemblyAttempt]:
    """Assemble the bodies, if possible with no part turned over in its joint, and count angles from the result.

    Directions that joints hold parallel may be far from parallel in the guess. The assembly may then fail, or turn a
    part over. The directions are then aligned first, in several ways until one assembles in a regular position.
    """
    names = [model.rows[rows] for rows in group_rows(model)]
    check_gears(model.system.groups, names)
    check_wheels(model.system.groups, names, model.guess)
    assembled, initial = _assemble_near_guess(model, instant, tolerance)
    if initial.closed:
        initial = initial._replace(signs=signs_of(model, initial))
    best = assembled, initial
    candidates = axis_signs_to_try(model, initial)
    rank = initial.jacobian.rank - 1 if candidates and initial.closed else -1  # of the best so far
    for signs in candidates:
        for start in starts_with_axis_signs(model, signs, instant, tolerance):
            restarted, _ = with_reference(dataclasses.replace(model, guess=start), start, instant, model.prescribed)
            other, attempt = _assemble_near_guess(restarted, instant, tolerance)
            signs_match = attempt.closed and np.array_equal(axis_signs(model.system, attempt.coordinates), signs)
            if signs_match and attempt.jacobian.rank > rank:
                best, rank = (dataclasses.replace(other, guess=model.guess), attempt), attempt.jacobian.rank
            if rank == attempt.jacobian.shape[1]:
                return best
        if best[1] is not initial:
            break
    return best


def _assemble_near_guess(model: Model, instant: float, tolerance: float) -> tuple[Model, AssemblyAttempt]:
    """Assemble the bodies from the starting guess, and count the angles about axes from the position found.

    If axes are not aligned in the guess, angles counted from the guess differ from those at the position found, so that
    it takes another iteration to reach the angles that the drivers prescribe.
    """
    displace, prescribed = Displacements(model, instant), model.prescribed
    residual, attempt, position = displace.closed(model.guess, tolerance)
    laws = law_values(model.system.groups, instant)
    lag = driver_lag(model, laws, residual)
    model, start = _start_after_turns(model, instant, tolerance, lag)
    if start is not None:
        attempt = assemble_from_guess(model, instant, tolerance, start)
    elif attempt is None:
        attempt = assemble_from_guess(model, instant, tolerance, start_position=position or displace.at(model.guess))
    if not attempt.closed and any(map(measures_angle, model.system.groups)):
        # angles counted from a tilted guess may be far off: first close the joints, with the drivers as in the guess
        lagging = attempt if lag is None else assemble_from_guess(model, instant, tolerance, lag=lag)
        if lagging.closed:
            model, _ = with_reference(model, lagging.coordinates, instant, prescribed, laws=laws)
            attempt = assemble_from_guess(model, instant, tolerance, lagging.coordinates)
    if "angle" in attempt.coordinates and start is None and attempt.closed:
        attempt = nearest_to_guess(model, attempt, instant)
    for _ in range(MAX_DATUMS):
        if not attempt.closed:
            return model, attempt
        model, change = with_reference(model, attempt.coordinates, instant, prescribed, laws=laws)
        if change <= SETTLED:
            return model, attempt
        attempt = assemble_from_guess(model, instant, tolerance, attempt.coordinates)
    return with_reference(model, attempt.coordinates, instant, prescribed, keep=True)[0], attempt


def warn_of_parts_turned_over(model: Model, attempt: AssemblyAttempt) -> None:
    """Warn of joints whose parts are turned over relative to the starting guess or to the definition of the joint."""
    if names := mirrored_discs(model, attempt.coordinates):
        message = (
            f"{', '.join(names)}: the center of the disc is one radius from the line, but on the other side than the "
            "joint has it, so that the disc turns against the way in which it would roll there; reverse the vector "
            "along the line (in the plane the center belongs on its right, in space on the side of vector x axis)"
        )
        warnings.warn(AssemblyWarning(message), stacklevel=3)
    signs = signs_of(model, attempt)
    if signs.all() or not (odd := signs != drawn_axis_signs(model)).any():
        return
    names = dict.fromkeys(itertools.compress(pair_names(model), odd))
    message = (
        f"{', '.join(names)}: assembled only with parts turned over: directions that are held "
        "parallel point opposite ways, unlike in the starting guess; guess the pose of the bodies more closely, or "
        "give one of the two directions the other sign"
    )
    warnings.warn(AssemblyWarning(message), stacklevel=3)


def _start_after_turns(
    model: Model, instant: float, tolerance: float, lag: DriverLag | None
) -> tuple[Model, Coordinates | None]:
    """Return model and start coordinates after turning the drivers from the guess to laws more than half a turn away.

    All angles count the turns made on the way. The coordinates are None if no law is so far away, or if the motion
    there cannot be followed.
    """
    if lag is None or not np.pi < lag.angle < np.inf:
        return model, None
    lagging = assemble_from_guess(model, instant, tolerance, lag=lag)
    if not lagging.closed:
        return model, None
    followed = turned_to_laws(model, lag, lagging.coordinates, Displacements(model, instant))
    if followed is None:
        return model, None
    coordinates, history = followed
    if history is not None:
        forces, outputs = (
            with_angles(with_datums(part, coordinates), history.last_angles(part))
            for part in (model.system.forces, model.system.outputs)
        )
        system = with_fields(model.system, forces=forces, outputs=outputs)
        model = dataclasses.replace(model, system=system, history=history)
    return model, coordinates


def nearest_to_guess(model: Model, attempt: AssemblyAttempt, instant: float) -> AssemblyAttempt:
    """Return a planar assembly with every angle shifted by whole turns to be nearest to the guess."""

    def residual_at(angle: np.ndarray) -> np.ndarray:
        return attempt.scale * Displacements(model, instant).at({**attempt.coordinates, "angle": angle}).residual

    return attempt._replace(coordinates=nearest_turns(model.guess, attempt.coordinates, residual_at))


def check_assembled(model: Model, attempt: AssemblyAttempt, instant: float, *, free: bool = False) -> None:
    """Raise AssemblyError if gaps are not closed, with the joints concerned and the sizes of their gaps.

    Missing equations are reported too, unless degrees of freedom may be left (`free`).
    """
    gaps = attempt.gaps
    if not (finite := np.isfinite(gaps)).all():
        undefined = ", ".join(dict.fromkeys(itertools.compress(model.rows, ~finite)))
        message = f"no finite value at t = {instant:g} s: {undefined}; check motion laws and the starting guess"
        raise AssemblyError(message, status=Status.INADMISSIBLE)
    if attempt.closed:
        return
    gaps = np.abs(gaps)
    worst = np.argsort(-gaps)
    open_rows = list(dict.fromkeys(model.rows[k] for k in worst if gaps[k] > 0.1 * gaps[worst[0]]))
    sizes = _gap_sizes(model, attempt, instant)
    message = (
        f"the mechanism cannot be assembled at t = {instant:g} s from its starting guess: {', '.join(open_rows[:4])} "
        f"{'stays' if len(open_rows) == 1 else 'stay'} open, by {', '.join(sizes[name] for name in open_rows[:4])}; "
        "check lengths and positions, or guess the pose of the bodies more closely"
    )
    if not free:
        message += " (`assembly: nearest` looks from random starts)"
    extra = _structural_excess(model, attempt, instant)
    if extra:
        details = (
            f"{message}; {_count(extra, 'equation')} more than coordinates are among them, and redundant constraints "
            "contradict each other by that much: correct lengths and axes, free a direction there, or raise the "
            "tolerance if the numbers are no more exact"
        )
        shown, others = open_rows[:2], " and others" if len(open_rows) > 2 else ""
        verb, gaps_of_shown = "stays" if len(open_rows) == 1 else "stay", ", ".join(sizes[name] for name in shown)
        driver = " or a driver" if any(name.startswith("drivers.") for name in open_rows) else ""
        message = (
            f"over-constrained at t = {instant:g} s: {', '.join(shown)}{others} {verb} open, by {gaps_of_shown}, and "
            f"contradict each other; correct lengths, or take out a joint{driver}"
        )
        raise AssemblyError(message, status=Status.NOT_ASSEMBLED, details=details)
    missing = attempt.jacobian.shape[1] - len(model.rows)
    if missing > 0 and not free:
        message += f"; {_count(missing, 'equation')} too few for all coordinates: a joint may be missing"
    raise AssemblyError(message, status=Status.NOT_ASSEMBLED)


def _structural_excess(model: Model, attempt: AssemblyAttempt, instant: float) -> int:
    """Return the number of equations that are dependent at a random position and may contradict each other.

    A failed assembly stops where equations are dependent at that position only, which does not count.
    """
    displacement = 0.1 * np.random.default_rng(1).standard_normal(model.system.shape[1])
    jacobian = Displacements(model, instant)(attempt.coordinates, displacement).jacobian
    return len(model.rows) - jacobian.scaled(jacobian.row_scale).rank if jacobian.finite().all() else 0


def _gap_sizes(model: Model, attempt: AssemblyAttempt, instant: float) -> dict[str, str]:
    """Return the gap of each joint and driver in words, as a length or as an angle."""
    shifts, entries = model.pose_type.shifts, np.abs(attempt.jacobian.blocks)
    by_shift, by_turn = (np.max(part, axis=(1, 2)) for part in (entries[:, :, :shifts], entries[:, :, shifts:]))
    squares = _squared_lengths(model, instant)  # where two points coincide, all slopes of their distance vanish
    lengthy = (by_shift > 1e-9 * by_turn) | np.isin(model.rows, list(squares))
    unit = np.where(lengthy, 1e3 * model.length, np.degrees(1.0))
    open_by = np.abs(attempt.gaps) * unit / np.maximum(np.where(lengthy, by_shift, by_turn), 1e-300)
    for row, name in enumerate(model.rows):
        if name in squares:  # the residual is the squared distance minus this value
            square = max(attempt.gaps[row] / attempt.scale[row] + squares[name], 0.0)
            open_by[row] = 1e3 * abs(np.sqrt(square) - np.sqrt(squares[name]))
    sizes = {name: {"mm": 0.0, "deg": 0.0} for name in model.rows}
    for row, name in enumerate(model.rows):
        unit = "mm" if lengthy[row] else "deg"
        sizes[name][unit] = max(sizes[name][unit], open_by[row])
    return {
        name: " and ".join(f"{size:.3g} {unit}" for unit, size in by_unit.items() if size > 1e-6)
        for name, by_unit in sizes.items()
    }


def _squared_lengths(model: Model, instant: float) -> dict[str, float]:
    """Return the squares of the distances that joints and drivers keep between two points, by name, m^2."""
    squares, clock = {}, Jet([np.full((1, 1), instant)])
    for group, members in named_groups(model):
        field = facts_of(type(group.element)).squared_distance
        if not field:
            continue
        lengths = getattr(group.element, field)
        lengths = lengths(clock).coefficients[0] if isinstance(lengths, AbstractMotion) else lengths
        lengths = np.broadcast_to(lengths, (group.instances, 1))[:, 0]
        squares |= {name: float(length) ** 2 for name, length in zip(members, lengths, strict=False)}
    return squares


def redundancy_of(model: Model, attempt: AssemblyAttempt, instant: float) -> tuple[Model, Redundancy]:
    """Return an assembled model with its rows scaled, and its redundancy."""
    system = resident(with_fields(model.system, row_scale=attempt.scale[:, None], rank=None))
    model = with_fields(model, system=system)
    redundant = redundancy(model, attempt.coordinates, attempt.jacobian, Displacements(model, instant))
    if redundant.count:
        model = dataclasses.replace(model, system=with_fields(system, rank=redundant.rank))
    return model, redundant


def check_mobility(model: Model, redundant: Redundancy, *, free: bool = False) -> None:
    """Raise MobilityError, with the bodies concerned, if degrees of freedom are left or the position is singular.

    Redundant constraints raise no error, since they agree. With `free`, degrees of freedom may be left.
    """
    (rows, columns), rank = redundant.at_assembly.shape, redundant.rank
    left_over = columns - rank
    if (free or not left_over) and not redundant.is_singular:
        return
    bodies = len(model.bodies)
    parts = [
        f"{bodies} moving {'body has' if bodies == 1 else 'bodies have'} {columns} coordinates; joints and drivers "
        f"give {rows} equations, {rank} of them independent"
    ]
    if left_over and not free:
        noun = "degree of freedom is" if left_over == 1 else "degrees of freedom are"
        moving = freely_moving(model, redundant.jacobian.free_directions)
        remedy = f"add {_count(left_over, 'driver')}, or simulate it under its forces"
        parts.append(f"{left_over} {noun} left, with which {moving} can move: {remedy}")
        if hint := missing_joint_words(model, moving_bodies(model, redundant.jacobian.free_directions), left_over):
            parts.append(hint)
    if redundant.count:
        parts.append(f"{redundant}, which is no fault as they agree")
    if redundant.is_singular:
        moving = freely_moving(model, redundant.at_assembly.free_directions)
        parts.append(
            "the start is a singular position (a dead point or a change point), where only "
            f"{redundant.at_assembly.rank} equations are independent and {moving} can move: start at another "
            "instant, or with another position"
        )
    raise MobilityError("; ".join(parts), status=Status.SINGULAR if redundant.is_singular else None)


def freely_moving(model: Model, directions: Float[np.ndarray, "direction column"]) -> str:
    """Return the names of the bodies that move along directions of the coordinates, (directions, columns), in words."""
    names = moving_bodies(model, directions)
    phrase = ", ".join(names[:6])
    return phrase + (f" and {len(names) - 6} more" if len(names) > 6 else "")


def moving_bodies(model: Model, directions: Float[np.ndarray, "direction column"]) -> list[str]:
    """Return the bodies that move along directions of the coordinates, the fastest first."""
    sizes = np.linalg.norm(directions.reshape(len(directions), len(model.bodies), -1), axis=(0, 2))
    indices = [k for k, name in enumerate(model.bodies) if not name.endswith(ENDING)]  # carriages move with the bodies
    weights, names = sizes[indices], [model.bodies[k] for k in indices]
    order = np.argsort(-weights, kind="stable")
    return [names[k] for k in order if weights[k] > 0.05 * weights[order[0]]]


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"
