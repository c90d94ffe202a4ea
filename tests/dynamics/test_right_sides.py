"""The right-hand sides of the equations of a mechanism: the closed forms of S, at any state and along motions."""

import numpy as np
import pytest
import xarray
from mpmath import mp, mpf

import jounce as jn
from jounce.constraints.angles import perpendiculars
from jounce.mechanism.resolve import resolve_element
from tests.oracles import mp_joints, sommer_planar as planar, sommer_spatial as spatial
from tests.oracles.mp_series import Series, atan2, sin_cos
from tests.problems.mechanisms import example

ORDER = 6
MECHANISMS = {  # and what their drivers swing about, by how much: degrees, or names of parameters
    "four_bar": (30.0, 60.0),
    "inverted_slider_crank_slide": ("d_start", "d_delta"),
    "inverted_slider_crank_distance": ("d_start", "d_delta"),
    "rsur": (30.0, 60.0),
    "rssr": (30.0, 60.0),
    "rspu_distance": ("d_start", "d_delta"),
    "rspu_slide": ("d_start", "d_delta"),
}
DRIVEN_BY_ROTATION = ("rsur", "rssr")


def with_slow(*slow):
    """Return the seven mechanisms; those whose joints others have too need not be compiled every time."""
    return [pytest.param(name, marks=pytest.mark.slow if name in slow else ()) for name in MECHANISMS]


def law(mechanism, name, t):
    """Return the derivatives of the driver of equation 56, 0 to ORDER."""
    values = mechanism.parameter_values
    start, delta = (values[x] if isinstance(x, str) else np.radians(x) for x in MECHANISMS[name])
    rate = 2 * np.pi / values["tau"]
    rates = [delta * rate**k * np.sin(rate * t + k * np.pi / 2) for k in range(ORDER + 1)]
    return np.array([start + rates[0], *rates[1:]])


class State:
    """Plain derivatives of all bodies at one instant, to the fifth, read off a dataset of equations."""

    def __init__(self, mechanism, equations, instant=0):
        self.mechanism, self.at = mechanism, equations.isel(time=instant)
        self.planar = mechanism.space == "planar"

    def rates(self, body, columns):
        if body == "ground":
            return np.zeros((ORDER - 1, len(columns)))
        names = [f"{body}.{column}" for column in columns]
        return self.at.velocities.sel(column=names, derivative=range(1, ORDER)).values

    def position(self, body):
        columns = ("x", "y") if self.planar else ("x", "y", "z")
        place = np.zeros(len(columns)) if body == "ground" else self.at.position.sel(body=body).values
        return np.vstack([place, self.rates(body, columns)])

    def angle(self, body):
        first = 0.0 if body == "ground" else float(self.at.angle.sel(body=body))
        return np.concatenate([[first], self.rates(body, ("angle",))[:, 0]])

    def attitude(self, body):
        return np.array([1.0, 0, 0, 0]) if body == "ground" else self.at.attitude.sel(body=body).values

    def spin(self, body):
        return self.rates(body, ("wx", "wy", "wz"))

    def body(self, name):
        """Return the body as the oracles of S take it."""
        if self.planar:
            return planar.Body(self.position(name)[:5], self.angle(name)[:5])
        p = self.attitude(name)
        A = np.array([v + 2 * np.cross(p[1:], np.cross(p[1:], v) + p[0] * v) for v in np.eye(3)]).T
        return spatial.Body(self.position(name)[:5], A, self.spin(name)[:4])

    def series(self, name, order):
        """Return the pose in series of thirty digits to an order, of which the last coefficients are zero."""

        def of(values):
            return Series([*(mpf(float(x)) / mp.factorial(k) for k, x in enumerate(values[:order])), mpf(0)])

        r = [of(column) for column in self.position(name).T]
        if self.planar:
            sine, cosine = sin_cos(of(self.angle(name)))
            return mp_joints.PlanarPose([*r, cosine, sine], mpf(float(self.angle(name)[0])))
        w = [Series([*(mpf(float(x)) / mp.factorial(k) for k, x in enumerate(c[: order - 1])), mpf(0)])
             for c in self.spin(name).T]  # fmt: skip
        p = [mpf(float(x)) for x in self.attitude(name)]
        table = [[x / mp.sqrt(mp.fdot(p, p)) for x in p]]
        for k in range(order):
            rate = [mpf(0)] * 4
            for m in range(k + 1):
                a, (x, y, z) = table[m], [c.c[k - m] for c in w]
                rate[0] += -a[1] * x - a[2] * y - a[3] * z
                rate[1] += a[0] * x + a[2] * z - a[3] * y
                rate[2] += a[0] * y + a[3] * x - a[1] * z
                rate[3] += a[0] * z + a[1] * y - a[2] * x
            table.append([c / (2 * (k + 1)) for c in rate])
        return mp_joints.SpatialPose(r + [Series(column) for column in zip(*table, strict=True)])


