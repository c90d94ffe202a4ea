"""Point-to-point laws: closed forms, variational optimality, limits, and rest before and after."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import BPoly

import jounce as jn
from jounce.errors import TrajectoryError
from jounce.jet import Jet
from jounce.trajectory import CycloidalMotion, JointTrajectory, RestToRestMotion, TrapezoidalMotion, motion_profile
from tests.problems.small import crank

START, END, DURATION, BEGINNING = -0.4, 1.1, 1.6, 0.3
INSIDE = np.linspace(BEGINNING, BEGINNING + DURATION, 25)[:-1]


def derivatives(law, order, at=INSIDE):
    return np.array(law(Jet.variable(jnp.asarray(at), order)).derivatives())


def close(found, expected, relative=1e-13):
    np.testing.assert_allclose(found, expected, rtol=0, atol=relative * max(np.abs(expected).max(), 1e-300))


@pytest.mark.parametrize("rest", [1, 2, 3, 4, 8])
def test_polynomial_is_the_hermite_one(rest):
    """The only polynomial of degree 2 r + 1 with r derivatives zero at both ends, by SciPy's Bernstein form."""
    ends = [[START] + [0.0] * rest, [END] + [0.0] * rest]
    expected = BPoly.from_derivatives([BEGINNING, BEGINNING + DURATION], ends)
    found = derivatives(RestToRestMotion(START, END, DURATION, BEGINNING, rest), 6)
    for k in range(min(7, 2 * rest + 2)):
        close(
            found[k], expected(INSIDE, k) if k else expected(INSIDE), 1e-11
        )  # high derivatives of high degrees cancel


@pytest.mark.parametrize("name, powers", [("minimum_jerk", [10, -15, 6]), ("minimum_snap", [35, -84, 70, -20])])
def test_polynomials_by_name(name, powers):
    law = motion_profile(name, START, END, DURATION, BEGINNING)
    u = (INSIDE - BEGINNING) / DURATION
    share = sum(c * u ** (len(powers) + j) for j, c in enumerate(powers))
    close(derivatives(law, 0)[0], START + (END - START) * share)
    twin = motion_profile(
        {3: "polynomial_3_4_5", 4: "polynomial_4_5_6_7"}[len(powers)], START, END, DURATION, BEGINNING
    )
    np.testing.assert_array_equal(derivatives(law, 3), derivatives(twin, 3))


@pytest.mark.parametrize("name, order", [("minimum_jerk", 3), ("minimum_snap", 4)])
def test_least_integral_of_the_square(name, order):
    """Any change that keeps the ends makes the integral of jerk (or snap) squared larger."""
    at, weights = np.polynomial.legendre.leggauss(24)
    at, weights = (at + 1) / 2, weights / 2
    values = derivatives(motion_profile(name, 0.0, 1.0, 1.0), order, at)[order]
    bump = np.polynomial.Polynomial([0, 1, -1]) ** order
    for shape in (bump, bump * np.polynomial.Polynomial([1, -3]), bump * np.polynomial.Polynomial([0.2, 0, 1])):
        change = 1e-2 * shape.deriv(order)(at)
        assert weights @ (values + change) ** 2 > weights @ values**2
        np.testing.assert_allclose(weights @ (values * change), 0, atol=1e-12)


def test_cycloid():
    found = derivatives(CycloidalMotion(START, END, DURATION, BEGINNING), 4)
    w, way = 2 * np.pi / DURATION, END - START
    t = INSIDE - BEGINNING
    close(found[0], START + way * (t / DURATION - np.sin(w * t) / (2 * np.pi)))
    close(found[1], way / DURATION * (1 - np.cos(w * t)))
    close(found[2], way / DURATION * w * np.sin(w * t))
    close(found[3], way / DURATION * w**2 * np.cos(w * t))
    close(found[4], -way / DURATION * w**3 * np.sin(w * t))


def test_cycloids_begin_and_end_at_rest_exactly():
    """Friction takes its sign from the velocity: rounding in its place would be all of the friction."""
    for start, end, duration, beginning in np.random.default_rng(2).uniform(0.1, 3.0, (20, 4)):
        law = CycloidalMotion(start, end, duration, beginning)
        assert not derivatives(law, 2, np.array([beginning, beginning + duration]))[1:].any()


