"""LaTeX text of atoms and polynomials, in the nomenclature of Sommer 2024."""

from collections import Counter
from collections.abc import Sequence
from fractions import Fraction

from jounce.written_equations.joint_forms.polynomials import Atom, Monomial, Polynomial
from jounce.written_equations.joint_forms.symbolic_joint import length_of

SIDES = (r"\mathbf{v}", r"\boldsymbol{\gamma}", r"\boldsymbol{\eta}", r"\boldsymbol{\sigma}")
_DOTS = ("", r"\dot", r"\ddot", r"\dddot", r"\ddddot")
_VECTORS = {"point": r"\mathbf{s}", "vector": r"\mathbf{a}", "axis": r"\mathbf{u}", "normal": r"\mathbf{n}"}
_NUMBERS = {"length": "L", "ratio": "K", "offset": "C", "radius": r"\rho", "lead": "p"}
_RELATIONS = {"lt": "<", "le": r"\le", "gt": ">", "ge": r"\ge", "eq": "=", "ne": r"\ne"}
_PRODUCTS = ("dot", "cross", "vector")


def escaped(text: str) -> str:
    """Return the text of a user in LaTeX: ASCII, without commands."""
    ascii_text = " ".join(text.encode("ascii", "replace").decode().split())
    special = {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
    return "".join(special.get(c, f"\\{c}" if c in "&%$#_{}" else c) for c in ascii_text)


def dotted(symbol: str, index: str, n: int) -> str:
    """Return a symbol with an index and the dots of the n-th derivative, or the number n if it is high."""
    if n == 0:
        return symbol + index
    return f"{_DOTS[n]}{{{symbol}}}{index}" if n < len(_DOTS) else rf"\overset{{({n})}}{{{symbol}}}{index}"


def local(field: str, body: str) -> str:
    """Return the name of a vector of a joint in the frame of its body."""
    stem = field.removesuffix(f"_{body}")
    symbol = _VECTORS.get(stem, rf"\mathbf{{{stem.replace('_', '')}}}")
    return f"{symbol}_{body}'" + ("^{P}" if stem == "point" else "")


def skew(vector: str) -> str:
    """Return the matrix of the vector product of a vector."""
    symbol, _, index = vector.partition("_")
    return rf"\tilde{{{symbol}}}_{index}"


def of_vector(vector: Atom, planar: bool) -> str:
    """Return the text of a vector."""
    kind, *rest = vector
    if kind == "d":
        return dotted(r"\mathbf{d}", "_{ij}", rest[0])
    if kind == "g":
        return right_side_name(rest[0], planar)
    if kind == "r":
        return dotted(r"\mathbf{r}", f"_{rest[0]}", rest[1])
    if kind == "R":
        _, body, _, field = rest[0]
        return rf"\mathbf{{B}}_{body} {local(field, body)}"
    body, n, field = rest
    if n == 0 and not field.startswith("point"):
        return local(field, body).replace("'", "")
    turned = _turned(body, n, known=kind == "h")
    return rf"\mathbf{{A}}_{body} {turned}{' ' if turned else ''}{local(field, body)}"


def _turned(body: str, n: int, *, known: bool) -> str:
    """Return the factor of the attitude matrix in its n-th derivative."""
    if n == 0:
        return ""
    spin, last = (dotted(r"\tilde{\boldsymbol{\omega}}", f"_{body}'", k) for k in (0, n - 1))
    symbols = {2: f"{spin} {spin}", 3: rf"\mathbf{{H}}_{body}'", 4: rf"\mathbf{{W}}_{body}'"}
    if n == 1:
        return spin
    symbol = symbols.get(n, rf"\mathbf{{M}}_{{{body},{n}}}'")
    return symbol if known else rf"\left( {symbol} + {last} \right)"


def right_side_name(n: int, planar: bool) -> str:
    """Return the name of the right side of order n of a pin or a ball."""
    name = SIDES[n - 1] if n <= len(SIDES) else rf"\boldsymbol{{\kappa}}_{{{n}}}"
    return f"{name}^{{{'r' if planar else 's'}}}"


def in_brackets(text: str) -> str:
    """Return a text, in brackets if it has more than one symbol."""
    return rf"\left( {text} \right)" if " " in text else text


def total(terms: Sequence[tuple[int, str]]) -> str:
    """Return the sum of terms, each a sign and a text; zero without terms."""
    sum_text = ""
    for sign, text in terms:
        sum_text += (f" {'-' if sign < 0 else '+'} " if sum_text else "-" if sign < 0 else "") + text
    return sum_text or "0"


class Words:
    """The LaTeX text of polynomials of a joint."""

    def __init__(self, planar: bool):
        self.planar = planar

    def side(self, n: int, *, own: bool = False) -> str:
        """Return the name of the right side of order n; `own` for a pin or a ball."""
        if own:
            return right_side_name(n, self.planar)
        return SIDES[n - 1] if n <= len(SIDES) else rf"\boldsymbol{{\kappa}}_{{{n}}}"

    def polynomial(self, row: Polynomial) -> str:
        """Return the text of a polynomial, with terms grouped by their product of vectors."""
        groups: dict[Monomial, Polynomial] = {}
        for monomial, factor in row.terms.items():
            products = tuple(a for a in monomial if a[0] in _PRODUCTS)
            factors = tuple(a for a in monomial if a[0] not in _PRODUCTS)
            groups[products] = groups.get(products, Polynomial({})) + Polynomial({factors: factor})
        parts = [(group, " ".join(map(self._product, products))) for products, group in groups.items()]
        return total(self.terms(sorted(parts, key=lambda part: part[1], reverse=True)))

    def terms(self, parts: Sequence[tuple[Polynomial, str]]) -> list[tuple[int, str]]:
        """Return signed terms from pairs of a factor and a text; pairs with the same text are combined."""
        factors: dict[str, Polynomial] = {}
        for factor, text in parts:
            factors[text] = factors.get(text, Polynomial({})) + factor
        return [term for text, factor in factors.items() if factor.terms for term in self._multiplied(factor, text)]

    def _multiplied(self, factor: Polynomial, text: str) -> list[tuple[int, str]]:
        terms = [self._scalars(m, c) for m, c in sorted(factor.terms.items(), key=_by_size)]
        if not text or len(terms) == 1:
            return [(sign, f"{word} {text}".strip() if word != "1" or not text else text) for sign, word in terms]
        flip = -1 if terms[0][0] < 0 else 1
        return [(flip, rf"\left( {total([(sign * flip, word) for sign, word in terms])} \right) {text}")]

    def _scalars(self, monomial: Monomial, factor: Fraction) -> tuple[int, str]:
        """Return the sign and the text of a product of numbers."""
        size, numerator, denominator = abs(factor), [], []
        for atom, power in Counter(monomial).items():
            is_inverse = atom[0] == "inverse"
            text = self._scalar(atom[1] if is_inverse else atom)
            raised = text if power == 1 else f"{_base(text)}^{{{power}}}"
            (denominator if is_inverse else numerator).append(raised)
        if size.denominator != 1:
            numerator.insert(0, rf"\tfrac{{{size.numerator}}}{{{size.denominator}}}")
        elif size != 1 or not numerator:
            numerator.insert(0, str(size.numerator))
        text = " ".join(numerator)
        return (1 if factor > 0 else -1), rf"\frac{{{text}}}{{{' '.join(denominator)}}}" if denominator else text

    def _product(self, atom: Atom) -> str:
        kind, *vectors = atom
        texts = [of_vector(vector, self.planar) for vector in vectors]
        if kind == "vector":
            return texts[0]
        return f"{in_brackets(texts[0])}^T " + (r"\mathbf{R}^T " if kind == "cross" else "") + texts[1]

    def _scalar(self, atom: Atom) -> str:
        kind, *rest = atom
        if kind == "phi":
            return dotted(r"\phi", f"_{rest[0]}", rest[1])
        if kind == "f":
            n = rest[0]
            return "f" if n == 0 else f"f_{{{'t' * n}}}" if n <= 4 else f"f_{{t^{{{n}}}}}"
        if kind in ("t", "theta"):
            return "t" if kind == "t" else r"\theta"
        if kind == "c":
            return f"c_{{{rest[0]}}}"
        if kind == "k":
            return _NUMBERS.get(rest[0], rf"\mathrm{{{rest[0].replace('_', ' ')}}}")
        if kind == "v":
            body = rest[0][-1] if rest[0][-2:] in ("_i", "_j", "_m") else "i"
            return rf"\left[{local(rest[0], body)}\right]_{'xyz'[rest[1]]}"
        if kind in ("r", "A", "e", "w"):
            return self._coordinate(kind, *rest)
        if kind == "sum":
            return rf"\left( {self.polynomial(Polynomial(dict(rest[0])))} \right)"
        return self._function(*rest) if kind == "function" else r"\infty"

    def _coordinate(self, kind: str, body: str, n: int, *place: int) -> str:
        if kind == "r":
            return dotted("xyz"[place[0]], f"_{body}", n)
        if kind == "A" and self.planar:
            return rf"\{'sin' if place[0] else 'cos'}\phi_{body}"
        if kind == "A":
            return f"A_{{{body},{place[0] + 1}{place[1] + 1}}}"
        if kind == "e":
            return f"e_{{{place[0]},{body}}}"
        return dotted(r"\omega", f"_{{{body}{'xyz'[place[0]]}}}'", n)

    def _function(self, name: str, arguments: Sequence[tuple]) -> str:
        rows = [Polynomial(dict(argument)) for argument in arguments]
        if name == "sqrt" and (field := length_of(rows[0])):
            body = field[-1] if field[-2:] in ("_i", "_j", "_m") else "i"
            return rf"\left| {local(field, body)} \right|"
        texts = [self.polynomial(row) for row in rows]
        if name in _RELATIONS:
            return f"{texts[0]} {_RELATIONS[name]} {texts[1]}"
        if name == "sqrt":
            return rf"\sqrt{{{texts[0]}}}"
        return rf"\operatorname{{{name.replace('_', ' ')}}}\left( {', '.join(texts)} \right)"


def _base(text: str) -> str:
    return text if not any(c in text for c in " |[") else rf"\left( {text} \right)"


def _by_size(term: tuple[Monomial, Fraction]) -> tuple:
    """Return the sort key of a term in a sum: positive terms first, then by the highest derivative."""
    monomial, factor = term
    return factor < 0, [-a[-1] if isinstance(a[-1], int) else 0 for a in monomial], repr(monomial)
