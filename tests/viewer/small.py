"""A wheel whose motion can be written down, and a subject whose solves take as long as a test wants."""

import dataclasses
import threading

import numpy as np

import jounce as jn
from jounce.viewer.shapes.appearance import Appearance, BodyPoint, ColoredMesh
from jounce.viewer.shapes.meshes import box
from jounce.viewer.shapes.recording import Parameter, Recording

INERTIA, MASS, RADIUS = 0.5, 2.0, 0.3


def wheel(**parts):
    """A wheel on the ground's origin, its angle c*t**3 and its center of mass in the pivot."""
    given = {
        "space": "planar",
        "bodies": {"wheel": jn.Body([0, 0], mass=MASS, inertia=INERTIA)},
        "joints": {"O": jn.planar.Revolute(("ground", "wheel"), [0, 0], [0, 0])},
        "drivers": {"turn": jn.drivers.CoordinateDriver(("ground", "wheel"), "angle", motion="c*t**3")},
        "outputs": {"rim": jn.outputs.PointOutput("wheel", point=["r", 0]), "angle": jn.outputs.AngleOutput("wheel")},
        "parameters": {"c": 2.0, "r": RADIUS, "twice": "2*r"},
        "gravity": [0, -10.0],
        "time": np.linspace(0.0, 1.0, 101),
        "title": "Wheel",
    }
    return jn.Mechanism(**{**given, **parts})


def derivatives_of_the_rim(time, c=2.0, radius=RADIUS):
    """Position, velocity and acceleration of the rim, (time, 3, 3), by hand."""
    angle, rate, second = c * time**3, 3 * c * time**2, 6 * c * time
    along = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    across = np.stack([-np.sin(angle), np.cos(angle), 0 * angle], axis=1)
    velocity = radius * rate[:, None] * across
    acceleration = radius * (second[:, None] * across - rate[:, None] ** 2 * along)
    return np.stack([radius * along, velocity, acceleration], axis=1)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class PlainRecording(Recording):
    """One motion of every point, and nothing else."""

    motions: np.ndarray

    def quantities(self):
        return {}

    def derivatives(self, body, point):
        return self.motions

    def all_loads(self):
        return []

    def dataset(self):
        return None


def plain_recording(value=1.0, notice=""):
    """A recording of a box that moves by a value along x."""
    time = np.linspace(0.0, 1.0, 5)
    position = np.zeros((5, 2, 3))
    position[:, 1, 0] = value * time
    quaternion = np.zeros((5, 2, 4))
    quaternion[..., 0] = 1.0
    motion = np.zeros((5, 2, 3))
    motion[:, 0], motion[:, 1, 0] = position[:, 1], value
    appearance = Appearance(
        {"ground": (), "box": (ColoredMesh(box([0.1, 0.1, 0.1]), (1, 2, 3)),)},
        (),
        (BodyPoint("box", (0.0, 0.0, 0.0), "box"),),
        1.0,
        (0.0, 0.0, 1.0),
    )
    return PlainRecording(
        title="box", planar=False, time=time, order=1, bodies=("ground", "box"), position=position,
        quaternion=quaternion, values={"value": value}, appearance=appearance, notice=notice, motions=motion,
    )  # fmt: skip


class Slow:
    """A subject that solves when it is let, and fails for values below zero."""

    name, loaded, no_sliders = "slow", False, ""
    parameters = (Parameter("value", 1.0, 0.5, 1.5),)

    def __init__(self):
        self.solved = []
        self.gate = threading.Event()
        self.gate.set()
        self.began = threading.Event()

    def solve(self, values, order):
        self.began.set()
        assert self.gate.wait(20.0)
        self.solved.append(values["value"])
        if values["value"] < 0:
            raise jn.errors.AssemblyError("the bodies cannot be assembled", name="value", value=values["value"])
        return plain_recording(values["value"], "some instants are missing" if values["value"] > 100 else "")
