"""Mechanisms with idle motions: joints hold the idle bodies, and no output may depend on their spin."""

import dataclasses
import functools
from collections.abc import Callable, Sequence
from typing import Any, ParamSpec, TypeVar, cast

import numpy as np

from jounce.constraints.spin_hold import SpinHold
from jounce.errors import IdleMotionWarning, JounceError, MechanismError, MobilityError, UnsupportedError, warn_caller
from jounce.kinematics.assembly.assemble import assemble
from jounce.kinematics.assembly.idle_motions import IdleMotions
from jounce.kinematics.results.motion import Motion
from jounce.kinematics.status import Status
from jounce.mechanism import AbstractQuantity, Mechanism, build, with_output_drivers
from jounce.mechanism.building.preconditions import holds_tracer
from jounce.mechanism.time import instants_of

P = ParamSpec("P")
R = TypeVar("R")
DEPENDS = 1e-9  # relative to an output, or to the size of the mechanism
ORDER = 4  # of the derivatives compared
BETWEEN = 0.618  # of the time: the instant of comparison between the first and the last


def with_idle_motions_held(mechanism: Mechanism, idle: IdleMotions) -> Mechanism:
    """Return the mechanism with joints that suppress its idle motions: no spin about the idle axes."""
    used_names = {*mechanism.joints, *mechanism.drivers, *mechanism.initial}
    holds = {}
    for body, (_, axis) in idle.items():
        name = f"{body}_spin"
        while name in used_names:
            name += "_"
        holds[name] = SpinHold((body,), list(axis))
    return dataclasses.replace(mechanism, joints={**mechanism.joints, **holds})


def idle_words(idle: IdleMotions, *, axes: bool = False) -> str:
    """Return the bodies that may spin, in words, with their axes in the frame of the first body of each group.

    Examples
    --------
    >>> idle_words({"rod": (("rod", "cap"), (0.0, 0.6, 0.8))}, axes=True)
    'rod and cap as one about [0, 0.6, 0.8] of rod'
    """
    reported = []
    for first, (bodies, axis) in idle.items():
        axis_phrase = f" about [{', '.join(f'{x + 0.0:.4g}' for x in axis)}] of {first}" if axes else ""
        reported.append(" and ".join(bodies) + (" as one" if len(bodies) > 1 else "") + axis_phrase)
    return "; ".join(reported)


def warn_of_idle(idle: IdleMotions) -> None:
    """Warn once of the idle motions that are held."""
    message = (
        "nothing prescribes the spin of these bodies, which moves nothing else: "
        f"{idle_words(idle, axes=True)}; they are held by the least motion, and no output depends on it"
    )
    warn_caller(IdleMotionWarning(message))


def holding_idle(solver: Callable[[], Callable[..., Any]]) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator that holds idle motions of a mechanism, if they are all its remaining degrees of freedom.

    Parameters
    ----------
    solver : callable
        Returns the function that solves a mechanism at instants to an order.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        @functools.wraps(function)
        def wrapper(*arguments: P.args, **keywords: P.kwargs) -> R:
            try:
                return function(*arguments, **keywords)
            except MobilityError as error:
                if not error.idle:
                    raise
                idle = error.idle
            given: Any = dict(zip(("mechanism", "time"), arguments, strict=False)) | keywords
            if holds_tracer(given):  # a change of design may end an idle motion, and depend on its angle
                message = (
                    f"where a motion is differentiated, no body may spin freely, as do: {idle_words(idle, axes=True)}; "
                    "drive the spin, or put a universal joint in the place of a spherical one"
                )
                raise UnsupportedError(message, name="mechanism")
            mechanism = with_idle_motions_held(given["mechanism"], idle)
            check: Any = functools.partial(check_independent, mechanism, idle, given.get("time"), solver())
            check()
            warn_of_idle(idle)
            other_keywords: Any = {name: value for name, value in keywords.items() if name != "mechanism"}
            solve_held: Any = function
            result: Any = solve_held(mechanism, *arguments[1:], **other_keywords)
            if isinstance(result, Motion):  # outputs requested later must not depend on the idle motions either
                vars(result).update(mechanism=given["mechanism"], check_idle=check)
            return cast("R", result)

        return wrapper

    return decorate


def with_idle_held_in_family(
    mechanism: Mechanism, designs: Sequence[Mechanism], instants: Any, tolerance: float, solve: Callable[..., Any]
) -> Mechanism:
    """Return a mechanism of many designs with the idle motions held that the first of the given designs has.

    Raise MechanismError if an output of a given design depends on an idle motion.
    """
    model, first = build(with_output_drivers(designs[0])), float(instants[0])
    (rows, columns), idle = model.system.shape, {}
    try:
        if rows < columns:
            assemble(model, first, tolerance)
    except JounceError as error:  # other errors are raised when the design is solved
        idle = error.idle if isinstance(error, MobilityError) else {}
    if not idle:
        return mechanism
    for design in designs:
        check_independent(with_idle_motions_held(design, idle), idle, instants, solve)
    warn_of_idle(idle)
    return with_idle_motions_held(mechanism, idle)


def check_independent(
    mechanism: Mechanism,
    idle: IdleMotions,
    time: Any,
    solve: Callable[..., Any],
    outputs: dict[str, AbstractQuantity] | None = None,
) -> None:
    """Raise MechanismError for an output that depends on an idle motion, by name.

    Outputs and their derivatives at some instants are compared with those of spinning bodies. Outputs of forces are
    skipped: an undriven idle motion takes no force, so the holding joints exert none.
    """
    checked = mechanism.outputs if outputs is None else outputs
    checked = {name: output for name, output in checked.items() if not output.of_forces}
    if not checked:
        return
    instants = instants_of(mechanism.time if time is None else time, mechanism.parameter_values)
    first, duration = float(instants[0]), abs(float(instants[-1]) - float(instants[0])) or 1.0
    names = [name for name, joint in mechanism.joints.items() if isinstance(joint, SpinHold)]
    holds = {name: dataclasses.replace(mechanism.joints[name], rate=k / duration) for k, name in enumerate(names, 1)}
    posed = dataclasses.replace(mechanism, outputs=checked, forces={}, initial={})
    spinning = dataclasses.replace(posed, joints={**posed.joints, **holds})
    middle = float(instants[0] + BETWEEN * (instants[-1] - instants[0]))
    sample_times = sorted({first, middle, float(instants[-1])}, reverse=bool(instants[-1] < instants[0]))
    held_motion, spun_motion = (solve(variant, sample_times, ORDER, strict=False) for variant in (posed, spinning))
    solved = (held_motion.status == Status.OK) & (spun_motion.status == Status.OK)
    scale = duration ** -np.arange(ORDER + 1.0) * held_motion.model.length
    for name in checked:
        a, b = (np.asarray(motion.outputs[name])[solved] for motion in (held_motion, spun_motion))
        size = np.maximum(np.abs(a), np.abs(b)).reshape(len(a), ORDER + 1, -1).max(axis=(0, 2), initial=0.0)
        difference = np.abs(a - b).reshape(len(a), ORDER + 1, -1).max(axis=(0, 2), initial=0.0)
        if not (difference <= DEPENDS * np.maximum(size, scale)).all():
            message = (
                f"depends on a spin that nothing prescribes: {idle_words(idle, axes=True)} may spin without moving "
                "anything else; drive the spin, put a universal joint in the place of a spherical one, or leave this "
                "output out"
            )
            raise MechanismError(message, name=f"outputs.{name}")
