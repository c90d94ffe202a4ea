"""The limited quantities of a robot on a path: of its joints, their torques, and points of its links."""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from jounce.dynamics.limits.check_limits import REST, SLIDING, TURNING
from jounce.dynamics.limits.shared_followers import SharedFollowers
from jounce.dynamics.limits.trajectories import FollowedTrajectory
from jounce.errors import RobotError, TrajectoryError
from jounce.planning.paths.path import Path
from jounce.planning.retiming.quantities.limits import MotionLimits, limits_of
from jounce.planning.retiming.quantities.path_quantities import Labels, PathQuantities, Quantity
from jounce.robot.algorithms.carried_loads import CarriedLoad, LoadedRobot
from jounce.robot.model.links_and_joints import Limits
from jounce.robot.recursions.kinematics import forward_kinematics
from jounce.robot.robot import Robot
from jounce.trajectory import JointTrajectory

ORDER = 4  # necessary derivatives of the path
CASES = np.array([[1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [1.0, 1.0]])
"""Samples of the rate of s and its time derivative, from which the polynomials of torques follow."""
_Points = Float[np.ndarray, " _"]  # of any length
_Table = Float[np.ndarray, "point column"]


class RobotQuantities:
    """The limited quantities of a robot at points of a path.

    Parameters
    ----------
    robot : Robot
        The robot, with its payload.
    path : Path
        The path; joints that it does not name stand still.
    limits : MotionLimits, dict of str to Limits, or None
        Limits as in `retime`.
    drives : bool
        Whether torques contain armature inertia, damping and friction of the drives.
    loads : sequence of CarriedLoad, optional
        Loads on links on parts of the path, by its parameter.

    Attributes
    ----------
    changes : array of shape (change,)
        Values of s at changes of loads.

    Raises
    ------
    RobotError, TrajectoryError
        If names do not fit the robot, or no moving joint or point has a limit.
    """

    def __init__(
        self,
        robot: Robot,
        path: Path,
        limits: MotionLimits | Mapping[str, Limits] | None,
        *,
        drives: bool = True,
        loads: Sequence[CarriedLoad] = (),
    ):
        self.robot, self.path, self.drives = robot, path, drives
        self.limits = limits_of(robot, limits)
        self.loaded = LoadedRobot(robot, loads, path.start, path.stop)
        self.changes = self.loaded.changes
        followed = FollowedTrajectory(robot, JointTrajectory(dict(path.laws), path.start, path.stop), given=False)
        self.columns, self.resting_joints = followed.columns, followed.resting_joints
        self.shared, count = SharedFollowers.of(robot), len(robot.joint_names)
        self.own_limits = {**self.limits.joints, **self.shared.limits}
        self.names = names = (*robot.joint_names, *self.shared.names)
        self.moved = [k for k, name in enumerate(robot.joint_names) if name not in self.resting_joints]
        self.moved += [count + k for k in self.shared.moving(self.columns)]
        self.with_velocity = self._limited("velocity")
        self.with_acceleration = self._limited("acceleration", "deceleration", "jerk")
        self.with_jounce = [k for k in self.moved if self._has(names[k], "jounce")]
        self.with_effort = [k for k in range(count) if self._has(names[k], "effort", "effort_rate")]
        self.labels = self._labels()

    def __call__(self, s: _Points) -> PathQuantities:
        """Return the quantities at values of s."""
        return self.at(self.coordinates(s), s)

    def at(self, q: Float[np.ndarray, "point 5 joint"], s: _Points) -> PathQuantities:
        """Return the quantities for coordinates and their derivatives by s, at values of s."""
        first, bounds = self._first(q)
        of_second = self._second(q, s)
        vectors, vector_bounds = self._vectors(q)
        chosen = self.with_jounce
        fourth = np.moveaxis(q[:, 1:, chosen], 1, 2)
        fourth_bounds = self._bounds("jounce", chosen, q)
        return PathQuantities(first, bounds, *of_second, vectors, vector_bounds, fourth, fourth_bounds)

    def coordinates(self, s: _Points) -> Float[np.ndarray, "point 5 joint"]:
        """Return the positions of all joints and their derivatives by s."""
        return self.whole(self.path.derivatives(s, ORDER))

    def whole(self, motion: Float[np.ndarray, "point level own"]) -> Float[np.ndarray, "point level joint"]:
        """Return positions and derivatives of all joints, of those of the joints of the path.

        Joints that follow several and have limits come last.
        """
        q = np.zeros((*motion.shape[:2], len(self.robot.joint_names)))
        for name, value in self.resting_joints.items():
            q[:, 0, self.robot.joint_names.index(name)] = value
        q[:, :, self.columns] = motion
        return self.shared.with_followers(q)

    def location(self, s: float) -> str:
        """Return the text of a place on the path."""
        q = self.path.derivatives(np.array([s]), 0)[0, 0]
        return f"s = {s:.6g} (q = {', '.join(f'{x:.4g}' for x in q)})"

    def _first(self, q: np.ndarray) -> tuple[_Table, _Table]:
        values = [q[:, 1, self.with_velocity]]
        forward, backward = self.both_ways("velocity", self.with_velocity, q)
        bounds = [np.where(values[0] < 0, backward, forward)]
        for point in self.limits.points:
            if point.speed is not None:
                values.append(np.linalg.norm(self.point(q, point)[:, 1], axis=-1)[:, None])
                bounds.append(np.full((len(q), 1), point.speed))
        return np.concatenate(values, axis=1), np.concatenate(bounds, axis=1)

    def _second(self, q: np.ndarray, s: _Points) -> tuple[np.ndarray, _Table, _Table, _Table, _Table]:
        """Return the coefficients of accelerations and torques, their bounds, and the bounds of their rates."""
        chosen = self.with_acceleration
        motion = q[:, :, chosen]
        nothing = np.zeros_like(motion[:, 0])
        coefficients = (motion[:, 1], motion[:, 2], nothing, nothing, motion[:, 2], motion[:, 3], nothing, nothing)
        is_at_rest = np.abs(motion[:, 1]) <= REST * np.abs(motion[:, 1]).max(axis=0, initial=0.0)
        is_positive, sides = motion[:, 1] > 0, []
        pairs = zip(self.both_ways("acceleration", chosen, q), self.both_ways("deceleration", chosen, q), strict=True)
        for (faster, slower), is_along in zip(pairs, (is_positive, ~is_positive), strict=True):
            slowing = np.where(np.isfinite(slower), slower, faster)
            speeding = np.where(
                is_at_rest & (s == self.path.stop)[:, None], slowing, faster
            )  # the arriving motion slows down
            sides.append(np.where(is_at_rest | is_along, speeding, slowing))
        jerk, reverse_jerk = self.both_ways("jerk", chosen, q)
        tables = [(np.stack(coefficients, axis=-1), -sides[1], sides[0], -reverse_jerk, jerk)]
        if self.with_effort:
            effort, reverse_effort = self.both_ways("effort", self.with_effort, q)
            rate, reverse_rate = self.both_ways("effort_rate", self.with_effort, q)
            tables.append((self._torques(q, s)[:, self.with_effort], -reverse_effort, effort, -reverse_rate, rate))
        second, *bounds = (np.concatenate(x, axis=1) for x in zip(*tables, strict=True))
        lower, upper, rate_lower, rate_upper = bounds
        return second, lower, upper, rate_lower, rate_upper

    def _torques(self, q: np.ndarray, s: _Points) -> Float[np.ndarray, "point joint 8"]:
        """Return the coefficients of the torques, polynomials through exact values for a few rates of s."""
        first, second = (x[:, None, None] for x in CASES.T)
        q = q[..., : len(self.robot.joint_names)]
        _, q1, q2, q3, _ = np.moveaxis(q, 1, 0)
        positions = np.broadcast_to(q[:, 0], (len(CASES), *q[:, 0].shape))
        states = (positions, q1 * first, q1 * second + q2 * first**2, 3 * q2 * first * second + q3 * first**3)
        torques = self.loaded.torques(np.stack(states, axis=2), s, self.drives)
        speeds = CASES[:3, 0]
        values, rates = np.moveaxis(torques, 2, 0)  # of cases, points, joints
        g, d, c = np.einsum("ij,jpn->ipn", np.linalg.inv(np.vander(speeds, increasing=True)), values[:3])
        g1, d1, c1 = np.einsum("ij,jpn->ipn", np.linalg.inv(speeds[:, None] ** [1, 2, 3]), rates[:3])
        m = values[3] - values[0]
        m1 = rates[3] - rates[0] - 2 * c - d
        return np.stack([m, c, d, g, m1, c1, d1, g1], axis=-1)

    def _vectors(self, q: np.ndarray) -> tuple[np.ndarray, _Table]:
        chosen = [point for point in self.limits.points if point.acceleration is not None]
        if not chosen:
            return np.zeros((len(q), 0, 3, 2)), np.zeros((len(q), 0))
        curves = [np.moveaxis(self.point(q, point)[:, 1:3], 1, -1) for point in chosen]
        return np.stack(curves, axis=1), np.tile(np.array([point.acceleration for point in chosen], float), (len(q), 1))

    def point(self, q: np.ndarray, point: object) -> Float[np.ndarray, "point 3 3"]:
        """Return the position of a point and two derivatives, for coordinates with derivatives."""
        q = q[:, :3, : len(self.robot.joint_names)]
        return np.asarray(forward_kinematics(self.robot, q, point.link, point.point).position)  # type: ignore[attr-defined]

    def _has(self, name: str, *fields: str) -> bool:
        """Whether a joint has any of some limits."""
        constant, varying = self.own_limits[name], self.limits.varying.get(name, {})
        more_limits, backward = {"jounce": self.limits.jounce.get(name)}, self.limits.backward.get(name, Limits())
        return any(
            f in varying
            or more_limits.get(f, getattr(constant, f, None)) is not None
            or getattr(backward, f, None) is not None
            for f in fields
        )

    def _limited(self, *fields: str) -> list[int]:
        return [k for k in self.moved if self._has(self.names[k], *fields)]

    def both_ways(self, field: str, chosen: list[int], q: np.ndarray) -> tuple[_Table, _Table]:
        """Return the limits of some joints at points, for positive and for negative values."""
        forward = self._bounds(field, chosen, q)
        backward = forward.copy()
        for column, k in enumerate(chosen):
            entry = self.limits.backward.get(self.names[k])
            if entry is not None and getattr(entry, field) is not None:
                backward[:, column] = getattr(entry, field)
        return forward, backward

    def _bounds(self, field: str, chosen: list[int], q: np.ndarray) -> _Table:
        """Return the limits of some joints at points, infinite without a limit."""
        bounds = np.full((len(q), len(chosen)), np.inf)
        for column, k in enumerate(chosen):
            name = self.names[k]
            law = self.limits.varying.get(name, {}).get(field)
            if law is not None:
                bounds[:, column] = self._law_values(name, field, law, q[:, 0, k])
                continue
            constant = self.limits.jounce.get(name) if field == "jounce" else getattr(self.own_limits[name], field)
            if constant is not None:
                bounds[:, column] = constant
        return bounds

    def _law_values(self, name: str, field: str, law: object, positions: _Points) -> _Points:
        values = np.broadcast_to(np.asarray(law(positions), float), positions.shape)  # type: ignore[operator]
        bad = np.flatnonzero(~(values > 0))
        if len(bad):
            message = (
                f"this limit must be greater than zero on the path, and is not at the position {positions[bad[0]]:.6g}"
            )
            raise RobotError(message, name=f"limits.{name}.{field}", value=float(values[bad[0]]))
        return values

    def _labels(self) -> Labels:
        names = self.names

        def label(k: int, field: str) -> Quantity:
            turns = self.robot.joints[names[k]].turning
            units = (TURNING if turns else SLIDING) | {"jounce": "rad/s^4" if turns else "m/s^4"}
            quantity = field.replace("effort", "torque" if turns else "force").replace("_", " ")
            return Quantity(names[k], quantity, units[field])

        points = self.limits.points
        first = [label(k, "velocity") for k in self.with_velocity]
        first += [Quantity(p.link, "speed of the point", "m/s") for p in points if p.speed is not None]
        second, rates = (
            [label(k, motion) for k in self.with_acceleration] + [label(k, effort) for k in self.with_effort]
            for motion, effort in (("acceleration", "effort"), ("jerk", "effort_rate"))
        )
        vectors = [Quantity(p.link, "acceleration of the point", "m/s^2") for p in points if p.acceleration is not None]
        fourth = [label(k, "jounce") for k in self.with_jounce]
        return Labels(*map(tuple, (first, second, rates, vectors, fourth)))

    def check_range(self) -> None:
        """Raise TrajectoryError if the path leaves the range of a joint, since no time law can prevent that."""
        s = np.linspace(self.path.start, self.path.stop, 2001)
        q = self.whole(self.path.derivatives(s, 0))[:, 0]
        for column in self.moved:
            name = self.names[column]
            limits = self.own_limits[name]
            for bound, sign, side in ((limits.upper, 1, "above"), (limits.lower, -1, "below")):
                if bound is None:
                    continue
                excess = sign * (q[:, column] - bound)
                index = int(np.argmax(excess))
                if excess[index] > 1e-9 * max(1.0, abs(bound)):
                    message = (
                        f"the path leaves the range of this joint: {q[index, column]:.6g} at s = {s[index]:.6g} is "
                        f"{side} {bound:g}; no time law changes that; choose another path"
                    )
                    raise TrajectoryError(message, name=name)
