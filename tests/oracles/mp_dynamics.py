"""Independent judge: equations of motion with constraints in many digits, to any order, from T, Q and g alone.

A mechanism is a list of coordinates q, and scalar functions of them: the kinetic energy is a sum of weighted squares
of rates, ``T = 1/2 sum w x(q)'^2`` (of coordinates of centers of mass, angles, columns of the attitude matrix), each
force F does work on one displacement ``s(q)``, and each constraint is ``g(q, t) = 0``. Then, by d'Alembert,

    sum w x'' dx/dq + sum lambda dg/dq = sum F ds/dq,

solved for one Taylor coefficient of q and lambda after another. The functions are a graph of nodes that remember their
coefficients, so that a new order costs one more row of every product; gradients are graphs as well. Nothing here
imports the library, and any coordinates will do: angles of a loop, absolute coordinates, quaternions judge each other.
"""

from mpmath import mp


class Node:
    """Scalar function of time, known by its Taylor coefficients so far; `update` computes the next one."""

    graph: list = []  # the graph being built; a Problem starts a new one
    beside: tuple = ()  # nodes that are computed side by side with this one

    def __init__(self, *inputs):
        self.inputs, self.c = inputs, []
        Node.graph.append(self)

    def __add__(self, other):
        other = node(other)
        if is_zero(self) or is_zero(other):
            return other if is_zero(self) else self
        return Sum(self, other)

    def __mul__(self, other):
        other = node(other)
        for a, b in ((self, other), (other, self)):
            if isinstance(a, Constant) and a.value in (0, 1):
                return b if a.value == 1 else a
        if isinstance(self, Constant) and isinstance(other, Constant):
            return Constant(self.value * other.value)
        return Product(self, other)

    def __truediv__(self, other):
        return Quotient(self, node(other))

    def __rtruediv__(self, other):
        return node(other) / self

    def __neg__(self):
        return self * -1

    def __sub__(self, other):
        return self + (-node(other))

    def __rsub__(self, other):
        return node(other) + (-self)

    __radd__, __rmul__ = __add__, __mul__


class Constant(Node):
    """Number."""

    def __init__(self, value):
        super().__init__()
        self.value = value

    def update(self, k):
        return self.value if k == 0 else mp.mpf(0)


class Free(Node):
    """Coordinate or multiplier: its coefficients are put in from outside."""


class Time(Node):
    """The time itself."""

    at = mp.mpf(0)

    def update(self, k):
        return (self.at, mp.mpf(1))[k] if k < 2 else mp.mpf(0)


class Sum(Node):
    """a + b."""

    def update(self, k):
        a, b = self.inputs
        return a.c[k] + b.c[k]

    def partials(self):
        return [Constant(mp.mpf(1)), Constant(mp.mpf(1))]


class Product(Node):
    """a b."""

    def update(self, k):
        a, b = self.inputs
        return mp.fdot(zip(a.c[: k + 1], b.c[k::-1], strict=True))

    def partials(self):
        a, b = self.inputs
        return [b, a]


class Quotient(Node):
    """a / b."""

    def update(self, k):
        a, b = self.inputs
        rest = mp.fdot(zip(self.c[:k], b.c[k:0:-1], strict=True)) if k else 0
        return (a.c[k] - rest) / b.c[0]

    def partials(self):
        _, b = self.inputs
        return [Constant(mp.mpf(1)) / b, -(self / b)]


class Root(Node):
    """Square root."""

    def update(self, k):
        (a,) = self.inputs
        if k == 0:
            return mp.sqrt(a.c[0])
        rest = mp.fdot(zip(self.c[1:k], self.c[k - 1 : 0 : -1], strict=True)) if k > 1 else 0
        return (a.c[k] - rest) / (2 * self.c[0])

    def partials(self):
        return [Constant(mp.mpf(1)) / (2 * self)]


class Sine(Node):
    """Sine, and its cosine beside it."""

    def __init__(self, angle):
        super().__init__(angle)
        self.cosine = Cosine(angle)
        self.beside, self.cosine.beside = (self.cosine,), (self,)

    def update(self, k):
        (a,) = self.inputs
        return _turned(mp.sin, a, self.cosine, k, 1)

    def partials(self):
        return [self.cosine]


class Cosine(Node):
    """Cosine, beside its sine."""

    def update(self, k):
        (a,) = self.inputs
        return _turned(mp.cos, a, self.beside[0], k, -1)

    def partials(self):
        return [-self.beside[0]]


