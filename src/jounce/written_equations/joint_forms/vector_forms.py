"""Polynomials of components as products of vectors: ``d = r_j^P - r_i^P``, ``a = A a'``, scalar and plane products.

Vectors are tuples: ("u", body, n, field) is the n-th derivative of a vector of the joint in global components, ("d", n)
the n-th derivative of d, and ("r", body, n) the n-th derivative of an origin. Without their unknown derivatives, these
are ("h", body, n, field) and ("g", n), the right side of order n of a pin or a ball. Atoms of vectors are
("dot", X, Y), ("cross", X, Y), which is X^T R^T Y, and ("vector", X) for an equation of several rows.
"""

import math
from fractions import Fraction

from jounce.written_equations.joint_forms.polynomials import Atom, Monomial, Polynomial, joined, without
from jounce.written_equations.joint_forms.symbolic_joint import SymbolicJoint

_COMPONENTS = ("u", "d", "r")


def recognized(joint: SymbolicJoint) -> list[tuple[int, list[Polynomial]]] | None:
    """Return the number of rows of each equation of a joint, and its derivatives as products of vectors.

    The result is None if an equation has no form in vectors.
    """
    count = 2 if joint.planar else 3
    levels = [[_in_vectors(joint, row) for row in level] for level in joint.rows]
    equations, k = [], 0
    while k < len(levels[0]):
        scalar = [_in_products(level[k], count) for level in levels]
        if not any(_has_components(p) for p in scalar):
            equations.append((1, scalar))
            k += 1
            continue
        rows = [
            [_of_one_vector(level[k + c], c) if k + c < len(level) else None for c in range(count)] for level in levels
        ]
        if any(row[0] is None or any(other is None or other.terms != row[0].terms for other in row) for row in rows):
            return None
        equations.append((count, [row[0] for row in rows]))
        k += count
    return equations


def _in_vectors(joint: SymbolicJoint, row: Polynomial) -> Polynomial:
    """Return a polynomial of components of d and of the vectors of the joint."""
    points = {frame: name for name, frame in joint.vectors.items() if name.startswith("point")}
    if {"i", "j"} <= points.keys():
        by_distance = row.replaced(lambda m: _with_distance(joint, m, points))
        if not any(atom[0] == "r" for m in by_distance.terms for atom in m):
            row = by_distance
    return row.replaced(lambda m: _with_turned(joint, m))


def _turned(joint: SymbolicJoint, body: str, n: int, field: str, c: int) -> Polynomial:
    """Return a component of the n-th derivative of a vector of a body, by the entries of the attitude matrix."""
    if joint.planar:
        cosine, sine = (Polynomial.atom(("A", body, n, k, 0)) for k in (0, 1))
        x, y = (Polynomial.atom(("v", field, k)) for k in (0, 1))
        return cosine * x + sine * y * -1 if c == 0 else sine * x + cosine * y
    terms = [Polynomial({joined((("A", body, n, c, k),), (("v", field, k),)): Fraction(1)}) for k in range(3)]
    return terms[0] + terms[1] + terms[2]


def _with_distance(joint: SymbolicJoint, monomial: Monomial, points: dict[str, str]) -> Polynomial | None:
    for atom in monomial:
        if atom[:2] == ("r", "j"):
            _, _, n, c = atom
            value = Polynomial.atom(("d", n, c)) + Polynomial.atom(("r", "i", n, c))
            value = value + _turned(joint, "i", n, points["i"], c) + _turned(joint, "j", n, points["j"], c) * -1
            return value * Polynomial({without(monomial, atom): Fraction(1)})
    return None


def _with_turned(joint: SymbolicJoint, monomial: Monomial) -> Polynomial | None:
    for atom in monomial:
        if atom[0] != "A" or atom[-1] != 0 or (joint.planar and atom[3] != 0):
            continue
        _, body, n, row, _ = atom
        for other in monomial:
            if other[0] != "v" or joint.vectors[other[1]] != body or (not joint.planar and other[2] != 0):
                continue
            c = other[2] if joint.planar else row
            remainder = _turned(joint, body, n, other[1], c) + Polynomial({joined((atom,), (other,)): Fraction(-1)})
            value = Polynomial.atom(("u", body, n, other[1], c)) + remainder * -1
            return value * Polynomial({without(monomial, atom, other): Fraction(1)})
    return None


def _in_products(row: Polynomial, count: int) -> Polynomial:
    """Return a polynomial of components with scalar and plane products in the place of pairs of components."""

    def rule(monomial: Monomial) -> Polynomial | None:
        vectors = sorted((a for a in monomial if a[0] in _COMPONENTS), key=_rank)
        if len(vectors) != 2:
            return None
        (x, a), (y, b) = ((vector[:-1], vector[-1]) for vector in vectors)
        remainder = Polynomial({without(monomial, *vectors): Fraction(1)})
        if (a, b) == (0, 0):
            others = Polynomial({joined(((*x, c),), ((*y, c),)): Fraction(-1) for c in range(1, count)})
            return (Polynomial.atom(("dot", x, y)) + others) * remainder
        if (a, b) == (0, 1) and count == 2 and x != y:
            return (
                Polynomial.atom(("cross", x, y)) + Polynomial({joined(((*x, 1),), ((*y, 0),)): Fraction(1)})
            ) * remainder
        return None

    return row.replaced(rule)


