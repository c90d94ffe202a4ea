"""Figures: what is drawn where, and with which labels."""

import pathlib

import matplotlib.image
import numpy as np
import pytest

import jounce as jn
from jounce.plot import check_figure, draw, save
from jounce.plot.figure import stacked
from jounce.plot.labels import axis_range, rounded_down, scale_of, symbol, unit_label
from jounce.plot.style import blank_figure, style

ROOT = pathlib.Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def four_bar():
    return jn.solve(jn.load(ROOT / "examples" / "four_bar.yaml"), np.linspace(0.0, 2.0, 41))


@pytest.fixture(scope="module")
def rsur():
    return jn.solve(jn.load(ROOT / "examples" / "rsur.yaml"), np.linspace(0.0, 2.0, 41))


def panels(figure):
    """Return the panels of a figure by row and column."""
    shape = figure.axes[0].get_subplotspec().get_gridspec().get_geometry()
    return np.array(figure.axes, dtype=object).reshape(shape)


@pytest.mark.slow
def test_panels_show_the_outputs_row_by_row(four_bar):
    grid = panels(draw(four_bar))
    assert grid.shape == (5, 2)
    for k in range(5):
        (line,) = (x for x in grid[k, 0].get_lines() if len(x.get_xdata()) > 2)
        np.testing.assert_array_equal(line.get_xdata(), four_bar.time)
        np.testing.assert_allclose(line.get_ydata(), four_bar.outputs["psi"][:, k], rtol=1e-15)
        curves = [x.get_ydata() for x in grid[k, 1].get_lines() if len(x.get_xdata()) > 2]
        np.testing.assert_allclose(np.array(curves).T, four_bar.outputs["C"][:, k], rtol=1e-15)


def test_labels_name_derivative_symbol_and_unit(four_bar):
    grid = panels(draw(four_bar, ["psi"]))
    labels = [axes.get_ylabel() for axes in grid[:, 0]]
    assert labels == [
        "angle\n$\\psi$  (rad)",
        "velocity\n$\\dot{\\psi}$  (rad/s)",
        "acceleration\n$\\ddot{\\psi}$  (rad/s$^2$)",
        "jerk\n$\\dddot{\\psi}$  (rad/s$^3$)",
        "jounce\n$\\ddddot{\\psi}$  (rad/s$^4$)",
    ]
    assert grid[-1, 0].get_xlabel() == "time  $t$  (s)"
    assert grid[0, 0].get_title(loc="left") == "psi"


def test_components_have_a_legend(four_bar):
    legend = panels(draw(four_bar, ["C"]))[0, 0].get_legend()
    assert [text.get_text() for text in legend.get_texts()] == ["$C_{x}$", "$C_{y}$"]


@pytest.mark.slow
def test_an_angular_velocity_starts_with_velocities(rsur):
    grid = panels(draw(rsur, ["psi", "coupler_spin"]))
    assert grid[0, 1].get_ylabel() == "velocity\n(rad/s)"
    assert [axes.axison for axes in grid[:, 1]] == [True, True, True, True, False]
    single = panels(draw(rsur, ["coupler_spin"]))
    assert single.shape == (4, 1)
    assert single[0, 0].get_ylabel() == "velocity\n(rad/s)"


def test_columns_leave_few_places_empty():
    assert [set(stacked(dict.fromkeys("abcde"[:count], 5)).values()) for count in (1, 5)] == [
        {(0, 0)},
        {(column, 0) for column in range(5)},
    ]
    press = {"ram": 4, "torque": 2, "bearing": 2, "knee": 2, "guide": 2, "blank": 2}
    for heights in (press, press | {"pin": 4}, press | {"ram": 5}, dict.fromkeys("abcdef", 3)):
        places = stacked(heights)
        cells = {(column, row + k) for name, (column, row) in places.items() for k in range(heights[name])}
        assert len(cells) == sum(heights.values())  # none is used twice
        assert len(cells) >= 0.8 * (1 + max(c for c, _ in cells)) * (1 + max(r for _, r in cells))


def test_large_numbers_are_scaled_in_the_label(four_bar):
    motion = jn.solve(four_bar.mechanism.with_parameters(tau=0.2), np.linspace(0.0, 0.2, 41))
    axes = panels(draw(motion, ["psi"]))[4, 0]
    assert "$10^{6}$ rad/s$^4$" in axes.get_ylabel()
    assert max(abs(limit) for limit in axes.get_ylim()) < 1000


