"""Torque of the Franka panda and its two exact rates over 10,000 samples, beside CasADi and Pinocchio.

CasADi compiles C code for this one arm; jounce and Pinocchio read its file. All results are compared before they are
timed. Then what jounce needs to compile, and how its cost grows with the number of joints.
Run: ``python benchmarks/robot_arm.py`` (needs CasADi, Pinocchio and gcc; the tensors of second order need g++ and
the headers that come with the Pinocchio package).
"""

import ctypes
import subprocess
import tempfile
import time
from pathlib import Path

from timing import race, report, use_one_core

use_one_core()

import casadi  # noqa: E402
import numpy as np  # noqa: E402
import pinocchio  # noqa: E402

import jounce as jn  # noqa: E402
from jounce.io.robots.loader import load_robot  # noqa: E402

SAMPLES = 10_000
ARM = Path(__file__).parents[1] / "examples" / "robots" / "panda.urdf"
FINGERS = ("panda_finger_joint1", "panda_finger_joint2")
ALONE, RATES = "jounce: tau", "jounce: tau, tau', tau''"
CASADI_ALONE, CASADI = "CasADi C code under map: tau", "CasADi C code under map: tau, tau', tau''"
PYTHON_ALONE, PYTHON_RATE = "Pinocchio from Python: tau", "Pinocchio from Python: tau, tau'"
CPP = ("Pinocchio in C++: tau", "Pinocchio in C++: tau, tau'", "Pinocchio in C++, tensors: tau, tau', tau''")
POINTER = ctypes.POINTER(ctypes.c_double)


def trajectory(joints):
    """Return q and four derivatives, (samples, 5, joints): sums of three sines for 10 s."""
    rng = np.random.default_rng(7)
    size, phase = rng.uniform(0.1, 0.35, (joints, 3)), rng.uniform(0, 2 * np.pi, (joints, 3))
    frequency = np.array([1.1, 2.3, 4.1])
    angle = frequency * (np.arange(SAMPLES) * 10 / SAMPLES)[:, None, None] + phase
    turns = np.sin(angle), np.cos(angle), -np.sin(angle), -np.cos(angle), np.sin(angle)
    q = np.stack([(size * frequency**k * turn).sum(-1) for k, turn in enumerate(turns)], axis=1)
    if joints == 7:
        q[:, 0] += [0, -0.4, 0, -1.8, 0, 1.6, 0.5]
    return q


def pinocchio_arm():
    """Return the model without the moving fingers."""
    model = pinocchio.buildModelFromUrdf(str(ARM))
    return pinocchio.buildReducedModel(model, [model.getJointId(name) for name in FINGERS], pinocchio.neutral(model))


def python_torques(model, q, v, a):
    """Return the torques of all samples from Pinocchio's Python function."""
    data, found, rnea = model.createData(), np.empty_like(q), pinocchio.rnea
    for k in range(len(q)):
        found[k] = rnea(model, data, q[k], v[k], a[k])
    return found


def python_rates(model, q, v, a, j):
    """Return torques and exact first rates from Pinocchio's Python functions."""
    data, found = model.createData(), np.empty((len(q), 2, model.nv))
    for k in range(len(q)):
        pinocchio.computeRNEADerivatives(model, data, q[k], v[k], a[k])
        mass = np.triu(data.M) + np.triu(data.M, 1).T
        found[k, 0] = data.tau
        found[k, 1] = data.dtau_dq @ v[k] + data.dtau_dv @ a[k] + mass @ j[k]
    return found


def symbolic_torques(model, q, v, a):
    """Return the torques as CasADi expressions with the figures of the arm in them; zeros and ones drop out."""

    def figures(x):
        rounded = np.round(x)
        return casadi.SX(casadi.DM(np.where(np.abs(x - rounded) < 1e-11, rounded, x)))

    joints = range(1, model.njoints)
    gravity = casadi.SX(casadi.DM(-model.gravity.linear))
    spin, spin_rate, rise, carried = casadi.SX.zeros(3), casadi.SX.zeros(3), gravity, []
    for k in joints:
        place, body, i = model.jointPlacements[k], model.inertias[k], k - 1
        shift, center = figures(place.translation), figures(body.lever)
        sine, cosine = casadi.sin(q[i]), casadi.cos(q[i])
        turn = casadi.vertcat(
            casadi.horzcat(cosine, -sine, 0), casadi.horzcat(sine, cosine, 0), casadi.horzcat(0, 0, 1)
        )
        rotation = figures(place.rotation) @ turn
        rise = rise + casadi.cross(spin_rate, shift) + casadi.cross(spin, casadi.cross(spin, shift))
        spin, spin_rate, rise = rotation.T @ spin, rotation.T @ spin_rate, rotation.T @ rise
        along = casadi.vertcat(0, 0, v[i])
        spin_rate = spin_rate + casadi.cross(spin, along) + casadi.vertcat(0, 0, a[i])
        spin = spin + along
        inertia = figures(body.inertia)
        rate = casadi.cross(spin_rate, center) + casadi.cross(spin, casadi.cross(spin, center))
        force = body.mass * (rise + rate)
        momentum = inertia @ spin
        moment = inertia @ spin_rate + casadi.cross(spin, momentum) + casadi.cross(center, force)
        carried.append((rotation, shift, force, moment))
    force, moment, torque = casadi.SX.zeros(3), casadi.SX.zeros(3), []
    for rotation, shift, own_force, own_moment in reversed(carried):
        force, moment = force + own_force, moment + own_moment
        torque.append(moment[2])
        force = rotation @ force
        moment = rotation @ moment + casadi.cross(shift, force)
    return casadi.vertcat(*reversed(torque))


