"""The robots of the package example-robot-data, each read twice: by jounce and by Pinocchio."""

import dataclasses
import importlib.metadata
import re
import warnings
from pathlib import Path

import numpy as np
import pinocchio

import jounce as jn

NOT_READ = "ur_description/urdf/ur3.urdf"  # holds no robot: Pinocchio refuses it too


def files():
    """Return the 68 URDF files that Pinocchio reads, by their place below the folder of robots."""
    return {name: path for name, path in _files(".urdf").items() if name != NOT_READ}


def sdf_files():
    """Return the five SDF files, all of the robot Cassie, likewise."""
    return _files(".sdf")


def _files(suffix):
    package = importlib.metadata.distribution("example-robot-data")
    found = [file for file in package.files or () if file.suffix == suffix]
    named = {str(file).partition("/robots/")[2]: Path(str(package.locate_file(file))) for file in found}
    return dict(sorted(named.items()))


class Pair:
    """A robot as both read it; columns of `spread` take our coordinates to the velocities of Pinocchio."""

    def __init__(self, path, root=None):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            self.robot = jn.load_robot(path)
        self.warnings = [warning for warning in caught if warning.category is jn.errors.RobotWarning]
        assert len(self.warnings) == len(caught)
        given = [str(path)] if root is None else [str(path), root]
        self.model = pinocchio.buildModelFromUrdf(*given)
        if root is not None:
            self.robot = self.robot.with_floating_base()
        self.first = 1 if root is None else 2
        self.free = 0 if root is None else 6
        names = self.robot.joint_names
        self.spread, self.offset = np.zeros((self.model.nv, len(names))), np.zeros(self.model.nv)
        self.spread[: self.free, : self.free] = np.eye(self.free)
        for number in range(self.first, self.model.njoints):
            mimic = self.robot.joints[self.model.names[number]].mimic
            row, leader = self.model.idx_vs[number], self.model.names[number] if mimic is None else mimic.joint
            self.spread[row, names.index(leader)] = 1.0 if mimic is None else mimic.multiplier
            self.offset[row] = 0.0 if mimic is None else mimic.offset

    @property
    def named(self):
        """Names of links and joints in the warning, but for those of what is left out."""
        messages = [str(warning.message).partition("what follows is left out")[0] for warning in self.warnings]
        return {name for message in messages for name in re.findall(r"(\S+) \(line \d+\)", message)}

    def torques(self, q):
        """Return torques by Pinocchio, (samples, 1, n), and on a fixed base their rates, (samples, 2, n)."""
        return np.array([self._torques(*sample) for sample in q]) @ self.spread

    def _torques(self, q, v, a, j):
        model, data = self.model, self.model.createData()
        q, (v, a, j) = self._configuration(self.spread @ q + self.offset), [self.spread @ x for x in (v, a, j)]
        torque = np.array(pinocchio.rnea(model, data, q, v, a))
        if self.free:
            return [torque]
        pinocchio.computeRNEADerivatives(model, data, q, v, a)
        mass = np.triu(data.M) + np.triu(data.M, 1).T
        return [torque, data.dtau_dq @ v + data.dtau_dv @ a + mass @ j]

    def _configuration(self, angles):
        """Return Pinocchio's configuration: cosine and sine where a joint is continuous."""
        model, found = self.model, np.zeros(self.model.nq)
        found[: self.free] = angles[: self.free]
        for number in range(self.first, model.njoints):
            at, size, angle = model.idx_qs[number], model.nqs[number], angles[model.idx_vs[number]]
            found[at : at + size] = angle if size == 1 else (np.cos(angle), np.sin(angle))
        return found


def floating_root():
    """Return Pinocchio's joint for a base with our coordinates: three slides, then three turns about z, y, x."""
    root = pinocchio.JointModelComposite()
    root.addJoint(pinocchio.JointModelTranslation())
    root.addJoint(pinocchio.JointModelSphericalZYX())
    return root


def forest(robots):
    """Return all robots on one base, names prefixed, so that the algorithms are compiled once for all of them.

    The coordinates of one robot stand together, in its own order.
    """
    links, joints = [jn.Link("forest")], []
    for prefix, robot in robots.items():
        new = f"{prefix}:{{}}".format
        # gravity counts for all of them here: Pinocchio does not read where Gazebo's extension switches it off
        links += [dataclasses.replace(link, name=new(link.name), gravity=1.0) for link in robot.links.values()]
        joints.append(jn.Joint(f"{prefix}|", "forest", new(robot.base), "fixed"))
        for joint in robot.joints.values():
            mimic = joint.mimic and dataclasses.replace(joint.mimic, joint=new(joint.mimic.joint))
            ends = {"parent": new(joint.parent), "child": new(joint.child)}
            joints.append(dataclasses.replace(joint, name=new(joint.name), mimic=mimic, **ends))
    whole = jn.Robot("forest", links, joints, strict=False)
    names = [f"{prefix}:{name}" for prefix, robot in robots.items() for name in robot.joint_names]
    assert list(whole.joint_names) == names
    return whole


def random_states(robot, samples=3, seed=16):
    """Return random coordinates, velocities, accelerations and jerks, (samples, 4, n)."""
    return np.random.default_rng(seed).uniform(-1, 1, (samples, 4, len(robot.joint_names)))


def difference(found, expected):
    """Return the largest difference over the largest magnitude; 0 of a robot that has no joints."""
    assert found.shape == expected.shape
    return float(np.abs(found - expected).max(initial=0) / max(np.abs(expected).max(initial=0), 1e-300))
