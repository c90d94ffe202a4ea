"""Draw the pictures of the gallery: python docs/make_gallery.py [NAME ...] writes docs/images/gallery/NAME.png.

Every mechanism file of examples/ and every robot of examples/robots has one, but for those that look like another one
there; the paths of points are colored by the size of their jerk.
"""

import dataclasses
import importlib.util
import io
import os
import pathlib
import sys
from collections.abc import Callable, Mapping

import numpy as np

os.environ.setdefault("JAX_DISABLE_MOST_OPTIMIZATIONS", "true")  # each file is compiled once to be run once

import jounce as jn
from jounce import plot
from jounce.plot.drawings.frames import frames, points_at
from jounce.plot.machine_sketch import draw_scale

ROOT = pathlib.Path(__file__).parents[1]
EXAMPLES = ROOT / "examples"
TARGET = ROOT / "docs" / "images" / "gallery"
LARGEST = 40_000  # bytes of a picture
RESOLUTION = 110  # dots per inch


@dataclasses.dataclass(frozen=True)
class Picture:
    """How a mechanism or a robot is drawn."""

    paths: tuple[str, ...]  # outputs, or points
    instant: float = 0.0  # s
    order: int = 3  # of the derivative in the color of the paths
    points: Mapping[str, tuple] = dataclasses.field(
        default_factory=dict
    )  # name: body and place, m, besides the outputs
    view: tuple[float, float] = (-60.0, 25.0)
    stop: float | None = None  # of a simulation, s
    source: str = ""  # the file in examples/, where it is not NAME.yaml
    module: str = ""  # the file in examples/ with a joint of one's own
    title: str = ""  # of a robot, whose file has a name only
    trajectory: str = ""  # of a robot: the file in examples/trajectories, or laws
    laws: Mapping[str, str] = dataclasses.field(default_factory=dict)
    outline: tuple[str, Callable] | None = None  # a body, and its outline, (n, 2) m, from the parameters


def pitch_curve(values):
    """Return the curve on which the roller center of examples/own_joint/cam.yaml stays."""
    angle = np.linspace(0.0, 2 * np.pi, 181)
    radius = values["base"] + values["rise"] * np.cos(values["lobes"] * angle)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def flat_face_cam(values):
    """Return the cam of examples/own_joint/valve_train.yaml, the envelope of the lines of its support function."""
    angle = np.linspace(-np.pi, np.pi, 361)
    half = 0.5 * (1 + np.cos(angle))
    support = values["base"] + values["lift"] * half ** values["sharpness"]
    slope = -0.5 * values["lift"] * values["sharpness"] * np.sin(angle) * half ** (values["sharpness"] - 1)
    along, across = np.stack([np.cos(angle), np.sin(angle)], -1), np.stack([-np.sin(angle), np.cos(angle)], -1)
    return support[:, None] * along + slope[:, None] * across


def disc_cam(values):
    """Return the profile of the cam of examples/camshaft.yaml for a roller of 6 mm."""
    turns = [("modified_sine", values["rise"]), ("dwell", None), ("modified_sine", 0.0), ("dwell", None)]
    law = jn.laws.SegmentedMotion(
        [jn.laws.Segment(profile, np.pi / 2, to=to) for profile, to in turns], beyond="repeat"
    )
    cam = jn.cams.plate_cam(
        law, jn.cams.TranslatingFollower("roller", radius=0.006), base_radius=values["base"] - 0.006
    )
    return np.stack([cam.dataset["x"].values, cam.dataset["y"].values], axis=-1)


def robot(title, source, trajectory, body, place=(0.0, 0.0, 0.0), **options):
    """Return the picture of a robot, with the path of a point of a link."""
    options = {"title": title, "trajectory": trajectory} | options
    return Picture(("tip",), points={"tip": (body, place)}, source=f"robots/{source}", **options)


