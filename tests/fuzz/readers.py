"""Every reader of the package, with good texts to begin from."""

from __future__ import annotations

import functools
import pathlib
import random
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import jounce as jn
from jounce.io.files.dumping import dumped
from jounce.io.files.parsers import read_yaml
from jounce.io.mechanisms.conversion import assigned
from jounce.io.mechanisms.overrides import override
from jounce.io.robots.limits import load_limits
from jounce.io.robots.payloads import with_payloads
from jounce.trajectory import Expression
from jounce.units.values import parse_value
from tests.fuzz.folders import edits, read_sweep, sweeps
from tests.fuzz.mutations import mutated
from tests.fuzz.results import changed_netcdf, changed_table, netcdfs, read_netcdf, read_table, tables

__all__ = ["READERS", "Reader"]

ROOT = pathlib.Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
PLANAR = ("four_bar", "slider_crank", "scotch_yoke", "gear_pair", "rolling_disc", "simple_pendulum")
SPATIAL = ("rssr", "hooke_joint", "screw_press", "spatial_slider_crank_free", "double_pendulum")
TABLE = "time,value\n" + "".join(f"{0.1 * k:.1f},{(0.1 * k) ** 2:.4f}\n" for k in range(12))
SAMPLED = """space: planar
parameters: {k: 2 N/m, s: 3 mm}
bodies:
  slider: {position: [s, 0], mass: 2 kg, inertia: {solid: box, size: [1, 2, 3]}}
joints: {guide: {type: prismatic, bodies: [ground, slider], points: [[0, 0], [0, 0]], vectors: [[1, 0], [1, 0]]}}
drivers: {x: {type: coordinate, bodies: [ground, slider], coordinate: x, motion: {samples: lift.csv, degree: 5}}}
outputs: {P: {body: slider, point: [0, 0]}, F: {driver: x, quantity: force}}
time: {start: 0, stop: 1, step: 0.1}
"""


def _read(*places: pathlib.Path) -> list[str]:
    return [place.read_text(encoding="utf-8") for place in places]


def _mechanisms() -> list[str]:
    templates = sorted((ROOT / "src" / "jounce" / "templates").glob("*.yaml"))
    return [SAMPLED, *_read(*(EXAMPLES / f"{name}.yaml" for name in (*PLANAR, *SPATIAL)), *templates)]


def _as(suffix: str) -> Callable[[], list[str]]:
    return lambda: [dumped(read_yaml("seed", text).data, suffix) for text in _mechanisms()]


@functools.cache
def _four_bar() -> Any:
    return jn.load(EXAMPLES / "four_bar.yaml")


@functools.cache
def _scara() -> Any:
    return jn.load_robot(EXAMPLES / "robots" / "scara.urdf")


def _samples(path: pathlib.Path) -> None:
    jn.load(path.with_name("cam.yaml"))


def _expression(text: str) -> None:
    for kind in ("any", "angle", "length", "mass"):
        try:
            parse_value(text, kind, ("a", "t"))
        except jn.errors.JounceError:
            continue
    Expression(text).evaluate({"a": 0.5, "t": 0.25})


def _set(text: str) -> None:
    override(_four_bar(), [text])


def _drive(text: str) -> None:
    assigned(_scara(), [text], "--drive", law=True)


@dataclass(frozen=True)
class Reader:
    """What reads, and good texts for it.

    ``ending`` of the file that is read; None where text is read, which has no lines. ``change`` makes a case of the
    texts, which are bytes where a file is none, and need no ``lines`` in messages then.
    """

    read: Callable[[Any], Any]
    seeds: Callable[[], list[Any]]
    ending: str | None = None
    beside: dict[str, str] = field(default_factory=dict)
    change: Callable[[random.Random, list[Any]], bytes] = mutated
    lines: bool = True

    @functools.cached_property
    def texts(self) -> list[Any]:
        return self.seeds()


