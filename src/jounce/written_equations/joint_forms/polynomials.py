"""Polynomials with rational coefficients in atoms, which are tuples."""

from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any

MOST_TERMS = 5000
LONGEST_ATOM = 3000  # characters of Python
Atom = tuple[Any, ...]
Monomial = tuple[Atom, ...]


class TooManyTermsError(Exception):
    """A polynomial has too many terms for a reader."""


class Polynomial:
    """A polynomial in atoms.

    Parameters
    ----------
    terms : mapping of tuple of Atom to Fraction
        Nonzero coefficient of each product of atoms in order.
    """

    def __init__(self, terms: Mapping[Monomial, Fraction]):
        self.terms = {m: c for m, c in terms.items() if c}

    @classmethod
    def number(cls, value: Fraction | int) -> "Polynomial":
        """Return a constant."""
        return cls({(): Fraction(value)})

    @classmethod
    def atom(cls, atom: Atom) -> "Polynomial":
        """Return an atom."""
        return cls({(atom,): Fraction(1)})

    def __add__(self, other: "Polynomial") -> "Polynomial":
        terms = dict(self.terms)
        for monomial, c in other.terms.items():
            terms[monomial] = terms.get(monomial, Fraction(0)) + c
        return Polynomial(terms)

    def __mul__(self, other: "Polynomial | Fraction | int") -> "Polynomial":
        if not isinstance(other, Polynomial):
            return Polynomial({m: c * other for m, c in self.terms.items()})
        if len(self.terms) * len(other.terms) > MOST_TERMS:
            raise TooManyTermsError(f"a product of {len(self.terms)} by {len(other.terms)} terms")
        terms: dict[Monomial, Fraction] = {}
        for m, c in self.terms.items():
            for n, d in other.terms.items():
                product = joined(m, n)
                terms[product] = terms.get(product, Fraction(0)) + c * d
        return Polynomial(terms)

    def inverse(self) -> "Polynomial":
        """Return one over the polynomial: a number for a number, otherwise an atom ("inverse", terms)."""
        if not self.terms:
            return Polynomial.atom(("inverse", ()))
        if set(self.terms) == {()}:
            return Polynomial.number(1 / self.terms[()])
        if len(self.terms) == 1:
            ((monomial, c),) = self.terms.items()
            return Polynomial({tuple(sorted((("inverse", atom) for atom in monomial), key=repr)): 1 / c})
        return Polynomial.atom(("inverse", ("sum", self.frozen())))

    def frozen(self) -> tuple[tuple[Monomial, Fraction], ...]:
        """Return the ordered terms, as part of an atom.

        Raises
        ------
        TooManyTermsError
            If the atom is too long for a reader.
        """
        rows = sorted((repr(term), term) for term in self.terms.items())
        if sum(len(text) for text, _ in rows) > LONGEST_ATOM:
            raise TooManyTermsError(f"a function of {len(rows)} long terms")
        return tuple(term for _, term in rows)

    def replaced(self, rule: Callable[[Monomial], "Polynomial | None"]) -> "Polynomial":
        """Return the polynomial with terms replaced until a rule returns None for all terms."""
        pending, result = dict(self.terms), Polynomial({})
        while pending:
            if len(pending) + len(result.terms) > MOST_TERMS:
                raise TooManyTermsError(f"more than {MOST_TERMS} terms")
            monomial, c = pending.popitem()
            other = rule(monomial)
            if other is None:
                result.terms[monomial] = result.terms.get(monomial, Fraction(0)) + c
                continue
            for m, d in other.terms.items():
                total = pending.pop(m, Fraction(0)) + c * d
                if total:
                    pending[m] = total
        return Polynomial(result.terms)


def joined(*monomials: Monomial) -> Monomial:
    """Return the product of monomials; an atom and its inverse cancel."""
    atoms = sorted((atom for monomial in monomials for atom in monomial), key=repr)
    for atom in [a[1] for a in atoms if a[0] == "inverse"]:
        if atom in atoms and ("inverse", atom) in atoms:
            atoms.remove(atom)
            atoms.remove(("inverse", atom))
    return tuple(atoms)


def without(monomial: Monomial, *atoms: Atom) -> Monomial:
    """Return a product without some of its atoms."""
    remaining = list(monomial)
    for atom in atoms:
        remaining.remove(atom)
    return tuple(remaining)
