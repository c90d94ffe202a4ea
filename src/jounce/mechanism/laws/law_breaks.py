"""Breaks in the laws of a mechanism: no series continues beyond a break, and peaks there may be one-sided limits."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import jax
import numpy as np
from jax.core import Tracer
from jaxtyping import Float

from jounce.constraints.base import field_kinds
from jounce.forces import AbstractForce, ExpressionLaw, TimeLaw, VectorLaw
from jounce.mechanism.laws.cam_laws import cams_in_time
from jounce.mechanism.laws.output_drivers import with_output_drivers
from jounce.mechanism.mechanism import Mechanism
from jounce.mechanism.resolve import resolve_motion
from jounce.settings import under_own_settings
from jounce.trajectory.law_checks.breaks import distinct_instants, law_breaks, may_break
from jounce.trajectory.motion import AbstractMotion, ExpressionMotion
from jounce.units.expression import Expression

ANYWHERE = 0.7310585786300049  # displacement and rate at which laws of forces are searched for jumps in time
OF_FORCES = 2  # derivatives that forces need beyond those of the motion


@under_own_settings
def breaks_of_laws(
    mechanism: Mechanism, first: float, last: float, order: int, *, forces: bool | None = None
) -> Float[np.ndarray, " time"]:
    """Return the instants at which laws of drivers, or of outputs that drivers follow, jump or bend, s.

    Laws of forces count as laws of time: jumps that a displacement, its rate or a Python function causes are not found.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism with numbers in the place of parameters.
    first, last : float
        Interval of time, s.
    order : int
        Highest derivative of the motion that matters.
    forces : bool, optional
        Whether laws of forces count; by default, if an output is a force.

    Examples
    --------
    >>> import jounce as jn
    >>> press = jn.load("examples/servo_press.yaml")
    >>> breaks_of_laws(press, 0.0, 1.2, 3).round(9).tolist()
    [0.05, 0.35, 0.55, 0.65, 0.75, 1.15]
    """
    breaks = law_breaks(laws_of(mechanism), first, last, order)
    if order < OF_FORCES or not (_shows_forces(mechanism) if forces is None else forces):
        return breaks
    of_forces = law_breaks(laws_of_forces(mechanism), first, last, order - OF_FORCES)
    return distinct_instants(np.concatenate([breaks, of_forces]), first, last)


@under_own_settings
def laws_may_break(mechanism: Mechanism, *, forces: bool | None = None) -> bool:
    """Return whether a law that `breaks_of_laws` searches may jump or bend anywhere, whatever the parameter values."""
    with_forces = _shows_forces(mechanism) if forces is None else forces
    return any(map(may_break, laws_of(mechanism))) or (with_forces and any(map(may_break, laws_of_forces(mechanism))))


@under_own_settings
def breaks_depend_on(mechanism: Mechanism, names: Iterable[str]) -> bool:
    """Return whether the breaks of the laws of a mechanism may depend on some of its parameters.

    Examples
    --------
    >>> import jounce as jn
    >>> press = jn.load("examples/servo_press.yaml")
    >>> breaks_depend_on(press, ["rod"]), breaks_depend_on(press, ["forming"])
    (False, True)
    """
    values = {name: float(mechanism.parameter_values[name]) for name in names}
    numbers = []

    def resolved(given: dict[str, Any]) -> dict[str, Any]:
        design = mechanism.with_parameters(**given)
        laws = [law for law in (*laws_of(design), *laws_of_forces(design)) if may_break(law)]
        numbers.extend(jax.tree.leaves(laws))
        return given

    try:
        jax.eval_shape(resolved, values)
    except Exception:  # noqa: BLE001 - a law that requires numbers in the place of parameters
        return True
    return any(isinstance(number, Tracer) for number in numbers)


def laws_of(mechanism: Mechanism) -> list[AbstractMotion]:
    """Return the laws of drivers and of the cams that they lead, with numbers in the place of parameters."""
    values, drivers = mechanism.parameter_values, with_output_drivers(mechanism).drivers.values()
    motions = (getattr(driver, "motion", None) for driver in drivers)
    laws = [resolve_motion(motion, values) for motion in motions if motion is not None]
    return [*laws, *(law for _, law in cams_in_time(mechanism))]


def laws_of_forces(mechanism: Mechanism) -> list[AbstractMotion]:
    """Return the time-dependent laws of forces, as laws of time alone."""
    laws = []
    for force in mechanism.forces.values():
        fields = [name for name, kind in field_kinds(type(force)).items() if kind in ("law", "laws")]
        laws += [law for name in fields for law in _in_time(getattr(force, name), force, mechanism.parameter_values)]
    return laws


def _shows_forces(mechanism: Mechanism) -> bool:
    return any(output.of_forces for output in mechanism.outputs.values())


def _in_time(law: Any, force: AbstractForce, parameters: dict[str, Any]) -> Iterator[AbstractMotion]:
    """Yield a law of a force, or each of its components, as a law of time alone if it depends on time."""
    if isinstance(law, VectorLaw):
        law = law.parts
    if isinstance(law, Sequence | np.ndarray) and not isinstance(law, str):
        for part in law:
            yield from _in_time(part, force, parameters)
        return
    if isinstance(law, TimeLaw):
        law = law.motion
    if isinstance(law, AbstractMotion):
        yield resolve_motion(law, parameters)
        return
    names = (*force.displacement_names, *force.velocity_names)
    if isinstance(law, ExpressionLaw):
        law, parameters, names = law.expression, law.parameters, (*law.displacements, *law.velocities)
    if isinstance(law, str):
        law = Expression(law)
    if isinstance(law, Expression) and "t" in law.names:
        values = {**parameters, **dict.fromkeys(names, ANYWHERE)}
        yield ExpressionMotion(law, {name: values[name] for name in law.names - {"t"}})
