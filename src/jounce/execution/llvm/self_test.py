"""The self-test of machine code: on untested systems, a small program is compared with XLA before machine code is used.

The test runs in another process, since code that calls a function that LLVM does not find ends the process.
"""

import subprocess
import sys
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

from jounce.errors import MachineCodeWarning, warn_caller

TRIED = ("linux",)
HOME = Path(__file__).parents[3]  # the import folder of this package
LONGEST = 120.0  # s
CALL = f"import sys; sys.path.insert(0, {str(HOME)!r}); from jounce.execution.llvm import self_test; self_test.check()"


@lru_cache(maxsize=1)
def is_usable() -> bool:
    """Return whether a compiler is installed, and this system is a tested one or passes the self-test."""
    if find_spec("llvmlite") is None:  # installed without dependencies
        return False
    return sys.platform in TRIED or passes()


@lru_cache(maxsize=1)
def passes() -> bool:
    """Return whether machine code gives the results of XLA on this system; if not, warn once with the reason."""
    if not Path(sys.executable or "").name.startswith("python"):  # may be an application that embeds Python
        reason = f"{sys.executable!r} cannot be run as a Python interpreter"
    else:
        try:
            subprocess.run([sys.executable, "-P", "-c", CALL], capture_output=True, check=True, timeout=LONGEST)
        except subprocess.CalledProcessError as error:
            last = error.stderr.decode(errors="replace").strip().rpartition("\n")[2]
            reason = last or f"the process that tried it ended with status {error.returncode}"
        except (OSError, subprocess.TimeoutExpired) as error:
            reason = f"the process that was to try it: {type(error).__name__}"
        else:
            return True
    message = (
        f"machine code was not tried on {sys.platform}, and a small program does not run here as it does in XLA "
        f"({reason}); XLA computes instead, with the same results in two to fifty times the time; JOUNCE_NATIVE=0 in "
        "the environment selects it without this message"
    )
    warn_caller(MachineCodeWarning(message))
    return False


def check() -> None:
    """Raise AssertionError unless machine code for instants side by side gives the results of XLA.

    The program uses C library functions, memory, and loops.
    """
    import jax
    import jax.numpy as jnp
    import numpy as np

    from jounce.execution.llvm.modules import object_file
    from jounce.execution.llvm.programs import Program
    from jounce.settings import own_settings

    size, count = 40, 21

    def function(shared, lanes):
        (matrix,), (x,) = shared, lanes

        def turn(k, y):
            return jnp.sin(jnp.sum(matrix[:, :, None] * y[None], axis=1)) + jnp.cos(y * (k + 1.0))

        y = jax.lax.fori_loop(0, 3, turn, jnp.broadcast_to(x, (size, 1)))
        y = jax.lax.while_loop(lambda y: jnp.max(y) > 0.5, lambda y: 0.5 * y, y)
        square = x * x
        values = [jnp.exp(x), jnp.log1p(square), jnp.arctan2(x, 1.0 + square), jnp.tanh(x), jnp.power(1.0 + square, x)]
        return y, jnp.concatenate([*values, jnp.sqrt(square), jnp.floor(x)])

    with own_settings():
        shared = (np.linspace(-0.1, 0.1, size * size).reshape(size, size),)
        lanes = (np.linspace(-2.0, 2.0, count)[None],)
        lane = (jax.ShapeDtypeStruct((1, 1), float),)
        expected = jax.vmap(lambda x: function(shared, (x[:, None],)), in_axes=1, out_axes=-1)(*lanes)
        for large in (None, 8):
            binary, results = object_file(function, shared, lane, {}, large=large)
            result = Program(binary, (shared, lane), results)(list(shared), list(lanes))
            for computed, reference in zip(result, expected, strict=True):
                if not np.allclose(computed, reference[:, 0], rtol=1e-12, atol=1e-14):
                    raise AssertionError("the numbers are others")
