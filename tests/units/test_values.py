"""Values and units of mechanism files."""

import math
import subprocess
import sys

import hypothesis
import hypothesis.strategies as st
import pint
import pytest

import jounce as jn
from jounce.errors import ExpressionError, JounceError, UnitError
from jounce.trajectory import Expression
from jounce.units.dimensions import KINDS, check_dimension, describe_dimension, dimension_of, si_unit
from jounce.units.table import COMMON
from jounce.units.values import parse_unit, parse_value

REGISTRY = pint.UnitRegistry()
LENGTH, ANGLE, TIME = (((name, 1),) for name in ("length", "angle", "time"))


@hypothesis.given(st.tuples(*[st.integers(-3, 3)] * 4))
def test_the_unit_of_a_dimension_is_read_back_as_one_of_it(powers):
    dimension = dimension_of(**dict(zip(("length", "angle", "time", "mass"), powers, strict=True)))
    if dimension:
        assert parse_unit(si_unit(dimension)) == (1, dimension)
        assert parse_value(f"2.5 {si_unit(dimension)}").value == 2.5


OWN = {"rev", "U", "r", "tr", "RPM", "mil", "PS", "CV", "kp"}  # what pint takes for something else, or does not know


@pytest.mark.parametrize("name", sorted(set(COMMON) - OWN))
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
        ("2e3", 2000.0),
        ("-1.5E3", -1500.0),
        ("2*pi", 2 * math.pi),
        ("0.36/pi", 0.36 / math.pi),
        ("1 / pi**2", 1 / math.pi**2),
        ("30*deg", math.pi / 6),
    ],
)
def test_values_are_turned_into_si(raw, value):
    assert math.isclose(parse_value(raw).value, value, rel_tol=3e-16)


@pytest.mark.parametrize("law", ["-2e3*v", "1e5*x", "2E3*v**3", "1e4*k*x", "2e3*k", "1e5/x", "1e2*e5"])
def test_the_exponent_of_a_number_is_no_unit(law):
    values = {"x": 0.5, "v": 0.25, "k": 3.0, "e5": 7.0}
    read = parse_value(law, names=["k", "e5"], variables={"x": None, "v": None})
    assert read.value.evaluate(values) == eval(law, {}, values)  # Python reads numbers in the same way


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
        ("1e400", "length", "a number too large at column 1"),
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
    code = "import sys, jounce.units.values as u; u.parse_value('3 cm'); assert 'pint' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize(
    "raw, same",
    [
        ("5 Nm", "5 N*m"),
        ("5 kNm", "5000 N*m"),
        ("5 mNm", "0.005 N*m"),
        ("5 Nmm", "0.005 N*m"),
        ("2 Ncm", "0.02 N*m"),
        ("2 Nm/rad", "2 N*m/rad"),
        ("2 Nms/rad", "2 N*m*s/rad"),
        ("2 Nm*s/rad", "2 N*m*s/rad"),
        ("2 Nm/(rad/s)", "2 N*m*s/rad"),
        ("4 rad/Nm", "4 rad/N/m"),
        ("3000 U/min", "3000 rpm"),
        ("3000 rev/min", "3000 rpm"),
        ("3000 r/min", "3000 rpm"),
        ("50 1/s", "50 Hz"),
        ("1 PS", "735.49875 W"),  # 75 kgf m/s
        ("1 kp", "9.80665 N"),
        ("1 mil", "0.001 in"),
        ("0.1 kgm^2", "0.1 kg*m^2"),
        ("0.1 kgm2", "0.1 kg*m^2"),
        ("120 gcm2", "1.2e-5 kg*m^2"),
        ("210 kN/mm2", "210 GPa"),
        ("3 m/s2", "3 m/s^2"),
        ("3 m/s\N{SUPERSCRIPT TWO}", "3 m/s^2"),
        ("3 s\N{SUPERSCRIPT MINUS}\N{SUPERSCRIPT ONE}", "3 Hz"),
        ("2 N m", "2 N*m"),
        ("2 N\N{MIDDLE DOT}m", "2 N*m"),
        ("3 N/(m*s)", "3 N/m/s"),
        ("5 Ns/m", "5 N*s/m"),
        ("1 ftlb", "1 ft*lbf"),
        ("5 percent", "0.05"),
        ("5 mins", "300 s"),
    ],
)
def test_engineers_spellings(raw, same):
    one, other = parse_value(raw), parse_value(same)
    assert math.isclose(one.value, other.value, rel_tol=3e-16)
    assert (one.dimension or ()) == (other.dimension or ())