def _turned(function, a, other, k, sign):
    if k == 0:
        return function(a.c[0])
    return sign * mp.fdot((j * a.c[j], other.c[k - j]) for j in range(1, k + 1)) / k


class Rate(Node):
    """Time derivative: always one coefficient behind its input."""

    def update(self, k):
        (a,) = self.inputs
        return (k + 1) * a.c[k + 1]


def node(x):
    """Return a number, in decimal text or any numeric type, as a node; a node stays."""
    return x if isinstance(x, Node) else Constant(mp.mpf(x))


def is_zero(x):
    """Tell whether a node is the constant zero."""
    return isinstance(x, Constant) and x.value == 0


def sin(a):
    """Return the sine, computed once for each angle."""
    a = node(a)
    if not hasattr(a, "trigonometric"):
        a.trigonometric = Sine(a)
    return a.trigonometric


def cos(a):
    """Return the cosine."""
    return sin(a).cosine


def sqrt(a):
    """Return the square root."""
    return Root(node(a))


def gradient(function, variables):
    """Return the partial derivatives of a node by free nodes, as nodes, by the chain rule backwards."""
    slopes, last = {function: Constant(mp.mpf(1))}, Node.graph.index(function)
    for n in Node.graph[last::-1]:
        if n in slopes and n.inputs:
            for i, partial in zip(n.inputs, n.partials(), strict=True):
                if not isinstance(i, (Constant, Time)):
                    slopes[i] = slopes.get(i, node(0)) + slopes[n] * partial
    return [slopes.get(v, node(0)) for v in variables]


