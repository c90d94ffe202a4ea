"""What to write in expressions in place of functions that other languages have."""

import difflib
from collections.abc import Iterable

_WRITTEN_AS = {
    "max": "max(a, b) as (a + b + abs(a - b))/2",
    "min": "min(a, b) as (a + b - abs(a - b))/2",
    "heaviside": "a step at x = 0 as (1 + sign(x))/2",
    "where": "a value a where x > 0, else b, as (a + b + (a - b)*sign(x))/2",
    "pow": "pow(a, b) as a**b",
    "log10": "log10(x) as log(x)/log(10)",
}


def function_hint(name: str, functions: Iterable[str]) -> str:
    """Return what to write in place of an unknown function.

    Examples
    --------
    >>> function_hint("max", ["sin", "cos"])
    'write max(a, b) as (a + b + abs(a - b))/2'
    >>> function_hint("sinn", ["sin", "cos"])
    "did you mean 'sin'?"
    """
    if name in _WRITTEN_AS:
        return f"write {_WRITTEN_AS[name]}"
    matches = difflib.get_close_matches(name, functions, n=1)
    return f"did you mean '{matches[0]}'?" if matches else f"valid: {', '.join(functions)}"
