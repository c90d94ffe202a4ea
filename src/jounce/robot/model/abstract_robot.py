"""Links and joints by name, moving joints in the order of q, and changed copies; frozen."""

import abc
import dataclasses
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np

from jounce.base.display import Displayed
from jounce.base.shapes import ArrayLike, Real, Refused, is_traced
from jounce.errors import RobotError, check_name, did_you_mean
from jounce.rigid.inertia import Inertia, TracedInertia, finite_numbers, vector_numbers
from jounce.robot.model.couplings import BallDrive, Coupling, Tendon, check_coupling
from jounce.robot.model.floating_base import floating_joints
from jounce.robot.model.links_and_joints import Closure, Joint, Limits, Link, limits_with_followers
from jounce.robot.model.mimics import Mimic
from jounce.robot.model.tree import Tree, arrange, ordered, turn_about

Made = TypeVar("Made", bound="AbstractRobot")

STANDARD_GRAVITY = 9.81  # m/s^2, as in Pinocchio and MuJoCo


class AbstractRobot(Displayed, abc.ABC):
    """Links and joints by name and their tree, without the methods of `Robot`."""

    def __init__(
        self,
        name: str,
        links: Sequence[Link],
        joints: Sequence[Joint],
        gravity: Any = (0.0, 0.0, -STANDARD_GRAVITY),
        closures: Sequence[Closure] = (),
        strict: bool = True,
        couplings: Sequence[Coupling] = (),
    ):
        self.name, self.strict = name, strict
        self.gravity = vector_numbers("gravity", gravity, (3,))
        self.links: Mapping[str, Link] = MappingProxyType(_by_name("links", links, Link))
        in_order = ordered(self.links, _by_name("joints", joints, Joint))
        self.joints: Mapping[str, Joint] = MappingProxyType({joint.name: joint for joint in in_order})
        self.base = ({*self.links} - {joint.child for joint in self.joints.values()}).pop()
        self.joint_names = tuple(joint.name for joint in self.moving_joints if joint.mimic is None)
        for joint in self.moving_joints:
            self._check_mimic(joint)
        self.couplings: Mapping[str, Coupling] = MappingProxyType(_by_name("couplings", couplings, (Tendon, BallDrive)))
        for coupling in self.couplings.values():
            check_coupling(coupling, self.joints, self.joint_names)
        couplings = list(self.couplings.values())
        self._tree, self.frames = arrange(self.base, self.links, in_order, self.gravity, couplings)
        if strict and (massless := self.massless_joints):
            message = (
                "this joint moves no mass; give its link, or one that it carries, an inertia, or keep it with "
                "strict=False, where its torque is zero"
            )
            raise RobotError(message, name=f"links.{self.joints[massless[0]].child}.inertia", value=None)
        closures_by_name = _by_name("closures", closures, Closure)
        closures_checked = {name: self._checked_closure(closure) for name, closure in closures_by_name.items()}
        self.closures: Mapping[str, Closure] = MappingProxyType(closures_checked)
        self._made = True

    def __setattr__(self, name: str, value: Any) -> None:
        if "_made" in self.__dict__:  # the tree would not follow
            message = "a robot does not change; make another, as with_gravity, with_payload and locked do"
            raise AttributeError(f"{name}: {message}")
        object.__setattr__(self, name, value)

    def __reduce__(self) -> tuple[Any, ...]:
        closures = list(self.closures.values())
        elements = (list(self.links.values()), list(self.joints.values()))
        return type(self), (self.name, *elements, self.gravity, closures, self.strict, list(self.couplings.values()))

    def __repr__(self) -> str:
        count = len(self.joint_names)
        closure_text = f", closed by {', '.join(self.closures)}" if self.closures else ""
        joints = "joint" if count == 1 else "joints"
        return f"<Robot {self.name}: {count} {joints}, {len(self.links)} links{closure_text}>"

    @property
    def tree(self) -> Tree:
        """Arrays for the algorithms on coordinates, for a robot without closures."""
        if self.closures:
            message = (
                "the loops of this robot make its coordinates depend on one another; jn.solve(robot.mechanism(...)) "
                "gives its motion and forces, robot.opened() the tree without closures"
            )
            raise RobotError(message, name=self.name, value=list(self.closures))
        return self._tree

    @property
    def link_names(self) -> tuple[str, ...]:
        """Names of the links, and of their frames."""
        return tuple(self.links)

    @property
    def moving_joints(self) -> tuple[Joint, ...]:
        """Joints that are not fixed, parents before children; some may follow others."""
        return tuple(joint for joint in self.joints.values() if joint.moving)

    @property
    def moving_links(self) -> tuple[str, ...]:
        """Names of the links that joints move, one for each moving joint, in the order of results for each body.

        A moving link includes the links fixed to it, with their mass.
        """
        return tuple(joint.child for joint in self.moving_joints)

    @property
    def massless_joints(self) -> tuple[str, ...]:
        """Joints that move no mass, so that their motion needs no force."""
        tree = self._tree
        if any(isinstance(link.inertia, TracedInertia) for link in self.links.values()):
            return ()  # traced masses are unknown: forward dynamics reports joints without inertia
        carried_mass = ((tree.mass > 0) | tree.inertia.any((1, 2))) @ tree.ancestors[:-1]
        return tuple(joint.name for joint, mass in zip(self.moving_joints, carried_mass, strict=True) if not mass)

    @property
    def limits(self) -> dict[str, Limits]:
        """Limits of the joints in `joint_names`, including the limits of their followers.

        Raises
        ------
        RobotError
            If the ranges of a joint and its followers have no coordinate in common, or only one.
        """
        return self.limits_with({})

    def limits_with(self, given: Mapping[str, Limits]) -> dict[str, Limits]:
        """Return the limits of the joints in `joint_names`, with given limits in the place of their own.

        Followers keep their own limits: the tighter of these and the given limits of the followed joint applies.

        Parameters
        ----------
        given : dict of str to Limits
            Limits of some of the joints in `joint_names`.

        Raises
        ------
        RobotError
            If the ranges of a joint and its followers have no coordinate in common, or only one.

        Examples
        --------
        >>> import jounce as jn
        >>> left = jn.Joint("left", "base", "a", "prismatic")
        >>> follows = {"limits": jn.Limits(velocity=1.0), "mimic": jn.robot.Mimic("left", -2.0)}
        >>> right = jn.Joint("right", "base", "b", "prismatic", **follows)
        >>> links = [jn.Link(name, jn.Inertia(1.0)) for name in ("base", "a", "b")]
        >>> gripper = jn.Robot("gripper", links, [left, right])
        >>> gripper.limits_with({"left": jn.Limits(velocity=5.0)})["left"].velocity
        0.5
        """
        followers: dict[str, list[Joint]] = {name: [] for name in self.joint_names}
        for joint in self.moving_joints:
            if joint.mimic is not None and not joint.mimic.several:
                followers[joint.mimic.joint].append(joint)
        return {
            name: limits_with_followers(name, given.get(name, self.joints[name].limits), joints)
            for name, joints in followers.items()
        }

    @property
    def base_inertia(self) -> Inertia | None:
        """Inertia of the base and of all links fixed to it, in the frame of the base; None without inertia."""
        base_frames = {name: frame for name, frame in self.frames.items() if frame.body < 0}
        inertias = [
            inertia.moved(frame.position, frame.rotation)
            for name, frame in base_frames.items()
            if (inertia := self.links[name].inertia) is not None
        ]
        return Inertia.total(inertias) if inertias else None

    @property
    def mass(self) -> float:
        """Mass of all links, the base included, kg."""
        return sum((link.inertia.mass for link in self.links.values() if link.inertia is not None), 0.0)

    def with_gravity(self: Made, gravity: ArrayLike) -> Made:
        """Return the robot with another gravitational acceleration, m/s^2 in the frame of the base."""
        return self.changed(gravity=gravity)

    def with_closures(self: Made, closures: Sequence[Closure]) -> Made:
        """Return the robot with more closures."""
        return self.changed(closures=[*self.closures.values(), *closures])

    def opened(self: Made) -> Made:
        """Return the tree without closures, with independent coordinates."""
        return self.changed(closures=())

    def with_payload(self: Made, link: str, payload: Inertia | Refused) -> Made:
        """Return the robot with a load fixed to a link, given in the frame of that link: Q_SU of Negrean 2025, 125.

        Raises
        ------
        RobotError
            If the link does not exist.
        """
        check_name("link", link, self.links, RobotError, name="link")
        if not isinstance(payload, Inertia):
            raise RobotError("must be a jn.Inertia, in the frame of the link", name="payload", value=payload)
        inertia = self.links[link].inertia
        combined = payload if inertia is None else Inertia.total([inertia, payload])
        links = {**self.links, link: dataclasses.replace(self.links[link], inertia=combined)}
        return self.changed(links=list(links.values()))

    def with_inertia(
        self: Made,
        link: str,
        *,
        mass: Real | None = None,
        center_of_mass: ArrayLike | None = None,
        tensor: ArrayLike | None = None,
    ) -> Made:
        """Return the robot with another inertia of a link; omitted values stay, or are zero without an inertia.

        JAX may trace the values to differentiate torques, accelerations and the mass matrix; traced values are not
        checked.

        Parameters
        ----------
        link : str
            Name of the link.
        mass : float, optional
            Mass, kg.
        center_of_mass : array_like of shape (3,), optional
            Center of mass in the frame of the link, m.
        tensor : array_like of shape (3, 3) or (3,), optional
            Inertia tensor about the center of mass, in axes parallel to those of the link, kg m^2, or its diagonal.

        Raises
        ------
        RobotError
            If the link does not exist, or no real body has these values (unless the robot is not strict).

        Examples
        --------
        >>> import jax
        >>> import jounce as jn
        >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0])
        >>> pin = jn.Joint("pin", "base", "rod", axis=[0, -1, 0])
        >>> arm = jn.Robot("arm", [jn.Link("base"), jn.Link("rod", rod)], [pin])
        >>> def torque(mass):
        ...     return jn.inverse_dynamics(arm.with_inertia("rod", mass=mass), [[0.0], [0.0], [0.0]])[0, 0]
        >>> with jax.enable_x64(True):
        ...     round(float(jax.grad(torque)(1.0)), 9)  # N m for each kg at half a meter
        4.905
        """
        check_name("link", link, self.links, RobotError, name="link")
        previous = self.links[link].inertia or Inertia(0.0, strict=False)
        new_values = {"mass": mass, "center_of_mass": center_of_mass, "tensor": tensor}
        values: dict[str, Any] = {k: getattr(previous, k) if v is None else v for k, v in new_values.items()}
        if is_traced(values) or isinstance(previous, TracedInertia):
            inertia = TracedInertia(**values)
        else:
            inertia = Inertia(**values, strict=self.strict)
        links = {**self.links, link: dataclasses.replace(self.links[link], inertia=inertia)}
        return self.changed(links=list(links.values()))

    def locked(self: Made, positions: Mapping[str, float] | Refused) -> Made:
        """Return the robot with joints fixed at given coordinates, rad or m, together with their followers.

        Raises
        ------
        RobotError
            If the joint does not exist, is fixed, or follows another.
        """
        if not isinstance(positions, Mapping):
            message = "must be a mapping of joints to coordinates, as {'elbow': 0.5}"
            raise RobotError(message, name="locked", value=positions)
        for name, value in positions.items():
            check_name("moving joint", name, self.joint_names, RobotError, name="locked")
            finite_numbers(f"locked.{name}", value, ())
        joints, held = [], {}
        for joint in self.joints.values():
            coordinate = positions.get(joint.name)
            if joint.moving and joint.mimic is not None:
                remainder = joint.mimic.held(positions)
                if isinstance(remainder, Mimic):
                    joint = dataclasses.replace(joint, mimic=remainder)
                else:
                    coordinate = remainder
            if coordinate is not None:
                held[joint.name] = float(coordinate)
            joints.append(joint if coordinate is None else _fixed_at(joint, float(coordinate)))
        couplings = [remainder for x in self.couplings.values() if (remainder := x.locked(held)) is not None]
        return self.changed(joints=joints, couplings=couplings)

    def with_floating_base(self: Made, sequence: str = "ZYX") -> Made:
        """Return the robot on a floating base: three translations along x, y, z, then three rotations.

        The new base is the link ``world``, or ``world_`` if the robot has a link of that name. The coordinates base_x,
        base_y, base_z (m) and base_angle_1 to 3 (rad) come first in q. Their generalized forces are the forces that
        would hold the base: for a free base, they show how far a motion violates the laws of motion. The angles have a
        singular orientation (for ``ZYX`` the second angle at a right angle): choose a sequence that avoids it.

        Parameters
        ----------
        sequence : str, default "ZYX"
            Axes of the rotations, three letters, each about the axes as rotated by the preceding ones.
        """
        world = "world"
        while world in self.links:
            world += "_"
        links, joints = floating_joints(self.base, sequence, world=world)
        return self.changed(links=[*links, *self.links.values()], joints=[*joints, *self.joints.values()])

    @abc.abstractmethod
    def mechanism(self, q: Any = None, **settings: Any) -> Any:
        """Return the mechanism of the robot."""

    def coordinates(self, **values: float) -> np.ndarray:
        """Return an array for q, shape (n,), with the named joints at the given values and the others at zero."""
        for name in values:
            check_name("moving joint", name, self.joint_names, RobotError, name="joint")
        return np.array([finite_numbers(name, values.get(name, 0.0), ()) for name in self.joint_names])

    def changed(self: Made, **parts: Any) -> Made:
        """Return the robot with other links, joints, closures or couplings, each a list, or another name or gravity."""
        parts_by_name = ("links", "joints", "closures", "couplings")
        current = {name: list(getattr(self, name).values()) for name in parts_by_name}
        return type(self)(**{"name": self.name, "gravity": self.gravity, "strict": self.strict, **current, **parts})

    def _checked_closure(self, closure: Closure) -> Closure:
        """Return a closure with missing values from the pose at coordinates zero."""
        location = f"closures.{closure.name}"
        if closure.name in self.joints:
            raise RobotError("a joint and a closure have the same name", name=location)
        for link in closure.links:
            check_name("link", link, self.links, RobotError, name=location)
        if len({self.frames[link].body for link in closure.links}) == 1:
            message = "these links are fixed to one another already; a closure joins links that move"
            raise RobotError(message, name=f"{location}.links", value=list(closure.links))
        poses = _poses_at_zero(self.joints)
        (origin, rotation_i), (origin_j, rotation_j) = (poses[link] for link in closure.links)
        points, rotation = closure.points, closure.rotation
        if points.shape == (3,):
            points = np.array([points, rotation_j.T @ (origin + rotation_i @ points - origin_j)])
        if rotation is None:
            rotation = rotation_i.T @ rotation_j
        return dataclasses.replace(closure, points=points, rotation=rotation)

    def _check_mimic(self, joint: Joint) -> None:
        for leader in joint.mimic.weights if joint.mimic is not None else ():
            if leader not in self.joint_names:
                suggestion = did_you_mean(leader, self.joint_names)
                message = f"must follow a moving joint that follows no other; {suggestion}"
                raise RobotError(message, name=f"joints.{joint.name}.mimic", value=leader)


