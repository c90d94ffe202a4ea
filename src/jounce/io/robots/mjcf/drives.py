"""Drives of the joints of a compiled MJCF model: armature, damping, friction, springs, and tendons along joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jounce.robot.model.couplings import BallDrive, Tendon

OF_CONSTRAINTS = ("FRICTIONLOSS", "EQUALITY", "LIMIT")  # which the flag of all constraints disables, too
OF_BALL = {"armature": "armature", "damping": "damping", "friction": "frictionloss"}


class Drives:
    """Drives of joints, as MuJoCo computes them.

    Parameters
    ----------
    model, mujoco
        Compiled model, and the package.
    names : sequence of str
        Names of the joints, by number.
    """

    def __init__(self, model: Any, mujoco: Any, names: Sequence[str]):
        self.model, self.mujoco, self.names = model, mujoco, names
        self.efforts = _efforts(model, mujoco)

    def works(self, part: str) -> bool:
        """Return whether no flag of the file disables a part of the dynamics."""
        return works(self.model.opt.disableflags, part, self.mujoco)

    @property
    def passive(self) -> bool:
        """Whether there are passive forces; MuJoCo disables all of them if it disables both springs and dampers."""
        return self.works("SPRING") or self.works("DAMPER")

    def of_joint(self, j: int) -> tuple[dict[str, float], str]:
        """Return the drive of a hinge or a slide, and the part of it that is no single number; empty if there is none.

        Armature and damping include those of its actuators times the square of the gear.
        """
        model, dof = self.model, self.model.jnt_dofadr[j]
        armature, damping = float(model.dof_armature[dof]), float(model.dof_damping[dof])
        unsupported = "damping" if model.dof_dampingpoly[dof].any() else ""
        for k in np.flatnonzero(model.actuator_trnid[:, 0] == j):
            gear = float(model.actuator_gear[k, 0]) ** 2
            if np.any(model.actuator_dampingpoly[k]):
                unsupported = "damping of an actuator"
            armature += gear * float(model.actuator_armature[k])
            damping += gear * float(np.ravel(model.actuator_damping[k])[0])
        given = {
            "armature": armature,
            "damping": damping if self.works("DAMPER") else 0.0,
            "friction": float(model.dof_frictionloss[dof]) if self.works("FRICTIONLOSS") else 0.0,
        }
        if single_spring(model, j) and self.works("SPRING"):
            given["stiffness"] = float(model.jnt_stiffness[j])
            given["spring_reference"] = float(model.qpos_spring[model.jnt_qposadr[j]])
        return given, unsupported

    def of_several(self, j: int) -> dict[str, float]:
        """Return the drive of a ball or free joint, which is the same along all its freedoms."""
        dof = self.model.jnt_dofadr[j]
        is_enabled = {"armature": True, "damping": self.works("DAMPER"), "friction": self.works("FRICTIONLOSS")}
        values = {key: float(getattr(self.model, f"dof_{name}")[dof]) for key, name in OF_BALL.items()}
        return {key: value if is_enabled[key] else 0.0 for key, value in values.items()}

    def ball(self, name: str, turns: Sequence[str], given: Mapping[str, float]) -> list[BallDrive]:
        """Return the drive of three turns, in a list that is empty if nothing drives them."""
        return [BallDrive(name, turns, **given)] if any(given.values()) else []

    def compensated(self, body: int) -> float:
        """Return the share of gravity that is compensated for a body."""
        applies = self.passive and not self.model.jnt_actgravcomp.any()
        return float(self.model.body_gravcomp[body]) if applies else 0.0

    def tendons(self, fixed: Mapping[str, float]) -> list[Tendon]:
        """Return the tendons along joints with a spring, damping or friction, unless all their joints are held."""
        model, tendons = self.model, []
        for k in range(model.ntendon):
            if not along_joints(model, k, self.mujoco):
                continue
            parts = range(int(model.tendon_adr[k]), int(model.tendon_adr[k]) + int(model.tendon_num[k]))
            weights: dict[str, float] = {}
            for part in parts:
                name = self.names[int(model.wrap_objid[part])]
                weights[name] = weights.get(name, 0.0) + float(model.wrap_prm[part])
            neutral_length = model.tendon_lengthspring[k]
            springs = self.works("SPRING") and neutral_length[0] == neutral_length[1]
            given = {
                "stiffness": float(model.tendon_stiffness[k]) if springs else 0.0,
                "damping": float(model.tendon_damping[k]) if self.works("DAMPER") else 0.0,
                "friction": float(model.tendon_frictionloss[k]) if self.works("FRICTIONLOSS") else 0.0,
                "armature": float(model.tendon_armature[k]),
            }
            if any(given.values()) and not set(weights) <= set(fixed):
                name = model.tendon(k).name or f"tendon_{k}"
                tendons.append(Tendon(name, weights, rest=float(neutral_length[0]), **given))
        return tendons


def works(flags: int, part: str, mujoco: Any) -> bool:
    """Return whether the flags of a file enable a part of the dynamics, by its name in MuJoCo."""
    switches = (part, "CONSTRAINT") if part in OF_CONSTRAINTS else (part,)
    return not any(flags & int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{switch}")) for switch in switches)


def single_spring(model: Any, j: int) -> bool:
    """Return whether the spring of a joint is linear and acts on one coordinate."""
    single = model.jnt_type[j] >= 2
    return bool(single and not model.jnt_stiffnesspoly[j].any())


def along_joints(model: Any, tendon: int, mujoco: Any) -> bool:
    """Return whether a tendon runs along joints, not between points."""
    first = int(model.tendon_adr[tendon])
    kinds = model.wrap_type[first : first + int(model.tendon_num[tendon])]
    return bool(np.all(kinds == int(mujoco.mjtWrap.mjWRAP_JOINT)))


def _efforts(model: Any, mujoco: Any) -> dict[int, float]:
    """Return the largest force of each joint whose own range, or that of its only actuator, is symmetric."""
    efforts: dict[int, float] = {}
    for j in range(model.njnt):
        actuators = np.flatnonzero(model.actuator_trnid[:, 0] == j)
        ranges = [model.jnt_actfrcrange[j]] if model.jnt_actfrclimited[j] else []
        if len(actuators) == 1:
            k = actuators[0]
            gear = float(model.actuator_gear[k, 0])
            types = [int(getattr(model, f"actuator_{name}type")[k]) for name in ("gain", "bias", "dyn")]
            simple = (mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_NONE, mujoco.mjtDyn.mjDYN_NONE)
            if model.actuator_forcelimited[k]:
                ranges.append(model.actuator_forcerange[k] * gear)
            elif types == [int(kind) for kind in simple] and model.actuator_ctrllimited[k]:
                ranges.append(model.actuator_ctrlrange[k] * model.actuator_gainprm[k, 0] * gear)
        symmetric = [float(abs(high)) for low, high in ranges if low == -high and high != 0]
        if symmetric:
            efforts[j] = min(symmetric)
    return efforts