PICTURES = {
    "andrews": Picture(
        ("crank_pin", "knee"), 0.018, points={"crank_pin": ("K1", (0.007, 0)), "knee": ("K3", (0, -0.035))}
    ),
    "cam": Picture(
        ("roller",),
        0.2,
        points={"roller": ("follower", (0, 0))},
        source="own_joint/cam.yaml",
        module="own_joint.py",
        outline=("cam", pitch_curve),
    ),
    "barrel_cam": Picture(
        ("pin", "groove"), 0.06, points={"groove": ("drum", (-0.025, 0.0, 0.04))}, view=(-70.0, 20.0)
    ),
    "belt_drive": Picture(("rim",), 0.3, points={"rim": ("tool", (0.0, 0.064))}),
    "block_and_tackle": Picture(("load",), 1.0, order=2),
    "camshaft": Picture(("roller",), 0.04, outline=("shaft", disc_cam)),
    "bicycle": Picture(("seat", "track"), 0.3, view=(-70.0, 14.0), stop=0.6),
    "bevel_differential": Picture(
        ("rim", "pinion"), 0.3, points={"pinion": ("spider", (0.02, 0, 0.025))}, view=(-60.0, 25.0)
    ),
    "bennett": Picture(("B", "C"), 0.25, points={"B": ("BC", (0, 0, 0))}, view=(-60.0, 30.0)),
    "delta_robot": Picture(("platform",), 0.15, view=(-70.0, 18.0)),
    "rolling_disc_in_space": Picture(("center", "mark"), 0.3, view=(-60.0, 30.0), stop=2.0),
    "double_cardan": Picture(("rim",), 0.1, view=(-70.0, 40.0)),
    "double_four_bar": Picture(("tip",), 0.25, stop=1.5),
    "double_pendulum": Picture(("tip",), 0.4, stop=2.0),
    "double_wishbone": Picture(
        ("contact", "wheel"),
        0.6,
        points={"contact": ("upright", (0, 0.78, 0)), "top": ("upright", (0, 0.78, 0.6))},
        view=(-20.0, 20.0),
    ),
    "epicyclic": Picture(("tooth",), 0.4),
    "excavator": Picture(("teeth",), 1.0),
    "five_bar": robot(
        "Five-bar robot",
        "five_bar.xml",
        "",
        "left_forearm",
        (0.22, 0, 0),
        laws={"left_motor": "0.3*sin(4*t)", "right_motor": "0.2*sin(6*t) - 0.1"},
        view=(-80.0, 12.0),
        instant=0.3,
        stop=np.pi,
    ),
    "flyball_governor": Picture(("ball",), 0.02, points={"ball": ("right", (1, 0, 0))}, view=(-70.0, 20.0)),
    "four_bar": Picture(("C",), 0.3),
    "four_bar_in_space": Picture(("C",), 0.3, points={"C": ("rocker", (0.2031, 0, 0))}, view=(-75.0, 60.0)),
    "garage_door": Picture(("bottom_roller", "top_roller"), 2.8),
    "gear_pair": Picture(("C",), 0.2),
    "hooke_joint": Picture(("rim",), 0.1, view=(-70.0, 40.0)),
    "human_arm": robot(
        "Human arm",
        "human_arm.xml",
        "human_arm_reach.yaml",
        "hand",
        (0, 0, -0.189),
        view=(-70.0, 15.0),
        instant=0.9,
    ),
    "inverted_slider_crank_slide": Picture(("G",), 0.3),
    "jansen_leg": Picture(("foot",), 0.6),
    "klann_leg": Picture(("foot",), 0.0),
    "lr_mate": robot("LR Mate 100iB", "lr_mate.urdf", "lr_mate_swing.yaml", "flange", (0.08, 0, 0), view=(-70.0, 15.0)),
    "panda": robot("Franka Panda", "panda.urdf", "panda_pick.yaml", "panda_hand", (0, 0, 0.1), view=(-50.0, 15.0)),
    "pantograph": Picture(("P", "Q"), 0.1),
    "peaucellier": Picture(("P", "B"), 0.2),
    "planetary_train": Picture(("tooth",), 0.4),
    "planar_arm": robot(
        "Planar arm", "planar_arm.xml", "planar_arm_lift.yaml", "ram", (0.25, 0, 0), view=(-80.0, 12.0)
    ),
    "press": Picture(("ram", "knee_pin"), 0.4, points={"knee_pin": ("upper", (0.4, 0))}),
    "press_with_friction": Picture(("ram", "knee_pin"), 0.4, points={"knee_pin": ("upper", (0.4, 0))}),
    "quick_return": Picture(("B", "pin"), 0.3, points={"B": ("arm", (0.5, 0)), "pin": ("crank", (0.08, 0))}),
    "rack_pinion": Picture(("spoke",), 0.2),
    "radial_engine": Picture(("knuckle2", "knuckle4"), 0.01),
    "rccc": Picture(("coupler_point",), 0.2),
    "rolling_disc": Picture(("pin",), 0.2),
    "rspu_slide": Picture(("B",), 0.2),
    "rssr": Picture(("B", "C"), 0.2, points={"B": ("crank", (0, 0.04, 0))}),
    "rsur": Picture(("B", "C"), 0.2),
    "sarrus": Picture(("lift", "knee"), 0.3, points={"knee": ("upper_x", (0, 0, 0))}, view=(-50.0, 20.0)),
    "scara": robot("SCARA", "scara.urdf", "scara_pick.yaml", "spindle", (0, 0, 0.06), view=(-50.0, 25.0)),
    "scotch_yoke": Picture(("pin",), 0.2, points={"pin": ("crank", (0.04, 0))}),
    "screw_jack": Picture(("rim",), 0.3, points={"rim": ("screw", (0.03, 0, 0))}, view=(-60.0, 20.0)),
    "screw_press": Picture(("tip",), 0.2),
    "sprung_four_bar": Picture(("C",), 0.0, stop=2.0),
    "servo_press": Picture(("ram", "pin"), 0.3, points={"pin": ("crank", (0.08, 0))}),
    "simple_pendulum": Picture(("place",), 0.3, stop=2.0),
    "six_bar_stephenson": Picture(("P", "F"), 0.1),
    "six_bar_watt": Picture(("coupler_point",), 0.1),
    "slider_crank": Picture(("middle",), 0.1),
    "solo12": robot("Solo 12", "solo12.urdf", "solo12_trot.yaml", "FL_LOWER_LEG", (0, 0, -0.16), view=(-60.0, 20.0)),
    "spatial_slider_crank": Picture(("middle",), 0.1),
    "stewart_platform": Picture(("corner",), 0.1),
    "swash_plate": Picture(("piston1",), 0.1),
    "ur5": robot("UR5", "ur5.urdf", "ur5_stack.yaml", "wrist_3_link", (0, 0.0823, 0), view=(-50.0, 25.0)),
    "valve_train": Picture(
        ("valve", "tappet"),
        0.004,
        source="own_joint/valve_train.yaml",
        module="valve_train.py",
        outline=("cam", flat_face_cam),
    ),
    "wolfrom_train": Picture(("tooth",), 0.4),
    "worm_gearhead": Picture(("tip",), 1.5, view=(-75.0, 15.0)),
}