def casadi_functions(model, folder):
    """Return tau alone, and tau with two rates, as C code that CasADi maps over the samples."""
    q, v, a, j, s = symbols = [casadi.SX.sym(name, model.nv) for name in "qvajs"]
    tau = symbolic_torques(model, q, v, a)
    first = casadi.jtimes(tau, casadi.vertcat(q, v, a), casadi.vertcat(v, a, j))
    second = casadi.jtimes(first, casadi.vertcat(q, v, a, j), casadi.vertcat(v, a, j, s))
    cse = {"cse": True}
    functions = [
        casadi.Function("torque", symbols[:3], [tau], cse),
        casadi.Function("rates", symbols, [tau, first, second], cse),
    ]
    generator = casadi.CodeGenerator("arm.c")
    for function in functions:
        generator.add(function)
    generator.generate(f"{folder}/")
    source, library = folder / "arm.c", folder / "arm.so"
    subprocess.check_call(["gcc", "-fPIC", "-shared", "-O3", "-march=native", str(source), "-o", str(library), "-lm"])
    return [casadi.external(function.name(), str(library)).map(SAMPLES) for function in functions]


def cpp_library(model, folder):
    """Return Pinocchio's C++ program, built with the headers of its Python package, or why there is none."""
    prefix = Path(pinocchio.__file__).parents[4] / "include"
    places = [prefix / "eigen3", Path(casadi.__file__).parent / "include" / "eigen3", Path("/usr/include/eigen3")]
    eigen = next((place for place in places if (place / "Eigen").is_dir()), None)
    if eigen is None or not (prefix / "pinocchio").is_dir():
        return None, "no headers of Pinocchio or Eigen"
    library, source = folder / "tensors.so", Path(__file__).with_name("robot_arm_tensors.cpp")
    flags = (
        "-std=c++17 -O3 -march=native -DNDEBUG -fPIC -shared -fvisibility=hidden -fno-gnu-unique -Wl,-Bsymbolic".split()
    )
    command = ["g++", *flags, "-isystem", str(prefix), "-isystem", str(eigen), str(source), "-o", str(library)]
    try:
        subprocess.run(command, check=True, capture_output=True, text=True)
    except FileNotFoundError:
        return None, "no C++ compiler"
    except subprocess.CalledProcessError as failure:
        why = next((line for line in failure.stderr.splitlines() if "error" in line), "no message")
        return None, f"it does not compile: {why}"
    program = ctypes.CDLL(str(library))
    numbers = []
    for place, body in zip(list(model.jointPlacements)[1:], list(model.inertias)[1:], strict=True):
        parts = place.rotation.ravel(), place.translation, [body.mass], body.lever, body.inertia.ravel()
        numbers.append(np.concatenate(parts))
    program.build(ctypes.c_long(model.nv), pointer(np.array(numbers)), pointer(np.array(model.gravity.linear)))
    return program, ""


def pointer(array):
    """Return where an array of floats begins."""
    return array.ctypes.data_as(POINTER)


def error(found, expected):
    """Return the largest error of each derivative by its peak; samples, derivatives, joints."""
    count = found.shape[1]
    return (np.abs(found - expected[:, :count]).max((0, 2)) / np.abs(expected[:, :count]).max((0, 2))).max()


