"""Values that are written as people write them elsewhere: what is wrong with them is said, and what to write."""

import re

import pytest

from jounce.errors import JounceError
from jounce.units.dimensions import ANGLE, TIME
from jounce.units.values import parse_value


@pytest.mark.parametrize(
    "text, words",
    [
        ("6000 rpm*t", "'t' would be a unit, too; give '6000 rpm' as a parameter, such as c: 6000 rpm, and write c*t"),
        ("6000 rpm * t", "'t' would be a unit, too"),
        ("3 mm/s*t", "give '3 mm/s' as a parameter, such as c: 3 mm/s, and write c*t"),
        ("600 U/min*t", "give '600 U/min' as a parameter, such as c: 600 U/min, and write c*t"),
        ("30 deg/s*t", "give '30 deg/s' as a parameter"),
        ("2 mm / t", "give '2 mm' as a parameter, such as c: 2 mm, and write c/t"),
        ("3 N*m/(rad*t)", "give it as a parameter, and write its name here"),
        ("2pi t", "a product needs its *, as in 2*pi*t"),
        ("1,000 mm", "write 1.000 mm or 1000 mm"),
        ("0.3 in + 2 mm", "a number with a unit must stand alone: '0.3 in' cannot be a part of an expression"),
        ("2*(5 mm + a)", "'5 mm' cannot be a part of an expression; define a parameter with this value"),
        ("4,5 mm", "write 4.5 mm"),
        ("-4,5", "write -4.5"),
        ("12,5 N*m/rad", "write 12.5 N*m/rad"),
        ("45 milimeter", "unknown unit 'milimeter'; did you mean 'millimeter'?"),
        ("2 secnds", "unknown unit 'secnds'; did you mean 'seconds'?"),
    ],
)
def test_what_is_said(text, words):
    with pytest.raises(JounceError, match=re.escape(words)):
        parse_value(text, "angle" if "rpm" in text else "any", ["a"], {}, {"t": TIME})


@pytest.mark.parametrize(
    "text, value", [("5 t", 5000.0), ("2 t/m", 2000.0), ("3 kg*m^2", 3.0), ("45 millimeter", 0.045)]
)
def test_where_no_law_is_meant_a_tonne_is_one(text, value):
    assert parse_value(text).value == value


def test_degrees_within_an_expression_keep_their_hint():
    with pytest.raises(JounceError, match=r"a product needs its \*, as in 30\*deg"):
        parse_value("w*t - 180 deg", "angle", ["w"], {"w": (("angle", 1), ("time", -1))}, {"t": TIME})
    assert parse_value("w*t - 180*deg", "angle", ["w"], {}, {"t": TIME}).dimension in (None, ANGLE)
