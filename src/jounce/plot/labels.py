"""Symbols and units of quantities and of their derivatives, in the notation of matplotlib's mathtext."""

from __future__ import annotations

import math
import re

import numpy as np

from jounce.reporting.peaks import derivative_unit

__all__ = ["scale_of", "symbol", "unit_label"]

GREEK = (
    "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau upsilon phi chi psi "
    "omega Gamma Delta Theta Lambda Xi Pi Sigma Upsilon Phi Psi Omega"
).split()
DOTS = ("", r"\dot", r"\ddot", r"\dddot", r"\ddddot")
PREFIXES = {-3: "m", -6: r"\mu ", -9: "n"}


def symbol(name: str, order: int = 0, component: str = "") -> str:
    r"""Return the symbol of a derivative of an output in mathtext; empty where the name is a word and no symbol.

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


def scale_of(values: np.ndarray) -> int:
    """Return the power of ten, a multiple of three, by which an axis is divided so that its numbers are short.

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
