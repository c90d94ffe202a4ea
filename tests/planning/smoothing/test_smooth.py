"""Noisy samples of motions that are known: jerk, deviation, dwells, uneven stamps, and what is refused."""

import pickle
import warnings

import numpy as np
import pytest
from scipy.interpolate import PPoly, make_lsq_spline

import jounce as jn
from jounce.errors import TrajectoryError
from jounce.planning.smoothing import bases, curves

pytestmark = pytest.mark.long


def minimum_jerk(times, start, duration, size):
    u = np.clip((times - start) / duration, 0, 1)
    return size * (10 * u**3 - 15 * u**4 + 6 * u**5)


def minimum_snap(times, start, duration, size):
    u = np.clip((times - start) / duration, 0, 1)
    return size * (35 * u**4 - 84 * u**5 + 70 * u**6 - 20 * u**7)


MOTIONS = {
    "sine": (lambda t: 0.5 * np.sin(2 * np.pi * t), 0.5 * (2 * np.pi) ** 3, 3.0),
    "slow sine": (lambda t: 0.8 * np.sin(1.9 * t + 0.4), 0.8 * 1.9**3, 6.0),
    "minimum jerk": (lambda t: minimum_jerk(t, 1.0, 1.0, 1.0), 60.0, 3.0),
    "two moves": (lambda t: minimum_snap(t, 0.5, 0.6, 0.3) + minimum_snap(t, 2.0, 1.5, 0.7), 52.5 * 0.3 / 0.6**3, 5.0),
}
STILL = {"minimum jerk": [(0.0, 0.7), (2.3, 3.0)], "two moves": [(0.0, 0.2), (1.4, 1.6), (3.8, 5.0)]}


def recorded(times, clean, noise):
    generator, (kind, size) = np.random.default_rng(11), noise
    if kind == "gaussian":
        return clean + size * generator.normal(size=len(times)), 4.5 * size
    if kind == "steps":
        return size * np.round(clean / size), size
    return size * np.round((clean + size / 2 * generator.normal(size=len(times))) / size), 3.5 * size


def law_of(times, values, deviation):
    motion = jn.smooth(jn.JointTrajectory.from_samples(times, values[:, None], ["a"]), deviation)
    return motion, motion.laws["a"], motion.joints["a"]


def derivative(law, times, order):
    begins, powers = np.asarray(law.breakpoints), np.asarray(law.coefficients)
    piece = np.clip(np.searchsorted(begins, times, side="right") - 1, 0, len(begins) - 1)
    polynomial = [np.polynomial.Polynomial(c).deriv(order)(t - b) for c, b, t in zip(
        powers.T[piece], begins[piece], times, strict=True)]  # fmt: skip
    return np.array(polynomial)