@pytest.mark.parametrize(
    "unit, words",
    [
        ("tex", "has a dimension that no mechanism uses"),
        ("Ne", "has a dimension that no mechanism uses"),
        ("K", "has a dimension that no mechanism uses"),
        ("V", "has a dimension that no mechanism uses"),
        ("sr", "has a dimension that no mechanism uses"),
        ("bit", "has a dimension that no mechanism uses"),
        ("lx", "has a dimension that no mechanism uses"),
        ("degC", "has no fixed zero"),
        ("degF", "has no fixed zero"),
        ("EUR", "unknown unit 'EUR'"),
        ("MM", "did you mean 'mm'"),
        ("CM", "did you mean 'cm'"),
        ("KG", "did you mean 'kg'"),
        ("Kg", "did you mean 'kg'"),
        ("Mm", "did you mean 'mm'"),
        ("Deg", "did you mean 'deg'"),
        ("KN", "did you mean 'kN'"),
        ("ftroy_pound", "which nobody uses"),
        ("N/m s", "can be read in two ways"),
    ],
)
def test_units_that_no_mechanism_uses_are_refused(unit, words):
    with pytest.raises(UnitError, match=words):
        parse_value(f"5 {unit}")


def test_what_pint_makes_of_prefixes_is_not_taken_over():
    """A prefix before any of its 1,100 units makes words: femto troy pounds, deci pi, peta siemens."""
    for name in ("ftoz", "PSs", "dpica", "cft", "kh", "Gft", "mmi"):
        with pytest.raises(UnitError):
            parse_unit(name)


DIMENSIONS = {
    "BC": LENGTH,
    "L0": LENGTH,
    "phi": ANGLE,
    "tau": TIME,
    **{name: parse_unit(unit)[1] for name, unit in {"M": "Nm", "k": "N/m", "w": "rpm", "v0": "m/s", "m": "kg"}.items()},
}
VARIABLES = {"t": TIME, "x": LENGTH, "v": parse_unit("m/s")[1]}


@pytest.mark.parametrize(
    "text, kind",
    [
        ("-M", "torque"), ("M/BC", "force"), ("BC/2", "length"), ("BC*phi", "length"), ("BC + 0.1", "length"),
        ("sqrt(BC**2 + L0**2)", "length"), ("BC**(1/2)*L0**0.5", "length"), ("atan2(BC, L0)", "angle"),
        ("acos(BC/L0)", "angle"), ("phi/2 + 30*deg", "angle"), ("BC*sin(phi)", "length"), ("m*9.81", "force"),
        ("7850*BC**3", "mass"), ("m/12", "inertia"), ("m*(1 + BC**2)/12 + m/4", "inertia"), ("BC/L0", "length"),
        ("c*BC", "angle"), ("phi", "angle"), ("2.5*M", "force"),
        ("w*t", "angle"), ("60*t", "angle"), ("phi + t", "angle"), ("t - tau", "angle"), ("sin(t)", "length"),
        ("BC*sin(t)", "length"), ("BC*exp(-t/tau)", "length"), ("sin(2*pi*t/tau)", "angle"),
        ("exp(-(t - tau)**2)", "angle"),
        ("-k*x", "force"), ("-500*x", "force"), ("-500*(x - L0)", "force"), ("-x", "force"), ("-k*(x - L0)", "force"),
        ("-M*v/v0/BC", "force"), ("x - L0", "force"),
    ],
)  # fmt: skip
def test_expressions_whose_dimension_fits_or_is_not_known_are_taken(text, kind):
    names = [*DIMENSIONS, "c"]
    varying = VARIABLES if {"t", "x", "v"} & Expression(text).names else {}
    assert parse_value(text, kind, names, DIMENSIONS, varying).value == Expression(text)


