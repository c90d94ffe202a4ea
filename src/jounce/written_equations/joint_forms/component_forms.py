"""Equations of joints without a vector form, by coordinates: entries of attitude matrices, Euler parameters."""

import math
from fractions import Fraction

from jounce.written_equations.joint_forms.polynomials import Atom, Monomial, Polynomial, without
from jounce.written_equations.joint_forms.symbolic_joint import SymbolicJoint
from jounce.written_equations.joint_forms.vector_forms import of_body, turning


def in_coordinates(joint: SymbolicJoint, row: Polynomial) -> Polynomial:
    """Return a polynomial with derivatives of attitudes expressed by angles, or by angular velocities."""
    replaced: dict[Atom, Polynomial] = {}

    def rule(monomial: Monomial) -> Polynomial | None:
        for atom in monomial:
            if atom[0] in ("A", "e") and atom[2] > 0:
                if atom not in replaced:
                    replaced[atom] = _planar(atom) if joint.planar else _spatial(atom, replaced)
                return replaced[atom] * Polynomial({without(monomial, atom): Fraction(1)})
        return None

    return row.replaced(rule)


def _planar(atom: Atom) -> Polynomial:
    """Return a derivative of a cosine or a sine."""
    _, body, n, sine, _ = atom
    along, aside = (of_body(p, body) for p in turning(n))
    cosine, other = (Polynomial.atom(("A", body, 0, k, 0)) for k in (0, 1))
    return along * other + aside * cosine if sine else along * cosine + aside * other * -1


def _spatial(atom: Atom, known: dict[Atom, Polynomial]) -> Polynomial:
    """Return a derivative of an entry of an attitude matrix or of an Euler parameter, by lower derivatives."""
    kind, body, n, *place = atom
    derivative = Polynomial({})
    for j in range(n):
        for factor, other, c in _rates(kind, place):
            rate = Polynomial.atom(("w", body, n - 1 - j, c)) * (factor * math.comb(n - 1, j))
            derivative = derivative + Polynomial.atom((kind, body, j, *other)) * rate
    del known
    return derivative


def _rates(kind: str, place: list[int]) -> list[tuple[Fraction, list[int], int]]:
    """Return the terms of A' = A skew(w) or p' = p o (0, w) / 2: a factor, an entry, a component of w."""
    if kind == "A":
        row, column = place
        i, j = {0: (1, 2), 1: (2, 0), 2: (0, 1)}[column]
        return [(Fraction(1), [row, i], j), (Fraction(-1), [row, j], i)]
    half, (k,) = Fraction(1, 2), place
    table = {0: [(-1, 1, 0), (-1, 2, 1), (-1, 3, 2)], 1: [(1, 0, 0), (-1, 3, 1), (1, 2, 2)],
             2: [(1, 3, 0), (1, 0, 1), (-1, 1, 2)], 3: [(-1, 2, 0), (1, 1, 1), (1, 0, 2)]}  # fmt: skip
    return [(half * sign, [other], c) for sign, other, c in table[k]]


def without_unknown(row: Polynomial, order: int) -> Polynomial:
    """Return a derivative of a residual without the derivatives of coordinates of the same order."""

    def unknown(atom: Atom) -> bool:
        return (atom[0] in ("r", "phi") and atom[2] == order) or (atom[0] == "w" and atom[2] == order - 1)

    return Polynomial({m: c for m, c in row.terms.items() if not any(map(unknown, m))})


def component_jacobian(rate: Polynomial, body: str, *, planar: bool) -> list[Polynomial]:
    """Return the derivatives of a residual by the coordinates of a body, from its first time derivative."""
    count = 2 if planar else 3
    atoms: list[Atom] = [("r", body, 1, c) for c in range(count)]
    atoms += [("phi", body, 1)] if planar else [("w", body, 0, c) for c in range(3)]
    return [Polynomial({without(m, atom): c for m, c in rate.terms.items() if atom in m}) for atom in atoms]
