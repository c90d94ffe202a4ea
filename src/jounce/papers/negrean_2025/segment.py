"""The one segment that section 4 prints, on [0.565, 0.605] s, and a check that its polynomials are derivatives.

The text at hand has lost minus signs. The signs of the angle are + - + - + - from the highest power down; the signs of
each derivative follow from them.
"""

import dataclasses
from decimal import Decimal

import numpy as np
from jaxtyping import Float

INTERVAL = (0.565, 0.605)  # s
POLYNOMIALS = (  # highest power first, as printed: angle to jounce, rad by s
    ("3792.503", "-11239.525", "13301.344", "-7864.321", "2331.436", "-277.457"),
    ("18962.519", "-44958.1", "39904.034", "-15728.643", "2331.436"),
    ("75850.076", "-134874.302", "79808.069", "-15728.643"),
    ("227550.23", "-269748.605", "79808.069"),
    ("455100.461", "-269748.605"),
)
HALF_UNIT = Decimal("0.0005")  # three decimals are printed; a final zero is not


@dataclasses.dataclass(frozen=True)
class Check:
    """One printed coefficient beside the coefficient that the preceding polynomial gives.

    Parameters
    ----------
    order : int
        Order of the derivative with the coefficient.
    power : int
        Power of the time.
    printed, derived : Decimal
        The coefficient as printed, and as derived from the preceding polynomial.
    rounding : Decimal
        Largest difference of the two if both are rounded to three decimals.
    """

    order: int
    power: int
    printed: Decimal
    derived: Decimal
    rounding: Decimal

    @property
    def residual(self) -> Decimal:
        """Printed less derived."""
        return self.printed - self.derived

    @property
    def rounded(self) -> bool:
        """Whether rounding to three decimals explains the difference; if not, the paper truncates digits."""
        return abs(self.residual) <= self.rounding


def check() -> list[Check]:
    """Return all fourteen coefficients of the four derivatives, each beside that from the preceding polynomial.

    Examples
    --------
    >>> worst = max(check(), key=lambda c: abs(c.residual))
    >>> worst.order, worst.power, str(worst.residual)
    (1, 4, '0.004')
    """
    rows = []
    for order in range(1, len(POLYNOMIALS)):
        before, printed = POLYNOMIALS[order - 1], POLYNOMIALS[order]
        for power, coefficient in zip(range(len(printed) - 1, -1, -1), printed, strict=True):
            factor = power + 1
            slope = factor * Decimal(before[len(before) - 1 - factor])
            rows.append(Check(order, power, Decimal(coefficient), slope, (factor + 1) * HALF_UNIT))
    return rows


def evaluated(time: Float[np.ndarray, " time"]) -> Float[np.ndarray, "5 time"]:
    """Return angle, speed, acceleration, jerk and jounce of the printed segment, rad by s."""
    return np.array([np.polyval([float(c) for c in printed], time) for printed in POLYNOMIALS])


def uncertainty(order: int) -> float:
    """Return the largest error of a value of the segment from the rounding of its coefficients, rad by s."""
    return sum(float(HALF_UNIT) * INTERVAL[1] ** k for k in range(len(POLYNOMIALS[order])))
