"""Text changed by chance: tokens, lines and bytes of good files taken away, doubled, exchanged, or made hostile."""

from __future__ import annotations

import random
import re
from collections.abc import Callable

__all__ = ["HOSTILE", "mutated", "swollen"]

HOSTILE = [
    *(
        "0 -0 -1 1e309 -1e309 nan -inf .nan .inf 1e-320 1e300 0x10 0o7 1_000 + - . null true ~ yes 1e400m 1/0 0**-1 "
        "(-1)**0.5 9**9**9**9 t sin(t exp(1e9) log(0) a.b __import__('os') [[[[ {{{{ ]] }} &a *a !!python/object:os "
        "--- ... ../x.csv /dev/zero /dev/tty . .. lift.csv =1+1 < > </robot> <!ENTITY &amp; &x; ]]> ${x} ground world "
        "t pi deg 1e3 5e-324 1.7976931348623157e308 18446744073709551616 %s {} | > ? : :: - - # @ ` ' \" ,, ;"
    ).split(),
    *("", " ", "\t", "\n", "\r", "\0", "\x7f", "\x85", "\u2028", "\ufeff", "\ud7ff", "\U0001f642", "\xe9", "e\u0301"),
    *("9" * 400, "(" * 300, "[" * 100, "a" * 3000, "-" * 50, "m*" * 200 + "m", "2*" * 400 + "t"),
    *("1 m", "3 deg", "5 Nm", "2 furlong/fortnight", "1 m**99999", "1 kg*m**2", "10 degC", "5 %", "1 1", "1 2 3"),
    *("0 0 0", "nan nan nan", "1e200 1e200 1e200", "x: {x: {x: {}}}", "[1, [2, [3]]]", "<joint/>"),
    *("<link name='base'/>", "<include file='a.xml'/>", "t**0.5", "1e200*t", "abs(t)", "t=3", "BC=", "=5"),
]
VALUES = re.compile(r'(?<==")[^"]*(?=")|(?<=: )[^,\n}\]]+|(?<=,)[^,\n]+|(?<== )[^\n]+')
TOKENS = re.compile(r"[A-Za-z_][A-Za-z0-9_]*|[0-9.]+(?:[eE][-+]?[0-9]+)?|\s+|.", re.DOTALL)


def mutated(chance: random.Random, seeds: list[str]) -> bytes:
    """Return a good text changed in one to six places, mostly few."""
    text = chance.choice(seeds)
    if chance.random() < 0.3:  # what may well be read, so that more than the first check is reached
        for _ in range(chance.randrange(4)):
            text = chance.choice(GENTLE)(chance, text, seeds)
    else:
        for _ in range(min(6, 1 + int(chance.expovariate(1.5)))):
            text = chance.choice(CHANGES)(chance, text, seeds)[:200_000]
    content = text.encode("utf-8", "surrogatepass")
    if chance.random() < 0.06:
        content = _bytes(chance, content)
    return content


