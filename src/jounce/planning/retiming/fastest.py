"""The fastest time law along a path, from a coarse to a fine basis, and the least slowing of a given law."""

import numpy as np

from jounce.planning.retiming.quantities.feasibility import bounded_everywhere, check_possible
from jounce.planning.retiming.quantities.path_quantities import Labels, Source
from jounce.planning.retiming.rates.rate_law import Conditions, RateLaw, progress
from jounce.planning.retiming.rates.rate_spline import Parametrization, RateBasis
from jounce.planning.retiming.search import COARSE, Search

COARSE_ROUNDS = {2: 1, 3: 2}  # by the level of limits: limits up to the second are linear in the program


def fastest(
    source: Source,
    labels: Labels,
    start: float,
    stop: float,
    conditions: Conditions,
    cells: int,
    handed_over: float | None = None,
) -> tuple[RateLaw, Search]:
    """Return the fastest law from a start to a stop of s, and the search that found it.

    With `handed_over`, the search starts from a law with rate 1 up to that value of s, which keeps the limits.

    Raises
    ------
    TrajectoryError
        If a limit is exceeded at rest, or no limited quantity moves on a part of the path.
    SolveError
        If no law keeps the limits.
    """
    check_possible(source, labels, start, stop)
    if handed_over is not None:
        return _faster(source, labels, (start, handed_over, stop), conditions, cells)
    u = np.linspace(0.0, 1.0, 201)
    slopes = [0.0 if rate == 0 else 1.0 for rate in conditions.rates]  # of a cubic at ends without rest
    s = u**2 * (3 - 2 * u) + slopes[0] * u * (1 - u) ** 2 - slopes[1] * u**2 * (1 - u)
    s = start + (stop - start) * s
    duration = 0.0
    coarse = 2 if bounded_everywhere(source, start, stop) else 3
    for count in (COARSE, COARSE):
        parameter = Parametrization(u, s, conditions.rests)
        search = Search(source, labels, parameter, RateBasis(count, coarse), conditions, coarse)
        law = search.run(np.full(count + coarse, search.level()), COARSE_ROUNDS[coarse])
        u, s = progress(law)
        duration = law.duration
    basis = RateBasis(cells, max(conditions.order + 1, 2))
    if labels.fourth:
        search = Search(source, labels, Parametrization(u, s, conditions.rests), basis, conditions, 3)
        law = search.run(np.full(basis.count, 1 / duration**2))
        (u, s), duration = progress(law), law.duration
    parameter = Parametrization(u, s, conditions.rests)
    search = Search(source, labels, parameter, basis, conditions)
    return search.fastest_law(np.full(basis.count, 1 / duration**2)), search


def _faster(
    source: Source, labels: Labels, marks: tuple[float, float, float], conditions: Conditions, cells: int
) -> tuple[RateLaw, Search]:
    """Return the fastest law, found from one with rate 1 on the first part that comes to rest on the second."""
    start, s_joined, stop = marks
    times = np.linspace(0.0, s_joined - start + 2 * (stop - s_joined), 401)
    slowing = np.clip(times - (s_joined - start), 0.0, None)
    s = start + times - slowing**2 / (4 * (stop - s_joined))
    u, duration = times / times[-1], float(times[-1])
    fine = RateBasis(cells, max(conditions.order + 1, 2))
    for basis, rounds in ((RateBasis(COARSE, 3), 2), (RateBasis(COARSE, 3), 2), (fine, 0)):
        parameter = Parametrization(u, s, conditions.rests)
        search = Search(source, labels, parameter, basis, conditions, 3 if rounds else 4)
        even = np.full(basis.count, 1 / duration**2)
        if not rounds:
            return search.fastest_law(even), search
        law = search.run(even, rounds)
        (u, s), duration = progress(law), law.duration
    raise AssertionError


def slowed_only(
    source: Source, labels: Labels, start: float, stop: float, conditions: Conditions, cells: int
) -> tuple[RateLaw, Search]:
    """Return the fastest law that is nowhere faster than s, which is a time, and the search that found it."""
    check_possible(source, labels, start, stop, bounded=True)
    parameter = Parametrization([0.0, 1.0], [start, stop], (1, 1))
    search = Search(source, labels, parameter, RateBasis(cells, max(conditions.order + 1, 2)), conditions)
    unchanged = search.law_of(np.full(search.basis.count, search.largest_z))
    if search.peaks(unchanged)[1].max() <= 1:
        return unchanged, search
    return search.fastest_law(np.full(search.basis.count, search.level())), search
