"""The three-dimensional part of the page: bodies, rods and springs, arrows, paths, the ground and the camera."""

from __future__ import annotations

from typing import Any

import numpy as np

from jounce.viewer.arrows import KINDS, derivative_colour, long_enough, quaternion_to, rounded
from jounce.viewer.looks import Looks
from jounce.viewer.solids import arc_arrow, coil, cylinder
from jounce.viewer.take import Exertion, Take

__all__ = ["Scene"]

FIELD_OF_VIEW, FLAT_FIELD_OF_VIEW = 0.6, 0.12  # rad; the second is nearly without perspective
MARGIN, NARROW = 1.2, 0.85  # width by height of the space between the panels
ARROW = {"shaft_radius": 0.0045, "head_radius": 0.0125, "head_length": 0.034}  # in sizes
ARC_RADIUS = 0.062


class Scene:
    """What a viser server shows of takes, one instant at a time.

    Parameters
    ----------
    server : viser.ViserServer
    """

    def __init__(self, server: Any):
        self.server, self.scene = server, server.scene
        self._frames: dict[str, Any] = {}
        self._solids: dict[str, list[tuple[Any, np.ndarray, np.ndarray]]] = {}
        self._stretches: list[tuple[Any, np.ndarray, np.ndarray]] = []
        self._arrows: dict[str, Any] = {}
        self._arcs: dict[str, Any] = {}
        self._ground: Any = None
        self._size = 1.0

    def dress(self, take: Take) -> None:
        """Show the shapes of a take, in the place of those of the one before; only what changed is sent."""
        self._size = take.size
        for body, solids in take.looks.solids.items():
            if body not in self._frames:
                self._frames[body] = self.scene.add_frame(f"/bodies/{body}", show_axes=False)
            self._dress_body(body, solids)
        for handle, _, _ in self._stretches:
            handle.remove()
        self._stretches = [self._stretched(take, stretch) for stretch in take.looks.stretches]

    def _dress_body(self, body: str, solids: Any) -> None:
        known = self._solids.setdefault(body, [])
        if len(known) != len(solids):
            for handle, _, _ in known:
                handle.remove()
            known.clear()
        for k, solid in enumerate(solids):
            if k < len(known):
                handle, vertices, faces = known[k]
                if vertices.shape == solid.vertices.shape and np.array_equal(faces, solid.faces):
                    if not np.array_equal(vertices, solid.vertices):
                        handle.vertices = solid.vertices.astype(np.float32)
                        known[k] = (handle, solid.vertices, faces)
                    continue
                handle.remove()
            handle = self.scene.add_mesh_simple(
                f"/bodies/{body}/{k}",
                solid.vertices,
                solid.faces,
                color=solid.colour,
                opacity=None if solid.opacity >= 1 else solid.opacity,
                side="double",
            )
            entry = (handle, solid.vertices, solid.faces)
            known[k : k + 1] = [entry]

    def _stretched(self, take: Take, stretch: Any) -> tuple[Any, np.ndarray, np.ndarray]:
        if stretch.kind == "spring":
            vertices, faces = coil(8, stretch.radius, 0.16 * stretch.radius)
        else:
            vertices, faces = cylinder(stretch.radius, 1.0, center=(0, 0, 0.5))
        handle = self.scene.add_mesh_simple(
            f"/stretches/{stretch.name}", vertices, faces, color=stretch.colour, side="double"
        )
        shift = np.array([0.0, 0.0, 0.85 * take.looks.front])
        start, end = (
            take.placed(body, point) + shift for body, point in zip(stretch.bodies, stretch.points, strict=True)
        )
        return handle, start, end

    def show(self, take: Take, frame: int) -> None:
        """Move the bodies to where they are at an instant."""
        for body, handle in self._frames.items():
            index = take.bodies.index(body)
            handle.position = take.position[frame, index]
            handle.wxyz = take.quaternion[frame, index]
        for handle, start, end in self._stretches:
            across = end[frame] - start[frame]
            length = float(np.linalg.norm(across))
            handle.visible = length > 0
            if length > 0:
                handle.position, handle.wxyz = start[frame], quaternion_to(across)
                handle.scale = (1.0, 1.0, length)

    def arrows(self, name: str, arrows: np.ndarray, colour: tuple[int, int, int]) -> None:
        """Show arrows, (arrows, 2, 3), in one colour; none takes those of this name away."""
        arrows = long_enough(arrows, self._size)
        handle = self._arrows.get(name)
        if not len(arrows):
            if handle is not None:
                self._arrows.pop(name).remove()
            return
        if handle is not None:
            handle.points = arrows.astype(np.float32)
            return
        sizes = {key: share * self._size for key, share in ARROW.items()}
        self._arrows[name] = self.scene.add_arrows(f"/arrows/{name}", arrows, _linear(np.array(colour)), **sizes)

    def derivative_arrows(self, order: int, arrows: np.ndarray) -> None:
        """Show the arrows of a derivative, (arrows, 2, 3)."""
        self.arrows(f"derivative {order}", arrows, derivative_colour(order))

    def torques(self, exertions: list[Exertion], frame: int, largest: float, shift: np.ndarray) -> None:
        """Show torques as arrows around their axes, larger where they are larger."""
        wanted = {f"{e.kind} {e.name}": e for e in exertions if e.torque is not None}
        for name in self._arcs.keys() - wanted.keys():
            self._arcs.pop(name).remove()
        for name, exertion in wanted.items():
            torque = exertion.torque
            size = 0.0 if torque is None else float(np.linalg.norm(torque[frame]))
            if name not in self._arcs:
                vertices, faces = arc_arrow()
                colour = KINDS[exertion.kind]
                self._arcs[name] = self.scene.add_mesh_simple(
                    f"/torques/{name}", vertices, faces, color=colour, side="double"
                )
            handle = self._arcs[name]
            handle.visible = bool(size > 1e-6 * largest > 0)
            if handle.visible and torque is not None:
                handle.position = exertion.place[frame] + shift
                handle.wxyz = quaternion_to(torque[frame])
                handle.scale = ARC_RADIUS * self._size * (0.3 + 0.7 * np.sqrt(size / largest))

    def paths(self, lines: np.ndarray, colours: np.ndarray) -> None:
        """Show paths as short lines, (lines, 2, 3), with a colour at each end."""
        handle = self._arrows.pop("paths", None)
        if handle is not None:
            handle.remove()
        if len(lines):
            self._arrows["paths"] = self.scene.add_line_segments(
                "/paths", lines, _linear(colours), thickness=3.0, thickness_units="screen"
            )

    def remake_arrows(self) -> None:
        """Forget the arrows, so that those shown next have the thickness of the size of now."""
        for name in [name for name in self._arrows if name != "paths"]:
            self._arrows.pop(name).remove()

    def stage(self, take: Take) -> None:
        """Set light, ground and camera for a take; done once, so that the view does not jump while one works."""
        self.scene.configure_environment_map(hdri=None)  # lights of our own, and nothing to be fetched
        self.scene.configure_default_lights(enabled=True, cast_shadow=False)
        self.scene.add_light_ambient("/lights/ambient", intensity=1.7)
        self.scene.set_up_direction(take.looks.up)
        low, high = take.box
        center, size = 0.5 * (low + high), take.size
        (self._flat if take.planar else self._solid)(take.looks, center, low, high, size)

    def _flat(self, looks: Looks, center: np.ndarray, low: np.ndarray, high: np.ndarray, size: float) -> None:
        half = 0.5 * MARGIN * max(high[1] - low[1], (high[0] - low[0]) / NARROW, 1e-9 * size)
        distance = half / np.tan(0.5 * FLAT_FIELD_OF_VIEW)
        self._camera(center + np.array([0.0, 0.0, distance]), center, looks.up, FLAT_FIELD_OF_VIEW, distance)
        self._grid("xy", [center[0], center[1], low[2] - 0.02 * size], size)

    def _solid(self, looks: Looks, center: np.ndarray, low: np.ndarray, high: np.ndarray, size: float) -> None:
        up = np.array(looks.up)
        k = int(np.argmax(np.abs(up)))
        toward = 0.55 * up + np.roll(up, 1) * 1.0 + np.roll(up, 2) * -0.75
        distance = 0.5 * size / np.tan(0.5 * FIELD_OF_VIEW)
        self._camera(center + toward / np.linalg.norm(toward) * distance, center, looks.up, FIELD_OF_VIEW, distance)
        place = center.copy()
        place[k] = (low if up[k] > 0 else high)[k] - up[k] * 0.02 * size
        self._grid(("yz", "xz", "xy")[k], place, size)

    def _camera(self, position: np.ndarray, target: np.ndarray, up: Any, field: float, distance: float) -> None:
        camera = self.server.initial_camera
        camera.position, camera.look_at, camera.up = tuple(position), tuple(target), up
        camera.fov, camera.near, camera.far = field, 0.01 * distance, 20.0 * distance

    def _grid(self, plane: Any, place: Any, size: float) -> None:
        cell = rounded(0.12 * size)
        section = 5 * cell
        width = float(np.ceil(2.2 * size / section)) * section
        corner = np.round(np.asarray(place) / section) * section
        fixed = {"xy": 2, "xz": 1, "yz": 0}[plane]
        corner[fixed] = place[fixed]
        self._ground = self.scene.add_grid(
            "/ground grid",
            width,
            width,
            plane=plane,
            cell_size=cell,
            section_size=section,
            cell_color=(225, 228, 232),
            section_color=(200, 205, 212),
            fade_distance=40 * size,
            shadow_opacity=0.0,
            position=corner,
        )


def _linear(colours: np.ndarray) -> np.ndarray:
    """Return colours as the page wants those of arrows and lines: by intensity of light, not as the eye sees them."""
    share = colours / 255
    light = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return (255 * light).round().astype(np.uint8)
