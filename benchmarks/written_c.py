"""Residual, Jacobian and right sides of the RSUR mechanism: C written by `jn.equations`, `jn` itself, CasADi's C.

`jn.constraint_equations` is called as users call it, labels included. CasADi differentiates the same residual, the one
of the Python module that `jn.equations` writes, on its own symbols. Both files of C are compiled alike and called in a
loop over the states of a motion.
"""

import ctypes
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import jounce as jn
from benchmarks.cases import EXAMPLES, CannotRunError, Case, Cases, Contestant

ORDER = 4
LOOP = """
void {name}_all(int n, const double *t, const double *q, const double *v, double *phi, double *j, double *sides)
{{
    for (int i = 0; i < n; i++) {{
        {name}_residual(t[i], q + i * {coordinates}, phi + i * {rows});
        {name}_jacobian(t[i], q + i * {coordinates}, j + i * {rows} * {columns});
        {name}_right_side(t[i], q + i * {coordinates}, v + i * {order} * {columns}, {order}, sides + i * {order} * {rows});
    }}
}}
"""  # noqa: E501
CASADI_LOOP = """
void casadi_all(int n, const double *t, const double *q, const double *v, double *phi, double *j, double *sides)
{{
    for (int i = 0; i < n; i++) {{
        const double *arg[SIZE_ARG] = {{t + i, q + i * {coordinates}, v + i * {order} * {columns}}};
        double *res[SIZE_RES] = {{phi + i * {rows}, j + i * {rows} * {columns}, sides + i * {order} * {rows}}};
        casadi_int iw[SIZE_IW + 1];
        double w[SIZE_W + 1];
        equations(arg, res, iw, w, 0);
    }}
}}
"""


class _Symbols:
    """What a written module asks of NumPy, on symbols of CasADi."""

    names = {"arctan2": "atan2", "abs": "fabs", "where": "if_else"}

    def __getattr__(self, name: str) -> Any:
        import casadi

        return getattr(casadi, self.names.get(name, name))

    def rint(self, x: Any) -> Any:
        import casadi

        return casadi.floor(x + 0.5)  # it has no rounding of its own

    def shape(self, _: Any) -> tuple[()]:
        return ()

    def broadcast_shapes(self, *_: Any) -> tuple[()]:
        return ()

    def zeros(self, shape: Any) -> Any:
        return np.zeros(shape, object)


class _States:
    """The states of a motion, and the identity by which right sides are judged."""

    def __init__(self, count: int):
        self.mechanism = jn.load(EXAMPLES / "rsur.yaml")
        self.motion = jn.solve(self.mechanism, np.linspace(0.0, 2.0, count), order=ORDER)
        equations = jn.constraint_equations(self.motion)
        place = np.concatenate([equations.position.values, equations.attitude.values], axis=-1)
        self.t, self.q = equations.time.values, np.ascontiguousarray(place.reshape(count, -1))
        self.v = np.ascontiguousarray(equations.velocities.sel(derivative=slice(1, None)).values)
        self.sizes = {
            "coordinates": self.q.shape[1], "columns": self.v.shape[2], "rows": len(equations.row), "order": ORDER,
        }  # fmt: skip

    def error(self, found: tuple[np.ndarray, np.ndarray, np.ndarray]) -> float:
        """Return the largest ``Phi_q q^(k) - right_side(k)`` over the largest of the right sides of that order."""
        _, jacobian, sides = found
        gaps = np.abs(np.einsum("trc,tkc->tkr", jacobian, self.v) - sides).max(axis=(0, 2))
        return float((gaps / np.abs(sides).max(axis=(0, 2))).max())

    def caller(self, source: str, function: str) -> Callable[[], Any]:
        """Return a function that calls a loop in a file of C on all states."""
        with tempfile.TemporaryDirectory() as folder:
            file, library = Path(folder) / "equations.c", Path(folder) / "equations.so"
            file.write_text(source, encoding="ascii")
            words = ["gcc", "-fPIC", "-shared", "-O3", "-march=native", str(file), "-o", str(library), "-lm"]
            try:
                subprocess.run(words, check=True, capture_output=True)
            except FileNotFoundError:
                raise CannotRunError("there is no C compiler gcc") from None
            loop = getattr(ctypes.CDLL(str(library)), function)
        n, rows, columns = len(self.t), self.sizes["rows"], self.sizes["columns"]
        out = np.empty((n, rows)), np.empty((n, rows, columns)), np.empty((n, ORDER, rows))
        given = [x.ctypes.data_as(ctypes.c_void_p) for x in (self.t, self.q, self.v, *out)]

        def run() -> Any:
            loop(ctypes.c_int(n), *given)
            return out

        return run


