"""From a motion of which outputs were held to laws to that of the drivers that move them."""

import dataclasses

import numpy as np

from jounce.jet.derivatives import plain_derivatives
from jounce.kinematics.gauss_newton import Displacements
from jounce.kinematics.motion import Motion
from jounce.kinematics.status import Status
from jounce.mechanism import Model, build
from jounce.mechanism.builder import counted_as_in
from jounce.mechanism.held_outputs import led_outputs
from jounce.modules import with_fields
from jounce.trajectory import HermiteMotion


def actuated(motion: Motion) -> Motion:
    """Return a motion for which outputs were held to their laws as that of the drivers that move them.

    The bodies move as they did; drivers have the laws found, so that forces are theirs. Any other motion is returned as
    it is.
    """
    mechanism = motion.mechanism
    led = led_outputs(mechanism)
    if not led or not np.any(motion.status == Status.OK):
        return motion
    laws = {name: _law(motion, name) for name in led}
    drivers = {name: dataclasses.replace(mechanism.drivers[name], motion=law) for name, law in laws.items()}
    driven = dataclasses.replace(mechanism, drivers={**mechanism.drivers, **drivers})
    return motion.moved_by(_counted(build(driven), motion.model, float(motion.time[0])), driven)


def _law(motion: Motion, name: str) -> HermiteMotion:
    """Return the law of a driver through all derivatives that there are, those beyond the order of the motion too."""
    derivatives = np.asarray(plain_derivatives(np.asarray(motion.driver_coefficients(name))[:, 0]))
    solved = motion.status == Status.OK
    return HermiteMotion(motion.time[solved], derivatives.T[solved])


def _counted(model: Model, held: Model, instant: float) -> Model:
    """Return the model of the drivers with all that was found when the outputs were held."""
    _, _, jacobian = Displacements(model, instant).at(held.reference)
    system = with_fields(
        model.system,
        groups=counted_as_in(model.system.groups, held),
        forces=held.system.forces,
        outputs=held.system.outputs,
        row_scale=jacobian.row_scale[:, None],
        rank=held.system.rank,
    )
    return dataclasses.replace(
        model, system=system, reference=held.reference, prescribed=held.prescribed, history=held.history
    )
