"""The command that describes an installation and tests its results."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
import platform
import re
import warnings
from typing import Any

from jounce.reporting.terminal import print_text, say_json, show_columns

PACKAGES = ("jax", "jaxlib", "numpy", "scipy", "xarray", "llvmlite", "pydantic", "pint", "matplotlib")
FOR_DEVELOPERS = ("test", "bench", "docs", "all")
VARIABLES = ("JOUNCE_CACHE_DIR", "JOUNCE_THREADS", "JOUNCE_NATIVE", "JOUNCE_DEBUG", "JAX_PLATFORMS", "XLA_FLAGS")
LARGEST_ERROR = 1e-12  # relative to the peak of each derivative


def doctor(*, json: bool = False) -> int:
    """Describe this installation, and test it within some seconds.

    The command prints versions, whether machine code is used and if not
    why, the folder of compiled programs, devices, extras and environment
    variables. It then compares a point on a crank to its fourth
    derivative, and the torque of a pendulum with its rates, with closed
    forms. The exit status is 1 if the test fails.

    Parameters
    ----------
    json
        Print the result as JSON.

    Examples
    --------
      jounce doctor
      jounce doctor --json
    """
    facts = {**_versions(), **_machine_code(), **_program_folder(), **_devices(), **_extras(), **_environment()}
    tests = _tests()
    failed = [name for name, error in tests.items() if not error <= LARGEST_ERROR]
    if json:
        say_json("doctor", {"facts": facts, "errors": tests, "passed": not failed})
        return 1 if failed else 0
    show_columns(list(facts.items()))
    print_text("")
    show_columns(
        [
            (name, f"{'FAILED' if name in failed else 'passed'}: error {error:.1e} of the peak")
            for name, error in tests.items()
        ]
    )
    return 1 if failed else 0


def _versions() -> dict[str, str]:
    from jounce.version import __version__

    versions = {"jounce": __version__, "Python": f"{platform.python_version()} ({platform.platform()})"}
    for name in PACKAGES:
        try:
            versions[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            versions[name] = "not installed"
    return versions


def _machine_code() -> dict[str, str]:
    from jounce.execution.backends import uses_machine_code
    from jounce.execution.llvm.self_test import is_usable

    if os.environ.get("JOUNCE_NATIVE") == "0":
        return {"machine code": "not used: JOUNCE_NATIVE=0; XLA computes"}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        usable = is_usable() and uses_machine_code()
    if usable:
        return {"machine code": "used"}
    reason = str(caught[0].message) if caught else "llvmlite is not installed, or an accelerator computes"
    return {"machine code": f"not used: {reason}"}


def _program_folder() -> dict[str, str]:
    from jounce.base.private_folder import PrivateFolder
    from jounce.errors import OutputError
    from jounce.execution.store.folder import ENDING, chosen_folder

    try:
        path = chosen_folder()
        if path is None:
            return {"compiled programs": "not kept: JOUNCE_CACHE_DIR is empty"}
        sizes = [size for _, size, _ in PrivateFolder(path).files(ENDING)]
    except (OutputError, RuntimeError, ValueError) as error:
        return {"compiled programs": f"not kept: {error}"}
    return {"compiled programs": f"{len(sizes)} in {path}, {sum(sizes) / 2**20:.1f} MiB"}


def _devices() -> dict[str, str]:
    import jax

    from jounce.execution.threads import thread_count

    devices = ", ".join(str(device) for device in jax.devices())
    return {"devices": devices, "threads": str(thread_count())}


def _extras() -> dict[str, str]:
    """Return the installed optional packages by extra."""
    extras: dict[str, str] = {}
    needed: dict[str, list[str]] = {}
    for requirement in importlib.metadata.requires("jounce") or ():
        if match := re.match(r"([\w.-]+)[^;]*;.*extra == ['\"]([\w-]+)['\"]", requirement):
            needed.setdefault(match[2], []).append(match[1])
    for extra, packages in needed.items():
        if extra in FOR_DEVELOPERS:
            continue
        missing = [package for package in packages if package != "jounce" and not _is_installed(package)]
        state = "installed" if not missing else f"missing: {', '.join(missing)}"
        extras[f"extra {extra}"] = state
    return extras


def _is_installed(package: str) -> bool:
    try:
        importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return False
    return True


def _environment() -> dict[str, str]:
    return {name: repr(os.environ[name]) for name in VARIABLES if name in os.environ}


def _tests() -> dict[str, float]:
    """Return the largest errors of tests with closed forms, relative to the peak of each derivative."""
    import numpy as np

    from jounce.constraints import drivers, planar
    from jounce.kinematics import solve
    from jounce.mechanism import Body, Mechanism, PointOutput
    from jounce.robot import Inertia, inverse_dynamics
    from jounce.robot.construct import JointAxis, from_screws

    def error(value: Any, expected: Any) -> float:
        return float((np.abs(value - expected).max(axis=0) / np.abs(expected).max(axis=0)).max())

    time, rate = np.linspace(0.0, 1.0, 201), 3.0
    crank = Mechanism(
        space="planar",
        bodies={"crank": Body([0, 0])},
        joints={"pin": planar.Revolute(("ground", "crank"), [0, 0], [0, 0])},
        drivers={"motor": drivers.CoordinateDriver(("ground", "crank"), "angle", f"{rate}*t")},
        outputs={"tip": PointOutput("crank", [0.1, 0.0])},
    )
    order = np.arange(5)
    expected = 0.1 * rate**order * np.cos(rate * time[:, None] + order * np.pi / 2)
    tip = error(solve(crank, time, order=4).outputs["tip"][..., 0], expected)

    pendulum = from_screws([JointAxis([0, 1, 0], inertia=Inertia(2.0, [0.5, 0, 0]))])
    q = np.stack([np.sin(time), np.cos(time), -np.sin(time), -np.cos(time)], axis=1)[..., None]
    weight = 2.0 * 9.81 * 0.5  # m g l; a rotation about y turns x downward
    torque = np.stack([
        -0.5 * np.sin(time) - weight * np.cos(np.sin(time)),
        -0.5 * np.cos(time) + weight * np.sin(np.sin(time)) * np.cos(time),
    ], axis=1)  # fmt: skip
    return {
        "test: point of a crank to jounce": tip,
        "test: torque of a pendulum and its rate": error(inverse_dynamics(pendulum, q)[..., 0], torque),
    }