@pytest.mark.slow
def test_a_constant_is_drawn_flat_not_magnified(rsur):
    grid = panels(draw(rsur, ["B"]))
    low, high = grid[0, 0].get_ylim()
    assert high - low > 0.1
    still = jn.Mechanism(
        space="planar",
        bodies={"a": jn.Body([0.0, 0.0])},
        joints={"O": jn.planar.Revolute(("ground", "a"), point_i=[0, 0], point_j=[0, 0])},
        drivers={"theta": jn.drivers.CoordinateDriver(("ground", "a"), "angle", motion="0.5 + 0*t")},
        outputs={"angle": jn.outputs.AngleOutput("a")},
    )
    grid = panels(draw(jn.solve(still, [0.0, 1.0], order=1)))
    assert grid[0, 0].get_ylim() == pytest.approx((0.45, 0.55))
    assert grid[1, 0].get_ylim() == pytest.approx((-1.0, 1.0))


def test_instants_not_solved_are_left_out(four_bar):
    motion = jn.solve(four_bar.mechanism.with_parameters(AB=0.08), np.linspace(0, 2, 41), order=1, strict=False)
    assert (motion.status != 0).any()
    axes = panels(draw(motion, ["psi"]))[0, 0]
    assert np.isnan(axes.get_lines()[0].get_ydata()).any()
    assert len(axes.patches) >= 1


def test_one_instant_and_order_zero_can_be_drawn(four_bar):
    figure = draw(jn.solve(four_bar.mechanism, [0.5], order=0))
    assert panels(figure).shape == (1, 2)
    figure.canvas.draw()


def test_dollars_in_a_title_are_not_mathematics(four_bar, tmp_path):
    import dataclasses

    mechanism = dataclasses.replace(four_bar.mechanism, title="costs $5, or $6_{ \u4e2d")
    save(draw(jn.solve(mechanism, [0.0, 0.1], order=0)), tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 1000


@pytest.mark.slow
@pytest.mark.parametrize("example, outputs", [("four_bar", ["psi"]), ("rsur", ["psi", "B", "C", "coupler_spin"])])
def test_the_file_has_ink_in_every_column(example, outputs, request, tmp_path):
    path = tmp_path / "figure.png"
    save(draw(request.getfixturevalue(example), outputs), path)
    pixels = matplotlib.image.imread(path)[..., :3]
    assert pixels.shape[1] > 900
    colored = np.ptp(pixels, axis=2) > 0.3
    for part in np.array_split(colored, len(outputs), axis=1):
        assert part.mean() > 1e-3


@pytest.mark.slow
def test_unknown_outputs_and_none_at_all_are_reported(four_bar):
    import dataclasses

    with pytest.raises(jn.errors.MechanismError, match="did you mean 'psi'"):
        draw(four_bar, ["psy"])
    bare = dataclasses.replace(four_bar.mechanism, outputs={})
    with pytest.raises(jn.errors.MechanismError, match="nothing to draw"):
        draw(jn.solve(bare, [0.0, 0.1], order=0))


@pytest.mark.parametrize("name", ["figure.gif", "figure", "none/figure.png", "."])
def test_paths_that_cannot_be_written_are_refused(tmp_path, name):
    with pytest.raises(jn.errors.OutputError):
        check_figure(tmp_path / name)


def test_symbols():
    assert symbol("theta_2", 1) == r"$\dot{\theta}_{2}$"
    assert symbol("C", 0, "y") == "$C_{y}$"
    assert symbol("rod1_angle", 2) == ""
    assert symbol("coupler_point", 0, "x") == "$x$"
    assert symbol("x1", 6) == "$x_{1}^{(6)}$"


def test_units_and_scales():
    assert unit_label("rad/s", 2) == "rad/s$^3$"
    assert unit_label("m", 10) == "m/s$^{10}$"
    assert unit_label("m", 1, -6) == r"$\mu $m/s"
    assert unit_label("m", 6, 3) == "$10^{3}$ m/s$^6$"
    assert scale_of(np.array([np.nan, -2500.0])) == 3
    assert scale_of(np.array([np.nan])) == 0


def test_a_long_title_stays_within_the_figure():
    title = "Acceleration energies of orders 1 to 3 (equations 141-143 of Negrean 2025), WMQ"
    with style():
        figure = blank_figure(6.0, 3.0, title)
        figure.subplots()
        figure.draw_without_rendering()
        extent = figure._suptitle.get_window_extent()
    assert extent.x0 > 0
    assert extent.x1 < 6.0 * figure.dpi


def test_scales_are_round_numbers_and_constants_are_not_magnified():
    assert [rounded_down(x) for x in (0.0499, 0.05, 1.9e-7, 3e8)] == pytest.approx([0.02, 0.05, 1e-7, 2e8])
    assert axis_range(np.array([3.0, 3.0])) == pytest.approx((2.7, 3.3))
    assert axis_range(np.array([3.0, np.nan, 5.0]), 0.1) == pytest.approx((2.8, 5.2))
    assert axis_range(np.array([1e-17, -1e-17]), size=2.0) == pytest.approx((-0.2, 0.2))