LAWS = {
    "cycloidal": (lambda: CycloidalMotion(START, END, DURATION, BEGINNING), 2),
    "cubic": (lambda: RestToRestMotion(START, END, DURATION, BEGINNING, 1), 1),
    "minimum_jerk": (lambda: RestToRestMotion(START, END, DURATION, BEGINNING, 2), 2),
    "minimum_snap": (lambda: RestToRestMotion(START, END, DURATION, BEGINNING, 3), 3),
    "trapezoidal": (lambda: TrapezoidalMotion(START, END, duration=DURATION, start_time=BEGINNING), 2),
}


@pytest.mark.parametrize("name", LAWS)
def test_rest_before_and_after_and_smooth_between(name):
    make, smooth = LAWS[name]
    law, last = make(), BEGINNING + DURATION
    found = derivatives(law, 5, [-7.0, BEGINNING - 1e-9, last, last + 1e-9, last + 40.0])
    np.testing.assert_array_equal(found[0], [START, START, END, END, END])
    np.testing.assert_array_equal(found[1:], 0)
    peaks = np.abs(derivatives(law, 5)).max(axis=1)
    at_ends = derivatives(law, 5, [BEGINNING, last - 1e-12])
    for k in range(1, smooth + 1):
        assert (np.abs(at_ends[k]) <= 1e-10 * peaks[max(k, 1)]).all()


@pytest.mark.parametrize("name", LAWS)
def test_symmetric_about_the_middle(name):
    found, mirrored = (
        derivatives(LAWS[name][0](), 5, BEGINNING + DURATION * np.array(at)) for at in ([0.11, 0.27], [0.89, 0.73])
    )
    close(mirrored[0], START + END - found[0])
    for k in range(1, 6):
        close(mirrored[k], (-1.0) ** (k + 1) * found[k], 1e-11)  # high derivatives cancel


