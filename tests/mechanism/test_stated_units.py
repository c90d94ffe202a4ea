"""Units of parameters that are given in Python suit where they are used, by the rules of files."""

import jax
import numpy as np
import pytest

import jounce as jn
from jounce.errors import UnitError, UnsupportedError


def crank(parameters, motion="t", tip=("a", 0), law="0", **body):
    pin = jn.planar.Revolute(("ground", "crank"), [0, 0], [0, 0])
    lift = "1 + lift*t/turn" if "turn" in parameters else "1"
    follower = jn.drivers.CoordinateDriver(("ground", "slider"), "y", lift)
    return jn.Mechanism(
        space="planar",
        parameters=parameters,
        bodies={"crank": jn.Body([0, 0], **body), "slider": jn.Body([0, 1])},
        joints={
            "O": pin,
            "guide": jn.planar.Prismatic(("ground", "slider"), [0, 0], [0, 0], [0, 1], [0, 1]),
            "cam": jn.joints.Cam(follower, pin),
        },
        drivers={"theta": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", motion)},
        forces={"brake": jn.forces.Torque(("ground", "crank"), law)},
        outputs={"tip": jn.outputs.PointOutput("crank", list(tip))},
    )


@pytest.mark.parametrize(
    "parameters, uses, where",
    [
        ({"a": "5 deg"}, {}, "outputs.tip.point"),
        ({"a": "5 cm", "w": "60 rpm"}, {"motion": "w"}, "drivers.theta.motion"),
        ({"a": "5 cm"}, {"mass": "a"}, "bodies.crank.mass"),
        ({"a": "5 cm", "k": "3 N/m"}, {"law": "-k*x"}, "forces.brake.law"),
        ({"a": "5 cm", "b": "a", "c": "-b"}, {"motion": "c"}, "drivers.theta.motion"),
        ({"a": "5 cm", "b": "2 s", "c": "a + b"}, {}, "parameters.c"),
    ],
)
def test_a_unit_that_does_not_suit_its_use_is_refused_where_it_is_used(parameters, uses, where):
    with pytest.raises(UnitError) as caught:
        crank(parameters, **uses)
    assert caught.value.name == where


def test_units_that_suit_are_converted_and_kept_for_new_values():
    given = {"a": "5 cm", "w": "60 rpm", "k": "2 N*m/rad", "m": "2 kg", "lift": "3 mm", "turn": "360 deg"}
    machine = crank(given, motion="w*t", law="-k*x", mass="m", inertia="m*a**2/3")
    plain = crank({"a": 0.05, "w": 2 * np.pi, "k": 2.0, "m": 2.0, "lift": 0.003, "turn": 2 * np.pi}, motion="w*t")
    tips = [jn.solve(one, [0.1, 0.2], order=2).outputs["tip"] for one in (machine, plain)]
    np.testing.assert_array_equal(*tips)
    assert machine.with_parameters(a="40 mm").parameters["a"] == 0.04
    with pytest.raises(UnitError, match="is an angle, but the parameter is a length"):
        machine.with_parameters(a="40 deg")


def test_a_mechanism_with_traced_values_is_not_written(tmp_path):
    def written(length):
        jn.write_mechanism(crank({"a": length}), tmp_path / "crank.yaml")
        return length

    with jax.enable_x64(True), pytest.raises(UnsupportedError, match="write_mechanism cannot yet be used"):
        jax.grad(written)(0.05)
    assert not (tmp_path / "crank.yaml").exists()