SAMPLES_BESIDE = {"lift.csv": TABLE, "data.csv": "t;x\n1;2\n"}
CAM_BESIDE = {"cam.yaml": SAMPLED.replace("lift.csv", "case.csv")}
ROBOTS = EXAMPLES / "robots"
INCLUDED = """<mujoco model="m"><include file="part.xml"/><default><joint damping="1"/></default>
<worldbody><body name="a" pos="0 0 1"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
<joint name="j" type="hinge" axis="0 1 0" range="-90 90" stiffness="2"/>
<body name="b" gravcomp="1"><joint name="k" type="slide"/>
<geom type="mesh" mesh="part" density="10"/></body></body></worldbody><asset><mesh name="part" file="part.obj"/></asset>
<equality><joint joint1="k" joint2="j" polycoef="0 1 0 0 0"/></equality>
<actuator><motor joint="j" forcerange="-3 3" ctrlrange="-1 1"/>
<motor tendon="f" armature="1"/></actuator><option density="1.2"/>
<tendon><fixed name="f" damping="1"><joint joint="j" coef="1"/></fixed></tendon></mujoco>
"""
EVERY_JOINT = """<sdf version="1.9"><model name="m"><frame name="f" attached_to="a">
<pose degrees="true">1 0 0 0 90 0</pose></frame><link name="a"/><link name="b">
<pose relative_to="f">1 0 0 0 0 0</pose></link><link name="c"><inertial><mass>2</mass><inertia>
<ixx>1</ixx><ixy>0.1</ixy></inertia></inertial></link>
<link name="d"><velocity_decay><linear>1</linear></velocity_decay></link><link name="e"/>
<joint name="j" type="revolute"><parent>a</parent><child>b</child><axis>
<xyz expressed_in="f">1 0 0</xyz><limit><lower>-1</lower></limit></axis></joint>
<joint name="k" type="continuous"><parent>c</parent><child>a</child><axis><dynamics>
<spring_stiffness>2</spring_stiffness></dynamics></axis></joint>
<joint name="g" type="gearbox"><parent>b</parent><child>c</child><gearbox_ratio>3</gearbox_ratio>
<gearbox_reference_body>a</gearbox_reference_body><axis><xyz>0 0 -1</xyz></axis><axis2/></joint>
<joint name="u" type="universal"><parent>c</parent><child>d</child><axis><xyz>1 0 0</xyz></axis>
<axis2><xyz>0 1 0</xyz></axis2></joint><joint name="s" type="ball"><parent>d</parent>
<child>e</child></joint><joint name="loop" type="prismatic"><parent>e</parent><child>a</child>
<axis/></joint></model></sdf>
"""
MJCF_BESIDE = {
    "part.xml": "<mujoco><worldbody><body name='c'><joint name='l'/><geom size='1'/></body></worldbody></mujoco>",
    "part.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n",
}
WIDE = "time,shoulder,elbow\n" + "".join(f"{0.1 * k:.1f},{0.01 * k * k:.4f},{0.5 - 0.1 * k:.4f}\n" for k in range(14))
LIMITS = """title: limits
default: {velocity: 150 deg/s, jerk: 4000, effort: 12 N*m}
joints:
  shoulder: {lower: -120 deg, upper: 2.0, velocity: 4 rad/s, acceleration: 20 rad/s^2, effort_rate: 1000 N*m/s}
  quill: {lower: 0, upper: 20 cm, velocity: null, effort: 200 N}
"""
MOVES = sorted((EXAMPLES / "trajectories").glob("*.yaml"))

READERS = {
    "yaml": Reader(jn.load, _mechanisms, ".yaml", SAMPLES_BESIDE),
    "toml": Reader(jn.load, _as(".toml"), ".toml", SAMPLES_BESIDE),
    "json": Reader(jn.load, _as(".json"), ".json", SAMPLES_BESIDE),
    "samples": Reader(_samples, lambda: [TABLE, TABLE.replace("time,value\n", ""), WIDE], ".csv", CAM_BESIDE),
    "urdf": Reader(jn.load_robot, lambda: _read(ROBOTS / "scara.urdf", ROBOTS / "ur5.urdf"), ".urdf"),
    "sdf": Reader(jn.load_robot, lambda: [EVERY_JOINT, *_read(ROBOTS / "luffing_crane.sdf")], ".sdf"),
    "mjcf": Reader(
        jn.load_robot,
        lambda: [INCLUDED, *_read(*(ROBOTS / f"{name}.xml" for name in ("planar_arm", "five_bar", "human_arm")))],
        ".xml",
        MJCF_BESIDE,
    ),
    "limits": Reader(lambda path: load_limits(path, _scara()), lambda: [LIMITS], ".yaml"),
    "trajectory": Reader(jn.load_trajectory, lambda: _read(*MOVES), ".yaml"),
    "table": Reader(jn.load_trajectory, lambda: [WIDE], ".csv", CAM_BESIDE),
    "results": Reader(read_table, tables, ".csv", change=changed_table),
    "netcdf": Reader(read_netcdf, netcdfs, ".nc", change=changed_netcdf, lines=False),
    "sweep": Reader(read_sweep, sweeps, ".txt", change=edits, lines=False),
    "expression": Reader(
        _expression,
        lambda: [
            "30*deg + 60*deg*sin(2*pi*t/3)",
            "2*exp(-t**2)*cos(a*t)",
            "sqrt(1 + tanh(t))",
            "13.21 cm",
            "-(a - 1)/4",
        ],
    ),
    "set": Reader(_set, lambda: ["BC=15 cm", "tau=3", "AB = 2*CD - AD", "tau=5e-1 s"]),
    "payload": Reader(
        lambda text: with_payloads(_scara(), [text]), lambda: [f"{link}=500 g" for link in _scara().moving_links]
    ),
    "drive": Reader(_drive, lambda: ["elbow=45*deg*sin(t)", "quill=5 cm", "wrist = 0.3 + t**2"]),
}