def swollen(chance: random.Random, seeds: list[str]) -> Callable[[int], bytes]:
    """Return what makes a good text of about a size, by a piece that it has many times over, numbered or not."""
    text = chance.choice(seeds)
    if chance.random() < 0.3:
        text = chance.choice(CHANGES)(chance, text, seeds) or text
    lines = text.splitlines(keepends=True)
    kind = chance.randrange(4)
    if kind < 2:  # lines
        first = chance.randrange(len(lines))
        last = min(len(lines), first + chance.choice([1, 1, 2, 4]))
        head, piece, tail = "".join(lines[:first]), "".join(lines[first:last]), "".join(lines[last:])
    else:
        start = chance.randrange(len(text))
        stop = min(len(text), start + 1 + int(chance.expovariate(0.1)))
        head, piece, tail = text[:start], text[start:stop], text[stop:]
        if kind == 3:
            piece = (
                chance.choice([chance.choice(HOSTILE), chance.choice("abc019.,:;'\"\\/-+*()[]{}<>#&%=_ \t\n")]) or " "
            )
    words = list(re.finditer(r"[A-Za-z_][A-Za-z0-9_]*", piece))
    place = chance.choice(words).end() if words and chance.random() < 0.5 else None

    def of(size: int) -> bytes:
        count = max(1, (size - len(head) - len(tail)) // len(piece))
        many = piece * count
        if place is not None:
            many = "".join(f"{piece[:place]}{k}{piece[place:]}" for k in range(count))
        return f"{head}{many}{tail}".encode("utf-8", "surrogatepass")

    return of


def _token(chance: random.Random, text: str, seeds: list[str]) -> str:
    """Exchange a word, number or sign for a hostile one, or for one of another place."""
    tokens = TOKENS.findall(text)
    if not tokens:
        return chance.choice(HOSTILE)
    place = chance.randrange(len(tokens))
    for _ in range(4):  # blanks are less interesting
        if tokens[place].isspace():
            place = chance.randrange(len(tokens))
    if chance.random() < 0.6:
        tokens[place] = chance.choice(HOSTILE)
    else:
        tokens[place] = chance.choice(TOKENS.findall(chance.choice(seeds)) or [""])
    return "".join(tokens)


def _number(chance: random.Random, text: str, _seeds: list[str]) -> str:
    """Change a number by a factor, a sign or a power of ten."""
    found = list(re.finditer(r"[0-9.]+(?:[eE][-+]?[0-9]+)?", text))
    if not found:
        return text
    match = chance.choice(found)
    factor = chance.choice(["-", "1e3*", "1e-9*", "1e99", "e99", "e-99", "0", ".5.", " m", " deg", "+", "**2", "/0"])
    changed = factor + match.group() if factor[0] in "-1+" else match.group() + factor
    return text[: match.start()] + changed + text[match.end() :]


def _lines(chance: random.Random, text: str, seeds: list[str]) -> str:
    """Take lines away, double them, move them, or bring some of another text."""
    lines = text.split("\n")
    first = chance.randrange(len(lines))
    last = min(len(lines), first + 1 + int(chance.expovariate(0.7)))
    piece = lines[first:last]
    kind = chance.randrange(5)
    if kind == 0:
        del lines[first:last]
    elif kind == 1:
        lines[last:last] = piece * chance.choice([1, 1, 2, 50])
    elif kind == 2:
        del lines[first:last]
        place = chance.randrange(len(lines) + 1)
        lines[place:place] = piece
    elif kind == 3:
        other = chance.choice(seeds).split("\n")
        start = chance.randrange(len(other))
        lines[first:first] = other[start : start + 1 + int(chance.expovariate(0.5))]
    else:
        lines[first] = chance.choice([" ", "  ", "\t", "- ", "# "]) + lines[first].lstrip()
    return "\n".join(lines)


def _piece(chance: random.Random, text: str, _seeds: list[str]) -> str:
    """Take a piece away, double it, put it elsewhere, or cut the text off."""
    if not text:
        return text
    start = chance.randrange(len(text))
    stop = min(len(text), start + 1 + int(chance.expovariate(0.05)))
    kind = chance.randrange(4)
    if kind == 0:
        return text[:start] + text[stop:]
    if kind == 1:
        return text[:stop] + text[start:stop] * chance.choice([1, 2, 100]) + text[stop:]
    if kind == 2:
        place = chance.randrange(len(text))
        return text[:place] + text[start:stop] + text[place:]
    return text[:start]


def _insert(chance: random.Random, text: str, _seeds: list[str]) -> str:
    place = chance.randrange(len(text) + 1)
    return text[:place] + chance.choice(HOSTILE) + text[place:]


def _value(chance: random.Random, text: str, _seeds: list[str]) -> str:
    """Give a key, an attribute or an entry of a table a hostile value."""
    found = list(re.finditer(VALUES, text))
    if not found:
        return text
    match = chance.choice(found)
    return text[: match.start()] + chance.choice(HOSTILE) + text[match.end() :]


def _exchange(chance: random.Random, text: str, _seeds: list[str]) -> str:
    """Exchange two values of one text, which may fit."""
    found = list(re.finditer(VALUES, text))
    if len(found) < 2:
        return text
    first, second = sorted(chance.sample(found, 2), key=re.Match.start)
    if first.end() > second.start():
        return text
    between = text[first.end() : second.start()]
    return text[: first.start()] + second.group() + between + first.group() + text[second.end() :]


def _scale(chance: random.Random, text: str, _seeds: list[str]) -> str:
    """Exchange a number for another of any size."""
    found = list(re.finditer(r"(?<![\w.])[0-9]+(?:\.[0-9]+)?(?:[eE][-+]?[0-9]+)?(?![\w.])", text))
    if not found:
        return text
    match = chance.choice(found)
    number = chance.choice([0, 1, -1, 2, 1e-12, 1e12, 1e-200, 1e200, chance.gauss(0, 1), -float(match.group())])
    return text[: match.start()] + repr(number) + text[match.end() :]


def _bytes(chance: random.Random, content: bytes) -> bytes:
    changed = bytearray(content)
    for _ in range(chance.randrange(1, 4)):
        if changed:
            changed[chance.randrange(len(changed))] = chance.randrange(256)
    return bytes(changed)


GENTLE = (_exchange, _scale, _scale)
CHANGES = (_token, _token, _value, _value, _number, _lines, _piece, _insert)