def rows_of(mechanism, element):
    """Return a joint or driver as basic constraints of S, each with its constant vectors."""
    size, kind = (2 if mechanism.space == "planar" else 3), type(element).__name__
    keys = resolve_element(element, mechanism.parameter_values, size, kind)
    points = [keys.get("point_i"), keys.get("point_j")]
    sides = (
        [np.asarray(n)[:, 0] for n in perpendiculars(np.asarray(keys["axis_i"])[:, None])] if "axis_j" in keys else []
    )
    parallel = [("dot1", n, keys["axis_j"]) for n in sides]
    if kind == "Prismatic" and size == 3:
        across = np.cross(keys["axis_i"] / np.linalg.norm(keys["axis_i"]), keys["normal_i"])
        return [*parallel, *(("dot2", *points, n) for n in sides), ("dot1", across, keys["normal_j"])]
    return {
        "Revolute": [("points", *points), *parallel],
        "Spherical": [("points", *points)],
        "Universal": [("points", *points), ("dot1", keys.get("vector_i"), keys.get("vector_j"))],
        "Prismatic": [("parallel1", keys.get("vector_i"), keys.get("vector_j")),
                      ("parallel2", *points, keys.get("vector_i"))],
        "DoubleRevolute": [("rod", *points, keys.get("length"))],
        "DoubleSpherical": [("rod", *points, keys.get("length"))],
        "CoordinateDriver": [("angle",)],
        "RotationDriver": [("rotation", keys.get("axis_i"))],
        "SlideDriver": [("slide", *points, keys.get("vector_i"))],
        "SpatialSlideDriver": [("slide", *points, keys.get("vector_i"))],
        "DistanceDriver": [("distance", *points)],
        "SpatialDistanceDriver": [("distance", *points)],
    }[kind]  # fmt: skip


def closed_form(row, i, j, f):
    """Return gamma, eta and sigma of a basic constraint by the numbered equations of S, (3, rows)."""
    kind, *given = row
    flat = isinstance(i, planar.Body)
    oracle = planar if flat else spatial
    if kind == "points" or kind == "rod":
        numbers = {"points": (23, 80), "rod": (28, 86)}[kind][not flat]
        found = [getattr(oracle, f"equation_{numbers + k:03d}")(i, j, *given[:2]) for k in range(3)]
    elif kind in ("dot1", "dot2", "parallel2"):
        first = {"dot1": 92, "dot2": 98, "parallel2": 36}[kind]
        found = [getattr(oracle, f"equation_{first + k:03d}")(i, j, *given) for k in range(3)]
    elif kind == "parallel1":
        found = planar.equation_033_anywhere(i, j, *given)
    elif kind == "slide" and flat:
        found = [e(i, j, *given, f) for e in (planar.equation_047, planar.equation_048, planar.equation_049)]
    else:
        found = {
            "angle": lambda: planar.equation_040(f),
            "rotation": lambda: spatial.equation_103(f),
            "slide": lambda: spatial.equation_111(i, j, *given, f),
            "distance": lambda: (planar.equation_055 if flat else spatial.equation_107)(i, j, *given, f),
        }[kind]()[1:]
    return np.reshape(found, (3, -1))


def in_series(row, i, j, f):
    """Return the residual of a basic constraint, a list of series: S 21, 26, 31, 34, 39, 44, 53 and those in space."""
    kind, *given = row
    given = [None if x is None else [mpf(float(e)) for e in np.ravel(x)] for x in given]
    if kind == "angle":
        return [j.angle - i.angle - f]
    if kind == "rotation":
        return [2 * atan2(*mp_joints.half_turn(i, j, given[0])) - f]
    if kind in ("dot1", "parallel1"):
        return [(mp_joints.dot if kind == "dot1" else mp_joints.cross)(i.direction(given[0]), j.direction(given[1]))]
    d = mp_joints.gap(i, j, given[:2])
    if kind in ("points", "rod", "distance"):
        square = mp_joints.dot(d, d)
        return d if kind == "points" else [square - (given[2][0] ** 2 if kind == "rod" else f * f)]
    if kind == "slide":
        return [mp_joints.dot(mp_joints.unit(i.direction(given[2])), d) - f]
    return [(mp_joints.dot if kind == "dot2" else mp_joints.cross)(i.direction(given[2]), d)]


