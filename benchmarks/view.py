"""How long the web view takes from a slider to a new motion: solving, arrows and paths, without the browser."""

from collections.abc import Callable
from itertools import count
from typing import Any

import numpy as np

import jounce as jn
from benchmarks.cases import EXAMPLES, Case, Cases, Contestant

FILES = ("four_bar", "slider_crank", "six_bar_watt", "press", "rssr", "rsur")


def moved(file: str) -> Callable[[], Any]:
    """Return the function that moves the first slider of a page and waits for its motion."""
    from jounce.viewer.page.local_server import quiet_server
    from jounce.viewer.page.page import Page
    from jounce.viewer.subjects.mechanisms import MechanismSubject

    subject = MechanismSubject(jn.load(EXAMPLES / f"{file}.yaml"))
    page, turn = Page(quiet_server(), subject, order=4), count()
    name, value = next((p.name, p.value) for p in subject.parameters if not p.derived)

    def run() -> None:
        page.session.request({name: value * (1 + 1e-3 * np.sin(next(turn)))})
        page.session.wait()
        if page.session.error is not None:
            raise page.session.error

    return run


def cases(quick: bool) -> Cases:
    """Yield mechanisms with their arrows and paths."""
    for file in FILES[:1] if quick else FILES:
        contestant = Contestant("jounce view", lambda file=file: moved(file), needs="viser", extra="viewer")
        yield Case(f"{file}, from a slider to a new motion to jounce", [contestant], clock="wall time", rounds=40)
