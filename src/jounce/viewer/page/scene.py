"""The three-dimensional scene of the page: bodies, rods and springs, arrows, paths, the ground and the camera."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float, Integer, UInt8
from trimesh import Trimesh

from jounce.plot.labels import rounded_down
from jounce.viewer.page.overlay import Overlay
from jounce.viewer.shapes.appearance import Color, ColoredMesh, Connector
from jounce.viewer.shapes.arrows import LOAD_COLORS, derivative_color, in_front, long_enough
from jounce.viewer.shapes.meshes import arc_arrow, coil, cylinder
from jounce.viewer.shapes.recording import Recording, Vectors

FIELD_OF_VIEW, FLAT_FIELD_OF_VIEW = 0.6, 0.12  # rad; the second has almost no perspective
MARGIN, NARROW = 1.2, 0.85  # NARROW is the aspect ratio of the space between the panels
ARROW = {"shaft_radius": 0.0045, "head_radius": 0.0125, "head_length": 0.034}  # in sizes
ARC_RADIUS = 0.062
Vector = Float[np.ndarray, "3"]


class ViserScene:
    """The scene of a recording on a viser server, one instant at a time.

    Parameters
    ----------
    server : viser.ViserServer
    """

    def __init__(self, server: Any):
        self.server, self.scene = server, server.scene
        self._frames: dict[str, Any] = {}
        self._meshes: dict[str, list[tuple[Any, ColoredMesh]]] = {}
        self._connectors: list[tuple[Any, Vectors, Vectors]] = []
        self._arrows: dict[str, Any] = {}
        self._arcs: dict[str, Any] = {}
        self._size = 1.0

    def set_shapes(self, recording: Recording) -> None:
        """Show the shapes of a recording instead of those of the previous one; only changes are sent."""
        self._size = recording.size
        for body, meshes in recording.appearance.meshes.items():
            if body not in self._frames:
                self._frames[body] = self.scene.add_frame(f"/bodies/{body}", show_axes=False)
            self._set_meshes(body, meshes)
        for handle, _, _ in self._connectors:
            handle.remove()
        self._connectors = [self._connector(recording, connector) for connector in recording.appearance.connectors]

    def _set_meshes(self, body: str, meshes: Sequence[ColoredMesh]) -> None:
        handles = self._meshes.setdefault(body, [])
        for handle, _ in handles[len(meshes) :]:
            handle.remove()
        del handles[len(meshes) :]
        for k, colored in enumerate(meshes):
            mesh = colored.mesh
            if k < len(handles):
                handle, before = handles[k]
                if before.color == colored.color and np.array_equal(before.mesh.faces, mesh.faces):
                    if not np.array_equal(before.mesh.vertices, mesh.vertices):
                        handle.vertices = mesh.vertices.astype(np.float32)
                        handles[k] = (handle, colored)
                    continue
                handle.remove()
            opacity = None if colored.opacity >= 1 else colored.opacity
            handle = self._mesh(f"/bodies/{body}/{k}", mesh, colored.color, opacity)
            handles[k : k + 1] = [(handle, colored)]

    def _mesh(self, name: str, mesh: Trimesh, color: Color, opacity: float | None = None) -> Any:
        vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
        return self.scene.add_mesh_simple(name, vertices, faces, color=color, opacity=opacity, side="double")

    def _connector(self, recording: Recording, connector: Connector) -> tuple[Any, Vectors, Vectors]:
        spring = connector.kind == "spring"
        mesh = (
            coil(8, connector.radius, 0.16 * connector.radius)
            if spring
            else cylinder(connector.radius, 1.0, center=(0, 0, 0.5))
        )
        handle = self._mesh(f"/connectors/{connector.name}", mesh, connector.color)
        points = zip(connector.bodies, connector.points, strict=True)
        ends = connector.ends or tuple(recording.global_point(body, point) for body, point in points)
        start, end = (center + 0.85 * in_front(recording) for center in ends)
        return handle, start, end

    def show(self, overlay: Overlay, frame: int) -> None:
        """Show an instant: bodies, arrows and loads."""
        recording = overlay.recording
        for body, handle in self._frames.items():
            index = recording.bodies.index(body)
            handle.position = recording.position[frame, index]
            handle.wxyz = recording.quaternion[frame, index]
        for handle, start, end in self._connectors:
            span = end[frame] - start[frame]
            length = float(np.linalg.norm(span))
            handle.visible = length > 0
            if length > 0:
                handle.position, handle.wxyz = start[frame], quaternion_to(span)
                handle.scale = (1.0, 1.0, length)
        arrow_sets = {f"derivative {k}": (arrows, derivative_color(k)) for k, arrows in overlay.arrows.items()}
        arrow_sets |= {kind: (arrows, LOAD_COLORS[kind]) for kind, arrows in overlay.forces.items()}
        for name in self._arrows.keys() - arrow_sets.keys() - {"paths"}:
            self._arrows.pop(name).remove()
        for name, (arrows, color) in arrow_sets.items():
            self._show_arrows(name, arrows[frame], color)
        self._show_torques(overlay, frame)

    def _show_arrows(self, name: str, arrows: Float[np.ndarray, "arrows 2 3"], color: Color) -> None:
        arrows = long_enough(arrows, self._size)
        if not len(arrows):
            if name in self._arrows:
                self._arrows.pop(name).remove()
        elif name in self._arrows:
            self._arrows[name].points = arrows.astype(np.float32)
        else:
            sizes = {key: fraction * self._size for key, fraction in ARROW.items()}
            self._arrows[name] = self.scene.add_arrows(f"/arrows/{name}", arrows, _linear(np.array(color)), **sizes)

    def _show_torques(self, overlay: Overlay, frame: int) -> None:
        """Show torques as arrows around their axes, scaled with their magnitude."""
        torques = {f"{load.kind} {load.name}": load for load in overlay.loads if load.torque is not None}
        for name in self._arcs.keys() - torques.keys():
            self._arcs.pop(name).remove()
        for name, load in torques.items():
            if name not in self._arcs:
                self._arcs[name] = self._mesh(f"/torques/{name}", arc_arrow(), LOAD_COLORS[load.kind])
            handle, torque = self._arcs[name], np.asarray(load.torque)[frame]
            fraction = float(np.linalg.norm(torque)) / (overlay.largest_torque or 1.0)
            handle.visible = fraction > 1e-6
            if handle.visible:
                handle.position = load.point[frame] + in_front(overlay.recording)
                handle.wxyz = quaternion_to(torque)
                handle.scale = ARC_RADIUS * self._size * (0.3 + 0.7 * np.sqrt(fraction))

    def begin(self, overlay: Overlay) -> None:
        """Show the paths, and set the thickness of arrows by the size of the recording."""
        for handle in self._arrows.values():
            handle.remove()
        self._arrows.clear()
        if len(overlay.lines):
            self._arrows["paths"] = self.scene.add_line_segments(
                "/paths", overlay.lines, _linear(overlay.colors), thickness=3.0, thickness_units="screen"
            )

    def set_stage(self, recording: Recording) -> None:
        """Set light, ground and camera; called once, so that the view does not jump later."""
        self.scene.configure_environment_map(hdri=None)  # own lights, so that nothing is fetched
        self.scene.configure_default_lights(enabled=True, cast_shadow=False)
        self.scene.add_light_ambient("/lights/ambient", intensity=1.7)
        (low, high), size, up = recording.box, recording.size, np.array(recording.appearance.up)
        self.scene.set_up_direction(recording.appearance.up)
        center = 0.5 * (low + high)
        if recording.planar:
            half_width = 0.5 * MARGIN * max(high[1] - low[1], (high[0] - low[0]) / NARROW, 1e-9 * size)
            self._set_camera(center, up, np.array([0.0, 0.0, 1.0]), half_width, FLAT_FIELD_OF_VIEW)
            self._set_grid(2, np.array([center[0], center[1], low[2] - 0.02 * size]), size)
            return
        k = int(np.argmax(np.abs(up)))
        viewpoint = 0.55 * up + np.roll(up, 1) * 1.0 + np.roll(up, 2) * -0.75
        self._set_camera(center, up, viewpoint / np.linalg.norm(viewpoint), 0.5 * size, FIELD_OF_VIEW)
        center[k] = (low if up[k] > 0 else high)[k] - up[k] * 0.02 * size
        self._set_grid(k, center, size)

    def _set_camera(self, target: Vector, up: Vector, viewpoint: Vector, half_width: float, field: float) -> None:
        """Point the camera at a target from a direction, with a field of view, rad, that covers twice `half_width`."""
        camera, distance = self.server.initial_camera, half_width / np.tan(0.5 * field)
        camera.position, camera.look_at, camera.up = tuple(target + distance * viewpoint), tuple(target), tuple(up)
        camera.fov, camera.near, camera.far = field, 0.01 * distance, 20.0 * distance

    def _set_grid(self, normal: int, position: Vector, size: float) -> None:
        """Draw a grid with cells of a round length through a position, perpendicular to one of the axes."""
        cell = rounded_down(0.12 * size)
        section = 5 * cell
        width = float(np.ceil(2.2 * size / section)) * section
        corner = np.round(position / section) * section
        corner[normal] = position[normal]
        self.scene.add_grid(
            "/ground grid",
            width,
            width,
            plane=("yz", "xz", "xy")[normal],
            cell_size=cell,
            section_size=section,
            cell_color=(225, 228, 232),
            section_color=(200, 205, 212),
            fade_distance=40 * size,
            shadow_opacity=0.0,
            position=corner,
        )


def quaternion_to(direction: Vector) -> Float[np.ndarray, "4"]:
    """Return the quaternion, scalar part first, that rotates z to a direction.

    Examples
    --------
    >>> import numpy as np
    >>> quaternion_to(np.array([0.0, 0.0, 2.0])).tolist()
    [1.0, 0.0, 0.0, 0.0]
    """
    x, y, z = direction / np.linalg.norm(direction)
    if z < -1 + 1e-12:
        return np.array([0.0, 1.0, 0.0, 0.0])
    quaternion = np.array([1.0 + z, -y, x, 0.0])
    return quaternion / np.linalg.norm(quaternion) + 0.0


def _linear(colors: Integer[np.ndarray, "*batch 3"]) -> UInt8[np.ndarray, "*batch 3"]:
    """Return sRGB colors as linear intensities, which the page expects for arrows and lines."""
    fraction = colors / 255
    intensity = np.where(fraction <= 0.04045, fraction / 12.92, ((fraction + 0.055) / 1.055) ** 2.4)
    return (255 * intensity).round().astype(np.uint8)
