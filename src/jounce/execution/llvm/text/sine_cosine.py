"""Sines and cosines of a vector of angles at once, instead of by C library calls for each lane."""

import math

from jounce.execution.llvm.text.scalars import Scalars
from jounce.execution.llvm.text.values import Value

LARGEST = 1e5  # rad, beyond which the C library is called
SMALLEST = 2.0**-27  # rad, of a reduced angle, below which the sine equals the angle
SHIFT = 1.5 * 2.0**52  # added to a number, it leaves the nearest integer in the last bits
QUARTER = 3373259426 * 2.0**-31, 2242054355 * 2.0**-65, 2.0222662487959506e-21
"""Parts of pi / 2, the first two of 32 bits: products with an integer below 2**21 are exact."""
SINE = tuple((-1.0) ** (k // 2) / math.factorial(k) for k in range(17, 2, -2))
COSINE = tuple((-1.0) ** (k // 2) / math.factorial(k) for k in range(18, 3, -2))


def sine_and_cosine(program: Scalars) -> str:
    """Return the text of a function of a vector of angles, rad, with errors of at most one unit in the last place.

    Angles are reduced by whole quarter turns (Cody and Waite 1980, Software Manual for the Elementary Functions,
    chapter 8) to at most an eighth of a turn, for which Taylor series are summed. If a reduced angle is so small that
    digits of pi are missing, the C library is called, too.

    Parameters
    ----------
    program : Scalars
        The program of the function.
    """
    code = Scalars(program.width)
    x, vector, truths = Value("%x", "f", True), code.type_of("f", lanes=True), code.type_of("b", lanes=True)

    def number(value: float) -> Value:
        return code.constant(value)

    def plus(a: Value, b: Value) -> Value:
        return code.arithmetic("add", a, b)

    def minus(a: Value, b: Value) -> Value:
        return code.arithmetic("sub", a, b)

    def times(a: Value, b: Value) -> Value:
        return code.arithmetic("mul", a, b)

    def series(coefficients: tuple[float, ...], square: Value) -> Value:
        result = number(coefficients[0])
        for coefficient in coefficients[1:]:
            result = plus(times(result, square), number(coefficient))
        return result

    def is_negative(turns: Value) -> Value:
        two = code.constant(2, "l")
        return code.compare("eq", code.logic("and", turns, two), two)

    shifted = plus(times(x, number(2 / math.pi)), number(SHIFT))
    turns = minus(shifted, number(SHIFT))
    first = minus(x, times(turns, number(QUARTER[0])))
    second = times(turns, number(QUARTER[1]))
    remainder = minus(first, second)
    third = minus(times(turns, number(QUARTER[2])), minus(minus(first, remainder), second))
    angle = minus(remainder, third)
    tail = minus(minus(remainder, angle), third)  # part of the angle below its last bit
    square = times(angle, angle)
    half = times(square, number(0.5))
    leading = minus(number(1.0), half)
    small = code.compare("lt", code.intrinsic("fabs", angle), number(SMALLEST))
    sine = plus(angle, plus(times(times(square, angle), series(SINE, square)), times(tail, leading)))
    sine = code.select(small, angle, sine)
    cosine = minus(times(times(square, square), series(COSINE, square)), times(angle, tail))
    cosine = plus(leading, plus(minus(minus(number(1.0), leading), half), cosine))

    one, count = code.constant(1, "l"), Value("%count", "l", True)
    code.lines.append(f"{count.name} = bitcast {vector} {shifted.name} to {code.type_of('l', lanes=True)}")
    swapped = code.compare("eq", code.logic("and", count, one), one)
    sine, cosine = code.select(swapped, cosine, sine), code.select(swapped, sine, cosine)
    sine = code.select(is_negative(count), code.negated(sine), sine)
    cosine = code.select(is_negative(code.arithmetic("add", count, one)), code.negated(cosine), cosine)
    in_range = code.compare("le", code.intrinsic("fabs", x), number(LARGEST))
    canceled = code.logic("and", small, code.compare("ne", turns, number(0.0)))
    uncertain = code.logic("or", code.inverted(in_range), canceled)
    code.branch(code.anywhere(uncertain), "others", "end")
    code.begin("others")
    for letter, computed, function in (("s", sine, "sin"), ("c", cosine, "cos")):
        code.lines += [
            f"%{letter}1 = call {vector} @{function}_of_lanes({vector} %x)",
            f"%{letter}2 = select {truths} {uncertain.name}, {vector} %{letter}1, {vector} {computed.name}",
        ]
    code.jump("end")
    code.begin("end")
    for letter, computed in (("s", sine), ("c", cosine)):
        code.lines.append(f"%{letter} = phi {vector} [{computed.name}, %begin], [%{letter}2, %others]")
    pair = f"{{ {vector}, {vector} }}"
    code.lines += [
        f"%one = insertvalue {pair} poison, {vector} %s, 0",
        f"%both = insertvalue {pair} %one, {vector} %c, 1",
        f"ret {pair} %both",
    ]
    program.intrinsics |= code.intrinsics
    body = "\n".join(code.lines)
    return f"define internal {pair} @sine_and_cosine({vector} %x) noinline #2 {{\nbegin:\n{body}\n}}"