CASES = {  # way and limits: which phases have a length
    "all": (4.0, (1.0, 2.0, 8.0), 7),
    "no cruise": (0.4, (3.0, 2.0, 8.0), 6),
    "no constant acceleration": (4.0, (1.0, 9.0, 8.0), 5),
    "jerk only": (0.1, (3.0, 9.0, 8.0), 4),
    "just at the limits": (1.5, (1.0, 2.0, 4.0), 7 - 2),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("sign", [1, -1])
def test_quickest_within_limits(case, sign):
    way, limits, phases = CASES[case]
    law = TrapezoidalMotion(0.5, 0.5 + sign * way, *limits)
    lengths = np.diff(law.switches)
    assert (lengths > 1e-12).sum() == phases
    at = np.linspace(0, law.duration, 4001)
    peaks = np.abs(derivatives(law, 3, at)).max(axis=1)[1:]
    assert (peaks <= np.array(limits) * (1 + 1e-12)).all()
    # A bang-bang law: at each instant one of the limits is reached.
    reached = np.abs(derivatives(law, 3, at[:-1])[1:]) >= np.array(limits)[:, None] * (1 - 1e-9)
    assert reached.any(axis=0).all()
    ends = derivatives(law, 2, [0.0, law.switches[-1] - 1e-13, law.switches[-1]])
    np.testing.assert_allclose(ends[0], [0.5, 0.5 + sign * way, 0.5 + sign * way], rtol=1e-13)
    np.testing.assert_allclose(ends[1:], 0, atol=1e-11)


def test_trapezium_of_seven_unit_phases():
    """v = 2, a = 1, j = 1 over 8: by hand, the acceleration phases end at v = 2 after 1, 2 and 3 s."""
    law = TrapezoidalMotion(0.0, 8.0, 2.0, 1.0, 1.0)
    np.testing.assert_allclose(law.switches, [0, 1, 2, 3, 4, 5, 6, 7], atol=1e-14)
    found = derivatives(law, 4, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    close(found[0], np.array([0, 1 / 6, 7 / 6, 3, 5, 41 / 6, 47 / 6]))
    close(found[1], np.array([0, 0.5, 1.5, 2, 2, 1.5, 0.5]))
    np.testing.assert_allclose(found[2], [0, 1, 1, 0, 0, -1, -1], atol=1e-14)
    np.testing.assert_allclose(found[3], [1, 0, -1, 0, -1, 0, 1], atol=1e-14)  # one-sided, from the right
    np.testing.assert_array_equal(found[4], 0)


def test_stretched_to_a_duration():
    quick, slow = TrapezoidalMotion(0.0, 1.0, 1.0, 2.0, 8.0), TrapezoidalMotion(0.0, 1.0, 1.0, 2.0, 8.0, duration=5.0)
    factor = 5.0 / quick.duration
    at = np.linspace(0, quick.duration, 20)[1:-1] + 1e-4  # off the switches
    a, b = derivatives(quick, 3, at), derivatives(slow, 3, at * factor)
    for k in range(4):
        close(b[k] * factor**k, a[k], 1e-11)


@pytest.mark.parametrize("name", ["cycloidal", "minimum_jerk", "minimum_snap", "trapezoidal"])
def test_quickest_of_each_profile_reaches_a_limit(name):
    limits = np.array([1.0, 2.0, 9.0])
    law = motion_profile(name, 0.2, 1.5, limits=limits.tolist())
    peaks = np.abs(derivatives(law, 3, np.linspace(0, float(law.duration), 2001)[:-1])).max(axis=1)[1:]
    assert (peaks / limits).max() == pytest.approx(1, abs=1e-6)
    with pytest.raises(TrajectoryError, match="do not allow this duration"):
        motion_profile(name, 0.2, 1.5, duration=0.9 * float(law.duration), limits=limits.tolist())


@pytest.mark.slow
def test_profiles_drive_a_mechanism():
    times = [0.0, 0.5, 1.0, 1.9, 2.5]
    law = RestToRestMotion(START, END, DURATION, BEGINNING)
    found = jn.solve(crank(law), times, order=3).outputs["angle"]
    np.testing.assert_allclose(np.asarray(found).T, derivatives(law, 3, times), atol=1e-12)


def test_laws_of_one_kind_are_stacked():
    laws = {f"j{k}": RestToRestMotion(0.1 * k, 1.0 - k, 1.0 + 0.1 * k, 0.05 * k, rest=3) for k in range(3)}
    found = JointTrajectory(laws, 0.0, 2.0).derivatives([0.0, 0.4, 1.1, 2.0], 3)
    for k, law in enumerate(laws.values()):
        np.testing.assert_allclose(found[:, :, k].T, derivatives(law, 3, [0.0, 0.4, 1.1, 2.0]), atol=1e-14)


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: RestToRestMotion(0.0, 1.0, 0.0), "duration: must be greater than zero, got 0.0"),
        (lambda: RestToRestMotion(0.0, 1.0, 1.0, rest=0), "rest: must be a whole number from 1 to 8, got 0"),
        (lambda: CycloidalMotion(0.0, float("nan")), "end: must be a finite number, got nan"),
        (lambda: TrapezoidalMotion(0.0, 1.0), "either the three limits or a duration"),
        (lambda: TrapezoidalMotion(0.0, 1.0, velocity=1.0), "all three or none"),
        (lambda: TrapezoidalMotion(0.0, 1.0, 1.0, -1.0, 1.0), "acceleration: must be greater than zero, got -1.0"),
        (lambda: TrapezoidalMotion(0.0, 8.0, 2.0, 1.0, 1.0, duration=6.0), "got 6.0; the quickest takes 7 s"),
        (lambda: motion_profile("minimum_jrk", 0.0, 1.0, 1.0), "did you mean 'minimum_jerk'"),
        (lambda: motion_profile("cycloidal", 0.0, 1.0), "either limits or a duration"),
        (lambda: motion_profile("cycloidal", 0.0, 1.0, limits=[1.0]), "limits are three numbers"),
    ],
)
def test_bad_profiles(make, message):
    with pytest.raises(TrajectoryError, match=message):
        make()


def test_no_way_takes_no_time():
    law = TrapezoidalMotion(0.5, 0.5, 1.0, 1.0, 1.0)
    assert law.duration == 0
    np.testing.assert_array_equal(derivatives(law, 2, [-1.0, 0.0, 1.0]), [[0.5] * 3, [0.0] * 3, [0.0] * 3])
