"""Values and units of mechanism files."""

import math
import subprocess
import sys

import hypothesis
import hypothesis.strategies as st
import pint
import pytest

from jounce.errors import ExpressionError, JounceError, UnitError
from jounce.io import units
from jounce.io.units import KINDS, check_dimension, describe_dimension, parse_unit, parse_value
from jounce.trajectory import Expression

REGISTRY = pint.UnitRegistry()
LENGTH, ANGLE, TIME = (((name, 1),) for name in ("length", "angle", "time"))


@pytest.mark.parametrize("name", sorted(set(units._COMMON) - {"rev"}))
def test_table_of_common_units_agrees_with_pint(name):
    size, dimension = parse_unit(name)
    factor, base = REGISTRY.get_base_units(name)
    assert math.isclose(float(size), factor, rel_tol=4e-16)
    names = {"meter": "length", "radian": "angle", "second": "time", "kilogram": "mass"}
    assert dict(dimension) == {names[unit]: power for unit, power in dict(base._units).items()}


@pytest.mark.parametrize(
    "raw, value",
    [
        (3, 3.0),
        (-0.5, -0.5),
        ("13.21 cm", 0.1321),
        ("13.21cm", 0.1321),
        ("4.00 cm", 0.04),
        ("0.3 mm", 0.0003),
        ("-2.5e1 mm", -0.025),
        ("1 in", 0.0254),
        ("30 deg", math.pi / 6),
        ("30 \N{DEGREE SIGN}", math.pi / 6),
        ("1 rev", 2 * math.pi),
        ("60 rpm", 2 * math.pi),
        ("9.81 m/s^2", 9.81),
        ("9.81 m/s**2", 9.81),
        ("2 kg * m ^ 2", 2.0),
        ("1 km/h", 1 / 3.6),
        ("5 m*s^-1", 5.0),
        ("3 \N{MICRO SIGN}m", 3e-6),
        ("2 nautical_mile", 3704.0),
        ("90 arcmin", math.pi / 120),
        ("1e-3", 1e-3),
        ("2*pi", 2 * math.pi),
        ("30*deg", math.pi / 6),
    ],
)
def test_values_are_turned_into_si(raw, value):
    assert math.isclose(parse_value(raw).value, value, rel_tol=3e-16)


@hypothesis.given(st.decimals(-1000, 1000, places=6))
def test_decimal_sizes_lose_nothing(number):
    assert parse_value(f"{number} cm").value == float(number.scaleb(-2))
    assert parse_value(f"{number} mm", "length").value == float(number.scaleb(-3))


@pytest.mark.parametrize(
    "raw, kind, words",
    [
        ("30 deg", "length", "expected a length, such as 5 cm, but the unit of '30 deg' is an angle"),
        ("30 cm", "angle", "expected an angle, such as 30 deg, but the unit of '30 cm' is a length"),
        ("3 s", "length", "is a time"),
        ("5 mm/rev", "length", "is length/angle"),
        ("1 kg", "inertia", "is a mass"),
        ("3 rad", "ratio", "expected a pure number"),
        ("9.81 m", "acceleration", "expected an acceleration, such as 9.81 m/s^2"),
        ("14.23 cmm", "length", "unknown unit 'cmm'; did you mean 'mm'?"),
        ("3 foo", "any", "unknown unit 'foo'"),
        ("3 degC", "any", "has no fixed zero"),
        ("1e400 m", "length", "must be a finite number"),
        ("1e999999999 m", "length", "must be a finite number"),
        ("1 light_year^99", "any", "unit out of range"),
        ("1 km^99*km^99", "any", "must be a finite number"),
        ("2 t", "angle", "a product needs its *, as in 2*t"),
        ("5 AB", "length", "a product needs its *, as in 5*AB"),
        (math.nan, "any", "must be a finite number"),
        (-math.inf, "any", "must be a finite number"),
        (10**400, "any", "must be a finite number"),
        ("nan", "any", "must be a finite number"),
        ("-.inf", "any", "must be a finite number"),
        (True, "any", "must be a number, a number with a unit, or an expression"),
        (None, "any", "must be a number"),
        ([1], "any", "must be a number"),
        ("x" * 2001, "any", "a value has at most 2000 characters"),
        ("tau", "length", "but the parameter 'tau' is a time"),
        ("2*tua", "any", "did you mean 'tau'?"),
    ],
)
def test_what_does_not_fit_is_refused(raw, kind, words):
    with pytest.raises((UnitError, ExpressionError)) as caught:
        parse_value(raw, kind, ["AB", "tau", "t"], {"tau": TIME})
    assert words in str(caught.value)


def test_a_unit_of_no_quantity_of_ours_keeps_its_dimension():
    assert parse_value("1 K", "any").dimension == (("kelvin", 1),)


def test_tiny_numbers_are_zero():
    assert parse_value("1e-999999999 m").value == 0.0


@hypothesis.given(st.text("0123456789.eE+-*/^() cmdegradstABpi", max_size=30))
def test_any_text_is_read_or_refused(text):
    try:
        value = parse_value(text, "length", ["AB"]).value
    except JounceError:
        return
    assert isinstance(value, Expression) or math.isfinite(value)


def test_expressions_keep_their_names():
    value = parse_value("AB/2", "length", ["AB"], {"AB": LENGTH})
    assert value.value == Expression("AB/2")
    assert parse_value("AB", "length", ["AB"], {"AB": LENGTH}).dimension == LENGTH


def test_angles_may_be_pure_numbers_but_lengths_may_not():
    check_dimension((), "angle", "it")
    check_dimension(ANGLE, "angle", "it")
    with pytest.raises(UnitError):
        check_dimension((), "length", "it")


def test_every_kind_is_worded():
    for words, allowed in KINDS.values():
        assert words
        assert all(describe_dimension(dimension) for dimension in allowed)


def test_usual_units_do_not_import_pint():
    code = "import sys; from jounce.io.units import parse_value as p; p('3 cm'); assert 'pint' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
