"""Driver forces, joint reactions and applied forces of a moving mechanism, with rates to any order."""

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
from jounce.errors import MechanismError, check_name
from jounce.kinematics import Motion
from jounce.mechanism.redundant_reactions import RedundantReactions

if TYPE_CHECKING:
    import xarray


def driver_force(motion: Motion, name: str, *, redundant: RedundantReactions | None = None) -> "xarray.DataArray":
    """Return the force or torque of a driver with its rates: yank, second rate and so on.

    The force is conjugate to the motion law: a torque, N m, if the law is an angle, otherwise a force, N. Its product
    with the rate of the law is the power of the driver. It follows from the transposed factor of the Jacobian, order
    after order, without finite differences.

    Parameters
    ----------
    motion : Motion
        Motion of a mechanism with masses or applied forces.
    name : str
        Name of the driver.
    redundant : str or mapping, optional
        Choice of forces if constraints are redundant; by default `Mechanism.redundant_reactions`.

    Returns
    -------
    xarray.DataArray
        Dimensions time and derivative. Accelerations use up two orders of the motion: the force of a motion solved to
        order 4 has two rates. (The output `DriverTorqueOutput` has all, as the solver goes two orders further.) NaN if
        redundant drivers leave the force undetermined, with the reason as the attribute ``comment``.

    Raises
    ------
    MechanismError
        If no driver has this name, or the mechanism has neither masses nor applied forces.

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
    drivers = motion.mechanism.drivers
    check_name("driver", name, drivers, MechanismError, name="driver")
    kind = DriverTorqueOutput if is_turning(drivers[name]) else DriverForceOutput
    return _with_choice_of_reactions(motion, redundant).evaluate(kind(name), name)


@dataclasses.dataclass(frozen=True)
class Reaction:
    """Force and torque of a joint on a body, with rates.

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

    The reactions of a joint on all bodies, the ground included, have no resultant. A coordinate of one body and a ratio
    of angles are measured in the ground frame, so joints of this kind have reactions on the ground, too.

    Parameters
    ----------
    motion : Motion
        Motion of a mechanism with masses or applied forces.
    name : str
        Name of the joint, of the driver, or of an applied force between bodies.
    body : str, optional
        Body on which the joint acts, by default its second body; ``"ground"`` is possible for every joint.
    frame : str, default "global"
        Axes of the components: ``"global"``, ``"body"`` (the body on which the joint acts), or the name of any body.
        The rates are those of the components in these axes.
    point : sequence, optional
        Reference point of the torque in the frame of the body, m; by default the point of the joint, or the origin of
        a body on which the joint has none.
    redundant : str or mapping, optional
        Choice of reactions if constraints are redundant: ``"unique"``, ``"least_norm"``, or stiffnesses of joints; by
        default `Mechanism.redundant_reactions`.

    Returns
    -------
    Reaction
        Force and torque, with two derivatives fewer than the motion. Components that redundant constraints leave
        undetermined are NaN, with the reason as the attribute ``comment`` (Wojtyra 2005).

    Raises
    ------
    MechanismError
        If no joint, driver or force has this name, it does not act on the body, there is no such frame, or the
        mechanism has neither masses nor applied forces.

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

    The total is that of all joints, drivers and forces between bodies. By the balance of momentum, the rate of momentum
    of the bodies equals weights and external loads less this force.

    Parameters
    ----------
    motion : Motion
        Motion of a mechanism with masses or applied forces.
    point : sequence, optional
        Reference point of the torque on the ground, m; by default the origin.
    redundant : str or mapping, optional
        As for `joint_reaction`. The total may be unique even if single reactions are not.

    Returns
    -------
    Reaction
        Force and torque, with two derivatives fewer than the motion.

    Raises
    ------
    MechanismError
        If the mechanism has neither masses nor applied forces.

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
    """Return the motion with another choice of redundant reactions."""
    if redundant is None or redundant == motion.mechanism.redundant_reactions:
        return motion
    changed = copy.copy(motion)
    changed.mechanism = dataclasses.replace(motion.mechanism, redundant_reactions=redundant)
    changed.derived = {}
    return changed


def applied_force(motion: Motion, name: str) -> "xarray.DataArray":
    """Return an applied force or torque with its rates, along its displacement or by components.

    Parameters
    ----------
    motion : Motion
        Motion of a mechanism with applied forces.
    name : str
        Name of the force.

    Returns
    -------
    xarray.DataArray
        Dimensions time, derivative and, for a vector, component; with two derivatives fewer than the motion.

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
    forces = motion.mechanism.forces
    check_name("force", name, forces, MechanismError, name="force")
    kind = AppliedForceOutput if forces[name].unit == "N" else AppliedTorqueOutput
    return motion.evaluate(kind(name), name)
