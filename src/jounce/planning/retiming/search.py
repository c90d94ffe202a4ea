"""The fastest rate along a path by sequential convex programming: each program starts from the last solution.

Verscheure and others, Time-optimal path tracking for robots: a convex optimization approach, IEEE Transactions on
Automatic Control 54 (2009), for velocity, acceleration and torque. Limits of rates (jerk, torque rate) are not convex
in z; their tangents at the last iterate are, and are conservative.
"""

import dataclasses

import numpy as np
from jaxtyping import Bool, Float

from jounce.errors import SolveError
from jounce.planning.retiming.quantities.path_quantities import Curves, Labels, Source
from jounce.planning.retiming.rates.program import Program, solve_program
from jounce.planning.retiming.rates.rate_law import Conditions, RateLaw, quadrature
from jounce.planning.retiming.rates.rate_spline import Parametrization, RateBasis

COARSE = 60  # cells of a first law
ENDS = 1e-9  # fraction of a cell: distance of the points on both sides of a knot
OFFSETS = np.array([ENDS, 0.25, 0.5, 0.75, 1 - ENDS])  # positions of the checked points in a cell
END_CELLS, END_POINTS = 2, 20
FIRST = (1, 3)  # offsets at which limits are enforced from the first program
NEAR, SETTLED_NEAR, HELD_NEAR = 0.2, 0.6, 0.9  # ratios to a limit below which a program omits the limit
SETTLED = 2e-4  # fraction of the duration: a smaller improvement ends the iteration
EXCEEDED = 1e-4  # fraction of a limit: a smaller excess is left to the final slowing
ROUNDS = 20
EXCHANGES = 4
EASE = 3.0  # factor by which an excess over a limit of fourth order is reduced in each program
TRUST = 4.0  # trust region of programs with approximate limits, as a factor of the coefficients of z
CLOSE = 2e-3  # distance from the largest ratio of the peaks to refine
ZOOMS = 3  # refinements of peaks
ASIDE = 0.1  # distance of points beside a vertex, as a fraction of the distance to the neighboring points
SPARE = 2e-8  # fraction of a limit: margin for rounding
SLOWINGS = 12
LEAST_FALL = 1e-3  # least decrease of a ratio per relative slowing
HOPELESS = 0.1  # fraction of a limit: a larger excess is not removed by slowing
MOST = 1e16
EVENED, SAME = 20, 1e-12  # steps toward a duration, and its relative tolerance
GIVEN = 4  # cells after a given state over which the margin grows from zero
BISECTIONS = 54  # to rounding
FLOOR = 1e-7  # fraction of the mean of z: its least value

_Points = Float[np.ndarray, " _"]


