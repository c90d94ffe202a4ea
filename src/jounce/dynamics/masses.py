"""The masses of all bodies of a mechanism as arrays, and gravity."""

from typing import Any, NamedTuple

import numpy as np
from jax.core import Tracer
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.errors import MechanismError
from jounce.mechanism import Mechanism, Model
from jounce.mechanism.building.contents import owned_arrays
from jounce.mechanism.masses import body_mass
from jounce.mechanism.resolve import along_instances, resolved
from jounce.mechanism.system import POSITION_COMPONENTS

Gravity = Float[Numbers, "component 1 #batch"]
"""Gravitational acceleration, m/s^2."""


class Masses(NamedTuple):
    """Masses, kg, centers of mass, m, and central second moments, kg m^2, of all bodies, the ground first.

    The second moments are the integrals of rho rho^T dm in body axes.
    """

    mass: Float[Numbers, "body #batch"]
    center: Float[Numbers, "component body #batch"]
    moments: Float[Numbers, "component component body #batch"]

    def scale(self, length: float) -> np.float64:
        """Return the scale of the masses: the largest mass, or else the largest moment over length^2, kg."""
        return np.float64(np.max(self.mass) or np.max(self.moments) / length**2)


def masses_of(mechanism: Mechanism) -> Masses:
    """Return the masses of all bodies, zero by default; parameters may be traced by JAX.

    Raises
    ------
    MechanismError
        If a body has an inertia without a mass, or a value is not valid.
    """
    size = POSITION_COMPONENTS[mechanism.space]
    tensor = size == 3
    columns: list[tuple[Any, ...]] = [(0.0, np.zeros(size), np.zeros((3, 3)) if tensor else 0.0)]
    for name, body in mechanism.bodies.items():
        if body.mass is None and body.inertia is not None:
            raise MechanismError("a body with an inertia needs a mass, too", name=f"bodies.{name}.mass")
        mass, center, inertia = body_mass(name, body, mechanism.parameter_values, size, solid=False)
        columns.append((mass, center, inertia * np.eye(3) if tensor and np.ndim(inertia) < 2 else inertia))
    masses, centers, inertias = (along_instances(*column) for column in zip(*columns, strict=True))
    # for a planar body only the sum of the two second moments is known, and only it counts
    moments = second_moments(inertias) if tensor else np.eye(2)[..., None, None] * (0.5 * inertias)[None, None]
    return Masses(masses, centers, moments)


def second_moments(tensor: Float[Numbers, "3 3 *batch"]) -> Float[Numbers, "3 3 *batch"]:
    """Return the second moments about the center of mass from the inertia tensor: Negrean 2025, equation 109."""
    unit = np.eye(3).reshape(3, 3, *[1] * (tensor.ndim - 2))
    return (tensor[0, 0] + tensor[1, 1] + tensor[2, 2])[None, None] / 2 * unit - tensor


def required_masses(mechanism: Mechanism, purpose: str = "energies") -> Masses:
    """Return the masses of all bodies.

    Raises
    ------
    MechanismError
        If no body has a mass or an inertia, or a body has an inertia and no mass is given.
    """
    masses = masses_of(mechanism)
    values = [value for value in (masses.mass, masses.moments) if not isinstance(value, Tracer)]
    if len(values) == 2 and not any(map(np.any, values)):
        raise MechanismError(f"no body has a mass; {purpose} need some", name="bodies")
    return masses


def stored_masses(model: Model, mechanism: Mechanism, purpose: str) -> Masses:
    """Return the masses of all bodies, as `required_masses` does, kept with the model of the mechanism.

    A stored model is that of a mechanism with the same values (`mechanism.building.contents`), masses among them.
    """
    values = vars(model)
    if "masses" not in values:
        values["masses"] = owned_arrays(required_masses(mechanism, purpose))
    return values["masses"]


def check_loads(mechanism: Mechanism, name: str = "bodies") -> None:
    """Raise MechanismError unless a body has a mass or a force is applied."""
    if not mechanism.forces and all(body.mass is None for body in mechanism.bodies.values()):
        raise MechanismError("forces need masses, and no body has one; give the bodies mass and inertia", name=name)


def gravity_of(mechanism: Mechanism) -> Gravity:
    """Return the gravitational acceleration of a mechanism, m/s^2; zero by default.

    Raises
    ------
    MechanismError
        If it is not a vector of finite numbers.
    """
    size = POSITION_COMPONENTS[mechanism.space]
    components = [0.0] * size if mechanism.gravity is None else mechanism.gravity
    return resolved(components, "gravity", "vector", size, mechanism.parameter_values)[:, None, None]
