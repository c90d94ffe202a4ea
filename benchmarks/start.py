"""Start-up in fresh processes: the command's help, the import and a first name, beside Python and JAX alone."""

import sys
from collections.abc import Callable
from typing import Any

from benchmarks.cases import Case, Cases, Contestant, Reported, ready
from benchmarks.processes import command


def fresh(*words: str) -> Callable[[], Callable[[], Any]]:
    """Return what runs Python with these words in a new process."""
    return ready(lambda: Reported(command([sys.executable, *words]).processor))


def cases(quick: bool) -> Cases:
    """Yield the command and the import."""
    del quick  # there is nothing to make smaller
    bare = Contestant("Python alone", fresh("-c", "pass"))
    yield Case("`jounce --help`", [Contestant("jounce", fresh("-m", "jounce", "--help")), bare])
    yield Case(
        "`import jounce`",
        [
            Contestant("jounce", fresh("-c", "import jounce")),
            Contestant("`import jax, jax.numpy`", fresh("-c", "import jax, jax.numpy")),
            bare,
        ],
    )
    imported = fresh("-c", "import jax, jax.numpy")()

    def beyond() -> Reported:
        whole = fresh("-c", "import jounce; jounce.Jet; jounce.load")()
        return Reported(whole().value - imported().value)

    yield Case(
        "first names after `import jounce`, `Jet` and `load`, beyond JAX",
        [
            Contestant("jounce", lambda: beyond),
            Contestant("`import jax, jax.numpy`", lambda: imported, aim=1 / 3),
        ],
    )
    yield Case(
        "first name after `import jounce`",
        [
            Contestant("jounce", fresh("-c", "import jounce; jounce.load")),
            Contestant("`import jax, jax.numpy`", fresh("-c", "import jax, jax.numpy")),
        ],
    )
