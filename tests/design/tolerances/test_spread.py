"""Tolerances against closed forms: a crank whose tip is a product of two parameters, and designs that cannot be."""

import json

import numpy as np
import pytest

import jounce as jn
from jounce.cli import main
from jounce.design.tolerances.spread import column_of
from jounce.errors import JounceError
from jounce.plot import draw_bands
from jounce.reporting.facts.spread_facts import columns_of

TIME = np.linspace(0.0, 2.0, 9)
L, K = 0.2, 1.5
SIGMA_L, SIGMA_K = 0.004, 0.06
VARY = {"L": f"normal:{SIGMA_L * 1000} mm", "K": ("uniform:%r" % (SIGMA_K * 3**0.5))}
CRANK = """
title: Crank
space: planar
parameters: {L: 20 cm, K: 1.5, reach: 1}
bodies:
  crank: {position: [0, 0]}
joints:
  O: {type: revolute, bodies: [ground, crank], points: [[0, 0], [0, 0]]}
drivers:
  turn: {type: coordinate, bodies: [ground, crank], coordinate: angle, motion: acos(reach) + 0.5*t}
outputs:
  tip: {body: crank, point: [L*K, 0]}
  angle: {body: crank, quantity: angle}
time: {start: 0, stop: 2, step: 0.25}
"""


@pytest.fixture(scope="module")
def crank(tmp_path_factory):
    path = tmp_path_factory.mktemp("crank") / "crank.yaml"
    path.write_text(CRANK)
    return path


@pytest.fixture(scope="module")
def spread(crank):
    return jn.tolerance(jn.load(crank), VARY, TIME, 2, samples=4096, indices=True)


def turned(time):
    """The tip over L K: cos and sin of half the time, with two derivatives; (time, derivative, component)."""
    c, s = np.cos(0.5 * time), np.sin(0.5 * time)
    return np.moveaxis(np.array([[c, s], [-0.5 * s, 0.5 * c], [-0.25 * c, -0.25 * s]]), 2, 0)


@pytest.mark.slow
def test_gradients_and_first_order_spread_are_those_of_the_product(spread):
    unit = turned(TIME)
    assert np.allclose(spread["tip"], L * K * unit, atol=1e-14)
    assert np.allclose(spread["tip_gradient"].sel(parameter="L"), K * unit, atol=1e-12)
    assert np.allclose(spread["tip_gradient"].sel(parameter="K"), L * unit, atol=1e-12)
    first_order = np.hypot(K * SIGMA_L, L * SIGMA_K)
    assert np.allclose(spread["tip_linear_std"], first_order * np.abs(unit), atol=1e-14)
    share = spread["tip_share"].sel(parameter="L").values[np.abs(unit) > 1e-9]
    assert np.allclose(share, (K * SIGMA_L / first_order) ** 2)
    assert (spread["angle_linear_std"].values == 0).all()
    assert (spread["angle_share"].values == 0).all()
    assert spread["deviation"].values == pytest.approx([SIGMA_L, SIGMA_K])


@pytest.mark.slow
def test_samples_have_the_variance_of_the_product_and_the_indices_its_parts(spread):
    unit = turned(TIME)
    parts = np.array([K * SIGMA_L, L * SIGMA_K, SIGMA_L * SIGMA_K]) ** 2
    assert np.allclose(spread["tip_mean"], L * K * unit, atol=1e-5)
    assert np.allclose(spread["tip_std"], np.sqrt(parts.sum()) * np.abs(unit), rtol=2e-3, atol=1e-12)
    whole = np.sort(np.random.default_rng(0).normal(L, SIGMA_L, 400_000) * np.random.default_rng(1).uniform(
        K - SIGMA_K * 3**0.5, K + SIGMA_K * 3**0.5, 400_000
    ))  # fmt: skip
    low, high = np.percentile(whole, [2.5, 97.5])
    assert np.allclose(spread["tip_low"][0, 0, 0], low, rtol=2e-3)
    assert np.allclose(spread["tip_high"][0, 0, 0], high, rtol=2e-3)
    assert (spread["solved"].values == 4096).all()
    first = spread["tip_peak_first_order"].sel(derivative=0, component="x").values
    total = spread["tip_peak_total_order"].sel(derivative=0, component="x").values
    assert np.allclose(first, parts[:2] / parts.sum(), atol=0.02)
    assert np.allclose(total, (parts[:2] + parts[2]) / parts.sum(), atol=0.02)
    assert np.allclose(spread["tip_peak_std"].sel(component="x")[0], np.sqrt(parts.sum()), rtol=2e-3)


