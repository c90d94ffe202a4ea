"""Forces in a moving mechanism, with rates to any order: what drivers, joints and applied forces exert."""

import copy
import dataclasses
from typing import TYPE_CHECKING

from jounce.base.shapes import ArrayLike
from jounce.dynamics.inverse.outputs.components import (
    AppliedForceOutput,
    AppliedTorqueOutput,
    DriverForceOutput,
    DriverTorqueOutput,
    GroundForceOutput,
    GroundTorqueOutput,
    JointForceOutput,
    JointTorqueOutput,
    is_turning,
)
from jounce.dynamics.motion_values import check_motion
from jounce.kinematics import Motion
from jounce.mechanism.redundant_reactions import RedundantReactions

if TYPE_CHECKING:
    import xarray


def driver_force(motion: Motion, name: str, *, redundant: RedundantReactions | None = None) -> "xarray.DataArray":
    """Return the force or torque of a driver with its rates: yank, second rate and so on.

    It is conjugate to the motion law: a torque, N m, where the law is an angle, else a force, N, and its product with
    the rate of the law is the power that the driver puts in. It follows from the transposed factor of the Jacobian,
    order after order; no difference is taken.

    Parameters
    ----------
    motion : Motion
        Of a mechanism with masses or applied forces.
    name : str
        Name of the driver.
    redundant : str or mapping, optional
        Which forces to give where constraints are redundant, as `Mechanism.redundant_reactions`, which it is unless
        given.

    Returns
    -------
    xarray.DataArray
        Dimensions time and derivative. Two orders of the motion are used up by accelerations: one solved to order 4
        has a second rate. (An output, `DriverTorqueOutput`, is not shorter, as the solver goes two orders further.)
        NaN where redundant drivers leave it open, with the reason as the attribute ``comment``.

    Raises
    ------
    MechanismError
        If no driver has this name, or nothing in the mechanism has a mass.

    Examples
    --------
    >>> import jounce as jn
    >>> wheel = jn.Mechanism(
    ...     space="planar",
    ...     bodies={"wheel": jn.Body([0, 0], mass=2.0, inertia=0.5)},
    ...     joints={"O": jn.planar.Revolute(("ground", "wheel"), [0, 0], [0, 0])},
    ...     drivers={"turn": jn.drivers.CoordinateDriver(("ground", "wheel"), "angle", motion="t**4")},
    ... )
    >>> torque = jn.driver_force(jn.solve(wheel, [2.0], order=4), "turn")  # 0.5 kg m^2 * 12 t^2
    >>> torque.values.round(12).tolist(), torque.attrs["units"]
    ([[24.0, 24.0, 12.0]], 'N*m')
    """
    check_motion(motion)
    driver = motion.mechanism.drivers.get(name)
    kind = DriverTorqueOutput if driver is not None and is_turning(driver) else DriverForceOutput
    return _with_choice_of_reactions(motion, redundant).evaluate(kind(name), name)


@dataclasses.dataclass(frozen=True)
class Reaction:
    """What a joint does to a body, with rates.

    Attributes
    ----------
    force : xarray.DataArray
        N, N/s, ...; dimensions time, derivative, component.
    torque : xarray.DataArray
        N m, N m/s, ..., about the requested point; without components in the plane.
    """

    force: "xarray.DataArray"
    torque: "xarray.DataArray"


def joint_reaction(
    motion: Motion,
    name: str,
    body: str | None = None,
    frame: str = "global",
    point: ArrayLike | None = None,
    *,
    redundant: RedundantReactions | None = None,
) -> Reaction:
    """Return the force and torque that a joint, or a driver, exerts on one of its bodies, with rates.

    All that it exerts has no resultant. What its bodies lack of that is on the ground: a coordinate of one body and a
    ratio of angles are measured there, so that a joint that is given by these has reactions on the ground too.

    Parameters
    ----------
    motion : Motion
        Of a mechanism with masses or applied forces.
    name : str
        Name of the joint, of the driver, or of an applied force between bodies.
    body : str, optional
        On which body; the second one of the joint unless given. ``"ground"`` is one of each.
    frame : str, default "global"
        In whose axes: ``"global"``, ``"body"`` (that on which it acts), or the name of any body. The rates are those of
        the components in these axes.
    point : sequence, optional
        About which point of the body the torque is taken, in its frame, m; that of the joint unless given, or the
        origin of the body where the joint has none on it.
    redundant : str or mapping, optional
        Which reactions to give where constraints are redundant, as `Mechanism.redundant_reactions`, which it is unless
        given: ``"unique"``, ``"least_norm"``, or stiffnesses of joints.

    Returns
    -------
    Reaction
        Force and torque, two orders shorter than the motion. Components that redundant constraints leave open are NaN,
        with the reason as the attribute ``comment`` (Wojtyra 2005).

    Raises
    ------
    MechanismError
        If no joint, driver or force has this name, the body is not one of its own, there is no such frame, or nothing
        has a mass.

    Examples
    --------
    >>> import jounce as jn
    >>> swing = jn.Mechanism(
    ...     space="planar",
    ...     gravity=[0, -10.0],
    ...     bodies={"arm": jn.Body([0, 0], mass=2.0, center_of_mass=[0.5, 0])},
    ...     joints={"O": jn.planar.Revolute(("ground", "arm"), [0, 0], [0, 0])},
    ...     drivers={"turn": jn.drivers.CoordinateDriver(("ground", "arm"), "angle", motion="3*t")},
    ... )
    >>> pin = jn.joint_reaction(jn.solve(swing, [0.0], order=3), "O", frame="body")
    >>> pin.force.sel(derivative=0).values.round(12).tolist()  # centripetal, and the weight
    [[-9.0, 20.0]]
    """
    check_motion(motion)
    force = JointForceOutput(name, body, frame)
    torque = JointTorqueOutput(name, body, frame, point)
    chosen = _with_choice_of_reactions(motion, redundant)
    return Reaction(chosen.evaluate(force, name), chosen.evaluate(torque, name))


