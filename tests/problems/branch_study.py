"""The study of branches: random linkages with time grids and orders, solved by jounce and judged by proved paths."""

import dataclasses
import time
from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np

import jounce as jn
from tests.oracles.linkage_paths import Paths, derivatives, follow, polished, rounding
from tests.problems.linkages import NEAREST, Family, FourBar, Linkage, SliderCrank, SliderDriven
from tests.problems.six_bars import SixBar, StephensonAtLink, StephensonSecond
from tests.problems.spatial_linkages import RCCC, RSSR

ALL = (
    SliderCrank(),
    SliderDriven(),
    FourBar(),
    SixBar("Watt I", "coupler", "rocker"),
    SixBar("Watt II", "rocker", "ground"),
    SixBar("Stephenson I", "crank", "rocker"),
    SixBar("Stephenson III", "coupler", "ground"),
    StephensonAtLink("Stephenson III at the link", "coupler", "ground"),
    StephensonSecond(),
    RSSR(),
    RCCC(),
)
FAMILIES: dict[str, Family] = {family.name: family for family in ALL}
ORDERS = (0, 1, 2, 3, 4, 8)  # of few heights, as jounce computes at least to order 4 and compiles for each
NEAR = 1e-4  # by the determinant of the scaled Jacobian
SMOOTH = 0.1
POSITION, ROUNDING = 1e-9, 1e-13  # what a position may be off, and each equation, of the size of its terms
SHARPEST = 1e-9  # of the driven value: an end of the motion is not known more sharply
RATE, SMALLEST_FOR_RATES = 1e-6, 1e-2  # relative error of derivatives, and the determinant down to which it is asked
BATCH = 128


@dataclasses.dataclass(frozen=True)
class Case:
    """A linkage, the instants and the order asked for."""

    linkage: Linkage
    time: np.ndarray
    order: int
    rates: bool  # whether derivatives are compared


@dataclasses.dataclass
class Solution:
    """What jounce says of a case."""

    case: Case
    nanoseconds: int
    status: np.ndarray
    position: np.ndarray  # (time, derivative, unknowns)
    refusal: str = ""


@dataclasses.dataclass
class Verdict:
    """What is wrong with it."""

    tally: Counter
    reasons: Counter
    first: dict[str, Any]
    smallest: float
    end: float | None


def random_cases(family: Family, count: int, seed: Any, orders: Any, nearest: float = NEAREST) -> Iterator[Case]:
    """Return random linkages of a family, every third near a singular position, with grids of 31 to 1001 instants."""
    for k in range(count):
        random = np.random.default_rng([*seed, k])
        linkage, stop = family.linkage(random, k % 3 == 0, nearest)
        instants = round(10 ** random.uniform(np.log10(31), np.log10(1001)))
        grid = np.linspace(0.0, stop, instants)
        if random.random() < 0.25:  # unevenly spaced
            grid[1:-1] += random.uniform(-0.4, 0.4, size=instants - 2) * grid[1]
        yield Case(linkage, grid, int(random.choice(orders)), bool(random.random() < 0.25))


_warm: set[tuple[str, int]] = set()


def solved(case: Case) -> Solution:
    """Solve a case with jounce."""
    mechanism = case.linkage.mechanism
    if (case.linkage.family.name, case.order) not in _warm:  # compile apart from what is timed
        _solve(mechanism, case.time, case.order)
        _warm.add((case.linkage.family.name, case.order))
    begun = time.process_time_ns()
    motion = _solve(mechanism, case.time, case.order)
    spent = time.process_time_ns() - begun
    unknowns = len(case.linkage.start)
    if isinstance(motion, jn.JounceError):
        lost = np.full((len(case.time), case.order + 1, unknowns), np.nan)
        return Solution(case, spent, np.full(len(case.time), -1), lost, type(motion).__name__)
    found = case.linkage.family.unknowns(motion.outputs, case.linkage.values)
    return Solution(case, spent, motion.status, found)


def _solve(mechanism: Any, grid: np.ndarray, order: int) -> Any:
    try:
        return jn.solve(mechanism, grid, order=order, strict=False)
    except jn.JounceError as error:
        return error


def judged(solutions: list[Solution]) -> Iterator[tuple[Case, Verdict]]:
    """Return each case with its verdict."""
    solutions = sorted(solutions, key=lambda s: len(s.case.time))
    for first in range(0, len(solutions), BATCH):
        batch = solutions[first : first + BATCH]
        paths, places = followed(batch)
        for k, solution in enumerate(batch):
            lane = Paths(*(field[k] for field in paths))
            instants = Paths(*(field[places[k]] if field.ndim else field for field in lane))
            yield solution.case, _verdict(solution, instants)


