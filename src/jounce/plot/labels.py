"""Names, symbols and units of quantities and their derivatives in mathtext of matplotlib, and the ranges of axes."""

from __future__ import annotations

import math
import re

import numpy as np
from jaxtyping import Float

from jounce.mechanism.outputs.base import AbstractQuantity
from jounce.reporting.peaks import rate_name
from jounce.units.shown_units import derivative_unit

GREEK = (
    "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau upsilon phi chi psi "
    "omega Gamma Delta Theta Lambda Xi Pi Sigma Upsilon Phi Psi Omega"
).split()
DOTS = ("", r"\dot", r"\ddot", r"\dddot", r"\ddddot")
PREFIXES = {-3: "m", -6: r"\mu ", -9: "n"}


def symbol(name: str, order: int = 0, component: str = "") -> str:
    r"""Return the symbol of a derivative of an output in mathtext; empty if the name is a word rather than a symbol.

    Examples
    --------
    >>> symbol("psi", 2), symbol("C", component="x"), symbol("psi_1", 5), symbol("piston")
    ('$\\ddot{\\psi}$', '$C_{x}$', '$\\psi_{1}^{(5)}$', '')
    """
    component = f"\\{component}" if component in GREEK else component
    match = re.fullmatch(r"([A-Za-z]+)_?([0-9A-Za-z]{0,2})", name)
    letter, index = match.groups() if match else ("", "")
    if match and letter in GREEK:
        letter = f"\\{letter}"
    elif match and len(name) <= 3 and re.fullmatch(r"[A-Za-z](_?[0-9]{0,2}|_[A-Za-z])", name):
        letter, index = name[0], name[1:].lstrip("_")
    else:
        return f"${component}$" if component else ""
    subscript = ",".join(part for part in (index, component) if part)
    subscript = f"_{{{subscript}}}" if subscript else ""
    if order < len(DOTS):
        return f"${f'{DOTS[order]}{{{letter}}}' if order else letter}{subscript}$"
    return f"${letter}{subscript}^{{({order})}}$"


def quantity_word(output: AbstractQuantity, order: int) -> str:
    """Return the name of a derivative of an output, like `rate_name`, but with "angle" for angles.

    Examples
    --------
    >>> import jounce as jn
    >>> quantity_word(jn.outputs.AngleOutput("crank"), 0), quantity_word(jn.outputs.AngleOutput("crank"), 1)
    ('angle', 'velocity')
    """
    word = rate_name(output, order)
    return "angle" if word == "position" and output.unit == "rad" else word


def unit_label(unit: str, order: int, exponent: int = 0) -> str:
    """Return the unit of a derivative in mathtext, with a prefix or a power of ten.

    Examples
    --------
    >>> unit_label("m", 2), unit_label("m", 1, -3), unit_label("rad", 4, 3), unit_label("N*m", 1)
    ('m/s$^2$', 'mm/s', '$10^{3}$ rad/s$^4$', 'N m/s')
    """
    text = re.sub(
        r"\^(-?\d+)",
        lambda m: f"$^{m[1]}$" if len(m[1]) == 1 else f"$^{{{m[1]}}}$",
        derivative_unit(unit.replace("*", " "), order),
    )
    if exponent == 0:
        return text
    if re.match(r"m(?![a-z])", unit) and exponent in PREFIXES:
        prefix = PREFIXES[exponent]
        return f"{f'${prefix}$' if prefix.startswith(chr(92)) else prefix}{text}"
    return f"$10^{{{exponent}}}$ {text}"


def scale_of(values: Float[np.ndarray, "..."]) -> int:
    """Return the exponent of ten, a multiple of three, that makes the numbers of an axis short.

    Examples
    --------
    >>> [scale_of(np.array([size])) for size in (0.0, 0.004, 0.03, 900.0, 3e4, 2e-5)]
    [0, -3, 0, 0, 3, -6]
    """
    finite = np.abs(values[np.isfinite(values)])
    largest = float(finite.max()) if finite.size else 0.0
    if largest == 0 or 0.01 <= largest < 2000:
        return 0
    return 3 * math.floor(math.log10(largest) / 3)


def axis_range(values: Float[np.ndarray, "..."], margin: float = 0.0, size: float | None = None) -> tuple[float, float]:
    """Return the ends of an axis for values, with room about a constant so that its rounding is not magnified.

    Parameters
    ----------
    values : numpy.ndarray
        Values; only finite ones count.
    margin : float, default 0
        Room on either side, relative to the span of the values.
    size : float, optional
        Size relative to which rounding is small; by default the largest value.

    Examples
    --------
    >>> axis_range(np.array([0.0, 2.0]), 0.5), axis_range(np.array([10.0, 10.0]))
    ((-1.0, 3.0), (9.0, 11.0))
    """
    finite = values[np.isfinite(values)]
    if not finite.size:
        return -1.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    size = max(abs(low), abs(high)) if size is None else size
    if high - low <= 1e-9 * size or size == 0:
        middle, half = 0.5 * (low + high), 0.1 * size or 1.0
        return middle - half, middle + half
    return low - margin * (high - low), high + margin * (high - low)


def bar_length(extent: float) -> float:
    """Return the round length, 1, 2, 2.5 or 5 times a power of ten, that is a tenth to a fifth of an extent.

    Examples
    --------
    >>> [bar_length(extent) for extent in (0.049, 0.2, 0.3, 1.3)]
    [0.005, 0.025, 0.05, 0.25]
    """
    power = 10.0 ** np.floor(np.log10(extent / 5) + 1e-12)
    return float(f"{power * max(k for k in (1.0, 2.0, 2.5, 5.0) if k * power <= extent / 5 * (1 + 1e-9)):.3g}")


def rounded_down(value: float) -> float:
    """Return the largest number of the form 1, 2 or 5 times a power of ten that is not above a value.

    Examples
    --------
    >>> [rounded_down(x) for x in (0.07, 0.7, 3.0, 12.0)]
    [0.05, 0.5, 2.0, 10.0]
    """
    power = 10.0 ** np.floor(np.log10(value) + 1e-12)
    return float(f"{power * max(k for k in (1.0, 2.0, 5.0) if k * power <= value * (1 + 1e-9)):.3g}")
