"""Drives of joints: a motor with a gear, and a spring with a damper between the gear and the link."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.errors import RobotError, check_name
from jounce.rigid.inertia import finite_numbers

POSITIVE = ("stiffness", "lead", "deflection_limit", "torque_limit", "velocity_limit")
NOT_NEGATIVE = ("damping", "rotor_inertia")


@dataclasses.dataclass(frozen=True)
class Drive:
    """The motor of a joint or driver, its gear, and the spring between the gear and the link.

    Stiffness, damping and deflection are values at the joint, behind the gear: N m/rad, N m s/rad and rad for a turning
    joint, N/m, N s/m and m for a sliding one. Inertia, torque and velocity limits are values of the motor itself,
    before the gear.

    Parameters
    ----------
    stiffness : float, optional
        Stiffness of the spring; the joint is rigid unless given.
    damping : float, default 0
        Damping parallel to the spring.
    rotor_inertia : float, optional
        Inertia of the motor about its own axis, kg m^2, or mass of a sliding motor, kg; by default the armature of the
        joint in the robot file, which is the same inertia as seen at the joint.
    gear_ratio : float, default 1
        Turns of the motor for one turn of the joint; negative if the gear reverses.
    lead : float, optional
        Travel of a sliding joint for one turn of a turning motor, m; instead of `gear_ratio`.
    deflection_limit : float, optional
        Largest deflection of the spring to either side.
    torque_limit, velocity_limit : float, optional
        Limits of the motor: N m and rad/s, or N and m/s for a sliding motor.

    Raises
    ------
    RobotError
        If a value is not finite, is zero or negative where it must not be, or contradicts another.

    Examples
    --------
    >>> import jounce as jn
    >>> drive = jn.planning.Drive(stiffness=2e4, damping=10.0, rotor_inertia=5e-5, gear_ratio=100)
    >>> drive.reflected_inertia, drive.time_constant
    (0.5, 0.0005)
    """

    stiffness: float | int | None = None
    damping: float | int = 0.0
    rotor_inertia: float | int | None = None
    gear_ratio: float | int = 1.0
    lead: float | int | None = None
    deflection_limit: float | int | None = None
    torque_limit: float | int | None = None
    velocity_limit: float | int | None = None

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if value is not None or field.default is not None:
                object.__setattr__(self, field.name, float(finite_numbers(field.name, value, ())))
        for field in POSITIVE:
            if getattr(self, field) is not None and getattr(self, field) <= 0:
                raise RobotError("must be greater than zero", name=field, value=getattr(self, field))
        for field in NOT_NEGATIVE:
            if (getattr(self, field) or 0.0) < 0:
                raise RobotError("must be zero or greater", name=field, value=getattr(self, field))
        if self.gear_ratio == 0:
            raise RobotError("must not be zero", name="gear_ratio", value=0.0)
        if self.lead is not None and self.gear_ratio != 1.0:
            raise RobotError("cannot be given together with a lead", name="gear_ratio", value=self.gear_ratio)
        for field in ("damping", "deflection_limit"):
            if self.stiffness is None and getattr(self, field):
                message = "belongs to a spring; give the stiffness too, or leave it out for a rigid joint"
                raise RobotError(message, name=field, value=getattr(self, field))

    @property
    def elastic(self) -> bool:
        """Whether the drive has a spring."""
        return self.stiffness is not None

    @property
    def ratio(self) -> float:
        """Ratio of the motion of the motor to that of the joint: rad/rad, m/m, or rad/m with a lead."""
        return self.gear_ratio if self.lead is None else 2 * math.pi / self.lead

    @property
    def reflected_inertia(self) -> float | None:
        """Inertia of the rotor as seen at the joint, kg m^2 or kg; None if the robot file gives it."""
        return None if self.rotor_inertia is None else self.ratio**2 * self.rotor_inertia

    @property
    def time_constant(self) -> float:
        """Damping over stiffness, s, the time constant with which a free deflection decays; 0 without damping."""
        return 0.0 if self.stiffness is None else self.damping / self.stiffness


@dataclasses.dataclass(frozen=True, eq=False)
class DriveArrays:
    """The drives of all joints in arrays of shape (joints,), as seen at the joints.

    Attributes
    ----------
    names : tuple of str
        Names of joints or drivers.
    turning : tuple of bool
        Whether each joint turns, rather than slides.
    motor_turning : tuple of bool
        Whether each motor turns.
    stiffness : array
        Stiffnesses, N m/rad or N/m, infinite for rigid joints.
    time_constant : array
        Damping over stiffness, s.
    inertia : array
        Inertias of rotors, kg m^2 or kg.
    friction : array
        Coulomb friction of the motors, N m or N.
    ratio : array
        Ratios of the gears.
    limits : array of shape (3, joints)
        Limits of deflection, motor velocity and motor torque; NaN for no limit.
    """

    names: tuple[str, ...]
    turning: tuple[bool, ...]
    motor_turning: tuple[bool, ...]
    stiffness: Float[np.ndarray, " joint"]
    time_constant: Float[np.ndarray, " joint"]
    inertia: Float[np.ndarray, " joint"]
    friction: Float[np.ndarray, " joint"]
    ratio: Float[np.ndarray, " joint"]
    limits: Float[np.ndarray, "3 joint"]

    @classmethod
    def of(
        cls,
        names: Sequence[str],
        turning: Sequence[bool],
        drives: object,
        armature: Float[np.ndarray, " joint"],
        friction: Float[np.ndarray, " joint"],
        kind: str,
    ) -> "DriveArrays":
        """Return the checked arrays of drives.

        Parameters
        ----------
        names, turning
            Names of joints or drivers, and whether each turns.
        drives : dict of str to Drive
            Drives; joints without one are rigid.
        armature, friction : array of shape (joints,)
            Values of the robot file.
        kind : str
            Noun for the names, for messages.

        Raises
        ------
        RobotError
            If `drives` is not a mapping, has an unknown name, or a drive does not fit its joint.
        """
        if not isinstance(drives, Mapping):
            raise RobotError(
                "must be a mapping of names to jn.planning.Drive, as jn.io.load_drives gives it",
                name="drives",
                value=drives,
            )
        for name, drive in drives.items():
            check_name(kind, name, names, RobotError, name="drives")
            if not isinstance(drive, Drive):
                raise RobotError("must be a jn.planning.Drive", name=f"drives.{name}", value=drive)
            if drive.lead is not None and turning[names.index(name)]:
                message = "is for joints and drivers that slide; this one turns, give a gear_ratio"
                raise RobotError(message, name=f"drives.{name}.lead", value=drive.lead)
        entries = [drives.get(name, Drive()) for name in names]
        inertia = [
            a if x.reflected_inertia is None else x.reflected_inertia for x, a in zip(entries, armature, strict=True)
        ]
        limits = [[x.deflection_limit, x.velocity_limit, x.torque_limit] for x in entries]

        def array(values: Sequence[Any]) -> np.ndarray:
            return np.array(values, float).reshape(len(names))

        return cls(
            tuple(names),
            tuple(map(bool, turning)),
            tuple(bool(t) or x.lead is not None for x, t in zip(entries, turning, strict=True)),
            array([np.inf if x.stiffness is None else x.stiffness for x in entries]),
            array([x.time_constant for x in entries]),
            array(inertia),
            np.asarray(friction, float),
            array([x.ratio for x in entries]),
            np.array(limits, float).reshape(len(names), 3).T,  # None becomes NaN
        )

    @property
    def elastic(self) -> np.ndarray:
        """Which joints have a spring."""
        return np.isfinite(self.stiffness)
