"""Appearance of robots: the shapes of their files, or bars from joint to joint without shapes."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator
from os import PathLike
from pathlib import Path

import numpy as np
from jaxtyping import Float

from jounce.robot.closed_loops.mechanism_parts import on_body
from jounce.robot.robot import Robot
from jounce.viewer.shapes.appearance import BODY_COLORS, DARK, GRAY, Appearance, BodyPoint, ColoredMesh, upward
from jounce.viewer.shapes.meshes import box, capsule, cylinder, merged, rotation_to, sphere, transformed
from jounce.viewer.shapes.robot_shapes import file_shapes
from jounce.viewer.shapes.shapes import Shapes

Vector = Float[np.ndarray, "3"]
Rotation = Float[np.ndarray, "3 3"]


def robot_appearance(robot: Robot, path: Path | None = None, allow: Iterable[str | PathLike[str]] = ()) -> Appearance:
    """Return the appearance of a robot.

    Parameters
    ----------
    robot : Robot
    path : Path, optional
        Its file; bars replace shapes that cannot be read.
    allow
        Further folders allowed for meshes.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.viewer.shapes.robot_appearance import robot_appearance
    >>> robot = jn.load_robot("examples/robots/scara.urdf")
    >>> found = robot_appearance(robot)
    >>> all(found.meshes[link] for link in robot.moving_links)
    True
    """
    links = (robot.base, *robot.moving_links)
    size = _size(robot)
    shapes_of_links: Shapes = {link: [] for link in links}
    for link, shapes in (file_shapes(path, allow) if path is not None else {}).items():
        if link in robot.frames:
            body, position, rotation = _body_of(robot, link)
            shapes_of_links[body] += [
                dataclasses.replace(shape, mesh=transformed(shape.mesh, position, rotation)) for shape in shapes
            ]
    bars = _bars(robot, size)
    has_no_shapes = not any(shapes_of_links.values())
    for link in links:  # a base without shapes gets a support only if all links are bars
        if not shapes_of_links[link] and (has_no_shapes or link != robot.base):
            shapes_of_links[link] = bars[link]
    return Appearance(shapes_of_links, (), list(_points(robot)), size, upward(robot.gravity))


def _body_of(robot: Robot, link: str) -> tuple[str, Vector, Rotation]:
    """Return the moving link, or the base, to which a link is fixed, and its pose in that frame."""
    if robot.frames[link].body < 0:
        base, frame = robot.frames[robot.base], robot.frames[link]
        return robot.base, base.rotation.T @ (frame.position - base.position), base.rotation.T @ frame.rotation
    return on_body(robot, link)


def _size(robot: Robot) -> float:
    """Return the reach of the longest branch, m."""
    reach = {robot.base: 0.0}
    for joint in robot.joints.values():
        reach[joint.child] = reach[joint.parent] + float(np.linalg.norm(joint.position))
    return max(reach.values()) or 1.0


def _ends(robot: Robot) -> dict[str, list[Vector]]:
    """Return the end points of each body: its next joints, closures, and frames fixed to it."""
    ends: dict[str, list[Vector]] = {link: [] for link in (robot.base, *robot.moving_links)}
    touched = [(joint.parent, joint.position) for joint in robot.joints.values()]
    for closure in robot.closures.values():
        touched += zip(closure.links, closure.points, strict=True)
    for link, point in touched:
        body, position, rotation = _body_of(robot, link)
        ends[body].append(position + rotation @ point)
    for link in robot.moving_links:  # the last link of a branch ends at its center of mass
        inertia = robot.links[link].inertia
        if not any(np.linalg.norm(end) > 1e-6 for end in ends[link]) and inertia is not None:
            ends[link].append(2.0 * np.asarray(inertia.center_of_mass))
    return ends


def _bars(robot: Robot, size: float) -> Shapes:
    """Return bars from each joint to the next, and cylinders and boxes for the joints."""
    radius = 0.016 * size
    colors = {link: BODY_COLORS[k % len(BODY_COLORS)] for k, link in enumerate(robot.moving_links)}
    colors[robot.base] = DARK
    shapes: Shapes = {}
    for body, ends in _ends(robot).items():
        bars = [capsule(np.zeros(3), end, radius) for end in ends if np.linalg.norm(end) > 1e-3 * size]
        shapes[body] = [ColoredMesh(merged(bars), colors[body])] if bars else []
        if body == robot.base:
            shapes[body].append(ColoredMesh(cylinder(0.06 * size, 0.02 * size, upward(robot.gravity)), DARK))
        elif not bars:
            shapes[body].append(ColoredMesh(sphere(1.4 * radius), colors[body]))
    for joint in robot.joints.values():
        if joint.moving and joint.turning:
            shapes[joint.child].append(ColoredMesh(cylinder(1.35 * radius, 4.2 * radius, joint.axis), DARK))
        elif joint.moving:
            block = box([3 * radius, 3 * radius, 5 * radius], rotation=rotation_to(joint.axis))
            shapes[joint.child].append(ColoredMesh(block, DARK))
            shapes[joint.child].append(ColoredMesh(cylinder(0.6 * radius, 10 * radius, joint.axis), GRAY))
    return shapes


def _points(robot: Robot) -> Iterator[BodyPoint]:
    """Yield the tips of the branches, then all other links, as points."""
    parents = {joint.parent for joint in robot.joints.values()}
    links = [link for link in robot.links if robot.frames[link].body >= 0]
    tips = [link for link in links if link not in parents]
    for link in [*reversed(tips), *(link for link in links if link in parents)]:
        body, position, _ = _body_of(robot, link)
        yield BodyPoint(body, tuple(position.tolist()), link)
