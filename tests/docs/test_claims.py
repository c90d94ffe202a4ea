"""Every number of the page on the claims of the papers, computed."""

import functools
import pathlib
import re

import numpy as np
import pytest

import jounce as jn
from jounce.papers.sommer_2024 import VALIDATION_CASES, lags
from jounce.papers.sommer_2024.residual_stop import ResidualStop

PAGE = pathlib.Path(__file__).parents[2] / "docs" / "claims.md"


@functools.cache
def sections():
    """Return the texts below the headings, with single spaces, in their order."""
    return [" ".join(part.split()) for part in re.split(r"^## ", PAGE.read_text(), flags=re.MULTILINE)[1:]]


def section(words):
    (text,) = [part for part in sections() if part.startswith(words)]
    return text


def test_energy_and_power_of_a_disc():
    text = section("An acceleration energy")
    disc = jn.robot.from_screws([jn.robot.JointAxis([0, 0, 1], inertia=jn.Inertia(1.0, tensor=[1.0, 1.0, 1.0]))])
    for motion, words in (([2.0, 3.0, 0.5], ("12.5 J/s^2", "10 J/s^2")), ([2.0, 0.0, 0.0], ("8 J/s^2", "0 J/s^2"))):
        q = np.array([0.0, *motion])[:, None]
        values = jn.energy.acceleration_energy(disc, q[:3]).total[0], jn.energy.kinetic_energy(disc, q).total[2]
        for value, word in zip(values, words, strict=True):
            assert f"{value:.10g} J/s^2" == word
            assert word in text


def rank(*joints):
    mechanism = jn.Mechanism(
        space="spatial",
        bodies={"arm": jn.Body([0, 0, 0])},
        joints={f"joint_{k}": joint for k, joint in enumerate(joints)},
    )
    jacobian = jn.constraint_equations(
        mechanism, {"arm": {"position": [[0, 0, 0]], "orientation": {"quaternion": [1, 0, 0, 0]}}}
    ).jacobian
    assert jacobian.sizes["row"] == 5
    return np.linalg.matrix_rank(np.asarray(jacobian).reshape(-1, jacobian.sizes["column"]))


def test_recipes_of_a_revolute_joint():
    text, pair = section("Two recipes"), ("ground", "arm")
    x, y, z = np.eye(3).tolist()
    ball, first = jn.spatial.Spherical(pair, [0, 0, 0], [0, 0, 0]), jn.spatial.Dot1(pair, x, z)
    ranks = [
        rank(ball, first, last)
        for last in (
            jn.spatial.Dot1(pair, y, z),
            jn.spatial.Dot2(pair, [0, 0, 0], z, y),
            jn.spatial.Dot2(pair, [0, 0, 0], [0, 0, 0], y),
        )
    ]
    assert ranks == [5, 5, 4]
    assert re.findall(r"rank (?:is )?(\d)", text) == [str(r) for r in ranks]