@pytest.mark.parametrize(
    "text, kind, words",
    [
        ("-M", "force", "'-M' is a torque"),
        ("-M", "stiffness", "expected a stiffness"),
        ("BC/2", "angle", "'BC/2' is a length"),
        ("2*phi", "length", "'2\\*phi' is an angle"),
        ("BC + phi", "length", "adds an angle to a length"),
        ("M - k", "any", "adds a stiffness to a torque"),
        ("sin(BC)", "ratio", "the argument of sin in"),
        ("2**BC", "any", "an exponent in"),
        ("atan2(BC, tau)", "angle", "adds a time to a length"),
        ("atan2(BC, L0)", "length", "is an angle"),
        ("BC*L0", "length", "is an area"),
        ("30*deg", "length", "is an angle"),
        ("phi", "ratio", "the parameter 'phi' is an angle"),
        ("v0*t", "angle", "is a length"),
        ("BC*t", "length", "is length\\*time"),
        ("BC*sin(w*t)", "angle", "is a length"),
        ("sin(v0*t)", "angle", "the argument of sin"),
        ("-k*v", "force", "expected a force"),
        ("-k*(x - phi)", "force", "expected a force"),
        ("-M*x", "force", "expected a force"),
    ],
)
def test_a_parameter_is_checked_where_it_is_used(text, kind, words):
    varying = VARIABLES if {"t", "x", "v"} & Expression(text).names else {}
    with pytest.raises(UnitError, match=words):
        parse_value(text, kind, [*DIMENSIONS, "c"], DIMENSIONS, varying)


BRAKE = """
space: planar
parameters: {M: %s, twice: 2*M, half: M, arm: 20 cm, plain: 5}
bodies: {wheel: {mass: 1, inertia: 0.1}}
joints: {O: {type: revolute, bodies: [ground, wheel], points: [[0, 0], [0, 0]]}}
forces: {brake: {type: torque, bodies: [ground, wheel], law: %s}}
time: {start: 0, stop: 1, step: 0.5}
"""


def brake(folder, moment, law):
    path = folder / "brake.yaml"
    path.write_text(BRAKE % (moment, law))
    return jn.load(path)


def test_a_torque_in_newton_metres_is_one(tmp_path):
    assert brake(tmp_path, "5 Nm", "-M").parameter_values["M"] == 5.0
    assert brake(tmp_path, "5 kNm", "-M*sin(t)").parameter_values["M"] == 5000.0


@pytest.mark.parametrize("moment, law", [("5 N", "-M"), ("5 Nm", "-M/arm"), ("5 N", "-half"), ("5 tex", "-M*t")])
def test_a_parameter_of_another_dimension_is_refused_with_its_place(tmp_path, moment, law):
    with pytest.raises(jn.errors.MechanismFileError, match=r"line [36], (forces\.brake\.law|parameters\.M)"):
        brake(tmp_path, moment, law)


def test_new_values_take_units_and_are_checked(tmp_path):
    known = brake(tmp_path, "5 Nm", "-M")
    changed = known.with_parameters(M="2 kNm").parameter_values
    assert changed == {**known.parameter_values, "M": 2000, "twice": 4000, "half": 2000}
    assert known.with_parameters(M="3", arm="twice/1e3").parameter_values["arm"] == 0.006
    assert known.with_parameters(M=7.0).parameter_values["M"] == 7.0
    for wrong in ({"M": "2 N"}, {"arm": "3 deg"}, {"arm": "2 MM"}, {"half": "arm"}, {"M": "arm + half"}):
        with pytest.raises(UnitError, match=f"parameters.{next(iter(wrong))}: "):
            known.with_parameters(**wrong)
    for wrong in ({"M": "nan"}, {"M": ""}, {"M": "2*q"}, {"M": "M"}):
        with pytest.raises(JounceError):
            known.with_parameters(**wrong)
    with pytest.raises(jn.errors.MechanismError, match="did you mean 'arm'"):
        known.with_parameters(arn="2 cm")


def test_use_alone_tells_the_dimension_of_a_parameter_without_a_unit(tmp_path):
    bare = brake(tmp_path, "5", "-M")
    assert bare.with_parameters(M="2 kNm").parameter_values["M"] == 2000.0
    with pytest.raises(UnitError, match="this is a length, but the parameter is a torque"):
        bare.with_parameters(M="2 cm")
    assert bare.with_parameters(plain="2 cm").parameter_values["plain"] == 0.02  # used nowhere


def test_parameters_in_python_take_units_too():
    built = jn.Mechanism(space="planar", bodies={"a": jn.Body([0, 0])}, joints={}, parameters={"r": 0.1, "d": "2*r"})
    assert built.with_parameters(r="2 furlong").parameter_values["d"] == pytest.approx(804.67, abs=0.01)