def written(states: _States) -> Callable[[], Any]:
    """Return the loop over what `jn.equations` writes."""
    text = jn.equations(states.motion, format="c", order=ORDER, name="rsur")
    return states.caller(text + LOOP.format(name="rsur", **states.sizes), "rsur_all")


def by_library(states: _States) -> Callable[[], Any]:
    """Return the call of `jn.constraint_equations`."""

    def run() -> Any:
        equations = jn.constraint_equations(states.motion)
        sides = equations.right_side.sel(derivative=slice(1, None))
        return equations.residual.values, equations.jacobian.values, sides.values

    return run


def by_casadi(states: _States) -> Callable[[], Any]:
    """Return the loop over what CasADi writes, from the residual alone."""
    import casadi

    module: dict[str, Any] = {"np": _Symbols()}
    exec(jn.equations(states.motion, order=1).replace("import numpy as np\n", ""), module)  # noqa: S102
    t, q = casadi.SX.sym("t"), casadi.SX.sym("q", states.sizes["coordinates"])
    v = casadi.SX.sym("v", states.sizes["columns"], ORDER)
    phi = casadi.vertcat(*module["residual"](t, casadi.vertsplit(q)))
    rate = []
    for body in range(states.sizes["coordinates"] // 7):
        e, w = q[7 * body + 3 : 7 * body + 7], v[6 * body + 3 : 6 * body + 6, 0]
        rate += [v[6 * body : 6 * body + 3, 0], -0.5 * casadi.dot(e[1:], w)]
        rate += [0.5 * (e[0] * w + casadi.cross(e[1:], w))]
    place, moving = casadi.vertcat(t, q, casadi.vec(v)), casadi.vertcat(1, *rate)
    still = casadi.SX.zeros(states.sizes["columns"])
    derivative, sides, jacobian = phi, [], None
    for k in range(ORDER):
        rates = casadi.vertcat(moving, *(v[:, n + 1] if n + 1 < k else still for n in range(ORDER)))
        known = casadi.substitute(rates, v[:, 0], still) if k == 0 else rates
        sides.append(-casadi.jtimes(derivative, place, known))
        full = casadi.vertcat(moving, *(v[:, n + 1] if n + 1 <= k else still for n in range(ORDER)))
        derivative = casadi.jtimes(derivative, place, full)
        if k == 0:
            jacobian = casadi.jacobian(derivative, v[:, 0])
    results = [phi, casadi.densify(jacobian.T), casadi.densify(casadi.horzcat(*sides))]
    function = casadi.Function("equations", [t, q, v], results, {"cse": True})
    with tempfile.TemporaryDirectory() as folder:
        generator = casadi.CodeGenerator("equations.c")
        generator.add(function)
        generator.generate(f"{folder}/")
        text = (Path(folder) / "equations.c").read_text(encoding="utf-8")
    sizes = {name: getattr(function, name.lower())() for name in ("SZ_ARG", "SZ_RES", "SZ_IW", "SZ_W")}
    defined = "\n".join(f"#define SIZE_{name.removeprefix('SZ_')} {size}" for name, size in sizes.items())
    return states.caller(f"{text}\n{defined}\n{CASADI_LOOP.format(**states.sizes)}", "casadi_all")


def cases(quick: bool) -> Cases:
    """Yield the equations at the states of a motion."""
    count = 201 if quick else 10_001
    states = _States(count)
    yield Case(
        f"RSUR, equations to order {ORDER} as C, {count:,} states",
        [
            Contestant("jounce, C code", lambda: written(states), states.error),
            Contestant("jounce, constraint_equations", lambda: by_library(states), states.error),
            Contestant("CasADi, C code, by the same residual", lambda: by_casadi(states), states.error, "casadi"),
        ],
        count=count,
        unit="state",
        reference="that the right sides are the Jacobian times the derivatives of a motion that was solved",
    )
