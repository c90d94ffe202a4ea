"""Arrays and settings that mean something else than plain numbers, from public trackers of NumPy, JAX and xarray.

Each test names its source, and says what is right and how that is known.
"""

import subprocess
import sys

import numpy as np
import pandas
import pytest

import jounce as jn

HANGING = jn.Robot(
    "pendulum",
    [jn.Link("base"), jn.Link("rod", jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 0.1, 0.1]))],
    [jn.Joint("pin", "base", "rod", axis=[0, -1, 0])],
)


def crank(motion="2*t"):
    """Return a crank that a motor turns."""
    return jn.Mechanism(
        space="planar",
        bodies={"crank": jn.Body([0, 0])},
        joints={"O": jn.planar.Revolute(("ground", "crank"), [0, 0], [0, 0])},
        drivers={"motor": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", motion=motion)},
        outputs={"angle": jn.outputs.AngleOutput("crank")},
    )


def test_masked_samples_are_refused():
    """NumPy issues 26669 and 18675, JAX issue 13795: asarray drops masks in silence."""
    q = np.ma.masked_array(np.zeros((2, 3, 1)), mask=[[[True], [False], [False]]] * 2)
    with pytest.raises(jn.JounceError, match="mask"):
        jn.inverse_dynamics(HANGING, q)
    with pytest.raises(jn.JounceError, match="mask"):
        jn.solve(crank(), np.ma.masked_array([0.0, 1.0, 2.0], mask=[False, True, False]))
    unmasked = np.ma.masked_array([0.0, 1.0], mask=False)  # nothing is hidden
    np.testing.assert_allclose(jn.solve(crank(), unmasked).outputs["angle"][:, 0], [0.0, 2.0], atol=1e-14)


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
def test_time_differences_are_seconds(unit):
    """xarray issue 1621 and others: times come back as timedelta64; 500 ms are half a second, not 500."""
    times = np.array([0, 500], dtype="timedelta64[ms]").astype(f"timedelta64[{unit}]")
    np.testing.assert_allclose(jn.solve(crank(), times, order=1).outputs["angle"][:, 0], [0.0, 1.0], atol=1e-14)


def test_pandas_time_differences_are_seconds():
    """A log whose index is a TimedeltaIndex (pandas); its first differences are seconds."""
    index = pandas.to_timedelta([0, 250, 500], unit="ms")
    found = jn.solve(crank(), index, order=1).outputs["angle"][:, 0]
    np.testing.assert_allclose(found, [0.0, 0.5, 1.0], atol=1e-14)


def test_dates_are_no_seconds():
    """A column of stamps (datetime64) where seconds are meant: 2024 is not the number of a second."""
    with pytest.raises(jn.JounceError):
        jn.solve(crank(), np.array(["2024-01-01", "2024-01-02"], dtype="datetime64[s]"))


@pytest.mark.parametrize("values", [["0", "1"], [False, True], [0.0, None], [0.0, 1j]])
def test_text_truth_values_and_objects_are_no_numbers(values):
    """A column read as text or as truth values by a table reader."""
    with pytest.raises(jn.JounceError):
        jn.solve(crank(), values)


def test_the_host_keeps_its_precision():
    """pymbar issue 496, tlm_adjoint pull 596, pmwd issue 33: an import switched all of JAX to double precision.

    A float32 network beside this library keeps its type, and torques stay right to double precision.
    """
    script = """
import jax, jax.numpy as jnp, numpy as np
import jounce as jn
rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 0.1, 0.1])
pin = jn.Joint("pin", "base", "rod", axis=[0, -1, 0])
arm = jn.Robot("pendulum", [jn.Link("base"), jn.Link("rod", rod)], [pin])
for setting in (False, True, False):
    jax.config.update("jax_enable_x64", setting)
    tau = jn.inverse_dynamics(arm, np.array([[[0.3], [0.0], [0.0]]]))
    assert abs(tau[0, 0, 0] - 9.81 * 0.5 * np.cos(0.3)) < 1e-14, tau
    assert jax.config.jax_enable_x64 == setting
    assert jnp.ones(3).dtype == (jnp.float64 if setting else jnp.float32)
"""
    done = subprocess.run([sys.executable, "-c", "import jax, jounce\nassert not jax.config.jax_enable_x64\n" + script])
    assert done.returncode == 0