def module(path):
    """Return a Python file as a module; the joints that it defines join the catalogue."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


def motion(name, picture):
    """Return the motion of a mechanism or a robot, with the points wanted among its outputs."""
    points = {key: jn.outputs.PointOutput(body, place) for key, (body, place) in picture.points.items()}
    source = EXAMPLES / (picture.source or f"{name}.yaml")
    if source.suffix != ".yaml":
        machine = jn.load_robot(source)
        laws = picture.laws or jn.load_trajectory(EXAMPLES / "trajectories" / picture.trajectory)
        free = set(machine.joint_names) - set(laws.names if picture.trajectory else machine.joint_names)
        machine = machine.locked(dict.fromkeys(free, 0.0))
        on_bodies = {key: jn.robot.body_point(machine, *there) for key, there in picture.points.items()}
        points = {key: jn.outputs.PointOutput(body, place) for key, (body, place) in on_bodies.items()}
        time = np.linspace(0.0, picture.stop, 201) if picture.stop else None
        machine = machine.mechanism(drivers=laws, outputs=points, time=time, drives=False)  # without their symbols
        return jn.solve(dataclasses.replace(machine, title=picture.title), order=picture.order)
    if picture.module:
        module(EXAMPLES / picture.module)
    mechanism = jn.load(source)
    mechanism = dataclasses.replace(mechanism, outputs={**mechanism.outputs, **points})
    if not mechanism.initial:
        return jn.solve(mechanism, order=picture.order)
    time = np.linspace(0.0, picture.stop, 401) if picture.stop else None
    return jn.simulate(mechanism, time, order=picture.order)


def add_outline(figure, moved, picture):
    """Draw the outline of a body behind the sketch, and widen the view to hold it."""
    body, outline = picture.outline
    at = int(np.argmin(np.abs(moved.time - picture.instant)))
    places = points_at(frames(moved)[body], outline(moved.mechanism.parameter_values))[at]
    axes = figure.axes[0]
    axes.fill(*places.T, facecolor="#cce3f0", edgecolor="#0072B2", linewidth=1.5, zorder=1)
    (left, right), margin = axes.get_xlim(), 0.12 * np.ptp(places[:, 0])
    lower, upper = axes.get_ylim()
    left, right = min(left, places[:, 0].min() - margin), max(right, places[:, 0].max() + margin)
    lower = min(lower, places[:, 1].min() - 2 * margin)
    axes.set_xlim(left, right)
    axes.set_ylim(lower, upper)
    width, height = figure.get_size_inches()
    figure.set_size_inches(max(width, (height - 0.6) * (right - left) / (upper - lower) + 1.2), height)
    draw_scale(axes, max(right - left, upper - lower))


def draw(name):
    """Write one picture, and return how many bytes it has."""
    from PIL import Image

    picture = PICTURES[name]
    moved = motion(name, picture)
    look = {"names": "outputs", "paths": picture.paths, "order": picture.order, "view": picture.view}
    figure = plot.sketch(moved, picture.instant, **look)
    if picture.outline:
        add_outline(figure, moved, picture)
    drawn, packed = io.BytesIO(), io.BytesIO()
    figure.savefig(drawn, format="png", dpi=RESOLUTION)
    few = Image.open(drawn).convert("RGB").quantize(96, dither=Image.Dither.NONE)  # line art needs few colors
    few.save(packed, format="png", optimize=True)
    if packed.tell() > LARGEST:
        raise SystemExit(f"{name}: {packed.tell()} bytes, more than {LARGEST}")
    TARGET.mkdir(parents=True, exist_ok=True)
    (TARGET / f"{name}.png").write_bytes(packed.getvalue())
    return packed.tell()


if __name__ == "__main__":
    for chosen in sys.argv[1:] or PICTURES:
        print(f"{chosen}.png: {draw(chosen)} bytes", flush=True)
