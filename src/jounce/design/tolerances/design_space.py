"""Designs by number: a grid of values, or a low-discrepancy sequence, computed chunk by chunk on request."""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.base.padding import power_of_two
from jounce.design.tolerances.variations import Interval, Values, Variation, spreads
from jounce.errors import MechanismError

MOST_DESIGNS = 10**10
BITS = 30  # of a Sobol sequence, which has 2**BITS points
SEED = 20260101  # of the scrambling; constant, so that a sweep can be continued


@dataclasses.dataclass(frozen=True)
class Grid:
    """All combinations of the values of parameters; the last parameter changes fastest.

    Parameters
    ----------
    variations : dict of str to Interval or Values
        Variations, each with a count.
    """

    variations: Mapping[str, Variation]

    def __post_init__(self) -> None:
        for name, variation in self.variations.items():
            if not isinstance(variation, Values | Interval) or variation.count is None:
                message = "has no count of values: write LOW:HIGH:COUNT, or draw designs by a sample: sobol:1024"
                raise MechanismError(message, name=f"vary {name}")
        if self.count > MOST_DESIGNS:
            raise MechanismError(f"at most {MOST_DESIGNS:g} designs are swept", name="vary", value=self.count)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values of each parameter."""
        return tuple(len(values) for values in self._axes)

    @property
    def count(self) -> int:
        """Number of designs."""
        return math.prod(int(getattr(variation, "count", 0) or 0) for variation in self.variations.values())

    def values(self, start: int, stop: int) -> dict[str, Float[np.ndarray, " design"]]:
        """Return the parameters of a chunk of designs."""
        indices = np.unravel_index(np.arange(start, stop), self.shape)
        return {name: axis[index] for (name, axis, index) in zip(self.variations, self._axes, indices, strict=True)}

    @property
    def _axes(self) -> list[np.ndarray]:
        return [variation.values for variation in self.variations.values()]  # type: ignore[union-attr]


@dataclasses.dataclass(frozen=True)
class Sobol:
    """Designs by a scrambled Sobol sequence, which fills the range of all parameters evenly. Owen 1998.

    Parameters
    ----------
    variations : dict of str to Interval, Normal or Uniform
        Variations without counts.
    nominal : dict of str to float
        Nominal values of the parameters, SI.
    count : int
        Number of designs; powers of two are best.
    """

    variations: Mapping[str, Variation]
    nominal: Mapping[str, float]
    count: int

    def __post_init__(self) -> None:
        spreads(self.variations)
        if not 1 <= self.count <= 2**BITS:
            message = f"the number of designs must be a whole number from 1 to {2**BITS}"
            raise MechanismError(message, name="sample", value=self.count)

    def values(self, start: int, stop: int) -> dict[str, Float[np.ndarray, " design"]]:
        """Return the parameters of a chunk of designs."""
        shares = sobol_shares(len(self.variations), start, stop).T
        return {
            name: variation.quantile(share, self.nominal.get(name, math.nan))
            for (name, variation), share in zip(spreads(self.variations).items(), shares, strict=True)
        }


def sobol_shares(dimension: int, start: int, stop: int) -> Float[np.ndarray, "point {dimension}"]:
    """Return a chunk of a scrambled Sobol sequence, every number above 0 and below 1.

    Examples
    --------
    >>> bool((sobol_shares(2, 3, 7) == sobol_shares(2, 0, 8)[3:7]).all())
    True
    """
    from scipy.stats.qmc import Sobol as Sequence

    settings: dict[str, Any] = {"scramble": True, "bits": BITS, "seed": SEED}  # rng in newer releases
    sequence = Sequence(dimension, **settings)
    if start:
        sequence.fast_forward(start)
        return sequence.random(stop - start) + 2.0 ** -(BITS + 1)
    points = sequence.random(power_of_two(stop))  # SciPy warns if the first points are not a power of two
    return points[:stop] + 2.0 ** -(BITS + 1)


def sample_space(variations: Mapping[str, Variation], sample: Any, nominal: Mapping[str, float]) -> Grid | Sobol:
    """Return the designs that variations and a sample describe: a grid, or ``sobol:COUNT``.

    Raises
    ------
    MechanismError
        If the kind of the sample is unknown, or it does not fit the variations.
    """
    if sample is None:
        return Grid(variations)
    kind, _, count = str(sample).partition(":")
    if kind.strip() != "sobol" or not count.strip().isdecimal() or len(count) > 15:
        raise MechanismError("must be sobol:COUNT, such as sobol:1024", name="sample", value=sample)
    return Sobol(variations, nominal, int(count))
