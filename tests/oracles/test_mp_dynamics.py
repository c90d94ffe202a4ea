"""The judge of dynamics against closed forms, published numbers, and itself in other coordinates."""

import json

import pytest
from mpmath import mp

from tests.oracles import mp_andrews, mp_benchmarks
from tests.oracles.mp_dynamics import Problem, cos, sin
from tests.problems.make_dynamic_references import FOLDER, MAKERS, double_pendulum, stewart

DIGITS = 40


@pytest.fixture(autouse=True)
def many_digits():
    """Compute in forty digits."""
    with mp.workdps(DIGITS):
        yield


def largest(first, second):
    """Return the largest difference of two tables, by the largest entry of each column."""
    worst = mp.mpf(0)
    for a, b in zip(zip(*first, strict=True), zip(*second, strict=True), strict=True):
        size = max(abs(x) for x in b) or mp.mpf(1)
        worst = max(worst, max(abs(x - y) for x, y in zip(a, b, strict=True)) / size)
    return worst


def pendulum(angle):
    """A point mass on a rod of 1 m, in its angle from the downward vertical or in Cartesian coordinates."""
    problem = Problem()
    if angle:
        (a,) = problem.coordinates(1)
        place = (sin(a), -cos(a))
    else:
        place = problem.coordinates(2)
        problem.constraint((place[0] * place[0] + place[1] * place[1] - 1) * mp.mpf("0.5"))
    for x in place:
        problem.inertia(1, x)
    problem.force("-9.81", place[1])
    return problem.close()


@pytest.mark.slow
def test_pendulum_is_the_elliptic_function():
    problem = pendulum(angle=True)
    problem.start(0, [mp.pi / 2], [0]).integrate(10, 30, "1e-32")
    modulus = mp.mpf(1) / 2
    argument = mp.sqrt(mp.mpf("9.81")) * 10
    expected = 2 * mp.asin(mp.sqrt(modulus) * mp.ellipfun("cd", argument, m=modulus))
    assert abs(problem.q[0].c[0] - expected) < mp.mpf("1e-29")


def test_multiplier_is_the_tension():
    problem = pendulum(angle=False)
    problem.start(0, [1, 0], [0, 0]).integrate(1, 30, "1e-32").solve(4)
    (x, y), (tension,) = problem.q, problem.multipliers
    expected = x.c[1] ** 2 + y.c[1] ** 2 - mp.mpf("9.81") * y.c[0]  # of the turning, and of the weight along the rod
    assert abs(tension.c[0] - expected) < mp.mpf("1e-28")


def test_andrews_starts_as_published():
    problem = mp_andrews.angles()
    position, velocity = problem.consistent(mp_andrews.START, [0] * 7, fixed=(1,))
    problem.start(0, position, velocity).solve(2)
    accelerations = ["14222.4439199541138705911625887", "-10666.8329399655854029433719415", *["0"] * 5]
    multipliers = ["98.5668703962410896057654982170", "-6.12268834425566265503114393122", *["0"] * 4]
    for n, text in zip(problem.q, accelerations, strict=True):
        assert abs(2 * n.c[2] - mp.mpf(text)) < mp.mpf("1e-22")
    for n, text in zip(problem.multipliers, multipliers, strict=True):
        assert abs(n.c[0] - mp.mpf(text)) < mp.mpf("1e-24")


def test_andrews_in_both_formulations():
    stored = json.loads((FOLDER / "andrews.json").read_text(encoding="utf-8"))["instants"]
    for instant in stored:
        for k, (pin, axis) in enumerate((pin, axis) for pin in ("P3", "P4", "P6") for axis in "xy"):
            rows = [instant["multipliers"][f"lambda{k + 1}"], instant["reactions"][f"{pin}_{axis}"]]
            first, second = ([mp.mpf(x) for x in row] for row in rows)
            assert largest([first], [second]) < mp.mpf("1e-20")


def test_double_four_bar_in_one_and_in_five_angles():
    one, _ = mp_benchmarks.parallel_four_bar()
    one.start(0, [mp.pi / 2], [-1]).solve(6)
    five = mp_benchmarks.double_four_bar()
    five.start(0, *mp_benchmarks.double_four_bar_start()).solve(6)
    (expected,) = one.derivatives(one.q[0])
    for found in five.derivatives(*five.q[:3]):
        assert largest([found], [expected]) < mp.mpf("1e-34")
    assert max(abs(x) for row in five.derivatives(*five.q[3:]) for x in row) < mp.mpf("1e-30")


def test_energy_of_andrews_where_the_published_state_has_lost_some():
    """Energy and constraints at 0.03 s: kept by the reference, and not to all digits by the state of the test set."""
    problem = mp_andrews.angles()
    n = {name: mp.mpf(value) for name, value in mp_andrews.PARAMETERS.items()}

    def energy(position, velocity):
        problem.start(0, position, velocity)
        gamma = problem.q[2].c[0]
        x = n["xb"] + n["sd"] * mp.cos(gamma) + n["sc"] * mp.sin(gamma) - n["xc"]
        y = n["yb"] + n["sd"] * mp.sin(gamma) - n["sc"] * mp.cos(gamma) - n["yc"]
        spring = n["c0"] / 2 * (mp.sqrt(x**2 + y**2) - n["l0"]) ** 2
        return problem.energy() + spring - n["mom"] * problem.q[0].c[0]

    at_start = energy(*problem.consistent(mp_andrews.START, [0] * 7, fixed=(1,)))
    stored = json.loads((FOLDER / "andrews.json").read_text(encoding="utf-8"))["instants"][-1]["angles"]
    found = energy(*([stored[name][k] for name in mp_andrews.NAMES] for k in (0, 1)))
    assert abs(found / at_start - 1) < mp.mpf("1e-27")
    published = energy(mp_andrews.PUBLISHED_ANGLES, mp_andrews.PUBLISHED_RATES)
    assert mp.mpf("1e-10") < abs(published / at_start - 1) < mp.mpf("2e-10")
    assert max(abs(g.c[1]) for g in problem.constraints) > mp.mpf("5e-10")


def test_every_reference_is_stored():
    assert {maker.__name__ for maker in MAKERS} == {path.stem for path in FOLDER.glob("*.json")}


@pytest.mark.slow
@pytest.mark.parametrize("maker", [stewart, double_pendulum])
def test_references_are_what_the_judge_says(maker):
    stored = json.loads((FOLDER / f"{maker.__name__}.json").read_text(encoding="utf-8"))
    with mp.workdps(50):
        assert maker() == (stored["quantities"], stored["instants"])
