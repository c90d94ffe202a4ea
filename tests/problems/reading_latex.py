"""Reads equations in LaTeX as numbers, by the values of their symbols: what is printed is what is compared."""

import re

import numpy as np

NUMBER = re.compile(r"[0-9]+")
OPEN, CLOSE = r"\left(", r"\right)"


class Reader:
    """Evaluates a text; products of arrays are matrix products."""

    def __init__(self, text, symbols):
        self.rest, self.symbols = text.strip(), sorted(symbols.items(), key=lambda item: -len(item[0]))

    def takes(self, *words):
        for word in words:
            if self.rest.startswith(word):
                self.rest = self.rest[len(word) :].lstrip()
                return word
        return None

    def needs(self, word):
        assert self.takes(word), f"expected {word} before {self.rest!r}"

    def sum(self):
        sign = -1 if self.takes("-") else 1
        total = sign * self.product()
        while word := self.takes("+", "-"):
            total = total + (1 if word == "+" else -1) * self.product()
        return total

    def product(self):
        value = self.power()
        while (other := self.power()) is not None:
            value = value * other if np.ndim(value) == 0 or np.ndim(other) == 0 else value @ other
        return value

    def power(self):
        value = self.primary()
        while value is not None:
            if self.takes("^T"):
                value = value.T
            elif self.takes("^{"):
                value = value ** int(self.number())
                self.needs("}")
            else:
                break
        return value

    def number(self):
        found = NUMBER.match(self.rest)
        if found is None:
            return None
        self.rest = self.rest[found.end() :].lstrip()
        return float(found[0])

    def primary(self):
        for symbol, value in self.symbols:
            if self.takes(symbol):
                return value
        if self.takes(OPEN):
            value = self.sum()
            self.needs(CLOSE)
            return value
        if self.takes(r"\frac{", r"\tfrac{"):
            above = self.sum()
            self.needs("}")
            self.needs("{")
            below = self.sum()
            self.needs("}")
            return above / below
        if self.takes(r"\left|"):
            value = np.linalg.norm(self.sum())
            self.needs(r"\right|")
            return value
        return self.number()

    def whole(self):
        value = self.sum()
        assert not self.rest, f"not read: {self.rest!r}"
        return value

    def blocks(self):
        self.needs(r"\left[")
        found = [self.sum()]
        while self.takes(","):
            found.append(self.sum())
        self.needs(r"\right]")
        assert not self.rest, f"not read: {self.rest!r}"
        return found


def assert_well_formed(text):
    """Check that brackets and environments of a document close, in their order."""
    waiting = []
    pairs = {"}": "{", r"\right)": r"\left(", r"\right]": r"\left[", r"\right|": r"\left|"}
    for found in re.finditer(
        r"\\[\\{}%&$#_]|\\begin\{(\w+\*?)\}|\\end\{(\w+\*?)\}|\\(?:left|right)[\[\]()|]|[{}$]", text
    ):
        word = found[0]
        if word.startswith(r"\begin"):
            waiting.append(found[1])
        elif word.startswith(r"\end"):
            assert waiting.pop() == found[2]
        elif word in pairs.values():
            waiting.append(word)
        elif word in pairs:
            assert waiting.pop() == pairs[word], text[max(0, found.start() - 60) : found.end()]
        elif word == "$":
            waiting.pop() if waiting and waiting[-1] == "$" else waiting.append("$")
    assert not waiting
