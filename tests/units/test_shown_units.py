"""Units in which results are shown."""

import math

import pytest

import jounce as jn
from jounce.units.shown_units import ShownUnits, derivative_unit, units_given

OUTPUTS = {"psi": "rad", "C": "m", "spin": "rad/s", "T": "N*m", "e": "1", "length": "rad"}


@pytest.mark.parametrize(
    "chosen, unit, name, label, factor",
    [
        ({"angle": "deg"}, "rad", "psi", "deg", 180 / math.pi),
        ({"angle": "deg"}, "rad/s^4", "psi", "deg/s^4", 180 / math.pi),
        ({"angle": "rev"}, "rad/s", "spin", "rev/s", 0.5 / math.pi),
        ({"spin": "rpm"}, "rad/s", "spin", "rpm", 30 / math.pi),
        ({"spin": "rpm"}, "rad/s^2", "spin", "rpm/s", 30 / math.pi),
        ({"length": "mm"}, "m/s^3", "C", "mm/s^3", 1000.0),
        ({"length": "mm"}, "N*m", "T", "N*m", 1.0),
        ({"length": "mm", "torque": "N*mm"}, "N*m/s", "T", "N*mm/s", 1000.0),
        ({"length": "mm", "C": "in"}, "m", "C", "in", 1 / 0.0254),
        ({"length": "mm", "C": "in"}, "m", "D", "mm", 1000.0),
        ({"angle": "deg"}, "1", "e", "1", 1.0),
        ({"energy": "kJ"}, "J/s^2", "", "kJ/s^2", 1e-3),
        ({"power": "kW"}, "W", "", "kW", 1e-3),
        ({"length": "deg"}, "rad", "length", "deg", 180 / math.pi),  # an output of that name goes first
    ],
)
def test_units_follow(chosen, unit, name, label, factor):
    found = ShownUnits(chosen, OUTPUTS).of(unit, name)
    assert found[0] == label
    assert found[1] == pytest.approx(factor, rel=1e-15)


@pytest.mark.parametrize(
    "chosen, name, words",
    [
        ({"angle": "mm"}, "units.angle", "measures a length, not an angle"),
        ({"angel": "deg"}, "units.angel", "did you mean 'angle'"),
        ({"length": "parsecs!"}, "units.length", "parsecs"),
        ({"spin": "deg"}, "units.spin", "not angle/time"),
        ({"time": "ms"}, "units.time", "no quantity"),
        ({"length": "2"}, "units.length", "must be a unit"),
    ],
)
def test_what_does_not_fit_is_named(chosen, name, words):
    with pytest.raises(jn.JounceError, match=words) as caught:
        ShownUnits(chosen, OUTPUTS)
    assert caught.value.name == name


def test_texts():
    assert units_given(["angle=deg, length = mm"]) == {"angle": "deg", "length": "mm"}
    with pytest.raises(jn.JounceError, match="more than once"):
        units_given(["angle=deg", "angle=rad"])
    assert derivative_unit("deg/s", 2) == "deg/s^3"