@pytest.mark.slow
def test_error_is_proportional_to_the_residual():
    text, instant = section("No threshold"), 0.35
    mechanism = VALIDATION_CASES["four_bar"].load()
    motion = jn.solve(mechanism, [instant], order=4)
    pose = {name: {"position": np.asarray(motion.point(name, [0, 0]))[0]} for name in ("crank", "rocker")}
    for name, body in pose.items():
        body["angle"] = np.asarray(motion.angle(name))[0]
    right = pose["rocker"]["angle"].copy()

    def off(turn):
        """Return the residual of the rod, m^2, and the error of the jounce, with the rocker turned by an angle."""
        angle, equations = np.array([right[0] + turn]), jn.constraint_equations(mechanism, time=instant)
        for order in range(1, 5):
            crank = {key: np.asarray(value)[:order] for key, value in pose["crank"].items()}
            state = {"crank": crank, "rocker": {"position": np.zeros((order, 2)), "angle": angle}}
            state["rocker"]["position"][0] = pose["rocker"]["position"][0]
            state = {name: {key: value.tolist() for key, value in body.items()} for name, body in state.items()}
            equations = jn.constraint_equations(mechanism, state, time=instant)
            matrix = np.asarray(equations.jacobian).reshape(6, 6)
            side = np.asarray(equations.right_side.sel(derivative=order)).reshape(6)
            angle = np.append(angle, np.linalg.solve(matrix, side)[5])
        residual = np.asarray(equations.residual).reshape(6)
        return np.abs(residual).max(), abs(angle[4] - right[4])

    slope = off(1e-7)[0] / 1e-7
    ratios = []
    for expected in (1e-4, 1e-6, 1e-8):
        residual, error = off(expected / slope)
        assert residual == pytest.approx(expected, rel=0.05)
        ratios.append(error / residual)
    assert ", ".join(f"{r:.1e}" for r in ratios[:2]) + f" and {ratios[2]:.1e}" in text
    assert max(ratios) / min(ratios) < 1.1


@pytest.mark.slow
def test_floors_of_the_sweeps_of_tolerances():
    text = section("The floor")
    for name, tolerances in (("four_bar", (1e-11, 1e-10)), ("rsur", (1e-12, 1e-11))):
        sweep = ResidualStop(VALIDATION_CASES[name])
        for tolerance in tolerances:
            four_bar, rsur = re.split(r"(?<=at 1e-10), and ", text)
            part = rsur if name == "rsur" else four_bar
            (printed,) = re.findall(rf"([\d.]+e-1\d)(?: for the [\w-]+)? at {tolerance:.0e}", part)
            assert sweep.error(tolerance).max() <= 3 * float(printed)  # as the page says


def phase(order, step):
    """Return the error of the phase of an oscillation after a step of an Obreshkov formula, as part of the phase."""
    z = 1j * step
    half = 1 + z / 2 + (z**2 / 12 if order == 4 else 0)
    other = 1 - z / 2 + (z**2 / 12 if order == 4 else 0)
    return abs(np.angle(half / other) / step - 1)


def test_gain_by_jerk():
    text = section("Ten times")
    gains = [phase(2, step) / phase(4, step) for step in (2.0, 1.0, 0.1)]
    assert " is {:.0f} at $\\omega h$ = 2, {:.0f} at 1, {:.0f} at 0.1".format(*gains) in text
    assert phase(2, 0.01) == pytest.approx(0.01**2 / 12, rel=1e-3)
    assert phase(4, 0.1) == pytest.approx(0.1**4 / 720, rel=1e-2)
    low, high = 2.0, 3.0
    for _ in range(50):
        middle = (low + high) / 2
        low, high = (middle, high) if phase(2, middle) > 10 * phase(4, middle) else (low, middle)
    assert f"steps of $\\omega h$ = {low:.3g} give, {2 * np.pi / low:.3g} of them to a period" in text


def test_steps_for_an_accuracy():
    text = section("What jerk costs")

    def widest(order):
        low, high = 1e-4, 1.0
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if phase(order, middle) < 1e-6 else (low, middle)
        return low

    steps = widest(2), widest(4)
    assert f"= {steps[0]:.3g}," in text
    assert f"steps of {steps[1]:.3g}: {steps[1] / steps[0]:.0f} times" in text


@pytest.mark.slow
def test_lags_of_backward_differences():
    text = section("Backward differences")
    case = VALIDATION_CASES["four_bar"]
    jerk, jounce = lags(case, case.load(), 0.01)
    late = [1e3 * lag.late(lag.difference) for lag in (jerk, jounce)]
    assert f"{late[0]:.3g} ms late in the jerk and {late[1]:.3g} ms in the jounce" in text
    errors = [100 * lag.measured_error(lag.difference) for lag in (jerk, jounce)]
    assert f"{errors[0]:.1f} and {errors[1]:.1f} percent" in text
