"""Values given outside a file, as ``NAME=VALUE``."""

from __future__ import annotations

from collections.abc import Iterable

from jounce.errors import JounceError


def assignments(
    texts: Iterable[str], option: str, form: str, error_type: type[JounceError] = JounceError
) -> dict[str, str]:
    """Return values by name, as text.

    Parameters
    ----------
    texts : iterable of str
        Texts of the form ``NAME=VALUE``.
    option : str
        Option by which they are given, for messages.
    form : str
        Description of the form, for messages.
    error_type : type
        Type of the exceptions.

    Raises
    ------
    JounceError
        Of the given type, if a name or a value is missing, or a name is given twice.

    Examples
    --------
    >>> assignments(["BC=15 cm"], "--set", "a parameter is set by NAME=VALUE")
    {'BC': '15 cm'}
    """
    assigned: dict[str, str] = {}
    for text in texts:
        name, _, value = (part.strip() for part in text.partition("="))
        if not name or not value:
            raise error_type(form, name=option, value=text)
        if name in assigned:
            raise error_type(f"is given more than once, as {assigned[name]} and as {value}", name=f"{option} {name}")
        assigned[name] = value
    return assigned
