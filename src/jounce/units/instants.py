"""Instants as text for readers."""

LATE = 1e4  # s; later instants have decimals, as significant digits would not tell them apart


def time_text(time: int | float, digits: int = 6) -> str:
    """Return the text of an instant, s: significant digits, or for late ones, as of a clock, three decimals.

    Examples
    --------
    >>> time_text(0.12345678), time_text(0.12345678, 3), time_text(1732686000.25), time_text(20000)
    ('0.123457', '0.123', '1732686000.25', '20000')
    """
    return f"{time:.{digits}g}" if not abs(time) >= LATE else f"{time:.3f}".rstrip("0").rstrip(".")


def interval_text(start: int | float, stop: int | float) -> str:
    """Return the text of the ends of a time interval, s.

    Examples
    --------
    >>> interval_text(0, 2.5)
    '0 s to 2.5 s'
    """
    return f"{time_text(start)} s to {time_text(stop)} s"
