"""Laws of angles in degrees, of mechanisms that are built in Python: told once, where they are first solved."""

import dataclasses
import warnings
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce.mechanism.laws.law_checks import check_laws

T = np.linspace(0.0, 2.0, 21)
GROUND = ("ground", "rod")


def rod(motion, **parts):
    whole = {
        "space": "planar",
        "bodies": {"rod": jn.Body([0, 0], mass=1.0, inertia=0.1)},
        "joints": {"pin": jn.planar.Revolute(GROUND, [0, 0], [0, 0])},
        "drivers": {"motor": jn.drivers.CoordinateDriver(GROUND, "angle", motion=motion)},
        "outputs": {"angle": jn.outputs.AngleOutput("rod")},
    }
    return jn.Mechanism(**(whole | parts))


def looked_at(mechanism, times=T):
    """Look at laws as solutions and simulations do before they begin."""
    check_laws(mechanism, times, 4, forces=False)


def unit_warnings(call):
    """Return the warnings of units by a call that name this file."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        call()
    return [str(x.message) for x in found if x.category is jn.errors.UnitWarning and x.filename == __file__]


SWING = "drivers.motor.motion: goes from -30 to 90 rad, 19 turns: degrees? A number without a unit is in SI"


@pytest.mark.parametrize(
    "motion, words",
    [
        ("30.5 + 60*sin(pi*t) - 0.5", SWING),
        (lambda t: 30 + 60 * jnp.sin(np.pi * t), SWING),
        (lambda t: jnp.where(t > -1.0, 30 + 60 * jnp.sin(np.pi * t), 0.0), SWING),
        (lambda t: 30 + 60 * jnp.dot(jnp.sin(jnp.stack([np.pi * t, 0.0])), jnp.ones(2)), SWING),  # of one instant only
        (jn.laws.motion_profile("cycloidal", 0.0, 90.0, 1.0), "goes from 0 to 90 rad, 14 turns: degrees?"),
        (90, "90 rad is 14 turns: 90 deg?"),
        ("60 + 360*t", "60 rad is 9.5 turns: 60 deg?"),
        (jn.laws.FollowingMotion(
            jn.laws.SplineMotion(np.linspace(0, 360, 9), np.linspace(0, 1, 9), beyond="hold"), "180*t"),
         "goes on over 360 rad of its leader, 57 turns: degrees?"),
    ],
)  # fmt: skip
def test_a_law_in_degrees_is_reported_once(motion, words):
    mechanism = rod(motion)
    (found,) = unit_warnings(lambda: looked_at(mechanism))
    assert words in found
    other = dataclasses.replace(mechanism, outputs={"tip": jn.outputs.PointOutput("rod", [1.0, 0.0])})
    assert not unit_warnings(lambda: (looked_at(mechanism), looked_at(other, 2 * T)))


def test_solutions_and_simulations_tell_it():
    mechanism = rod("size*sin(pi*t)", parameters={"size": 1.0})
    assert not unit_warnings(lambda: jn.solve(mechanism, T, order=0))
    (found,) = unit_warnings(lambda: jn.solve(mechanism.with_parameters(size=60.0), T, order=0))
    assert "goes from -60 to 60 rad" in found

    def run():
        with pytest.raises(jn.errors.MechanismError, match="mass"):
            jn.simulate(rod("60*sin(pi*t)", joints={}, bodies={"rod": jn.Body([0, 0])}), T)

    assert len(unit_warnings(run)) == 1


@pytest.mark.parametrize(
    "motion", ["2*pi*50*t", "360*t", "60*deg*sin(t)", "3*sin(t)", lambda t: 100 * t, lambda t: 20 * np.pi * jnp.sin(t)]
)
def test_a_law_in_rad_is_not_doubted(motion):
    looked_at(rod(motion))  # warnings are errors here


def test_a_length_is_no_angle():
    sliding = jn.drivers.CoordinateDriver(GROUND, "x", motion="30 + 60*sin(pi*t)")
    joints = {"slide": jn.planar.Prismatic(GROUND, [0, 0], [0, 0], [1, 0], [1, 0])}
    looked_at(rod("t", joints=joints, drivers={"motor": sliding}))  # warnings are errors here


def test_what_a_file_reported_is_not_reported_again(tmp_path):
    path = tmp_path / "four_bar.yaml"
    text = Path("examples/four_bar.yaml").read_text()
    path.write_text(text.replace("motion: 30*deg + 60*deg*sin", "motion: 1 + 60*sin"))
    with pytest.warns(jn.errors.UnitWarning, match="four_bar.yaml, line"):
        mechanism = jn.load(path)
    assert not unit_warnings(lambda: looked_at(mechanism))
    path.write_text(text.replace("motion: 30*deg + 60*deg*sin(2*pi*t/tau)", "motion: {samples: law.csv}"))
    rows = "".join(f"{t},{30 * np.sin(np.pi * t)}\n" for t in np.linspace(0, 2, 101))
    (tmp_path / "law.csv").write_text(f"time [s],angle [rad]\n{rows}")
    meant = jn.load(path)  # in rad, as the file says
    assert not unit_warnings(lambda: looked_at(dataclasses.replace(meant, title="other")))
