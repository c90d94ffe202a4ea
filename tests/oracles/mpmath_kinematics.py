"""Independent judge: kinematics of a mechanism file in fifty digits, to any order.

Positions by Newton's method, then the Taylor coefficients one order after another. The Jacobian is the derivative of
the residuals along each coordinate, taken by the series themselves. TakenSteps from the starting guess runs in
floats; only the instants asked for are carried to full precision. Nothing here imports the library.
"""

from mpmath import fp, mp

from tests.oracles import mp_joints
from tests.oracles.mp_files import parameters, read, value, vector
from tests.oracles.mp_joints import PlanarPose, SpatialPose, gap, half_turn, signed_turn
from tests.oracles.mp_series import Series, atan2, sqrt

VECTORS = {"vector", "axis"}
LISTS = {"points", "vectors", "axes", "normals"}
SCALARS = {"length", "ratio", "offset", "radius", "lead"}


class Model:
    """Mechanism on one kind of scalar: `mpmath.mp` or `mpmath.fp`."""

    def __init__(self, description, ctx):
        self.ctx, self.names = ctx, parameters(description, ctx)
        self.planar = description["space"] == "planar"
        self.pose = PlanarPose if self.planar else SpatialPose
        self.bodies = list(description["bodies"])
        self.offset = {name: k * self.pose.size for k, name in enumerate(self.bodies)}
        self.size = len(self.bodies) * self.pose.size
        self.branch = {}
        space = "PLANAR" if self.planar else "SPATIAL"
        self.constraints = []
        self.start = self._guess(description["bodies"])
        for role, kinds in (("joints", "JOINTS"), ("drivers", "DRIVERS")):
            table = getattr(mp_joints, f"{space}_{kinds}")
            for entry in (description.get(role) or {}).values():
                self.constraints.append(self._constraint(entry, table[entry["type"]], role))
        self.outputs = {name: self._keys(entry) for name, entry in description["outputs"].items()}

    def _keys(self, entry):
        """Return the keys of a joint, driver or output with their values in this model's scalars."""
        keys = {"pi": +self.ctx.pi}
        for key, item in entry.items():
            if key in LISTS:
                keys[key] = [vector(v, self.names, self.ctx) for v in item]
            elif key in VECTORS or key == "point":
                keys[key] = vector(item, self.names, self.ctx)
            elif key in SCALARS:
                keys[key] = value(item, self.names, self.ctx)
            else:
                keys[key] = item
        return keys

    def _constraint(self, entry, residual, role):
        keys = self._keys(entry)
        if entry["type"] == "coordinate" and entry["bodies"][0] == "ground":
            keys.setdefault("ratio", 0)
        if role == "joints" and "offset" not in keys and entry["type"] in ("coordinate", "gear", "rolling"):
            keys["offset"] = residual(keys, None, *self._poses([self.start], entry["bodies"]))[0].c[0]
        if role == "joints" and "offset" not in keys and entry["type"] == "screw":
            i, j = self._poses([self.start], entry["bodies"])
            axis = keys["axes"][0]
            advance = mp_joints.dot(i.direction(mp_joints.unit(axis)), gap(i, j, keys["points"]))
            keys["offset"] = (advance - atan2(*half_turn(i, j, axis)) * (keys["lead"] / keys["pi"])).c[0]
        return entry["bodies"], keys, residual

    def _guess(self, bodies):
        start, ctx = [], self.ctx
        for name, body in bodies.items():
            start += vector(body.get("position", [0, 0] if self.planar else [0, 0, 0]), self.names, ctx)
            if self.planar:
                angle = value(body.get("angle", 0), self.names, ctx)
                self.branch[name] = angle
                start += [ctx.cos(angle), ctx.sin(angle)]
            else:
                start += self._quaternion(body.get("orientation") or {"quaternion": [1, 0, 0, 0]})
        return start

    def _quaternion(self, orientation):
        ctx = self.ctx
        if "quaternion" in orientation:
            return mp_joints.unit(vector(orientation["quaternion"], self.names, ctx))
        if "axis" in orientation:
            half = value(orientation["angle"], self.names, ctx) / 2
            axis = mp_joints.unit(vector(orientation["axis"], self.names, ctx))
            return [ctx.cos(half), *(ctx.sin(half) * u for u in axis)]
        p = [ctx.mpf(1), *[ctx.mpf(0)] * 3]
        for letter, angle in zip(orientation["euler"], vector(orientation["angles"], self.names, ctx), strict=True):
            k = "xyz".index(letter)
            turn = [ctx.cos(angle / 2), *(ctx.sin(angle / 2) if n == k else ctx.mpf(0) for n in range(3))]
            v = mp_joints.cross(p[1:], turn[1:])
            scalar = p[0] * turn[0] - mp_joints.dot(p[1:], turn[1:])
            p = [scalar, *(p[0] * turn[n + 1] + turn[0] * p[n + 1] + v[n] for n in range(3))]
        return p

    def _series(self, table, first):
        """Return the coordinate series of one body from a list (one entry per order) of coordinate lists."""
        return [Series([row[n] for row in table]) for n in range(first, first + self.pose.size)]

    def _poses(self, table, names):
        out = []
        for name in names:
            if name == "ground":
                fixed = [0, 0, 1, 0] if self.planar else [0, 0, 0, 1, 0, 0, 0]
                zeros = [self.ctx.mpf(0)] * (len(table) - 1)
                out.append(self.pose([Series([self.ctx.mpf(x), *zeros]) for x in fixed], self.ctx.mpf(0)))
            else:
                out.append(self.pose(self._series(table, self.offset[name]), self.branch.get(name)))
        return out

    def motions(self, t, order):
        """Return the series of every driver's motion at an instant, None for a joint."""
        zero = self.ctx.mpf(0)
        time = Series([self.ctx.mpf(t), zero + 1, *[zero] * order][: order + 1])
        out = []
        for _, keys, _ in self.constraints:
            f = None if "motion" not in keys else value(keys["motion"], self.names | {"t": time}, self.ctx)
            out.append(f if f is None or isinstance(f, Series) else Series([f, *[zero] * order]))
        return out

    def residuals(self, table, motions):
        """Return the series of all residuals, normalizations last."""
        n, out = len(table), []
        for (names, keys, residual), f in zip(self.constraints, motions, strict=True):
            out += residual(keys, None if f is None else Series(f.c[:n]), *self._poses(table, names))
        for pose in self._poses(table, self.bodies):
            out.append(pose.normalization())
        return out

    def jacobian(self, x, motions):
        """Return the matrix of derivatives of the residuals, one coordinate after another, time held still."""
        zero, ctx = self.ctx.mpf(0), self.ctx
        matrix, row = [], 0
        entries = [(names, r, k, f) for (names, k, r), f in zip(self.constraints, motions, strict=True)]
        entries += [([name], lambda k, f, body: [body.normalization()], {}, None) for name in self.bodies]
        for names, residual, keys, f in entries:
            frozen = None if f is None else Series([f.c[0], zero])
            for body in dict.fromkeys(names):
                if body == "ground":
                    continue
                for n in range(self.offset[body], self.offset[body] + self.pose.size):
                    step = [zero] * self.size
                    step[n] = ctx.mpf(1)
                    column = residual(keys, frozen, *self._poses([x, step], names))
                    while len(matrix) < row + len(column):
                        matrix.append([zero] * self.size)
                    for m, entry in enumerate(column):
                        matrix[row + m][n] = entry.c[1]
            row = len(matrix)
        return matrix

    def solve_position(self, x, t, tolerance, lu=None, limit=60):
        """Return coordinates that satisfy every residual, by Newton's method; with `lu`, by the chord method."""
        motions = self.motions(t, 0)
        for _ in range(limit):
            rest = [-r.c[0] for r in self.residuals([x], motions)]
            step = solve(lu or factor(self.jacobian(x, motions)), rest)
            x = [a + b for a, b in zip(x, step, strict=True)]
            if max(abs(s) for s in step) < tolerance:
                return x
        raise ArithmeticError(f"no convergence at t = {t}")

    def solve_orders(self, x, t, order):
        """Return the Taylor coefficients of all coordinates, a list per order, and the factored Jacobian."""
        motions = self.motions(t, order)
        lu, table = factor(self.jacobian(x, motions)), [x]
        for _ in range(order):
            table.append([self.ctx.mpf(0)] * self.size)
            table[-1] = solve(lu, [-r.c[-1] for r in self.residuals(table, motions)])
        return table, lu

    def advance(self, past, t, lu):
        """Return coordinates at an instant: the cubic through those of the last ones, corrected with the factors given.

        Returns them and the factors: others where those are too far from the instant.
        """
        weights = ([1], [2, -1], [3, -3, 1], [4, -6, 4, -1])[min(len(past), 4) - 1]
        x = [sum(w * row[n] for w, row in zip(weights, reversed(past), strict=False)) for n in range(self.size)]
        try:
            return self.solve_position(x, t, 1e-8, lu, limit=8), lu
        except ArithmeticError:
            lu = factor(self.jacobian(x, self.motions(t, 0)))
            return self.solve_position(x, t, 1e-8, lu), lu

    def commit(self, table):
        """Remember the branch of every angle, so that the next instant continues it; return the outputs."""
        if self.planar:
            for name, pose in zip(self.bodies, self._poses(table, self.bodies), strict=True):
                self.branch[name] = pose.angle.c[0]
        out = {}
        for name, keys in self.outputs.items():
            found = self._output(name, keys, table)
            if keys.get("quantity") == "angle" and not self.planar:
                self.branch[f"output {name}"] = found[0].c[0]
            out[name] = found
        return out

    def _output(self, name, keys, table):
        poses = self._poses(table, keys["bodies"] if "bodies" in keys else [keys["body"]])
        kind = keys.get("quantity", "point")
        if kind == "point":
            return poses[0].point(keys["point"])
        if kind == "distance":
            d = gap(*poses, keys["points"])
            return [sqrt(mp_joints.dot(d, d))]
        if kind == "angular_velocity":
            return [poses[0].angle.differentiate()] if self.planar else poses[0].angular_velocity(keys.get("frame"))
        if self.planar:
            return [poses[-1].angle - poses[0].angle] if len(poses) == 2 else [poses[0].angle]
        near = self.branch.get(f"output {name}")
        if "vectors" in keys:
            return [atan2(*signed_turn(*poses, keys["axis"], keys["vectors"]), near)]
        return [2 * atan2(*half_turn(*poses, keys["axis"]), None if near is None else near / 2)]


