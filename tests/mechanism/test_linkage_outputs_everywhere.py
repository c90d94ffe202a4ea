"""Instant centers and derivatives of outputs in files, batches, gradients, traces and simulations."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn

TIMES = [0.1, 0.2, 0.3]
OUTPUTS = {
    "theta": jn.outputs.AngleOutput("crank"),
    "psi": jn.outputs.AngleOutput("rocker"),
    "ratio": jn.outputs.DerivativeOutput("psi", "theta"),
    "second": jn.outputs.DerivativeOutput("psi", "theta", 2),
    "pole": jn.outputs.InstantCenterOutput(("crank", "rocker")),
}


def four_bar(**values):
    made = jn.load("examples/four_bar.yaml")
    return dataclasses.replace(made, outputs=OUTPUTS).with_parameters(**values)


def test_a_file_has_them_again(tmp_path):
    jn.write_mechanism(four_bar(), tmp_path / "again.yaml")
    text = (tmp_path / "again.yaml").read_text()
    assert "of: psi" in text
    again = jn.load(tmp_path / "again.yaml")
    assert {name: (type(x), x.unit) for name, x in again.outputs.items()} == {
        name: (type(x), x.unit) for name, x in four_bar().outputs.items()
    }
    assert again.shown_units.of("rad/m", "")[0] == "rad/m"
    (tmp_path / "bad.yaml").write_text(text.replace("of: psi", "of: psy"))
    with pytest.raises(jn.errors.MechanismFileError, match="psy") as caught:
        jn.load(tmp_path / "bad.yaml")
    assert caught.value.line is not None


@pytest.mark.slow
def test_batches_and_gradients_have_them():
    lengths = [0.14, 0.145]
    found = jn.solve_batch(four_bar(), {"BC": lengths}, TIMES, order=2)
    for k, length in enumerate(lengths):
        single = jn.solve(four_bar(BC=length), TIMES, order=2)
        for name in OUTPUTS:
            np.testing.assert_allclose(found[name][k], single.outputs[name], rtol=1e-9, atol=1e-10)

    def last(length):
        return jn.solve(four_bar(BC=length), jnp.array(TIMES), order=2).outputs["second"][-1]

    slope = jax.jacfwd(last)(0.142)
    high, low = (jn.solve(four_bar(BC=0.142 + h), TIMES, order=2).outputs["second"][-1] for h in (1e-6, -1e-6))
    np.testing.assert_allclose(slope, (high - low) / 2e-6, rtol=1e-6)


@pytest.mark.slow
def test_a_trace_has_the_same_ratio_whatever_moves_it():
    curve = jn.trace(four_bar())
    theta, psi = curve.outputs["theta"], curve.outputs["psi"]
    moving = np.abs(theta[:, 1]) > 0.1
    np.testing.assert_allclose(curve.outputs["ratio"][moving, 0], (psi[:, 1] / theta[:, 1])[moving], rtol=1e-9)


@pytest.mark.slow
def test_free_simulations_have_them_one_by_one_and_side_by_side():
    made = jn.load("examples/four_bar.yaml")
    bodies = {"crank": (0.5, 1e-4, [0.02, 0]), "rocker": (1.0, 4e-3, [0.1, 0])}
    heavy = {
        name: dataclasses.replace(made.bodies[name], mass=mass, inertia=inertia, center_of_mass=center)
        for name, (mass, inertia, center) in bodies.items()
    }
    outputs = OUTPUTS | {
        "energy": jn.outputs.KineticEnergyOutput(),
        "push": jn.outputs.DerivativeOutput("energy", "psi"),
    }
    free = dataclasses.replace(made, bodies=heavy, drivers={}, gravity=[0, -9.81], outputs=outputs)
    free = dataclasses.replace(
        free, initial={"start": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", "0.5+3*t")}
    )
    times = np.linspace(0.0, 0.1, 5)
    one = jn.simulate(free, times, order=2)
    psi, theta = one.outputs["psi"], one.outputs["theta"]
    np.testing.assert_allclose(one.outputs["ratio"][:, 0], psi[:, 1] / theta[:, 1], rtol=1e-12)
    np.testing.assert_allclose(one.outputs["push"][:, 0], one.outputs["energy"][:, 1] / psi[:, 1], rtol=1e-9)
    many = jn.simulate_batch(dataclasses.replace(free, outputs=OUTPUTS), {"BC": [0.1423]}, times, order=2)
    found = {name: values[0] for name, values in many.outputs.items()}
    for its in (found, one.outputs):
        psi, theta, ratio = its["psi"], its["theta"], its["ratio"]
        np.testing.assert_allclose(ratio[:, 0], psi[:, 1] / theta[:, 1], rtol=1e-11)
        rate = (psi[:, 2] * theta[:, 1] - psi[:, 1] * theta[:, 2]) / theta[:, 1] ** 2
        np.testing.assert_allclose(ratio[:, 1], rate, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(its["second"][:, 0], rate / theta[:, 1], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found["pole"][:, 0], one.outputs["pole"][:, 0], rtol=1e-6, atol=1e-9)


@pytest.mark.slow
def test_a_family_that_leaves_outputs_out_keeps_what_a_derivative_is_of():
    made = four_bar()
    single = dataclasses.replace(made, outputs={"ratio": made.outputs["ratio"]})
    assert jn.solve(single, TIMES, order=1).outputs["ratio"].shape == (3, 2)
    other = dataclasses.replace(made, outputs={**made.outputs, "psi": jn.outputs.AngleOutput("crank")})
    np.testing.assert_allclose(jn.solve(other, TIMES, order=1).outputs["ratio"], [[1, 0]] * 3, atol=1e-12)
