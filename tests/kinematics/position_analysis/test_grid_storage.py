"""Long grids, solved chunk by chunk: the same motion, and discarded results are computed again on request."""

import numpy as np
import pytest

import jounce as jn
from jounce.execution.device import on_processor
from jounce.kinematics import Status
from jounce.kinematics.continuation.instant_program import round_width
from jounce.mechanism import build
from tests.problems.small import four_bar, slider_crank

TIME = np.linspace(0, 2, 2501)


@pytest.fixture
def short_chunks(monkeypatch):
    monkeypatch.setattr("jounce.kinematics.position_analysis.grid_storage.CHUNK", 1100)


@pytest.mark.slow
def test_chunks_make_one_motion(short_chunks):
    reports = []
    motion = jn.solve(four_bar(), TIME, progress=lambda done, total: reports.append((done, total)))
    angle, length = motion.outputs["psi"], 0.1423
    crank = np.pi / 6 + np.pi / 3 * np.sin(np.pi * TIME)
    gap = 0.04 * np.exp(1j * crank) - 0.1321 - 0.2031 * np.exp(1j * angle[:, 0])
    np.testing.assert_allclose(np.abs(gap), length, rtol=1e-14)
    expected = jn.solve(four_bar(), TIME[::50]).outputs["psi"]
    np.testing.assert_allclose(
        angle[::50] / np.abs(expected).max(axis=0), expected / np.abs(expected).max(axis=0), atol=1e-13
    )
    assert [done for done, _ in reports] == sorted(done for done, _ in reports)
    assert reports[-1] == (2501, 2501)


@pytest.mark.slow
@pytest.mark.parametrize("keep", [None, True, False])
def test_points_are_there_whether_bodies_were_kept_or_not(short_chunks, keep):
    motion = jn.solve(four_bar(), TIME, order=2, keep=keep)
    assert callable(motion._bodies) == (keep is not True)
    tip = motion.point("rocker", [0.2031, 0])
    psi = motion.outputs["psi"]
    turned = 0.2031 * np.exp(1j * psi[:, 0])
    np.testing.assert_allclose(tip.values[:, 0] @ [1, 1j], 0.1321 + turned, atol=1e-15)
    np.testing.assert_allclose(tip.values[:, 1] @ [1, 1j], 1j * psi[:, 1] * turned, atol=1e-13)


def test_a_short_grid_need_not_keep_bodies_either():
    motion = jn.solve(four_bar(), TIME[:40], order=1, keep=False)
    assert callable(motion._bodies)
    np.testing.assert_array_equal(motion.poses[1]["angle"], jn.solve(four_bar(), TIME[:40], order=1).poses[1]["angle"])


@pytest.mark.slow
@pytest.mark.parametrize("chunk", [500, 1100])
def test_an_end_is_explained_once(monkeypatch, chunk):
    mechanism = slider_crank("3.8 - 2*t")  # beyond its range from t = 0.9 on
    whole = jn.solve(mechanism, TIME, order=0, strict=False)
    monkeypatch.setattr("jounce.kinematics.position_analysis.grid_storage.CHUNK", chunk)
    motion = jn.solve(mechanism, TIME, order=0, strict=False)
    np.testing.assert_array_equal(motion.status, whole.status)
    assert motion.faults == whole.faults
    assert (motion.status == Status.NOT_REACHED).sum() > 1000


@pytest.mark.skipif(not on_processor(), reason="a GPU is filled whatever the size")
def test_a_large_mechanism_is_solved_fewer_instants_side_by_side():
    pins = {f"g{k}": jn.planar.Revolute(("ground", f"b{k}"), [k, 0], [0, 0]) for k in range(30)}
    drivers = {f"d{k}": jn.drivers.CoordinateDriver(("ground", f"b{k}"), "angle", motion="t") for k in range(30)}
    many = jn.Mechanism(
        space="planar", bodies={f"b{k}": jn.Body([k, 0]) for k in range(30)}, joints=pins, drivers=drivers
    )
    assert round_width(build(many).system) < round_width(build(four_bar()).system)