def arm_race(folder):
    """Time all competitors on the panda and print the table."""
    model, robot = pinocchio_arm(), load_robot(ARM).locked({FINGERS[0]: 0.0})
    motion = np.ascontiguousarray(trajectory(model.nv))
    q, v, a, j, _ = levels = [np.ascontiguousarray(level) for level in np.swapaxes(motion, 0, 1)]
    columns = [casadi.DM(level.T) for level in levels]
    torque, rates = casadi_functions(model, folder)
    short = np.ascontiguousarray(motion[:, :3])
    expected = jn.inverse_dynamics(robot, motion)

    def stacked(results):
        return np.stack([np.array(x).T for x in results], axis=1)

    competitors = {
        ALONE: lambda: jn.inverse_dynamics(robot, short),
        RATES: lambda: jn.inverse_dynamics(robot, motion),
        CASADI_ALONE: lambda: torque(*columns[:3]),
        CASADI: lambda: rates(*columns),
        PYTHON_ALONE: lambda: python_torques(model, q, v, a),
        PYTHON_RATE: lambda: python_rates(model, q, v, a, j),
    }
    results = {
        ALONE: competitors[ALONE](),
        CASADI_ALONE: stacked([torque(*columns[:3])]),
        CASADI: stacked(rates(*columns)),
        PYTHON_ALONE: competitors[PYTHON_ALONE]()[:, None],
        PYTHON_RATE: competitors[PYTHON_RATE](),
    }
    program, why = cpp_library(model, folder)
    if program is None:
        print(f"Pinocchio in C++ is left out: {why}")
    else:
        for rate, name in enumerate(CPP):
            out = np.empty((SAMPLES, rate + 1, model.nv))
            arguments = ctypes.c_long(SAMPLES), ctypes.c_int(rate), pointer(motion), pointer(out)
            competitors[name] = lambda arguments=arguments: program.torques(*arguments)
            competitors[name]()
            results[name] = out
    for name, found in results.items():
        assert error(found, expected) < 1e-12, (name, error(found, expected))
    medians = race(competitors)
    report(f"Franka panda, 7 joints, {SAMPLES} samples", medians, SAMPLES, RATES)
    print("largest difference from jounce, by the peak of each derivative")
    for name, found in results.items():
        print(f"  {name:<58} {error(found, expected):9.1e}")
    print("ratios")
    pairs = [(RATES, CASADI), (ALONE, CASADI_ALONE), (ALONE, PYTHON_ALONE), (PYTHON_RATE, RATES)]
    pairs += [(CPP[2], RATES), (CPP[1], RATES), (CPP[0], ALONE)] if program is not None else []
    for slow, fast in pairs:
        print(f"  {slow} / {fast}: {medians[slow] / medians[fast]:.2f}")


def made(name, parents):
    """Return a robot of revolute joints with made-up figures; parents are indices of joints, -1 for the base."""
    rng = np.random.default_rng(len(parents))
    links, joints = [jn.Link("base")], []
    for k, parent in enumerate(parents):
        links.append(jn.Link(f"link_{k}", jn.Inertia(1.0, rng.uniform(-0.1, 0.1, 3), rng.uniform(0.01, 0.019, 3))))
        axis, start = np.eye(3)[rng.integers(3)], "base" if parent < 0 else f"link_{parent}"
        joints.append(jn.Joint(f"joint_{k}", start, f"link_{k}", position=rng.uniform(-0.2, 0.2, 3), axis=axis))
    return jn.Robot(name, links, joints)


def humanoid():
    """Return a tree of 36 joints: waist 3, neck 3, two legs of 6, two arms of 7, two fingers on each hand."""
    parents = []

    def limb(parent, count):
        for _ in range(count):
            parents.append(parent)
            parent = len(parents) - 1
        return parent

    chest = limb(-1, 3)
    limb(chest, 3)
    for _ in range(2):
        limb(-1, 6)
        hand = limb(chest, 7)
        limb(hand, 1)
        limb(hand, 1)
    return made("humanoid", parents)


def first_call(robot):
    """Return the seconds of the first call for a robot of this shape: tracing, compiling and one block."""
    q = trajectory(len(robot.joint_names))[:100]
    start = time.perf_counter()
    jn.inverse_dynamics(robot, q)
    return time.perf_counter() - start


def growth():
    """Print compile times, and cost against the number of joints."""
    print("first call for tau, tau', tau'': tracing and compiling")
    for robot in (load_robot(ARM).locked({FINGERS[0]: 0.0}), humanoid()):
        print(f"  {robot.name:<20} {len(robot.joint_names):3d} joints {first_call(robot):6.2f} s")
    competitors, counts = {}, {}
    for joints in (4, 8, 16, 32, 64):
        robot, q = made("chain", range(-1, joints - 1)), trajectory(joints)
        name = f"chain of {joints} joints"
        competitors[name], counts[name] = lambda robot=robot, q=q: jn.inverse_dynamics(robot, q), joints
    tree, q = humanoid(), trajectory(36)
    competitors["humanoid, 36 joints"], counts["humanoid, 36 joints"] = lambda: jn.inverse_dynamics(tree, q), 36
    print(f"tau, tau', tau'' against the number of joints, {SAMPLES} samples")
    for name, seconds in race(competitors, rounds=7).items():
        cost = seconds / SAMPLES * 1e6
        print(f"  {name:<24} {cost:8.2f} us a sample {cost / counts[name]:7.3f} us a sample and joint")


if __name__ == "__main__":
    jn.inverse_dynamics(made("warm", [-1]), np.zeros((3, 1)))  # starts JAX
    growth()
    with tempfile.TemporaryDirectory() as folder:
        arm_race(Path(folder))
