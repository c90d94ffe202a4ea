"""Masses, centers of mass and inertias of bodies as checked numbers."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from jax.core import Tracer

from jounce.errors import MechanismError, RobotError
from jounce.mechanism.mechanism import Body
from jounce.mechanism.resolve import resolved
from jounce.rigid.inertia import ADVICE, Inertia


def body_mass(
    name: str, body: Body, parameters: Mapping[str, Any], components: int, *, solid: bool = True
) -> tuple[Any, Any, Any]:
    """Return the mass, the center of mass, (2,) or (3,), and the inertia about it, () or (3, 3), of a body.

    Values that are not given are zero.

    Parameters
    ----------
    name : str
        Name of the body, for messages.
    body : Body
        Body with values that may be expressions.
    parameters : mapping of str to float
        Values of the names in expressions.
    components : int
        2 in the plane, 3 in space.
    solid : bool, default True
        Whether to refuse moments that no rigid body has; those of a link may contain the rotor of a drive.

    Raises
    ------
    MechanismError
        If a value has a wrong shape or is not finite, a mass or inertia is negative, or no rigid body has such moments.

    Examples
    --------
    >>> import jounce as jn
    >>> plate = jn.Body([0, 0], mass="m", inertia="m*a**2/6", center_of_mass=[0.1, 0])
    >>> mass, center, inertia = body_mass("plate", plate, {"m": 3.0, "a": 2.0}, 2)
    >>> mass, center.tolist(), inertia
    (3.0, [0.1, 0.0], 2.0)
    """
    location = f"bodies.{name}"
    kind, zero = ("scalar", 0.0) if components == 2 else ("tensor", [0.0] * 3)
    mass = resolved(0.0 if body.mass is None else body.mass, f"{location}.mass", "scalar", 0, parameters)
    center = [0.0] * components if body.center_of_mass is None else body.center_of_mass
    center = resolved(center, f"{location}.center_of_mass", "vector", components, parameters)
    inertia = zero if body.inertia is None else body.inertia
    inertia = resolved(inertia, f"{location}.inertia", kind, components, parameters)
    for field, value in (("mass", mass), ("inertia", inertia)):
        if np.shape(value) == () and not isinstance(value, Tracer) and value < 0:
            raise MechanismError("must not be negative", name=f"{location}.{field}", value=float(value))
    if solid and components == 3 and not isinstance(inertia, Tracer):
        try:
            unit_mass = Inertia(1.0, tensor=inertia, strict=False)
        except RobotError as error:
            raise MechanismError(error.message, name=f"{location}.inertia", value=error.value) from None
        if fault := unit_mass.fault:
            raise MechanismError(f"{fault.words}; {ADVICE}", name=f"{location}.inertia", value=fault.value)
        inertia = unit_mass.tensor
    return mass, center, inertia
