"""Torque of the Franka panda and its exact rates, beside CasADi, Pinocchio and MuJoCo.

CasADi compiles C code for this one arm, with zeros and ones of its geometry left out; jounce, Pinocchio and MuJoCo read
its file. The first samples are those of the reference.
"""

import ctypes
import json
import subprocess
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import jounce as jn
from benchmarks.arm_symbols import symbolic_torques
from benchmarks.cases import EXAMPLES, ROOT, CannotRunError, Case, Cases, Contestant, ready
from benchmarks.compiled_c import compiled
from benchmarks.references import largest_error

ARM = EXAMPLES / "robots" / "panda.urdf"
FINGERS = ("panda_finger_joint1", "panda_finger_joint2")
REFERENCE = "fifty digits at 21 samples (tests/robot/references/arm.json), by the peak of each derivative"
POINTER = ctypes.POINTER(ctypes.c_double)
COMPILER = "-std=c++17 -O3 -march=native -DNDEBUG -fPIC -shared -fvisibility=hidden -fno-gnu-unique -Wl,-Bsymbolic"


def arm() -> jn.Robot:
    """Return the arm without moving fingers."""
    return jn.load_robot(ARM).locked({FINGERS[0]: 0.0})


def motion(samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Return q and four derivatives, (samples, 5, 7), and the torques with two rates of the first 21, (21, 3, 7)."""
    content = json.loads((ROOT / "tests" / "robot" / "references" / "arm.json").read_text(encoding="utf-8"))
    known, torque = np.array(content["q"], float)[:, :5], np.array(content["torque"], float)[:, :3]
    return np.resize(known, (samples, 5, 7)), torque


def pinocchio_arm() -> Any:
    """Return Pinocchio's model without the moving fingers."""
    import pinocchio

    model = pinocchio.buildModelFromUrdf(str(ARM))
    return pinocchio.buildReducedModel(model, [model.getJointId(name) for name in FINGERS], pinocchio.neutral(model))


def pinocchio_torques(q: np.ndarray) -> Callable[[], Any]:
    """Return a loop over Pinocchio's Python function, which gives torques, (samples, 1, 7)."""
    import pinocchio

    model = pinocchio_arm()
    data, found, rnea = model.createData(), np.empty_like(q[:, :1]), pinocchio.rnea
    states = [np.ascontiguousarray(q[:, k]) for k in range(3)]

    def run() -> Any:
        for k, (x, v, a) in enumerate(zip(*states, strict=True)):
            found[k, 0] = rnea(model, data, x, v, a)
        return found

    return run


def pinocchio_rates(q: np.ndarray) -> Callable[[], Any]:
    """Return a loop that gives torques and exact first rates, (samples, 2, 7)."""
    import pinocchio

    model = pinocchio_arm()
    data, found = model.createData(), np.empty_like(q[:, :2])
    states = [np.ascontiguousarray(q[:, k]) for k in range(4)]

    def run() -> Any:
        for k, (x, v, a, j) in enumerate(zip(*states, strict=True)):
            pinocchio.computeRNEADerivatives(model, data, x, v, a)
            mass = np.triu(data.M) + np.triu(data.M, 1).T
            found[k, 0], found[k, 1] = data.tau, data.dtau_dq @ v + data.dtau_dv @ a + mass @ j
        return found

    return run


def mujoco_model() -> Any:
    """Return MuJoCo's model of the arm, on the inertias that Pinocchio reads."""
    import mujoco

    def numbers(values: Any) -> str:
        return " ".join(f"{x:.17g}" for x in np.ravel(values))

    def bodies(model: Any) -> str:
        text = ""
        for place, body in zip(list(model.jointPlacements)[1:], list(model.inertias)[1:], strict=True):
            turn = np.zeros(4)
            mujoco.mju_mat2Quat(turn, np.ascontiguousarray(place.rotation).ravel())
            tensor = body.inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
            text += f'<body pos="{numbers(place.translation)}" quat="{numbers(turn)}"><joint axis="0 0 1"/><inertial '
            text += f'pos="{numbers(body.lever)}" mass="{body.mass!r}" fullinertia="{numbers(tensor)}"/>'
        return text + "</body>" * (model.njoints - 1)

    settings = '<compiler balanceinertia="false"/><option gravity="0 0 -9.81"/>'
    return mujoco.MjModel.from_xml_string(
        f"<mujoco>{settings}<worldbody>{bodies(pinocchio_arm())}</worldbody></mujoco>"
    )


def mujoco_torques(q: np.ndarray) -> Callable[[], Any]:
    """Return a loop over MuJoCo's inverse dynamics, (samples, 1, 7)."""
    import mujoco

    model = mujoco_model()
    data, found = mujoco.MjData(model), np.empty_like(q[:, :1])

    def run() -> Any:
        for k, (x, v, a) in enumerate(q[:, :3]):
            data.qpos, data.qvel, data.qacc = x, v, a
            mujoco.mj_inverse(model, data)
            found[k, 0] = data.qfrc_inverse
        return found

    return run


def casadi_run(q: np.ndarray, rates: bool) -> Callable[[], Any]:
    """Return CasADi's C code under its map: torque alone, or with two rates."""
    import casadi

    model = pinocchio_arm()
    x, v, a, j, s = symbols = [casadi.SX.sym(name, model.nv) for name in "xvajs"]
    results = [symbolic_torques(model, x, v, a)]
    if rates:
        results.append(casadi.jtimes(results[0], casadi.vertcat(x, v, a), casadi.vertcat(v, a, j)))
        results.append(casadi.jtimes(results[1], casadi.vertcat(x, v, a, j), casadi.vertcat(v, a, j, s)))
    given = symbols if rates else symbols[:3]
    (function,) = compiled([casadi.Function("torque", given, results, {"cse": True})], len(q))
    columns = [casadi.DM(np.ascontiguousarray(q[:, k].T)) for k in range(len(given))]
    return (lambda: function(*columns)) if rates else (lambda: [function(*columns)])


@cache
def tensors_program() -> ctypes.CDLL:
    """Return the C++ program that calls Pinocchio, built with the headers of its Python package: takes minutes."""
    import casadi
    import pinocchio

    model = pinocchio_arm()
    prefix = Path(pinocchio.__file__).parents[4] / "include"
    places = [prefix / "eigen3", Path(casadi.__file__).parent / "include" / "eigen3", Path("/usr/include/eigen3")]
    eigen = next((place for place in places if (place / "Eigen").is_dir()), None)
    if eigen is None or not (prefix / "pinocchio").is_dir():
        raise CannotRunError("there are no headers of Pinocchio or Eigen")
    with tempfile.TemporaryDirectory() as folder:
        library, source = Path(folder) / "tensors.so", Path(__file__).with_name("arm_tensors.cpp")
        headers = ["-isystem", str(prefix), "-isystem", str(eigen)]
        words = ["g++", *COMPILER.split(), *headers, str(source), "-o", str(library)]
        try:
            subprocess.run(words, check=True, capture_output=True)
        except FileNotFoundError:
            raise CannotRunError("there is no C++ compiler g++") from None
        program = ctypes.CDLL(str(library))
    numbers = [
        np.concatenate((place.rotation.ravel(), place.translation, [body.mass], body.lever, body.inertia.ravel()))
        for place, body in zip(list(model.jointPlacements)[1:], list(model.inertias)[1:], strict=True)
    ]
    program.build(ctypes.c_long(model.nv), _pointer(np.array(numbers)), _pointer(np.array(model.gravity.linear)))
    return program


def tensors_run(q: np.ndarray, rates: int) -> Callable[[], Any]:
    """Return Pinocchio in C++: first and second derivatives of inverse dynamics, (samples, rates + 1, 7)."""
    program = tensors_program()
    given, found = np.ascontiguousarray(q), np.empty((len(q), rates + 1, q.shape[-1]))

    def run() -> Any:
        program.torques(ctypes.c_long(len(q)), ctypes.c_int(rates), _pointer(given), _pointer(found))
        return found

    return run


def _pointer(array: np.ndarray) -> Any:
    return array.ctypes.data_as(POINTER)


def cases(quick: bool) -> Cases:
    """Yield the torque alone, with its first rate, and with two."""
    robot, samples = arm(), 2000 if quick else 10_000
    q, expected = motion(samples)
    short = np.ascontiguousarray(q[:, :3])

    def error(found: Any) -> float:
        return largest_error(found[: len(expected)], expected)

    def of_columns(found: Any) -> float:
        return error(np.stack([np.array(x).T for x in found], axis=1))

    def case(what: str, order: int, *peers: Contestant) -> Case:
        given = np.ascontiguousarray(q[:, :order])
        ours = Contestant("jounce", ready(lambda: jn.inverse_dynamics(robot, given, drives=False)), error)
        name = f"{what} of the panda, {samples:,} samples"
        return Case(name, [ours, *peers], count=samples, unit="sample", reference=REFERENCE)

    def pinocchio(name: str, build: Callable[[], Any], aim: float | None = None) -> Contestant:
        return Contestant(f"Pinocchio, {name}", build, error, "pinocchio", aim=aim)

    def in_cpp(rates: int) -> Callable[[], Any]:
        if quick:
            raise CannotRunError("not with --quick, as it compiles for minutes")
        return tensors_run(q, rates)

    def casadi(rates: bool) -> Contestant:
        return Contestant("CasADi, C code", lambda: casadi_run(q, rates), of_columns, "casadi", aim=1.0)

    python = pinocchio("rnea from Python", lambda: pinocchio_torques(q), aim=1.0)
    mujoco = Contestant("MuJoCo from Python", lambda: mujoco_torques(short), error, "mujoco", extra="mjcf")
    yield case("torque", 3, casadi(False), python, pinocchio("C++", lambda: in_cpp(0)), mujoco)
    first = pinocchio("derivatives from Python", lambda: pinocchio_rates(q))
    yield case("torque and rate", 4, first, pinocchio("derivatives, C++", lambda: in_cpp(1)))
    yield case("torque and two rates", 5, casadi(True), pinocchio("tensors, C++", lambda: in_cpp(2)))