def ground_reaction(
    motion: Motion, point: ArrayLike | None = None, *, redundant: RedundantReactions | None = None
) -> Reaction:
    """Return the total force and torque of a mechanism on the ground, with rates: shaking force and shaking moment.

    They are those of all joints, drivers and forces between bodies. With weights and loads from outside they are what
    the momentum of the bodies lacks: its rate is weights and loads less this force.

    Parameters
    ----------
    motion : Motion
        Of a mechanism with masses or applied forces.
    point : sequence, optional
        About which point of the ground the torque is taken, m; the origin unless given.
    redundant : str or mapping, optional
        As of `joint_reaction`. Where reactions are not unique, their total may be.

    Returns
    -------
    Reaction
        Force and torque, two orders shorter than the motion.

    Raises
    ------
    MechanismError
        If nothing in the mechanism has a mass and no force is applied.

    Examples
    --------
    >>> import jounce as jn
    >>> lift = jn.Mechanism(
    ...     space="planar",
    ...     gravity=[0, -10.0],
    ...     bodies={"lift": jn.Body([0, 0], mass=2.0, inertia=0.1)},
    ...     joints={"guide": jn.planar.Prismatic(("ground", "lift"), [0, 0], [0, 0], [0, 1], [0, 1])},
    ...     drivers={"motor": jn.drivers.CoordinateDriver(("ground", "lift"), "y", motion="t**3")},
    ... )
    >>> shaking = jn.dynamics.ground_reaction(jn.solve(lift, [1.0], order=4))
    >>> shaking.force.sel(component="y").values.round(12).tolist()  # -2 kg (10 + 6 t) m/s^2
    [[-32.0, -12.0, 0.0]]
    """
    check_motion(motion)
    chosen = _with_choice_of_reactions(motion, redundant)
    return Reaction(
        chosen.evaluate(GroundForceOutput(), "ground"), chosen.evaluate(GroundTorqueOutput(point=point), "ground")
    )


def _with_choice_of_reactions(motion: Motion, redundant: RedundantReactions | None) -> Motion:
    """Return a motion whose mechanism has another choice of reactions that redundant constraints leave open."""
    if redundant is None or redundant == motion.mechanism.redundant_reactions:
        return motion
    other = copy.copy(motion)
    other.mechanism = dataclasses.replace(motion.mechanism, redundant_reactions=redundant)
    other.derived = {}
    return other


def applied_force(motion: Motion, name: str) -> "xarray.DataArray":
    """Return an applied force or torque with its rates, along its displacement or by components.

    Parameters
    ----------
    motion : Motion
        Of a mechanism with applied forces.
    name : str
        Name of the force.

    Returns
    -------
    xarray.DataArray
        Dimensions time, derivative and, for a vector, component; two orders shorter than the motion.

    Raises
    ------
    MechanismError
        If no force has this name.

    Examples
    --------
    >>> import jounce as jn
    >>> sled = jn.Mechanism(
    ...     space="planar",
    ...     bodies={"sled": jn.Body([1, 0])},
    ...     joints={"rail": jn.planar.Prismatic(("ground", "sled"), [0, 0], [0, 0], [1, 0], [1, 0])},
    ...     drivers={"push": jn.drivers.SlideDriver(("ground", "sled"), [0, 0], [0, 0], [1, 0], "1 + t**2")},
    ...     forces={"spring": jn.forces.Spring(("ground", "sled"), [0, 0], [0, 0], stiffness=5.0, length=1.0)},
    ... )
    >>> motion = jn.solve(sled, [2.0], order=4)
    >>> jn.dynamics.applied_force(motion, "spring").values.round(12).tolist()  # -5 t^2 and its rates
    [[-20.0, -20.0, -10.0]]
    >>> jn.driver_force(motion, "push").values.round(12).tolist()
    [[20.0, 20.0, 10.0]]
    """
    check_motion(motion)
    force = motion.mechanism.forces.get(name)
    kind = AppliedTorqueOutput if force is not None and force.unit != "N" else AppliedForceOutput
    return motion.evaluate(kind(name), name)
