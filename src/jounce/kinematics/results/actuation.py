"""Actuation: the motion of drivers that make outputs follow laws."""

import dataclasses

import numpy as np
from jaxtyping import Float

from jounce.base.modules import with_fields
from jounce.jet.derivatives import plain_derivatives
from jounce.kinematics.assembly.gauss_newton import Displacements
from jounce.kinematics.results.motion import Motion
from jounce.kinematics.status import Status
from jounce.mechanism import Mechanism, Model, build
from jounce.mechanism.building.builder import counted_as_in
from jounce.mechanism.laws.output_drivers import output_laws, without_output_laws
from jounce.trajectory import HermiteMotion


def actuated(motion: Motion) -> Motion:
    """Return a motion that was solved with outputs held to their laws as the motion of the drivers that move them.

    The bodies move as before. The drivers have the laws found, so that forces are those of the drivers. Any other
    motion is returned unchanged.
    """
    mechanism = motion.mechanism
    held_outputs = output_laws(mechanism)
    if not held_outputs or not np.any(motion.status == Status.OK):
        return motion
    laws = {name: _law(motion, name) for name in held_outputs}
    drivers = {name: dataclasses.replace(mechanism.drivers[name], motion=law) for name, law in laws.items()}
    driven = dataclasses.replace(mechanism, drivers={**mechanism.drivers, **drivers})
    model = _counted(build(driven), motion.model, _row_scale(mechanism, motion.model, float(motion.time[0])))
    return motion.moved_by(model, driven)


def _law(motion: Motion, name: str) -> HermiteMotion:
    """Return the law of a driver through all its derivatives, including those beyond the order of the motion."""
    derivatives = np.asarray(plain_derivatives(np.asarray(motion.driver_coefficients(name))[:, 0]))
    solved = motion.status == Status.OK
    return HermiteMotion(motion.time[solved], derivatives.T[solved])


def _row_scale(mechanism: Mechanism, driven: Model, instant: float) -> Float[np.ndarray, "row 1"]:
    """Return the row scales of drivers and joints at the first instant, at which the outputs were held.

    The scales do not depend on the laws. The mechanism without them is used, because laws found by a motion have one
    piece per instant, and each number of pieces would compile another program.
    """
    displace = Displacements(build(without_output_laws(mechanism)), instant)
    return displace.at(driven.reference).jacobian.row_scale[:, None]


def _counted(model: Model, driven: Model, row_scale: Float[np.ndarray, "row 1"]) -> Model:
    """Return the model of the drivers, with angle counts, forces and rank of the model that held the outputs."""
    groups, source = counted_as_in(model.system.groups, driven), driven.system
    fields = {"forces": source.forces, "outputs": source.outputs, "row_scale": row_scale, "rank": source.rank}
    system = with_fields(model.system, groups=groups, **fields)
    return dataclasses.replace(
        model, system=system, reference=driven.reference, prescribed=driven.prescribed, history=driven.history
    )