def factor(matrix):
    """Return an LU factorization with row exchanges."""
    a, n, order = [row[:] for row in matrix], len(matrix), list(range(len(matrix)))
    if any(len(row) != n for row in a):
        raise ArithmeticError(f"{n} residuals for {len(a[0])} coordinates")
    for k in range(n):
        p = max(range(k, n), key=lambda r: abs(a[r][k]))
        if abs(a[p][k]) < 1e-14:
            raise ArithmeticError("singular position")
        a[k], a[p], order[k], order[p] = a[p], a[k], order[p], order[k]
        filled = [c for c in range(k + 1, n) if a[k][c] != 0]
        for r in range(k + 1, n):
            if a[r][k] != 0:
                a[r][k] /= a[k][k]
                for c in filled:
                    a[r][c] -= a[r][k] * a[k][c]
    return a, order


def solve(lu, right):
    """Return the solution of the factored system."""
    a, order = lu
    n, y = len(a), []
    for k in range(n):
        y.append(right[order[k]] - sum((a[k][c] * y[c] for c in range(k) if a[k][c] != 0), right[0] * 0))
    for k in reversed(range(n)):
        y[k] = (y[k] - sum((a[k][c] * y[c] for c in range(k + 1, n) if a[k][c] != 0), right[0] * 0)) / a[k][k]
    return y


