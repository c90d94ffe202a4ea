"""Outliers of velocities in logs, alone and in groups, and logs that have none."""

import numpy as np
import pytest

import jounce as jn
from jounce.io.trajectories.agreement import MOST, _outliers

ROWS = 400


def log(seed):
    """Return a log: sines, or moves and dwells with jumps of the acceleration, or jumps of the velocity; with noise."""
    random = np.random.default_rng(seed)
    step = random.choice([1e-3, 8e-3, 0.02])
    times = np.cumsum(step * random.choice([np.ones(ROWS), random.uniform(0.7, 1.3, ROWS)]))
    fine = np.linspace(times[0], times[-1], 20 * ROWS)
    if seed % 3 == 0:
        w, phase = random.uniform(0.3, 8, 3) / (100 * step), random.uniform(0, 6, 3)
        rate = np.cos(w[:, None] * fine + phase[:, None]).sum(axis=0)
    else:
        part = fine % (80 * step) / (80 * step)
        moves = np.interp(part, [0, 0.2, 0.5, 0.7, 1], [0, 1, 1, 0, 0])
        rate = np.where(fine // (80 * step) % 2 == 0, 1.0, -1.0) * (moves if seed % 3 == 1 else 1.0)
    path = np.append(0.0, np.cumsum((rate[1:] + rate[:-1]) / 2 * np.diff(fine)))
    positions, velocities = np.interp(times, fine, path), np.interp(times, fine, rate)
    positions = positions + random.choice([0.0, 1e-6, 1e-4]) * step * random.normal(size=ROWS)
    velocities = velocities + random.choice([0.0, 1e-4, 1e-2]) * random.normal(size=ROWS)
    return times, positions, velocities


def test_logs_without_outliers_have_none():
    assert [seed for seed in range(24) if _outliers(*log(seed)) is not None] == []


@pytest.mark.parametrize("count", range(1, MOST + 1))
def test_outliers_in_a_row_are_found_where_they_are(count):
    for seed in range(12):
        times, positions, velocities = log(seed)
        random = np.random.default_rng(seed)
        first = int(random.integers(3, ROWS - 3 - count))
        off = random.choice([-1, 1]) * np.ptp(velocities) * random.uniform(1.5, 4, count)
        velocities[first : first + count] += off
        found = _outliers(times, positions, velocities)
        assert found is not None, seed
        assert found[:2] == (first, first + count - 1), seed


@pytest.mark.parametrize("count", [2, 3])
def test_a_group_is_reported_by_lines_and_column(tmp_path, count):
    times = np.linspace(0, 1, 51)
    rates = 2 * np.cos(2 * times)
    rates[20 : 20 + count] += 3.0
    rows = zip(times, np.sin(2 * times), rates, strict=True)
    path = tmp_path / "log.csv"
    path.write_text("time,a,a_vel\n" + "".join(f"{t:.9g},{q:.17g},{v:.17g}\n" for t, q, v in rows))
    last = 22 + count - 1
    words = rf"line 22, a: velocities have {count} outliers in a row from t = 0.4 s to .* s, to line {last}: 4.39"
    with pytest.raises(jn.errors.TrajectoryError, match=words) as raised:
        jn.load_trajectory(path)
    assert "say 1.39" in str(raised.value)