class Problem:
    """Mechanism by its kinetic energy, forces and constraints; see the top of this file.

    Call `coordinates` first, then `inertia`, `force` and `constraint`, `close`, and `start` at a state; `solve` extends
    the series about it, `integrate` carries the state on.
    """

    def __init__(self):
        Node.graph = []
        self.q, self.inertias, self.forces, self.constraints, self.watched = [], [], [], [], []
        self.time = Time()

    def coordinates(self, count):
        """Return free nodes."""
        new = [Free() for _ in range(count)]
        self.q += new
        return new

    def inertia(self, weight, function):
        """Add 1/2 w x'^2 to the kinetic energy."""
        self.inertias.append((mp.mpf(weight), node(function)))

    def force(self, value, displacement):
        """Add a force that does the work F ds; the value is a node or a number."""
        self.forces.append((node(value), node(displacement)))

    def constraint(self, function):
        """Add g(q, t) = 0; its multiplier is one more unknown."""
        self.constraints.append(node(function))

    def watch(self, function):
        """Keep a function of the coordinates as a result, made before `close`, and return it."""
        self.watched.append(node(function))
        return self.watched[-1]

    def close(self):
        """Build the graphs of the gradients and of the balance."""
        self.multipliers = [Free() for _ in self.constraints]
        terms = [(w * Rate(Rate(x)), gradient(x, self.q)) for w, x in self.inertias]
        terms += [(-value, gradient(s, self.q)) for value, s in self.forces]
        self.slopes = [gradient(g, self.q) for g in self.constraints]
        terms += list(zip(self.multipliers, self.slopes, strict=True))
        self.balance = []
        for i in range(len(self.q)):
            total = node(0)
            for factor, slope in terms:
                total = total + factor * slope[i]
            self.balance.append(total)
        self.mass = [
            (w, [(i, s) for i, s in enumerate(slope) if not is_zero(s)])
            for (w, _), (_, slope) in zip(self.inertias, terms, strict=False)
        ]
        series = [*self.q, *self.watched, *self.multipliers, *self.constraints, *self.balance]
        series += [s for slope in self.slopes for s in slope]
        series += [s for _, slope in self.mass for _, s in slope]
        self._order(series)
        return self

    def _order(self, series):
        """Keep the nodes that are needed, inputs before what is made of them, and tell how far each lags behind q."""
        waiting, needed = list(series), set()
        while waiting:
            n = waiting.pop()
            if n not in needed:
                needed.add(n)
                waiting += [*n.inputs, *n.beside]
        self.nodes = [n for n in Node.graph if n in needed or n is self.time]
        for n in self.nodes:
            first = 2 if n in self.multipliers else 0
            n.lag = max((i.lag for i in n.inputs), default=first) + isinstance(n, Rate)

    def _fill(self, level):
        """Compute (again) the last coefficient of every node: q has those up to the level, others lag behind."""
        for n in self.nodes:
            k = level - n.lag
            if k >= 0 and not isinstance(n, Free):
                del n.c[k:]
                n.c.append(n.update(k))

    def start(self, time, position, velocity):
        """Put in a state; it must fulfill the constraints."""
        for n in self.nodes:
            n.c = []
        self.time.at = mp.mpf(time)
        for n, x, v in zip(self.q, position, velocity, strict=True):
            n.c = [mp.mpf(x), mp.mpf(v)]
        self._fill(0)
        self._fill(1)
        self.factored = None
        return self

    def solve(self, order):
        """Extend the coefficients of q to an order, and those of the multipliers to two less."""
        size = len(self.q)
        for level in range(len(self.q[0].c), order + 1):
            for n in (*self.q, *self.multipliers):
                n.c.append(mp.mpf(0))
            self._fill(level)
            if self.factored is None:
                self.factored = mp.LU_decomp(self._matrix())
            scale = level * (level - 1)
            right = [-b.c[level - 2] for b in self.balance] + [-g.c[level] * scale for g in self.constraints]
            found = mp.U_solve(self.factored[0], mp.L_solve(self.factored[0], mp.matrix(right), self.factored[1]))
            for n, x in zip(self.q, found[:size], strict=True):
                n.c[level] = x / scale
            for n, x in zip(self.multipliers, found[size:], strict=True):
                n.c[level - 2] = x
            self._fill(level)
        return self

    def _matrix(self):
        """Return [[M, G^T], [G, 0]]."""
        size = len(self.q)
        matrix = mp.zeros(size + len(self.constraints))
        for w, slope in self.mass:
            for i, a in slope:
                for j, b in slope:
                    matrix[i, j] += w * a.c[0] * b.c[0]
        for r, slope in enumerate(self.slopes):
            for i, s in enumerate(slope):
                matrix[size + r, i] = matrix[i, size + r] = s.c[0]
        return matrix

    def derivatives(self, *nodes):
        """Return the plain derivatives of nodes, a list for each, as far as they have been computed."""
        return [[c * mp.factorial(k) for k, c in enumerate(n.c)] for n in nodes]

    def energy(self):
        """Return the kinetic energy now."""
        return sum(w * x.c[1] ** 2 for w, x in self.inertias) / 2

    def state_after(self, h):
        """Return position and velocity at a time h later, by the series."""
        position = [mp.fsum(c * h**k for k, c in enumerate(n.c)) for n in self.q]
        velocity = [mp.fsum(k * c * h ** (k - 1) for k, c in enumerate(n.c) if k) for n in self.q]
        return position, velocity

    def integrate(self, stop, order, tolerance):
        """Carry the state to an instant by its series; a step ends where the last terms weigh as little as asked."""
        stop, steps = mp.mpf(stop), 0
        while self.time.at < stop:
            self.solve(order)
            limits = []
            for k in range(order - 3, order + 1):
                size = max(abs(n.c[k]) / (1 + abs(n.c[0])) for n in self.q)
                if size:
                    limits.append((mp.mpf(tolerance) / size) ** (mp.mpf(1) / k))
            left = stop - self.time.at
            h = min(*limits, left)
            self.start(stop if h == left else self.time.at + h, *self.state_after(h))
            steps += 1
        self.steps = steps
        return self

    def consistent(self, position, velocity, fixed=()):
        """Return a state that fulfills the constraints: Newton's method, those in `fixed` held as they are."""
        position, velocity = [mp.mpf(x) for x in position], [mp.mpf(v) for v in velocity]
        free = [i for i in range(len(self.q)) if i not in fixed]
        for _ in range(100):
            self.start(self.time.at, position, velocity)
            step = self._least(free, [-g.c[0] for g in self.constraints])
            for i, x in zip(free, step, strict=True):
                position[i] += x
            if max(abs(x) for x in step) < mp.mpf(10) ** (5 - mp.dps):
                break
        self.start(self.time.at, position, velocity)
        step = self._least(free, [-g.c[1] for g in self.constraints])
        for i, x in zip(free, step, strict=True):
            velocity[i] += x
        return position, velocity

    def _least(self, free, right):
        """Return the shortest change of the free coordinates that changes the constraints as asked."""
        slope = mp.matrix([[row[i].c[0] for i in free] for row in self.slopes])
        return list(slope.T * mp.lu_solve(slope * slope.T, mp.matrix(right)))