class Search:
    """The search for the fastest rate in one parametrization.

    Parameters
    ----------
    source : callable
        Returns the limited quantities at values of s.
    labels : Labels
        Names of the quantities.
    parameter : Parametrization
        s over u.
    basis : RateBasis
        Splines of z.
    conditions : Conditions
        Further conditions of the law.
    level : int, default 4
        Level of the limits to keep: 2 up to acceleration and torque, 3 up to their rates, 4 for all.
    """

    def __init__(
        self,
        source: Source,
        labels: Labels,
        parameter: Parametrization,
        basis: RateBasis,
        conditions: Conditions,
        level: int = 4,
    ):
        self.source, self.labels, self.parameter = source, labels, parameter
        self.basis, self.conditions = basis, conditions
        self.limit_level, self.margin = level, 0.0
        self.duration: float | None = None  # prescribed duration of a law; None for the fastest
        self.points, self.enforced = np.zeros(0), np.zeros(0, bool)
        self.prices = np.zeros((0, len(labels.every)))
        self.held = np.zeros((0, len(labels.every)), bool)  # limits of the last program
        grid = ((np.arange(basis.cells)[:, None] + OFFSETS) / basis.cells).reshape(-1)
        ends = np.linspace(0.0, END_CELLS / basis.cells, END_POINTS)[1:]  # near rest, ratios to limits change fast
        enforced = np.isin(np.arange(len(grid)) % len(OFFSETS), FIRST)
        sides = np.array([self._share(s) for s in source.changes])[:, None] + ENDS / basis.cells * np.array([-1.0, 1.0])
        enforced = np.append(enforced, np.ones(2 * len(ends) + sides.size, bool))
        self.extend(np.concatenate([grid, ends, 1 - ends, sides.reshape(-1)]), enforced)
        self.nodes, self.weights = quadrature(basis.cells, 2)
        self.node_matrix = basis.matrices(self.nodes, 0)[0]

    def _share(self, s: float) -> float:
        """Return the u of a value of s."""
        low, high = 0.0, 1.0
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            is_below = float(self.parameter.derivatives(np.array([middle]), 0)[0, 0]) < s
            low, high = (middle, high) if is_below else (low, middle)
        return high

    def extend(self, points: _Points, enforced: Bool[np.ndarray, " point"]) -> None:
        """Add values of u at which limits are checked; `enforced` points have nearby limits in the first program."""
        old_points, all_points = self.points, np.concatenate([self.points, points])
        self.points, first = np.unique(all_points, return_index=True)
        self.enforced = np.concatenate([self.enforced, enforced])[first]
        self.shape = self.parameter.derivatives(self.points, 4)
        quantities = self.source(self.shape[0])
        omitted = {"rate_lower": (3, -np.inf), "rate_upper": (3, np.inf), "fourth_bounds": (4, np.inf)}
        unlimited = {
            field: np.full_like(getattr(quantities, field), no_bound)
            for field, (level, no_bound) in omitted.items()
            if level > self.limit_level
        }
        quantities = dataclasses.replace(quantities, **unlimited)
        self.curves = Curves(quantities, self.shape)
        self.matrices = self.basis.matrices(self.points)
        self.compact = self.basis.compact(self.points, self.matrices)
        indices, shape = np.searchsorted(self.points, old_points), (len(self.points), len(self.labels.every))
        (prices, is_held), self.prices, self.held = (self.prices, self.held), np.zeros(shape), np.zeros(shape, bool)
        self.prices[indices], self.held[indices] = prices, is_held

    @property
    def largest_z(self) -> float:
        """Largest z that the largest rate allows."""
        if self.conditions.max_rate is None:
            return np.inf
        return float((self.conditions.max_rate / self.shape[1].max()) ** 2)

    def law_of(self, coefficients: _Points) -> RateLaw:
        """Return the law with the given coefficients."""
        return RateLaw(self.parameter, self.basis, coefficients)

    def at(self, coefficients: _Points) -> Float[np.ndarray, "4 point"]:
        """Return z and its derivatives at the points."""
        return np.stack([matrix @ coefficients for matrix in self.matrices])

    def level(self) -> float:
        """Return a constant z near the largest that exceeds no limit."""
        z, ones = min(1.0, self.largest_z), np.ones(self.basis.count)

        def max_ratio(z: float) -> float:
            return float(np.max(self.curves.ratios(self.at(z * ones))))

        while max_ratio(z) > 1 and z > 1e-12:
            z /= 4
        while z * 1.2 <= min(self.largest_z, MOST) and max_ratio(z * 1.2) <= 1:
            z *= 1.2
        return z

    def run(self, start: _Points, rounds: int = ROUNDS, *, settled: bool = False) -> RateLaw:
        """Return the fastest law, from the coefficients of a first law, which is near the result if `settled`.

        Raises
        ------
        SolveError
            If no program has a solution; the message gives the limit and the place.
        """
        x, cost = start, self._cost(start) if settled else np.inf
        ratios = self.curves.ratios(self.at(x))
        threshold = 0 if len(self.nodes) == 2 * COARSE else SETTLED_NEAR if settled else NEAR
        chosen = self.enforced[:, None] & (ratios > threshold) | _peaks(ratios) & (ratios > 1)
        if settled:
            chosen |= self.held & (ratios > HELD_NEAR)
        for self.rounds in range(1, rounds + 1):
            try:
                x = self._improved(x, chosen, near=settled or self.rounds > 1)
            except SolveError:
                if not np.isfinite(cost):
                    raise
                break  # the solver reached its accuracy, and its last law is the result
            ratios = self.curves.ratios(self.at(x))
            new_cost = self._cost(x)
            excess = float(ratios.max()) - 1
            change, cost = abs(cost - new_cost) / new_cost, new_cost
            if excess < EXCEEDED and change < SETTLED:
                break
            chosen |= _peaks(ratios) & (ratios > 1 + EXCEEDED / 10)
        self.held = chosen
        return self.law_of(x)

    def _cost(self, x: _Points) -> float:
        """Return the objective: the duration, or, if that is given, the mean of z."""
        z = self.node_matrix @ x
        return float(self.weights @ (1 / np.sqrt(z) if self.duration is None else z))

    def _improved(self, x: _Points, chosen: np.ndarray, *, near: bool) -> _Points:
        """Return the solution of the program about a law, expanded to second order if `near` the fastest."""
        program, labels, points = self._program(x, chosen)
        scale = float(np.mean(x))
        if near:
            program = dataclasses.replace(program, about=self.node_matrix @ x / scale)
        solution = solve_program(program)
        if solution.coefficients is None:
            raise self._infeasibility_error(program, labels, points)
        prices = np.zeros(chosen.shape)
        np.add.at(prices, (points, labels), solution.prices[: len(points)])
        is_first_order = np.arange(chosen.shape[1]) < len(self.labels.first)
        # limits of first order are squared in the program: a relative increase raises the bound by twice as much
        self.prices = prices * np.where(is_first_order, 2.0, 1.0) / np.sqrt(scale)
        return solution.coefficients * scale

    def _infeasibility_error(self, program: Program, labels: np.ndarray, points: np.ndarray) -> SolveError:
        """Return the error of a program without a solution, which names the limit with the largest dual variable."""
        elastic = solve_program(program, elastic=True)
        prices = elastic.prices[: len(points)]
        if elastic.coefficients is None or not prices.size or elastic.slack < 1e-5:
            return SolveError("the cone program has no solution that can be computed; try another number of cells")
        index = int(np.argmax(prices))
        label, s = self.labels.every[labels[index]], float(self.shape[0][points[index]])
        message = (
            f"no time law with these rates at the ends keeps the limits: the {label.word} of {label.owner} at "
            f"s = {s:.6g} would exceed its limit; choose smaller rates"
        )
        return SolveError(message, name="rates", value=list(self.conditions.rates))

    def ratios_at(self, u: _Points, law: RateLaw) -> Float[np.ndarray, "point curve"]:
        """Return the ratio of each quantity to its bound at values of u."""
        shape = self.parameter.derivatives(u, 4)
        return Curves(self.source(shape[0]), shape).ratios(law.at(u))

    def peaks(self, law: RateLaw, zooms: int = ZOOMS) -> tuple[_Points, _Points]:
        """Return the positions and ratios of the highest peaks, also between the points."""
        ratios = self.curves.ratios(law.at(self.points))
        indices, curve = np.nonzero(_peaks(ratios) & (ratios > min(float(ratios.max()), 1.0) - CLOSE))
        neighbors = np.clip(indices + np.array([[-1], [0], [1]]), 0, len(self.points) - 1)
        u, values, columns = self.points[neighbors], ratios[neighbors, curve], np.arange(len(indices))
        for _ in range(zooms):
            added = _about_vertex(u, values)
            u = np.concatenate([u, added])
            more_values = self.ratios_at(added.reshape(-1), law).reshape(*added.shape, -1)[:, columns, curve]
            values = np.concatenate([values, more_values])
            sequence = np.argsort(u, axis=0, kind="stable")
            u, values = np.take_along_axis(u, sequence, axis=0), np.take_along_axis(values, sequence, axis=0)
            neighbors = np.clip(np.argmax(values, axis=0) + np.array([[-1], [0], [1]]), 0, len(u) - 1)
            u, values = np.take_along_axis(u, neighbors, axis=0), np.take_along_axis(values, neighbors, axis=0)
        return u[1], values[1]

    def fastest_law(self, start: _Points) -> RateLaw:
        """Return the fastest law that keeps its limits at and between the points.

        A position between points at which a limit is exceeded becomes an enforced point, and the search continues.
        """
        law = self.run(start)
        for _ in range(EXCHANGES):
            positions, ratios = self.peaks(law, 2)
            is_exceeded = ratios > 1 + EXCEEDED
            if not is_exceeded.any():
                break
            self.extend(*self._among_points(positions[is_exceeded]))
            law = self.run(law.coefficients, settled=True)
        return self.slowed_to_limits(law)

    def _among_points(self, positions: _Points) -> tuple[_Points, Bool[np.ndarray, " point"]]:
        """Return positions between points, and those halfway to the neighboring points, all of them enforced."""
        next_index = np.clip(np.searchsorted(self.points, positions), 1, len(self.points) - 1)
        halfway = (positions + self.points[np.stack([next_index - 1, next_index])]) / 2
        points = np.unique(np.append(halfway.reshape(-1), positions))
        return points, np.ones(len(points), bool)

    def slowed_to_limits(self, law: RateLaw) -> RateLaw:
        """Return a law slowed as a whole until no peak exceeds a limit.

        Raises
        ------
        SolveError
            If slowing does not suffice.
        """
        previous, step = np.inf, np.inf
        for _ in range(SLOWINGS):
            excess = float(self.peaks(law)[1].max()) - 1 + SPARE
            if excess <= SPARE / 2:
                return law
            if excess > HOPELESS:
                break
            # a torque that mostly bears weight decreases by a small fraction of the slowing
            fell = (previous - excess) / step if np.isfinite(step) else 1.0
            step, previous = excess / float(np.clip(fell, LEAST_FALL, 1.0)), excess
            law = self.with_margin(law, step)
        message = (
            "the time law still exceeds its limits after tightening them; smooth the path where it bends sharply, or "
            "try another number of cells"
        )
        raise SolveError(message)

    def with_margin(self, law: RateLaw, excess: float) -> RateLaw:
        """Return a law with a margin to its limits: slowed as a whole, unless rates are given at the ends."""
        if self.duration is None and not any(self.conditions.rates):
            return law.slowed(1 + excess)
        self.margin += 1.1 * excess
        return self.lengthened(self.run(law.coefficients, settled=True), self.duration)

    def lengthened(self, law: RateLaw, duration: float | None) -> RateLaw:
        """Return a law with a given longer duration, from a faster law, with the least mean square of the rate.

        That is the same law slowed uniformly, unless rates are given at the ends or that exceeds a limit, as is
        possible for torques with damping.
        """
        if duration is None:
            return law
        self.prices[:], self.duration = 0.0, duration
        slowed = law.slowed(duration / law.duration)
        if not any(self.conditions.rates) and self.peaks(slowed)[1].max() <= 1:
            return slowed
        law = self.run(law.coefficients, settled=True)
        inner = np.zeros(self.basis.count)
        inner[self.basis.degree + 1 : -self.basis.degree - 1] = 1.0  # given rates at the ends stay
        for _ in range(EVENED):
            ratio = law.duration / duration
            law = dataclasses.replace(law, coefficients=law.coefficients * ratio ** (2 * inner))
            if abs(ratio - 1) < SAME:
                break
        return law

    def _program(self, x: _Points, chosen: np.ndarray) -> tuple[Program, np.ndarray, np.ndarray]:
        from scipy import sparse

        scale = float(np.mean(x))
        law = self.at(x)
        eased = max(float(self.curves.fourth_ratio(law)) / EASE, 1.0)
        slopes, right, curve = self.curves.rows(law, eased)
        point_index, row = np.nonzero(chosen[:, curve] & np.isfinite(right))
        first, dense = self.compact
        data = np.einsum("kr,krj->rj", slopes[:, point_index, row] * scale, dense[:, point_index])
        columns = first[point_index][:, None] + np.arange(data.shape[1])
        # positive coefficients make the spline positive everywhere
        count = self.basis.count
        begins = np.append(np.arange(len(point_index)) * data.shape[1], data.size + np.arange(count + 1))
        entries = np.append(data.reshape(-1), np.full(count, -1.0)), np.append(columns.reshape(-1), np.arange(count))
        rows = sparse.csr_matrix((*entries, begins), shape=(len(point_index) + count, count))
        squared = np.where(curve[row] < len(self.labels.first), 2.0, 1.0)
        margin = self.margin * self._margin_shares(point_index, curve[row])
        right = np.append(right[point_index, row] - margin * squared, np.full(self.basis.count, -FLOOR))
        if self.labels.fourth and self.limit_level == 4:  # limits of fourth order are accurate only near the last law
            rows = sparse.vstack([rows, sparse.identity(self.basis.count), -sparse.identity(self.basis.count)])
            right = np.concatenate([right, TRUST * np.abs(x) / scale, -x / TRUST / scale])
        if self.conditions.max_rate is not None:
            rows = sparse.vstack([rows, sparse.identity(self.basis.count)])
            right = np.append(right, np.full(self.basis.count, self.largest_z / scale))
        vectors = self.curves.vector
        bounds = self.curves.quantities.vector_bounds
        first = sum(len(x) for x in (self.labels.first, self.labels.second, self.labels.rates))
        points, column = np.nonzero(chosen[:, first : first + len(self.labels.vectors)] & np.isfinite(bounds))
        size = bounds[points, column]
        repeated = np.repeat(points, 3)
        cones = sum(
            sparse.diags((block[points, column] / size[:, None] * factor * scale).reshape(-1)) @ matrix[repeated]
            for block, factor, matrix in zip(vectors, (0.5, 1.0), self.matrices[1::-1], strict=True)
        )
        end_rows, end_values = self._end_equations(scale)
        cone_bounds, duration = np.full(len(size), 1 - self.margin), self.duration and self.duration * np.sqrt(scale)
        bounded = rows, right, sparse.csr_matrix(cones), cone_bounds, end_rows, end_values
        return Program(self.weights, self.node_matrix, *bounded, duration), curve[row], point_index

    def _margin_shares(self, points: np.ndarray, curve: np.ndarray) -> _Points:
        """Return the fraction of the margin that rows keep, as a given state may be at its limits."""
        if not self.conditions.further:
            return np.ones(len(points))
        counts = [len(self.labels.first), len(self.labels.second), len(self.labels.rates)]
        is_given = curve < sum(counts[: 1 + len(self.conditions.further)])
        return np.where(is_given, np.minimum(self.points[points] * self.basis.cells / GIVEN, 1.0) ** 2, 1.0)

    def _end_equations(self, scale: float) -> tuple[object, _Points]:
        """Return the equations for given rates at the ends."""
        from scipy import sparse

        ends = np.array([0.0, 1.0])
        slopes = self.parameter.derivatives(ends, 1)[1]
        fixed_rates = [(k, rate) for k, rate in enumerate(self.conditions.rates) if rate]
        values = [(rate / slopes[k]) ** 2 / scale for k, rate in fixed_rates]
        if not fixed_rates:
            return sparse.csr_matrix((0, self.basis.count)), np.zeros(0)
        rows = [self.basis.matrices(ends[[k for k, _ in fixed_rates]], 0)[0]]
        if further := self.conditions.further:
            # s'' = s_u z_u / 2 + s_uu z, and s''' / u' = s_u z_uu / 2 + 3/2 s_uu z_u + s_uuu z
            s1, s2, s3 = self.parameter.derivatives(ends[:1], 3)[1:, 0]
            z, z1, z2, _ = self.basis.matrices(ends[:1])
            sums = [s1 / 2 * z1 + s2 * z, s1 / 2 * z2 + 1.5 * s2 * z1 + s3 * z]
            divisors = [1.0, float(self.conditions.rates[0] or 0.0) / s1]
            rows += sums[: len(further)]
            values += [x / divisor / scale for x, divisor in zip(further, divisors, strict=False)]
        return sparse.vstack(rows, format="csr"), np.array(values)


def _about_vertex(u: Float[np.ndarray, "3 peak"], values: Float[np.ndarray, "3 peak"]) -> Float[np.ndarray, "3 peak"]:
    """Return the vertex of a parabola through three points, or the middle point, with a point on each side."""
    left, right = u[1] - u[0], u[2] - u[1]
    fall = (values[1] - values[0]) * right, (values[1] - values[2]) * left
    with np.errstate(divide="ignore", invalid="ignore"):
        step = (fall[0] * right - fall[1] * left) / (2 * (fall[0] + fall[1]))
    step = np.clip(np.where(np.isfinite(step), step, 0.0), -left, right)
    vertex = u[1] + np.where(np.abs(step) < 1e-3 * (left + right), 0.25 * ASIDE * (right - left), step)
    return np.stack([vertex - ASIDE * (vertex - u[0]), vertex, vertex + ASIDE * (u[2] - vertex)])


def _peaks(ratios: np.ndarray) -> np.ndarray:
    """Return the mask of local maxima of curves."""
    edge = np.full((1, ratios.shape[1]), -np.inf)
    return (ratios >= np.concatenate([edge, ratios[:-1]])) & (ratios >= np.concatenate([ratios[1:], edge]))