def followed(batch: list[Solution]) -> tuple[Paths, list[np.ndarray]]:
    """Follow linkages from where jounce starts, or from their own start where it does not."""
    linkages = [solution.case.linkage for solution in batch]
    forms, circular = np.stack([linkage.tracked_form for linkage in linkages]), linkages[0].family.circular
    starts = [linkage.start if s.status[0] else s.position[0, 0] for s, linkage in zip(batch, linkages, strict=True)]
    values = np.array([linkage.law(0.0) for linkage in linkages])
    starts, _ = polished(forms, circular, np.stack(starts)[:, : forms.shape[1]], values)
    targets, places = [], []
    for solution, linkage in zip(batch, linkages, strict=True):
        grid = solution.case.time
        turning = linkage.law.turning_times(grid[-1])
        visited = np.concatenate([grid, turning])
        in_time = np.argsort(visited, kind="stable")
        targets.append(linkage.law(visited[in_time]))
        places.append(np.argsort(in_time)[: len(grid)])
    return follow(forms, circular, starts, targets), places


def whole(case: Case, path: Paths, reached: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return all unknowns at all instants, and by how much those of jounce may be off."""
    linkage, values = case.linkage, case.linkage.law(case.time[reached])
    forms = np.broadcast_to(linkage.form, (len(values), *linkage.form.shape))
    known, circular = path.position[reached], linkage.family.circular
    start = np.concatenate([known, np.zeros((len(known), len(linkage.form) - known.shape[1]))], axis=1)
    found = polished(forms, circular, start, values)[0]
    position = np.full((len(case.time), found.shape[1]), np.nan)
    allowed = position.copy()
    position[reached] = found
    allowed[reached] = POSITION * np.maximum(np.abs(found), 1.0) + ROUNDING * rounding(forms, circular, found, values)
    return position, allowed


def _verdict(solution: Solution, path: Paths) -> Verdict:
    case, law = solution.case, solution.case.linkage.law
    reached = np.isfinite(path.margin)
    fine = solution.status == jn.Status.OK
    sharp = np.ones(len(fine), bool)
    if np.isfinite(path.limit):  # at the very end of the motion, neither answer is wrong
        blunt = SHARPEST * max(1.0, abs(path.limit))
        turns_there = np.any(np.abs(law(law.turning_times(case.time[-1])) - path.limit) <= blunt)
        sharp = np.abs(law(case.time) - path.limit) > blunt
        sharp &= reached | bool(path.proved and not turns_there)
    position, allowed = whole(case, path, reached)
    elsewhere = fine & reached & ~(np.abs(solution.position[:, 0] - position) <= allowed).all(axis=1)
    beyond = fine & ~reached & sharp
    given_up = ~fine & reached & sharp
    near = ~(path.margin > NEAR)
    rates, compared = _wrong_rates(solution, path, position, fine & reached & ~elsewhere)
    smallest = float(np.nanmin(path.margin))
    which = "ending" if np.isfinite(path.limit) else "smooth" if smallest > SMOOTH else "close"
    tally = Counter(
        {
            "mechanisms": 1,
            "instants": len(fine),
            "OK": fine.sum(),
            "wrong": (elsewhere | beyond | rates).sum(),
            "elsewhere": elsewhere.sum(),
            "beyond": beyond.sum(),
            "rates": rates.sum(),
            "derivatives": compared,
            "given up": given_up.sum(),
            "of them near": (given_up & near).sum(),
            "far": (reached & ~near).sum(),
            "near": (reached & near).sum(),
            "rightly refused": (~fine & ~reached & sharp).sum(),
            "undecided": (~sharp).sum(),
            "nanoseconds": solution.nanoseconds,
            f"{which} nanoseconds": solution.nanoseconds,
            f"{which} instants": len(fine),
            f"{which} mechanisms": 1,
        }
    )
    tally = Counter({name: int(number) for name, number in tally.items()})
    reasons = Counter()
    for where, mask in (("above", given_up & ~near), ("below", given_up & near)):
        for status in solution.status[mask]:
            reasons[f"{solution.refusal or jn.Status(int(status)).name} {where} 1e-4"] += 1
    first = {
        name: float(case.time[np.argmax(mask)])
        for name, mask in (("elsewhere", elsewhere), ("beyond", beyond), ("rates", rates), ("given up", given_up))
        if mask.any()
    }
    return Verdict(tally, reasons, first, smallest, float(path.limit) if np.isfinite(path.limit) else None)


def _wrong_rates(solution: Solution, path: Paths, position: np.ndarray, judged: np.ndarray) -> tuple[np.ndarray, int]:
    """Tell at which instants velocity, acceleration or jerk are not those of the branch; away from dead points."""
    case, order = solution.case, min(solution.case.order, 3)
    wrong = np.zeros(len(case.time), bool)
    chosen = np.flatnonzero(judged & (np.abs(path.determinant) > SMALLEST_FOR_RATES))[::7]
    if not case.rates or order == 0 or not chosen.size:
        return wrong, 0
    linkage = case.linkage
    known = derivatives(linkage.form, linkage.family.circular, linkage.law, case.time[chosen], position[chosen], order)
    found = solution.position[chosen, : order + 1]
    scale = np.maximum(np.abs(known), np.abs(known[:, :1])).max(axis=2)
    away = np.abs(found - known).max(axis=2)
    wrong[chosen] = ~(away <= RATE * scale).all(axis=1)
    return wrong, chosen.size
