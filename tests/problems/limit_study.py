"""The study of limit positions: random linkages traced from every assembly, against closed forms."""

import dataclasses
import time

import numpy as np

import jounce as jn
from tests.oracles import limit_positions
from tests.problems.linkages import FourBar, SliderCrank
from tests.problems.spatial_linkages import RSSR

LARGEST_ERROR = 1e-10
NEAREST = 1e-4  # to a change point: nearer ones make the closed form itself lose digits
EXPECTED = {
    "four-bar": lambda v: limit_positions.four_bar(v["a"], v["b"], v["c"], v["d"]),
    "slider-crank": lambda v: limit_positions.slider_crank(v["a"], v["b"], v["e"]),
    "RSSR": lambda v: limit_positions.rssr(
        v["a"], v["r"], v["l"], (v["dx"], v["dy"], v["dz"]), (v["nx"], v["ny"], v["nz"])
    ),
}
FAMILIES = {family.name: family for family in (FourBar(), SliderCrank(), RSSR())}


@dataclasses.dataclass
class Verdict:
    """How the limit positions of one linkage compare."""

    expected: np.ndarray
    found: np.ndarray  # nearest to each
    stray: int  # found where none is expected
    seconds: float
    traces: int

    @property
    def error(self):
        """The largest, rad; infinite where one was not found."""
        if self.stray:
            return np.inf
        return float(np.max(np.abs(self.expected - self.found), initial=0.0))


def random_linkage(name, seed, number):
    """Return a linkage of a family, every third of them near a change point or a dead point."""
    return FAMILIES[name].linkage(np.random.default_rng([seed, number]), number % 3 == 0, NEAREST)[0]


def judged(linkage):
    """Trace a linkage from both assemblies of every range of its crank, and compare all limit positions."""
    expected = np.sort(EXPECTED[linkage.family.name](linkage.values))
    seconds, found, traces = 0.0, [], 0
    for mechanism in _starts(linkage, expected):
        begun = time.process_time()
        curve = jn.trace(mechanism, 0.0)
        found += [x.value for x in curve.limits]
        seconds, traces = seconds + time.process_time() - begun, traces + 1
        assert curve.closed, linkage
    if not len(expected) or not found:
        return Verdict(expected, np.full(len(expected), np.inf), len(found), seconds, traces)
    away = np.angle(np.exp(1j * (np.array(found)[:, None] - expected)))
    nearest = np.argmin(np.abs(away), axis=0)
    stray = int(np.sum(np.min(np.abs(away), axis=1) > LARGEST_ERROR))
    return Verdict(expected, expected + away[nearest, np.arange(len(expected))], stray, seconds, traces)


def _starts(linkage, expected):
    """Return the linkage assembled in both ways in the middle of every range."""
    family, random = linkage.family, np.random.default_rng(0)
    ends = [*expected, expected[0] + 2 * np.pi] if len(expected) else [linkage.law.start, linkage.law.start]
    for value in 0.5 * (np.array(ends[1:]) + ends[:-1]):
        found = [family.assembly(linkage.values, value, random) for _ in range(20)]
        if found[0] is None:
            continue
        law = dict.fromkeys(linkage.law._fields, 0.0) | {"start": value}
        for start in {tuple(np.round(x, 9)): x for x in found}.values():
            guess = map(float, family.guess(linkage.values, float(value), start))
            known = dict(zip(family.guessed, guess, strict=True))
            yield linkage.mechanism.with_parameters(**law, **known)