def instants(description, count=11):
    """Return indices into the file's time grid, spread unevenly over it, and the grid itself as floats."""
    names = parameters(description)
    start, stop, step = (value(description["time"][key], names) for key in ("start", "stop", "step"))
    steps = int(mp.nint((stop - start) / step))
    grid = [float(start + step * k) for k in range(steps + 1)]
    inner = [round(k * steps / (count - 1)) - 3 * k % 5 for k in range(1, count - 1)]
    return [0, *inner, steps], grid


def solve_file(description, order=10, digits=50, count=11):
    """Return times and, per output, the plain derivatives as a nested list [instant][component][derivative].

    Parameters
    ----------
    description : dict or path
        A mechanism file, or what `read` returns for it.
    order : int
        Highest derivative of the outputs.
    digits : int
        Decimal digits of the arithmetic.
    count : int
        Number of instants, spread over the file's time grid; each is the double nearest to the grid's value.
    """
    description = description if isinstance(description, dict) else read(description)
    with mp.workdps(digits):
        rough, fine = Model(description, fp), Model(description, mp)
        chosen, grid = instants(description, count)
        x, times, found = rough.solve_position(rough.start, grid[0], 1e-11), [], {name: [] for name in fine.outputs}
        past, still = [], [0.0] * rough.size
        lu = factor(rough.jacobian(x, rough.motions(grid[0], 0)))
        for k, t in enumerate(grid):
            if k:
                x, lu = rough.advance(past, t, lu)
            past = [*past[-3:], x]
            rough.commit([x, still])
            if k in chosen:
                fine.branch = {name: mp.mpf(a) for name, a in rough.branch.items()}
                times.append(t)
                y = fine.solve_position([mp.mpf(a) for a in x], mp.mpf(t), mp.mpf(10) ** (8 - digits))
                for name, parts in fine.commit(fine.solve_orders(y, mp.mpf(t), order + 1)[0]).items():
                    found[name].append([part.derivatives()[: order + 1] for part in parts])
    return times, found