@pytest.mark.slow
def test_designs_that_cannot_be_are_counted_and_left_out(crank):
    mechanism = jn.load(crank).with_parameters(reach=0.9)
    vary = {"reach": (0.7, 1.1)}  # above 1 there is no angle
    found = jn.tolerance(mechanism, vary, TIME, 2, of=["angle"], samples=256, linear=False)
    assert 150 < int(found["solved"].min()) < 256
    assert "angle_linear_std" not in found
    assert "tip" not in found
    reached = np.linspace(0.7, 1.0, 20001)
    assert float(found["angle_mean"][0, 0]) == pytest.approx(np.arccos(reached).mean(), rel=5e-3)
    with pytest.raises(JounceError, match="designs lock or cannot be assembled"):
        jn.tolerance(mechanism, vary, TIME, 2, of=["angle"], samples=64, linear=False, indices=True)


@pytest.mark.slow
def test_the_command_tells_what_matters_and_draws_it(crank, tmp_path, capsys, spread):
    command = ["tolerance", str(crank), "--vary", f"L=normal:{SIGMA_L}", "--vary", VARY["K"].join(["K=", ""])]
    command += ["--output", "tip_x,tip_d2,angle", "--samples", "64"]
    out, figure = tmp_path / "spread.csv", tmp_path / "bands.svg"
    assert main([*command, "--out", str(out), "--figure", str(figure)]) == 0
    text = capsys.readouterr().out
    assert "64 designs, of which all were solved" in text
    assert "K 80 %, L 20 %" in text
    assert figure.read_text().count("<svg") == 1
    heading = out.read_text().splitlines()[0].split(",")
    assert {"time", "tip_x", "tip_x_d1", "tip_std_x_d1", "tip_linear_std_y"} <= set(heading)
    assert main([*command, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    from jsonschema import Draft202012Validator

    from jounce.reporting.json.result_schema import result_schema

    Draft202012Validator(result_schema()).validate(result)
    columns = [(x["output"], x["derivative"]) for x in result["spread"]]
    assert columns == [("tip_x", 0), ("tip_x", 2), ("tip_y", 2), ("angle", 0)]
    every = [(name, label, k) for name, label in (("tip", "x"), ("tip", "y"), ("angle", "")) for k in range(3)]
    assert columns_of(spread, None) == every  # one component after the other, as in other tables
    assert len(draw_bands(spread, [("tip", "y", 2), ("angle", "", 0)]).axes) == 6


@pytest.mark.slow
def test_euler_angles_next_to_half_a_turn_have_the_spread_of_any_others():
    """The rod is turned by e + t/2 about z, and e is 180 degrees, give or take."""
    rod = jn.Body([0, 0, 0], orientation=[0, 0, 0, 1])
    rod_pin = jn.spatial.Revolute(("ground", "rod"), [0, 0, 0], [0, 0, 0], [0, 0, 1], [0, 0, 1])
    vectors = {"vector_i": [1, 0, 0], "vector_j": [1, 0, 0]}
    motor = jn.drivers.RotationDriver(("ground", "rod"), [0, 0, 1], motion="e + 0.5*t", **vectors)
    mechanism = jn.Mechanism(
        space="spatial",
        parameters={"e": np.pi},
        bodies={"rod": rod},
        joints={"O": rod_pin},
        drivers={"turn": motor},
        outputs={"attitude": jn.outputs.EulerAnglesOutput("rod", "zyx")},
    )
    spread = jn.tolerance(mechanism, {"e": "normal:0.02"}, [0.0, 1.0], 0, samples=16, linear=False)
    alpha = spread.sel(euler_angle="alpha", derivative=0)
    assert np.allclose(alpha["attitude_std"], 0.02, rtol=0.1)
    assert np.allclose(alpha["attitude_mean"], alpha["attitude"], atol=3e-3)
    assert float(alpha["attitude_peak_std"]) == pytest.approx(0.02, rel=0.1)


def test_columns_have_names(crank):
    mechanism = jn.load(crank)
    assert column_of(mechanism, "tip") == ("tip", "", 0)
    assert column_of(mechanism, "tip_y_d12") == ("tip", "y", 12)
    assert column_of(mechanism, "angle_d3") == ("angle", "", 3)
    for name in ("tap", "tip_z", "tip_z_d", "tip_q", "_d3", "tip_d333"):
        with pytest.raises(JounceError, match="no output has this name"):
            column_of(mechanism, name)


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"vary": {"X": "normal:1"}}, "no parameter has this name"),
        ({"vary": {"L": "1cm:2cm:3"}}, "not a list"),
        ({"vary": {"L": "normal:1 kg"}}, "this is a mass"),
        ({"vary": {}}, "say what varies"),
        ({"of": ["tap"]}, "did you mean 'tip'"),
        ({"of": "tap"}, "got 'tap'; did you mean 'tip'"),  # one name, not its letters
        ({"samples": -1}, "whole number"),
        ({"samples": 0, "linear": False}, "^samples: nothing is left to compute, got 0; .*give samples"),
        ({"samples": 100, "indices": True}, "power of two"),
    ],
)
def test_what_is_refused(crank, changes, message):
    with pytest.raises(JounceError, match=message):
        jn.tolerance(jn.load(crank), **{"vary": VARY, "time": TIME, "order": 2} | changes)