def check_right_sides(mechanism, equations, f, instant=0, leave_out=()):
    """Compare right sides of orders 1 to 6 with series, and gamma, eta, sigma with the closed forms of S."""
    state = State(mechanism, equations, instant)
    for name, element in {**mechanism.joints, **mechanism.drivers}.items():
        found = state.at.right_side.sel(row=[r for r in equations.row.values if r.rpartition(".")[0] == name])
        first = 0
        for row in rows_of(mechanism, element):
            if row[0] in leave_out:
                continue
            closed = closed_form(row, *map(state.body, element.bodies), f)
            mine = found.isel(row=slice(first, first + closed.shape[1]))
            first += closed.shape[1]
            with mp.workdps(30):
                motion = [mpf(float(x)) / mp.factorial(k) for k, x in enumerate(f)]
                for k in range(1, ORDER + 1):
                    bodies = [state.series(body, k) for body in element.bodies]
                    expected = [-mp.factorial(k) * r.c[k] for r in in_series(row, *bodies, Series(motion[: k + 1]))]
                    expected = np.array([float(x) for x in expected])
                    scale = np.abs(state.at.velocities.sel(derivative=range(1, min(k, ORDER - 1) + 1))).max().item()
                    near = 1e-13 * (1 + scale + np.abs(expected).max())
                    np.testing.assert_allclose(
                        mine.sel(derivative=k), expected, rtol=0, atol=near, err_msg=f"{name} {k}"
                    )
                    if 2 <= k <= 4:
                        np.testing.assert_allclose(mine.sel(derivative=k), closed[k - 2], rtol=0, atol=near)


def random_state(mechanism, random, order=ORDER - 1, size=0.1):
    """Return a state that fulfills nothing."""

    def body():
        if mechanism.space == "planar":
            return {"position": size * random.normal(size=(order + 1, 2)), "angle": random.normal(size=order + 1)}
        spin = random.normal(size=(order, 3))
        return {"position": size * random.normal(size=(order + 1, 3)), "orientation": random.normal(size=4).tolist(),
                "angular_velocity": spin}  # fmt: skip

    return {name: body() for name in mechanism.bodies}


@pytest.mark.parametrize(
    "name", with_slow("inverted_slider_crank_distance", "rssr", "rspu_distance", "rspu_slide", "rsur")
)
def test_right_sides_of_the_seven_mechanisms_at_any_state(name):
    """S 21-111 as one system, away from the constraints, so that no term can hide; S 103 needs a common axis."""
    mechanism = jn.load(example(name))
    t = 0.3
    equations = jn.constraint_equations(mechanism, random_state(mechanism, np.random.default_rng(1)), t)
    assert list(equations.right_side.derivative.values) == [1, 2, 3, 4, 5, 6]
    check_right_sides(mechanism, equations, law(mechanism, name, t), leave_out=("rotation",))
    if name not in DRIVEN_BY_ROTATION:
        driver = next(iter(mechanism.drivers))
        nu = equations.right_side.sel(row=f"{driver}.1", derivative=1)
        f = law(mechanism, name, t)
        assert float(nu[0]) == pytest.approx(2 * f[0] * f[1] if "distance" in name else f[1], rel=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["four_bar", "inverted_slider_crank_distance", "rsur"])
def test_right_sides_along_motions(name):
    """In the plane and in space, driven by a rotation, for which S 103 needs a common axis, and by a distance."""
    mechanism = jn.load(example(name))
    instants = np.array([0.0, 0.37, 1.1])
    equations = jn.constraint_equations(jn.solve(mechanism, instants, order=ORDER))
    along = xarray.dot(equations.jacobian, equations.velocities, dim="column")
    scale = 1 + np.abs(equations.velocities).max(("time", "column"))
    assert float((np.abs(along - equations.right_side).max(("time", "row")) / scale).max()) < 1e-14
    assert float(np.abs(equations.residual).max()) < 1e-15
    for k, t in enumerate(instants):
        check_right_sides(mechanism, equations, law(mechanism, name, t), k)


def test_columns_in_space_are_turns_about_the_axes_of_the_body():
    """The residual of a rod that a body carries, at poses displaced by exact rotations: central differences."""
    mechanism = jn.load(example("rssr"))
    state = random_state(mechanism, np.random.default_rng(5), 0, 0.3)
    equations, h = jn.constraint_equations(mechanism, state), 1e-6
    for k, letter in enumerate("xyz"):
        gaps = []
        for sign in (1.0, -1.0):
            e0, *e = np.array(state["crank"]["orientation"]) / np.linalg.norm(state["crank"]["orientation"])
            turn = np.eye(3)[k] * np.sin(sign * h / 2)
            c = np.cos(h / 2)
            turned = [e0 * c - np.dot(e, turn), *(e0 * turn + c * np.array(e) + np.cross(e, turn))]
            moved = {**state, "crank": {**state["crank"], "orientation": turned}}
            gaps.append(float(jn.constraint_equations(mechanism, moved).residual.sel(row="BC.1")[0]))
        slope = float(equations.jacobian.sel(row="BC.1", column=f"crank.w{letter}")[0])
        assert slope == pytest.approx((gaps[0] - gaps[1]) / (2 * h), abs=1e-9)
