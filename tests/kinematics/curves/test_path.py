"""Time grids: coarse, uneven, long, of one instant; angles over many turns; number of compilations."""

import jax
import numpy as np
import pytest

import jounce as jn
from jounce.jet import Jet
from jounce.kinematics.continuation.continuation_steps import take_steps
from jounce.kinematics.continuation.instant_program import advance_instant
from jounce.mechanism import build
from tests.problems.small import crank, four_bar, law, screw, slider_crank, spindle

TURN = 2 * np.pi


def slider_position(angle):
    return np.cos(angle) + np.sqrt(9 - np.sin(angle) ** 2)


@pytest.mark.slow
def test_coarse_grid_follows_the_motion_over_turns():
    time = np.array([0.0, 10.0, 40.0])
    motion = jn.solve(slider_crank(), time, order=1)
    np.testing.assert_allclose(motion.outputs["angle"][:, 0], time, rtol=1e-14, atol=1e-30)  # 7e-46 for zero
    np.testing.assert_allclose(motion.outputs["x"][:, 0, 0], slider_position(time), rtol=1e-14)


@pytest.mark.slow
def test_fifty_turns_with_three_instants_after_the_first():
    time = np.array([0.0, 1 / 3, 2 / 3, 1.0])
    motion = jn.solve(crank(law(rate=50 * TURN)), time, order=2)
    np.testing.assert_allclose(motion.outputs["angle"][:, 0] / TURN, 50 * time, rtol=1e-15)
    np.testing.assert_allclose(motion.outputs["tip"][:, 0, 0], np.cos(TURN * 50 * time), atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(
    "vectors",
    [
        pytest.param(None, marks=pytest.mark.slow, id="euler"),
        pytest.param(([1.0, 0.0, 0.2], [1.0, 0.0, 0.0]), id="vectors"),
    ],
)
def test_rotation_driver_over_turns_and_back(vectors):
    time = np.array([0.0, 0.5, 1.0])
    mechanism = spindle(law(0.3, wave=5 * TURN), vectors=vectors)
    with pytest.warns(jn.errors.UnitWarning, match="degrees"):  # five turns there and back: told, and right
        motion = jn.solve(mechanism, time, order=1)
    expected = 0.3 + TURN * 5 * np.sin(np.pi * time)
    np.testing.assert_allclose(motion.outputs["angle"][:, 0], expected, atol=1e-12)
    np.testing.assert_allclose(motion.outputs["between"][:, 0], expected, atol=1e-12)
    speed = TURN * 5 * np.pi * np.cos(np.pi * time)
    np.testing.assert_allclose(motion.outputs["spin"][:, 0, 2], speed, atol=1e-10)


@pytest.mark.slow
def test_rotation_about_an_oblique_axis():
    axis = np.array([1.0, 2.0, -3.0])
    motion = jn.solve(spindle(law(rate=3 * TURN), axis=axis), [0.0, 0.5, 1.0], order=1)
    expected = 3 * TURN * axis / np.linalg.norm(axis)
    np.testing.assert_allclose(motion.outputs["spin"][:, 0], np.tile(expected, (3, 1)), rtol=1e-13)
    np.testing.assert_allclose(motion.outputs["body_spin"][:, 0], np.tile(expected, (3, 1)), rtol=1e-13)
    np.testing.assert_allclose(motion.outputs["angle"][:, 0], 3 * TURN * np.array([0, 0.5, 1]), atol=1e-12)


@pytest.mark.slow
def test_screw_keeps_count_of_its_turns():
    time = np.array([0.0, 0.4, 1.0])
    for lead in (0.01, -0.01):
        motion = jn.solve(screw(lead, law(rate=30 * TURN)), time, order=1)
        np.testing.assert_allclose(motion.outputs["p"][:, 0, 2], 30 * lead * time, atol=1e-14)
        np.testing.assert_allclose(motion.outputs["p"][:, 1, 2], 30 * lead, rtol=1e-13)


@pytest.mark.slow
def test_screw_driven_by_its_slide_turns():
    time = np.array([0.0, 0.4, 1.0])
    motion = jn.solve(screw(0.01, law(rate=0.2), driven="slide"), time, order=1)
    np.testing.assert_allclose(motion.outputs["angle"][:, 0], TURN * 20 * time, atol=1e-11)


@pytest.mark.slow
def test_one_instant():
    motion = jn.solve(crank(law(rate=1.0)), [0.5])
    np.testing.assert_allclose(motion.outputs["angle"], [[0.5, 1, 0, 0, 0]], atol=1e-15)


def test_negative_times():
    motion = jn.solve(crank("t**2"), [-3.0, -1.0, 0.0, 3.5], order=2)
    np.testing.assert_allclose(motion.outputs["angle"], [[9, -6, 2], [1, -2, 2], [0, 0, 2], [12.25, 7, 2]], atol=1e-13)


def test_whole_power_of_time_given_by_a_parameter_at_zero():
    motion = jn.solve(crank("a*t**n", parameters={"a": 1.0, "n": 2.0}), [0.0, 2.0], order=3)
    np.testing.assert_allclose(motion.outputs["angle"], [[0, 0, 2, 0], [4, 4, 2, 0]], atol=1e-14)


def test_uneven_grid_gives_what_each_instant_gives_alone():
    time = np.array([0.0, 1e-9, 1e-4, 0.3, 0.31, 1.7])
    together = jn.solve(four_bar(), time, order=2).outputs["psi"]
    single = [jn.solve(four_bar(), [0.0, t], order=2).outputs["psi"][-1] for t in time[1:]]
    np.testing.assert_allclose(together[1:], single, rtol=1e-13)


def test_long_grid_is_the_short_one_and_progress_is_reported():
    reports = []
    short = jn.solve(four_bar(), np.linspace(0, 2, 31))
    long = jn.solve(four_bar(), np.linspace(0, 2, 3001), progress=lambda done, total: reports.append((done, total)))
    for k in range(5):
        expected = short.outputs["psi"][:, k]
        np.testing.assert_allclose(long.outputs["psi"][::100, k], expected, rtol=0, atol=1e-14 * np.abs(expected).max())
    done = [d for d, _ in reports]
    assert done == sorted(done)
    assert reports[-1] == (3001, 3001)


def compilations():
    by_xla = advance_instant.on_xla, advance_instant.in_rounds, take_steps.on_xla
    return sum(one.jitted._cache_size() for one in by_xla) + len(advance_instant.machine_code)


def test_parameters_and_number_of_instants_compile_nothing_again():
    mechanism = four_bar()
    jn.solve(mechanism, np.linspace(0, 2, 31))
    before = compilations()
    for values in ({"AB": 0.05}, {"tau": 1.0}, {"AD": 0.14, "CD": 0.2}):
        jn.solve(mechanism.with_parameters(**values), np.linspace(0, 1, 31))
    for count in (1, 2, 64, 65, 1000):
        jn.solve(mechanism, np.linspace(0, 2, count) if count > 1 else [0.3])
    for order in (0, 2):
        jn.solve(mechanism, [0.0, 0.1], order=order)
    assert compilations() == before


def many_cranks(count):
    names = [f"crank{k}" for k in range(count)]
    return jn.Mechanism(
        space="planar",
        bodies={name: jn.Body([k, 0]) for k, name in enumerate(names)},
        joints={f"O{k}": jn.planar.Revolute(("ground", n), [k, 0], [0, 0]) for k, n in enumerate(names)},
        drivers={f"d{k}": jn.drivers.CoordinateDriver(("ground", n), "angle", "t") for k, n in enumerate(names)},
    )


def program_size(count):
    """Length of the program that is compiled for cranks side by side."""
    model = build(many_cranks(count))
    pose = model.pose_type.from_coordinates({name: Jet([value]) for name, value in model.guess.items()})
    time = Jet.constant(np.zeros((1, 1)), 1)
    return str(jax.make_jaxpr(lambda p: model.system.jacobian(p, time))(pose)).count(" = ")


def test_program_does_not_grow_with_the_number_of_joints_of_a_kind():
    assert program_size(12) == program_size(3)


def test_unrefined_positions_are_as_far_off_as_the_tolerance_lets_them():
    time = np.linspace(0, 2, 21)
    exact = jn.solve(four_bar(), time).outputs["psi"][:, 0]
    loose = jn.solve(four_bar(), time, refine=False, tolerance=1e-3).outputs["psi"][:, 0]
    assert 1e-9 < np.abs(loose - exact).max() < 1e-2
    refined = jn.solve(four_bar(), time, tolerance=1e-3).outputs["psi"][:, 0]
    np.testing.assert_allclose(refined, exact, rtol=1e-9)


@pytest.mark.parametrize("tolerance", [1e-16, 1e-30])
def test_a_tolerance_below_rounding_still_ends(tolerance):
    motion = jn.solve(four_bar(), np.linspace(0, 2, 5), tolerance=tolerance, strict=False)
    assert not motion.status.any()


@pytest.mark.slow
@pytest.mark.parametrize("time", [[0.0, 1.0], np.linspace(0, 1, 11)], ids=["ends", "grid"])
def test_a_quick_whole_turn_between_rests_is_counted(time):
    """Before and after its turn the nut rests in the same attitude: only the law shows that it has turned."""
    motion = jn.solve(screw(0.01, law(rise=TURN)), time, order=1)
    assert motion.outputs["p"][-1, 0, 2] == pytest.approx(0.01, rel=1e-12)
    assert motion.outputs["angle"][-1, 0] == pytest.approx(TURN, rel=1e-12)
