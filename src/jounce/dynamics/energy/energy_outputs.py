"""Energies as outputs: kinetic, of accelerations of any order, and potential, of a body or of the whole mechanism."""

import abc
from typing import ClassVar

from jounce.base.modules import field
from jounce.base.shapes import Numbers
from jounce.constraints.base import Whole
from jounce.dynamics.energy.energies import energy_coefficients, energy_unit
from jounce.dynamics.energy.potential import potential_coefficients
from jounce.errors import MechanismError, check_name, whole_number
from jounce.kinematics import Motion
from jounce.kinematics.position_analysis.solve import HIGHEST_ORDER
from jounce.mechanism import AbstractMotionOutput, Mechanism


class AbstractEnergyOutput(AbstractMotionOutput):
    """An energy of all bodies of a mechanism, J; of accelerations of order p, J/s^(2 p)."""

    unit = "J"
    rate_names = ("energy", "first rate", "second rate", "third rate", "fourth rate")
    source: ClassVar[str] = "mechanism"  # the key of a file that names the owner of the energy

    @property
    def single_body(self) -> str | None:
        """The single body whose energy it is; None for all bodies."""
        return getattr(self, "body", None)

    def check(self, mechanism: Mechanism) -> None:
        """Raise MechanismError unless the body exists and has a mass, or for all bodies, unless one of them has."""
        bodies, name_of_body = mechanism.bodies, self.single_body
        if name_of_body is not None:
            check_name("moving body", name_of_body, bodies, MechanismError, name="body")
        if all(body.mass is None for name, body in bodies.items() if name_of_body in (None, name)):
            phrase = "no body has a mass" if name_of_body is None else "this body has no mass"
            raise MechanismError(f"{phrase}, and an energy needs one", name=self.source, value=name_of_body)

    def coefficients(self, motion: Motion) -> Numbers:
        """Return the Taylor coefficients of the energy, (levels, 1, time)."""
        energies = self._of_bodies(motion)
        if self.single_body is None:
            return energies.sum(axis=1, keepdims=True)
        index = 1 + list(motion.mechanism.bodies).index(self.single_body)  # the ground first
        return energies[:, index : index + 1]

    @abc.abstractmethod
    def _of_bodies(self, motion: Motion) -> Numbers:
        """Return the Taylor coefficients of all bodies, (levels, bodies, time)."""


class KineticEnergyOutput(AbstractEnergyOutput):
    """Kinetic energy of all bodies, J. Negrean 2025, equations 65-77."""

    lost_orders = 1

    def _of_bodies(self, motion):
        return sum(energy_coefficients(motion, 0))


class AccelerationEnergyOutput(AbstractEnergyOutput):
    """Acceleration energy of order p of all bodies, J/s^(2 p). Negrean 2025, equations 83-122."""

    order: Whole = field(static=True, default=1)

    def __check_init__(self):
        whole_number("order", self.order, 0, HIGHEST_ORDER, error=MechanismError)

    @property
    def lost_orders(self) -> int:  # type: ignore[override] - of an instance, as it depends on the order
        """Number of derivatives of the motion that the energy uses up."""
        return int(self.order) + 1

    @property
    def unit(self) -> str:
        """Unit of the energy."""
        return energy_unit(int(self.order))

    def _of_bodies(self, motion):
        return sum(energy_coefficients(motion, int(self.order)))


class PotentialEnergyOutput(AbstractEnergyOutput):
    """Potential energy of all bodies in gravity, J; zero at the origin."""

    def _of_bodies(self, motion):
        return potential_coefficients(motion)


class BodyKineticEnergyOutput(KineticEnergyOutput):
    """Kinetic energy of a body, J. Negrean 2025, equations 65-72."""

    body: str = field(static=True, kw_only=True)

    source = "body"


class BodyAccelerationEnergyOutput(AccelerationEnergyOutput):
    """Acceleration energy of order p of a body, J/s^(2 p). Negrean 2025, equations 83-122."""

    body: str = field(static=True, kw_only=True)

    source = "body"


class BodyPotentialEnergyOutput(PotentialEnergyOutput):
    """Potential energy of a body in gravity, J; zero at the origin."""

    body: str = field(static=True, kw_only=True)

    source = "body"


ENERGY_OUTPUTS: tuple[tuple[str, type[AbstractEnergyOutput]], ...] = (
    ("kinetic_energy", KineticEnergyOutput),
    ("kinetic_energy", BodyKineticEnergyOutput),
    ("acceleration_energy", AccelerationEnergyOutput),
    ("acceleration_energy", BodyAccelerationEnergyOutput),
    ("potential_energy", PotentialEnergyOutput),
    ("potential_energy", BodyPotentialEnergyOutput),
)
"""For each energy output, the value of ``quantity`` in a file, and its class."""