@pytest.mark.parametrize(
    "spoil, says",
    [
        (
            lambda t, noise: np.sin(2 * t) + noise + np.where(t == 2.0, 0.5, 0.0),
            r"a: the sample at t = 2 s is 0\.5 from those beside it:",
        ),
        (
            lambda t, noise: (np.sin(2 * t) + noise)[np.arange(len(t)) // 4 * 4],
            r"a: 2\d\d of 401 samples repeat the one before while the joint moves, the first at t = 0\.",
        ),
        (
            lambda t, noise: (np.sin(2 * t) + noise)[np.where(abs(t - 1.6) < 0.095, 151, np.arange(len(t)))],
            r"a: 1\d of 401 samples repeat the one before while the joint moves, the first at t = 1\.\d* s:",
        ),
    ],
)
def test_what_no_motion_does_is_reported(spoil, says):
    times = np.linspace(0.0, 4.0, 401)
    values = spoil(times, 1e-4 * np.random.default_rng(2).normal(size=times.size))
    with pytest.warns(jn.errors.RecordingWarning, match=says):
        jn.smooth(jn.JointTrajectory.from_samples(times, values[:, None], ["a"]), 5e-4)


@pytest.mark.parametrize(
    "angle",
    [
        lambda t, noise: 3 * t + noise,
        lambda t, noise: np.pi - 1e-4 * (1 - np.minimum(t, 1)) + noise,  # at rest where angles are wrapped
    ],
)
def test_an_angle_within_one_turn_is_refused(angle):
    times = np.linspace(0.0, 4.0, 401)
    wrapped = np.angle(np.exp(1j * angle(times, 1e-3 * np.random.default_rng(2).normal(size=times.size))))
    log = jn.JointTrajectory.from_samples(times, wrapped[:, None], ["a"])
    with pytest.raises(jn.errors.TrajectoryError, match=r"a: goes by a whole turn, -?6\.2.*numpy\.unwrap"):
        jn.smooth(log, 5e-3)


def test_samples_beside_a_gap_are_no_outliers():
    times = np.linspace(0.0, 4.0, 801)
    times = times[(times < 1.5) | (times > 2.5)]
    values = np.sin(3 * times) + 1e-5 * np.random.default_rng(2).normal(size=times.size)
    with pytest.warns(jn.errors.RecordingWarning, match=r"no samples between t = 1\.\d* and 2\.\d* s: the motion"):
        log = jn.JointTrajectory.from_samples(times, values[:, None], ["a"])
    with warnings.catch_warnings():
        warnings.simplefilter("error", jn.errors.RecordingWarning)
        jn.smooth(log, 1e-4)


@pytest.mark.parametrize("name", MOTIONS)
def test_samples_that_steps_of_an_encoder_or_a_rest_make_equal_are_not_called_old(name):
    clean, _, stop = MOTIONS[name]
    times = np.arange(0, stop + 1e-9, 0.01)
    for step in (1e-6, 1e-4, 1e-3):
        values = step * np.round(clean(times) / step)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            jn.smooth(jn.JointTrajectory.from_samples(times, values[:, None], ["a"]), step)


@pytest.mark.parametrize("rate", [100, 500])
@pytest.mark.parametrize("noise", [("gaussian", 1e-5), ("gaussian", 1e-4), ("steps", 1e-4), ("both", 2e-5)])
@pytest.mark.parametrize("name", MOTIONS)
def test_the_jerk_is_that_of_the_motion(name, noise, rate):
    clean, peak, stop = MOTIONS[name]
    times = np.arange(0, stop + 1e-9, 1 / rate)
    values, deviation = recorded(times, clean(times), noise)
    motion, law, own = law_of(times, values, deviation)
    looks = np.linspace(0, stop, 2501)
    assert 0.75 <= np.abs(derivative(law, looks, 3)).max() / peak <= 1.25
    assert np.abs(derivative(law, times, 0) - values).max() <= deviation
    assert own.away <= deviation
    for first, last in STILL.get(name, []):
        inside = np.linspace(first, last, 50)
        assert not derivative(law, inside, 1).any()
    assert motion.stop == times[-1]


@pytest.mark.parametrize("count, periods", [(501, 10), (501, 20), *((2501, periods) for periods in (10, 20, 40, 80))])
def test_many_periods_are_no_noise(count, periods):
    times, rate = np.linspace(0.0, 5.0, count), 2 * np.pi * periods / 5
    values = 0.5 * np.sin(rate * times + 1) + 2e-5 * np.random.default_rng(periods).normal(size=count)
    _, law, found = law_of(times, values, 2e-4)
    assert found.noise == pytest.approx(2e-5, rel=0.2)
    inner = times[(times > 0.5) & (times < 4.5)]
    jerk = -0.5 * rate**3 * np.cos(rate * inner + 1)
    assert np.sqrt(np.mean((derivative(law, inner, 3) - jerk) ** 2)) < 0.05 * 0.5 * rate**3


@pytest.mark.parametrize("rate, size", [(100, 1e-4), (500, 2e-5)])
def test_standard_errors_are_those_of_many_logs(rate, size):
    times = np.arange(0, 5, 1 / rate)
    inner = np.flatnonzero((times > 1) & (times < 4))
    exact = np.stack([0.5 * 6.28**k * np.sin(6.28 * times + 1 + k * np.pi / 2) for k in range(4)])
    squares, stated = [], []
    for seed in range(12):
        values = exact[0] + size * np.random.default_rng(seed).normal(size=len(times))
        motion, _, found = law_of(times, values, 6 * size)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", jn.errors.SampleWarning)
            errors = motion.derivatives(times, 3)[:, :, 0].T - exact
        squares.append([(errors[:, inner] ** 2).mean(axis=1), (errors[:, [0, -1]] ** 2).mean(axis=1)])
        stated.append(found.standard_errors)
    within, ends = np.sqrt(np.mean(squares, axis=0)) / np.mean(stated, axis=0)
    assert ((within > 0.25) & (within < 1.1)).all()  # a sine is smoother than a motion whose jounce is noise
    assert (np.abs(np.log(ends / [2.7, 6.7, 6.8, 2.8])) < 0.4).all()


@pytest.mark.parametrize("noise, supported", [(1e-7, 3), (1e-5, 2)])
def test_estimated_errors_are_those_of_the_motion(noise, supported):
    """To the jerk they are above those of 99 percent; the jounce of such samples is off by more than half its peak."""
    times, rate = np.arange(0, 3 + 1e-9, 2e-3), 2 * np.pi
    sine = np.stack([0.5 * rate**k * np.sin(rate * times + 0.4 + k * np.pi / 2) for k in range(5)])
    motion, _, _ = law_of(times, sine[0] + noise * np.random.default_rng(1).normal(size=len(times)), 5 * noise)
    motion.derivatives(times, supported)
    size = r"is about 12 %, and nothing is known above the jerk;" if supported == 2 else r"cannot be known from them;"
    says = f"smoothed samples of 'a' .* of order {supported + 1}: its error {size}"
    with pytest.warns(jn.errors.SampleWarning, match=says):
        found = motion.derivatives(times, 4)[:, :, 0].T
    inner = (times > 0.3) & (times < 2.7)
    errors = np.quantile(np.abs(found - sine)[:, inner], 0.99, axis=1) / np.abs(sine).max(axis=1)
    estimated = motion.estimate_error(4)[:, 0]
    assert (errors < estimated).all()
    assert (estimated[:4] < 10 * errors[:4]).all()
    assert (estimated[4], motion.supported_order()) == (1, supported)
    assert errors[4] > 0.5


def test_a_motion_that_follows_noise_says_so():
    """With a deviation of twice the noise the acceleration is off by half of its peak, the jerk by 27 peaks."""
    times, rate = np.arange(0, 3 + 1e-9, 2e-3), 2 * np.pi
    sine = np.stack([0.5 * rate**k * np.sin(rate * times + 0.4 + k * np.pi / 2) for k in range(4)])
    values = sine[0] + 1e-4 * np.random.default_rng(1).normal(size=len(times))
    with pytest.warns(jn.errors.RecordingWarning, match="is below three times the noise"):
        motion, law, found = law_of(times, values, 2e-4)
    followed = np.stack([derivative(law, times, k) for k in range(4)])
    peaks = np.abs(followed).max(axis=1)
    true = np.quantile(np.abs(followed - sine), 0.99, axis=1) / peaks
    assert (true < motion.estimate_error(3)[:, 0]).all()
    assert true[3] > 0.1 > 0.02 > 3 * found.standard_errors[3] / peaks[3]
    assert motion.supported_order() == 1


def test_a_joint_that_rests_has_no_errors():
    noisy = 1e-4 * np.random.default_rng(1).normal(size=201)
    motion, _, _ = law_of(np.linspace(0, 1, 201), noisy, 1e-3)
    assert not motion.estimate_error(6).any()


def test_a_deviation_below_the_noise_is_kept_where_it_can_be():
    times = np.linspace(0, 3, 601)
    values = np.sin(2 * times) + 1e-4 * np.random.default_rng(2).normal(size=601)
    with pytest.warns(
        jn.errors.RecordingWarning, match=r"^a: the deviation of 0\.00015 is below three times .* follow the noise"
    ):
        _, law, own = law_of(times, values, 1.5e-4)
    assert own.follows_noise(1.5e-4)
    assert np.abs(derivative(law, times, 0) - values).max() <= 1.5e-4
    assert 0.8e-4 < own.noise < 1.2e-4


@pytest.mark.parametrize("size, intervals", [(0.0, []), (0.02, [50, 51])])
def test_swings_between_samples_are_found(size, intervals):
    times, dense = np.linspace(0, 1, 101), np.linspace(0, 1, 4001)
    samples = bases.Samples(times, np.sin(7 * times), np.linspace(0, 1, 401))
    swing = size * np.sin(100 * np.pi * dense) ** 2 * ((dense > 0.5) & (dense < 0.52))  # zero at the samples
    values = np.sin(7 * dense) + swing - samples.middle
    spline = make_lsq_spline(dense / samples.scale, values, bases.whole(samples.knots), bases.DEGREE)
    assert curves._Problem(samples, None, values, 1e-5)._swings(spline.c).tolist() == intervals


@pytest.mark.filterwarnings("ignore:a. the deviation")  # the noise of few samples is unsure
@pytest.mark.parametrize("start, duration", [(0.2, 0.5), (1.1, 0.6)])
def test_motions_of_few_samples_between_dwells_do_not_swing_between_them(start, duration):
    times, instants = np.linspace(0, 2, 51), np.linspace(0, 2, 2001)
    _, law, _ = law_of(times, np.round(minimum_jerk(times, start, duration, 1.5), 6), 2e-6)
    errors = derivative(law, instants, 0) - minimum_jerk(instants, start, duration, 1.5)
    assert np.abs(errors).max() < 5e-4


def limited_jerk(times, start, duration, size, order):
    jerk = 32 * size / duration**3
    powers = [np.maximum(times - start - k * duration / 4, 0) ** (3 - order) for k in (0, 1, 3, 4)]
    return jerk * np.array([1, -2, 2, -1]) @ powers / (6, 2, 1)[order]


@pytest.mark.parametrize("start, duration", [(0.25, 1.5), (0.3, 1.45)])
def test_samples_that_the_deviation_holds_everywhere_are_solved_for_together(start, duration):
    times = np.linspace(0, 2, 2001)
    samples = np.round(limited_jerk(times, start, duration, 0.7, 0), 8)
    _, law, _ = law_of(times, samples, 8e-8)
    accelerations = limited_jerk(times, start, duration, 0.7, 2)
    np.testing.assert_allclose(derivative(law, times, 2), accelerations, rtol=0, atol=0.008 * accelerations.max())


def test_a_deviation_near_rounding_is_kept():
    times = np.linspace(0, 2, 1001)
    _, law, own = law_of(times, 0.4 * np.exp(-12.5 * (times - 0.9) ** 2), 1e-12)
    u = 25 * (times - 0.9)
    jerk = 0.4 * np.exp(-12.5 * (times - 0.9) ** 2) * (75 * u - u**3)
    inner = slice(30, -30)  # at the ends the spline has no jounce
    assert own.away <= 1e-12
    np.testing.assert_allclose(derivative(law, times, 3)[inner], jerk[inner], rtol=0, atol=1e-3 * np.abs(jerk).max())


def test_uneven_stamps_and_all_derivatives_are_continuous():
    generator = np.random.default_rng(4)
    times = np.sort(generator.uniform(0, 4, 900))
    values = np.sin(2 * times) + 1e-5 * generator.normal(size=900)
    motion, law, _ = law_of(times, values, 6e-5)
    looks = np.linspace(times[0], times[-1], 1500)
    assert np.abs(derivative(law, looks, 3)).max() == pytest.approx(8.0, rel=0.2)
    knots = np.asarray(law.breakpoints)[1:]
    for k in range(7):
        size = np.abs(derivative(law, looks, k)).max()
        before = derivative(law, np.nextafter(knots, 0), k)
        assert np.abs(derivative(law, knots, k) - before).max() <= 1e-6 * size
    again = pickle.loads(pickle.dumps(motion))
    assert again.deviation == motion.deviation
    assert again.joints == motion.joints


@pytest.mark.parametrize("seed, noise", [(77, 2e-5), (78, 1e-4)])
def test_moves_that_begin_slowly_are_no_dwells(seed, noise):
    generator, times = np.random.default_rng(seed), np.arange(0.0, 30.0005, 1e-3)
    clean, jerk, start, sign = np.zeros_like(times), np.zeros_like(times), 0.5, 1
    while start < 27.0:
        duration, size = generator.uniform(0.6, 2.5), sign * generator.uniform(0.2, 1.0)
        clean += minimum_snap(times, start, duration, size)
        u = np.clip((times - start) / duration, 0, 1)
        jerk += size * (840 * u - 5040 * u**2 + 8400 * u**3 - 4200 * u**4) / duration**3
        start, sign = start + duration + generator.uniform(0.0, 1.5), -sign
    _, law, _ = law_of(times, clean + noise * generator.normal(size=len(times)), 6 * noise)
    found = np.abs(PPoly(np.asarray(law.coefficients)[::-1], np.append(law.breakpoints, law.stop))(times, 3))
    assert 0.75 < found.max() / np.abs(jerk).max() < 1.25


def test_a_short_move_there_and_back_is_no_part_of_the_dwells_beside_it():
    times, instants = np.linspace(0, 2, 101), np.linspace(0, 2, 2001)
    samples, truth = (0.55 * np.exp(-(((t - 1.23) / 0.07) ** 2)) for t in (times, instants))
    _, law, own = law_of(times, np.round(samples, 5), 2e-5)
    assert len(own.dwells) == 2
    assert np.abs(derivative(law, instants, 0) - truth).max() < 1e-3


def test_long_logs_are_smoothed_part_by_part_as_they_are_whole(monkeypatch):
    times = np.arange(0.0, 8.0, 2e-3)
    values = np.sin(times) + 1e-5 * np.random.default_rng(6).normal(size=len(times))
    _, whole, _ = law_of(times, values, 3.5e-5)
    monkeypatch.setattr(bases, "PART", 7)
    _, parts, own = law_of(times, values, 3.5e-5)
    assert own.away <= 3.5e-5
    np.testing.assert_allclose(derivative(parts, times, 2), derivative(whole, times, 2), rtol=0, atol=1e-6)  # of 1


@pytest.mark.filterwarnings("ignore:a. the deviation")
def test_many_splines_are_moved_part_by_part_as_they_are_together(monkeypatch):
    times = np.linspace(0, 4, 2001)
    values = np.sin(5 * times) + 0.1 * np.sin(31 * times) + 1e-5 * np.random.default_rng(0).normal(size=len(times))
    _, together, _ = law_of(times, values, 1.5e-5)
    monkeypatch.setattr(curves, "TOGETHER", 100)
    monkeypatch.setattr(curves, "AHEAD", 100)
    _, parts, own = law_of(times, values, 1.5e-5)
    jerk = derivative(together, times, 3)
    assert own.away <= 1.5e-5
    np.testing.assert_allclose(derivative(parts, times, 3), jerk, rtol=0, atol=1e-3 * np.abs(jerk).max())


def test_what_is_refused_is_named():
    times = np.linspace(0, 1, 201)
    laws = jn.JointTrajectory({"a": "t"}, 0.0, 1.0)
    with pytest.raises(TrajectoryError, match=r"must be a jn\.JointTrajectory"):
        jn.smooth(np.sin(times), 1e-3)
    with pytest.raises(TrajectoryError, match="no joint goes through samples"):
        jn.smooth(laws, 1e-3)
    log = jn.JointTrajectory.from_samples(times, np.sin(times)[:, None], ["a"])
    with pytest.raises(TrajectoryError, match="deviation: must be greater than zero"):
        jn.smooth(log, 0.0)
    with pytest.raises(TrajectoryError, match="a: at least 12 samples are needed"):
        jn.smooth(jn.JointTrajectory.from_samples(times[:8], times[:8, None], ["a"]), 1e-3)
    noisy = 1e-3 * np.random.default_rng(1).normal(size=201)
    with pytest.raises(TrajectoryError, match=r"a: samples of a dwell differ by .* more than twice the deviation"):
        jn.smooth(jn.JointTrajectory.from_samples(times, noisy[:, None], ["a"]), 1e-3)