def _by_name(kind: str, elements: Sequence[Any], expected: type | tuple[type, ...]) -> dict[str, Any]:
    by_name: dict[str, Any] = {}
    for k, element in enumerate(elements):
        if not isinstance(element, expected):
            names = " or a ".join(x.__name__ for x in (expected if isinstance(expected, tuple) else (expected,)))
            raise RobotError(f"must be a {names}", name=f"{kind}[{k}]", value=element)
        if element.name in by_name:
            raise RobotError("this name is given twice", name=kind, value=element.name)
        by_name[element.name] = element
    if not by_name and kind == "links":
        raise RobotError("a robot needs at least one link", name=kind)
    return by_name


def _poses_at_zero(joints: Mapping[str, Joint]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return position and rotation of all links at coordinates zero, in the frame of the base."""
    poses: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for joint in joints.values():
        follows = joint.moving and joint.mimic is not None
        fixed_joint = _fixed_at(joint, joint.mimic.offset if follows and joint.mimic is not None else 0.0)
        position, rotation = poses.setdefault(joint.parent, (np.zeros(3), np.eye(3)))
        poses[joint.child] = (position + rotation @ fixed_joint.position, rotation @ fixed_joint.rotation)
    return poses


def _fixed_at(joint: Joint, coordinate: float) -> Joint:
    """Return the fixed joint that holds a moving joint at a coordinate."""
    position, rotation = joint.position, joint.rotation
    if joint.turning:
        rotation = rotation @ turn_about(joint.axis, coordinate)
    else:
        position = position + rotation @ joint.axis * coordinate
    return dataclasses.replace(joint, type="fixed", position=position, rotation=rotation, mimic=None)
