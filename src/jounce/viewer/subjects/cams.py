"""Plate cams in the viewer: a mechanism of the cam and its follower, moved by the law, with their outlines."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping

import numpy as np
from shapely.geometry import Polygon
from trimesh import Trimesh

from jounce.constraints.drivers import CoordinateDriver
from jounce.constraints.planar import Prismatic, Revolute
from jounce.kinematics import OscillatingFollower, PlateCam, solve
from jounce.kinematics.cams.plate_cams import SIGNS
from jounce.mechanism import AngleOutput, Body, Mechanism, PointOutput
from jounce.mechanism.mechanism import GROUND
from jounce.viewer.shapes.appearance import BODY_COLORS, Appearance, ColoredMesh
from jounce.viewer.shapes.mechanism_appearance import mechanism_appearance
from jounce.viewer.shapes.mechanism_meshes import THICKNESS
from jounce.viewer.shapes.meshes import extruded, plate, wheel
from jounce.viewer.shapes.recording import Recording
from jounce.viewer.subjects.mechanisms import MechanismSubject, instants_shown, recorded

INSTANTS = 361
STEM = 0.05  # half the width of the stem of an edge or a roller, in base radii


def cam_mechanism(cam: PlateCam) -> Mechanism:
    """Return a cam and its follower as a mechanism, both driven; the cam turns by one radian per second.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.viewer.subjects.cams import cam_mechanism
    >>> motion = jn.solve(cam_mechanism(jn.cams.load_cam("examples/cams/intake.yaml")), [0.0, 3.14159265], order=0)
    >>> [round(1e3 * float(y), 3) for y in motion.outputs["follower"][:, 0, 1]]  # mm; it has risen by 9
    [25.923, 34.923]
    """
    follower, start = cam.follower, cam.follower.start(cam.base_radius)
    turn = "t" if SIGNS[cam.sense] > 0 else "-t"
    if isinstance(follower, OscillatingFollower):
        pivot, angle = [follower.center_distance, 0.0], -start - float(cam.table.lift[0])
        guided = Revolute((GROUND, "follower"), pivot, [0, 0])
        lift = CoordinateDriver(("follower", GROUND), "angle", cam.law, ratio=1.0, offset=start)
        body, output = Body(pivot, angle), AngleOutput("follower")
    else:
        height = start + float(cam.table.lift[0])
        guided = Prismatic((GROUND, "follower"), [follower.offset, 0], [0, 0], [0, 1], [0, 1])
        lift = CoordinateDriver((GROUND, "follower"), "y", cam.law, offset=start)
        body, output = Body([follower.offset, height]), PointOutput("follower", [0, 0])
    return Mechanism(
        title=cam.title or "plate cam",
        space="planar",
        bodies={"cam": Body([0, 0]), "follower": body},
        joints={"axle": Revolute((GROUND, "cam"), [0, 0], [0, 0]), "guide": guided},
        drivers={"turn": CoordinateDriver((GROUND, "cam"), "angle", turn), "lift": lift},
        outputs={"follower": output},
        time=np.linspace(0.0, 2 * np.pi, INSTANTS),
    )


class CamSubject(MechanismSubject):
    """A plate cam with its follower.

    Parameters
    ----------
    cam : PlateCam
    """

    no_sliders = "A cam has no sliders. Change the file, or give --set."

    def __init__(self, cam: PlateCam):
        super().__init__(cam_mechanism(cam))
        self.cam = cam

    def solve(self, values: Mapping[str, float], order: int) -> Recording:
        """Return a turn of the cam, which has no parameters."""
        del values
        motion = solve(self.mechanism, instants_shown(self.mechanism), order=order, strict=False)
        seen = mechanism_appearance(motion)
        meshes = {body: list(parts) for body, parts in seen.meshes.items()}
        for k, (body, mesh) in enumerate(_outlines(self.cam, THICKNESS * seen.size)):
            meshes[body].append(ColoredMesh(mesh, BODY_COLORS[min(k, 1)]))
        appearance: Appearance = dataclasses.replace(seen, meshes=meshes)
        return recorded(motion, appearance)


def _outlines(cam: PlateCam, thickness: float) -> Iterator[tuple[str, Trimesh]]:
    """Yield the plate of the cam, then the contact part and the stem of the follower, each in its body frame."""
    follower, width = cam.follower, STEM * cam.base_radius
    yield "cam", extruded(Polygon(cam.table.profile.T).buffer(0), 0.0, 0.8 * thickness, sharp=False)
    low, high = 0.1 * thickness, 0.7 * thickness
    if (face := cam.face) is not None:
        ends = sorted((-1.0 if follower.turning else 1.0) * end.value for end in face)
        foot = -getattr(follower, "face_offset", 0.0)
        left, right, top = ends[0] - width, max(ends[1], 0.0) + width, foot + 2 * width
        yield "follower", extruded(Polygon([(left, foot), (right, foot), (right, top), (left, top)]), low, high)
        holder = [0.0, 0.0], [0.5 * sum(ends), foot + 2 * width]
        if not follower.turning:
            holder = [0.0, 2 * width], [0.0, 1.5 * cam.base_radius]
        yield "follower", plate(np.array(holder), width, low, high)
        return
    tip = np.array([-follower.arm, 0.0] if isinstance(follower, OscillatingFollower) else [0.0, 0.0])
    end = np.zeros(2) if follower.turning else np.array([0.0, 1.5 * cam.base_radius])
    direction = (end - tip) / np.linalg.norm(end - tip)
    if follower.radius:
        yield "follower", wheel(follower.radius, low, high, tip)
        yield "follower", plate(np.stack([tip, end]), width, high, high + 0.5 * thickness)
        return
    side, neck = np.array([-direction[1], direction[0]]) * width, tip + 4 * width * direction
    if follower.turning:  # the edge points to the cam, perpendicular to the arm
        direction, neck = np.array([0.0, 1.0]), tip + np.array([0.0, 4 * width])
        side = np.array([width, 0.0])
    yield "follower", extruded(Polygon([tip, neck + side, neck - side]), low, high)
    yield "follower", plate(np.stack([neck, end]), width, low, high)