def _rank(vector: Atom) -> tuple:
    """Return the sort key of a vector in products: vectors of the joint, then d, lower derivatives first."""
    kind = _COMPONENTS.index(vector[0]) if vector[0] in _COMPONENTS else 3
    return kind, *(str(x) for x in vector[1:])


def _has_components(row: Polynomial) -> bool:
    return any(atom[0] in (*_COMPONENTS, "A", "v", "e", "w") for m in row.terms for atom in m)


def _of_one_vector(row: Polynomial, c: int) -> Polynomial | None:
    """Return component c of a vector equation as the equation of the vector; None for other rows."""
    terms = {}
    for monomial, factor in row.terms.items():
        vectors = [a for a in monomial if a[0] in _COMPONENTS]
        if len(vectors) != 1 or vectors[0][-1] != c or any(a[0] in ("A", "v", "e", "w") for a in monomial):
            return None
        terms[joined(without(monomial, *vectors), (("vector", vectors[0][:-1]),))] = factor
    return Polynomial(terms)


def turning(order: int, *, known: bool = False) -> tuple[Polynomial, Polynomial]:
    """Return a and b in the derivative of the attitude matrix of a planar body, ``A^(n) = a A + b B``.

    The atoms are ("phi", n). Each order follows from lower orders by A' = phi' B; `known` omits phi^(n).
    """
    factors = [(Polynomial.number(1), Polynomial.number(0))]
    for k in range(order):
        a, b = Polynomial.number(0), Polynomial.number(0)
        for j, (aj, bj) in enumerate(factors):
            rate = Polynomial.atom(("phi", k - j + 1)) * math.comb(k, j)
            if known and k == order - 1 and j == 0:
                continue
            a, b = a + bj * rate * -1, b + aj * rate
        factors.append((a, b))
    return factors[-1]


def of_body(row: Polynomial, body: str) -> Polynomial:
    """Return a polynomial of ("phi", n) as a polynomial of the angle of a body."""
    return Polynomial({tuple(("phi", body, a[1]) for a in m): c for m, c in row.terms.items()})


def right_side(derivative: Polynomial, order: int) -> Polynomial:
    """Return the right side of an order: minus the derivative of the residual without its unknown."""

    def known(vector: Atom) -> tuple[int, Atom] | None:
        if vector[0] == "d" and vector[1] == order:
            return (-1, ("g", order)) if order > 1 else None
        if vector[0] == "u" and vector[2] == order:
            return (1, ("h", *vector[1:])) if order > 1 else None
        return None if vector[0] == "r" and vector[2] == order else (1, vector)

    terms: dict[Monomial, Fraction] = {}
    for monomial, factor in derivative.terms.items():
        sign, atoms = -factor, []
        for atom in monomial:
            if atom[0] == "phi" and atom[2] == order:
                sign = Fraction(0)
            if atom[0] in ("dot", "cross", "vector"):
                parts = [known(v) for v in atom[1:]]
                if any(p is None for p in parts):
                    sign = Fraction(0)
                    continue
                sign = sign * math.prod(p[0] for p in parts if p is not None)
                atom = (atom[0], *(p[1] for p in parts if p is not None))
            atoms.append(atom)
        key = joined(tuple(atoms))
        terms[key] = terms.get(key, Fraction(0)) + sign
    return Polynomial(terms)


def in_angles(row: Polynomial) -> Polynomial:
    """Return a polynomial of a planar joint with derivatives of its vectors expressed by derivatives of angles."""

    def rule(monomial: Monomial) -> Polynomial | None:
        for atom in monomial:
            if atom[0] not in ("dot", "cross", "vector"):
                continue
            for k, vector in enumerate(atom[1:], 1):
                if vector[0] not in ("u", "h") or vector[2] == 0 or vector[1] not in "ijm":
                    continue
                a, b = (of_body(p, vector[1]) for p in turning(vector[2], known=vector[0] == "h"))
                unit_atom = ("u", vector[1], 0, vector[3])
                along, aside = _split(atom, k, unit_atom)
                return (a * along + b * aside) * Polynomial({without(monomial, atom): Fraction(1)})
        return None

    return row.replaced(rule)


def _split(atom: Atom, k: int, unit_atom: Atom) -> tuple[Polynomial, Polynomial]:
    """Return a product with a vector in the place of its k-th vector, and with that vector turned by a right angle."""
    kind, *vectors = atom
    vectors[k - 1] = unit_atom
    along = Polynomial.atom((kind, *vectors))
    if kind == "vector":
        return along, Polynomial.atom(("vector", ("R", unit_atom)))
    other = Polynomial.atom(("cross" if kind == "dot" else "dot", *vectors))
    return along, other * (1 if (kind == "dot") == (k == 1) else -1)
