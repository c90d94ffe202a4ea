"""The equations of a mechanism as users see them: closed forms of S, identities, states that are no motion's."""

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
    """Return a state that fulfils nothing."""

    def body():
        if mechanism.space == "planar":
            return {"position": size * random.normal(size=(order + 1, 2)), "angle": random.normal(size=order + 1)}
        spin = random.normal(size=(order, 3))
        return {"position": size * random.normal(size=(order + 1, 3)), "orientation": random.normal(size=4).tolist(),
                "angular_velocity": spin}  # fmt: skip

    return {name: body() for name in mechanism.bodies}


@pytest.mark.parametrize("name", with_slow("inverted_slider_crank_distance", "rssr", "rspu_distance"))
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


@pytest.mark.parametrize("name", with_slow(*list(MECHANISMS)[1:]))
def test_right_sides_along_the_motions_of_the_seven_mechanisms(name):
    mechanism = jn.load(example(name))
    instants = np.array([0.0, 0.37, 1.1])
    equations = jn.constraint_equations(jn.solve(mechanism, instants, order=ORDER))
    along = xarray.dot(equations.jacobian, equations.velocities, dim="column")
    scale = 1 + np.abs(equations.velocities).max(("time", "column"))
    assert float((np.abs(along - equations.right_side).max(("time", "row")) / scale).max()) < 1e-14
    assert float(np.abs(equations.residual).max()) < 1e-15
    for k, t in enumerate(instants):
        check_right_sides(mechanism, equations, law(mechanism, name, t), k)


def along(jacobian, velocities):
    return xarray.dot(jacobian, velocities, dim="column")


def test_rows_and_columns_are_those_of_the_file_whatever_the_types():
    """The solver keeps joints of one type together; the rows of the file stand as they are written."""
    mechanism = jn.load(example("inverted_slider_crank_slide"))
    equations = jn.constraint_equations(mechanism)
    rows = ["E.1", "E.2", "F.1", "F.2", "slide.1", "slide.2", "G.1", "G.2", "d.1"]
    assert list(equations.row.values) == rows
    columns = [f"{body}.{c}" for body in ("guide", "block", "rocker") for c in ("x", "y", "angle")]
    assert list(equations.column.values) == list(equations.column.values) == columns
    pinned = equations.jacobian.isel(time=0).sel(row=["F.1", "F.2"])
    np.testing.assert_array_equal(pinned.sel(column=["rocker.x", "rocker.y"]), np.eye(2))
    assert not pinned.sel(column=columns[:6]).any()
    spatial_columns = jn.constraint_equations(jn.load(example("rssr"))).column.values
    assert list(spatial_columns[:6]) == [f"crank.{c}" for c in ("x", "y", "z", "wx", "wy", "wz")]


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


LINKAGE = jn.Mechanism(
    space="planar",
    gravity=[0.3, -9.81],
    parameters={"k": 20.0},
    bodies={
        "crank": jn.Body([0, 0], angle=0.4, mass=1.2, inertia=0.02, center_of_mass=[0.1, 0.03]),
        "coupler": jn.Body([0.2, 0.1], angle=0.3, mass=0.8, inertia=0.03, center_of_mass=[0.2, -0.05]),
        "rocker": jn.Body([0.5, 0], angle=1.5, mass=1.5, inertia=0.05, center_of_mass=[0.15, 0]),
    },
    joints={
        "O": jn.planar.Revolute(("ground", "crank"), [0, 0], [0, 0]),
        "A": jn.planar.Revolute(("crank", "coupler"), [0.2, 0], [0, 0]),
        "B": jn.planar.Revolute(("coupler", "rocker"), [0.45, 0], [0.35, 0]),
        "C": jn.planar.Revolute(("ground", "rocker"), [0.5, 0], [0, 0]),
    },
    drivers={"theta": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", motion="0.4 + 2*t + 0.3*sin(4*t)")},
    forces={"spring": jn.forces.Spring(("ground", "rocker"), [0.8, 0.1], [0.3, 0.05], stiffness="k", length=0.1)},
)


def planar_balance(mechanism, motion, size=8):
    """Return what constraints must balance, Q - M q'', as series about the first instant, by NumPy's polynomials."""
    series = {}
    for name in mechanism.bodies:
        r = motion.point(name, [0, 0]).values[0] / FACTORIALS[:size, None]
        phi = motion.angle(name).values[0] / FACTORIALS[:size]
        c, s = cos_sin(phi)
        series[name] = r.T, phi, c, s

    def point(name, p):
        r, _, c, s = series[name]
        return [r[0] + p[0] * c - p[1] * s, r[1] + p[0] * s + p[1] * c]

    found = []
    for name, body in mechanism.bodies.items():
        (_, phi, c, s), center = series[name], body.center_of_mass
        a = [np.polynomial.polynomial.polyder(x, 2) for x in point(name, center)]
        force = [
            cut_to(body.mass * np.r_[g - x[0], -x[1:]], size - 2) for g, x in zip(mechanism.gravity, a, strict=True)
        ]
        arm = [center[0] * c - center[1] * s, center[0] * s + center[1] * c]
        moment = times(arm[0], force[1]) - times(arm[1], force[0])
        moment -= body.inertia * np.polynomial.polynomial.polyder(phi, 2)
        if name == "rocker":
            d = [x - np.eye(1, size)[0] * p for x, p in zip(point(name, [0.3, 0.05]), [0.8, 0.1], strict=True)]
            length = root(times(d[0], d[0], size) + times(d[1], d[1], size))
            pull = 20.0 * (np.eye(1, size)[0] * 0.1 - length)
            along = [times(over(pull, length), x, size) for x in d]
            lever = [0.3 * c - 0.05 * s, 0.3 * s + 0.05 * c]
            force = [f + cut_to(x, size - 2) for f, x in zip(force, along, strict=True)]
            moment = moment + times(lever[0], along[1]) - times(lever[1], along[0])
        found += [*force, moment]
    return np.array(found)


FACTORIALS = np.cumprod([1.0, *range(1, 12)])


def cut_to(x, size):
    return np.resize(x, size) if len(x) >= size else np.r_[x, np.zeros(size - len(x))]


def times(a, b, size=6):
    return np.array([sum(a[m] * b[k - m] for m in range(k + 1)) for k in range(size)])


def over(a, b):
    out = []
    for k in range(len(a)):
        out.append((a[k] - sum(out[m] * b[k - m] for m in range(k))) / b[0])
    return np.array(out)


def root(a):
    out = [np.sqrt(a[0])]
    for k in range(1, len(a)):
        out.append((a[k] - sum(out[m] * out[k - m] for m in range(1, k))) / (2 * out[0]))
    return np.array(out)


def cos_sin(phi):
    c, s = [np.cos(phi[0])], [np.sin(phi[0])]
    for k in range(1, len(phi)):
        c.append(-sum(m * phi[m] * s[k - m] for m in range(1, k + 1)) / k)
        s.append(sum(m * phi[m] * c[k - m] for m in range(1, k + 1)) / k)
    return np.array(c), np.array(s)


@pytest.fixture(scope="module")
def linkage_motion():
    return jn.solve(LINKAGE, [0.2, 0.5], order=7)


@pytest.mark.slow
def test_multipliers_balance_forces_and_inertia_with_rates(linkage_motion):
    """``M q'' + Phi_q^T lambda = Q`` and its five rates: loads and the Jacobian of the pins anew, on polynomials."""
    equations = jn.constraint_equations(linkage_motion)
    assert equations.multipliers.dims == ("time", "derivative", "row")
    levels = 6
    known = equations.multipliers.isel(time=0).sel(derivative=range(levels)).values / FACTORIALS[:levels, None]
    assert np.isfinite(known).all()
    assert np.isnan(equations.multipliers.sel(derivative=[6, 7])).all()
    places = {name: k for k, name in enumerate(LINKAGE.bodies)}
    work = np.zeros((9, levels))
    for row, (body, point, sign) in {
        0: ("crank", [0, 0], 1), 2: ("crank", [0.2, 0], -1), 3: ("coupler", [0, 0], 1), 4: ("coupler", [0.45, 0], -1),
        5: ("rocker", [0.35, 0], 1), 6: ("rocker", [0, 0], 1),
    }.items():  # fmt: skip
        first = {0: 0, 2: 2, 3: 2, 4: 4, 5: 4, 6: 6}[row]
        c, s = cos_sin(linkage_motion.angle(body).values[0] / FACTORIALS[:8])
        x, y = (sign * known[:, first + k] for k in range(2))
        at = 3 * places[body]
        work[at] += x
        work[at + 1] += y
        lever = [point[0] * c - point[1] * s, point[0] * s + point[1] * c]
        work[at + 2] += times(lever[0], y) - times(lever[1], x)
    work[2] += known[:, 8]  # the driver acts on the angle of the crank
    expected = planar_balance(LINKAGE, linkage_motion)[:, :levels]
    scale = np.abs(expected).max(axis=0)
    np.testing.assert_array_less(np.abs(work - expected).max(axis=0) / scale, 1e-12)


def test_mass_matrix_and_multipliers_make_the_equations_of_motion(linkage_motion):
    equations = jn.constraint_equations(linkage_motion).isel(time=0)
    matrix = equations.mass_matrix.values
    np.testing.assert_array_equal(matrix, matrix.T)
    arm = LINKAGE.bodies["rocker"].mass * np.array([0.15, 0.0])
    angle = float(equations.angle.sel(body="rocker"))
    turned = np.array([np.cos(angle) * arm[0], np.sin(angle) * arm[0]])
    expected = np.array([[1.5, 0, -turned[1]], [0, 1.5, turned[0]], [-turned[1], turned[0], 0.05 + 1.5 * 0.15**2]])
    np.testing.assert_allclose(matrix[6:, 6:], expected, rtol=0, atol=1e-15)
    assert not matrix[6:, :6].any()
    joined = equations.jacobian.values.T @ equations.multipliers.sel(derivative=0).values
    forces = matrix @ equations.velocities.sel(derivative=2).values + joined
    weight = LINKAGE.bodies["crank"].mass * np.array([0.3, -9.81])
    spin = float(equations.velocities.sel(derivative=1, column="crank.angle"))
    start = float(equations.angle.sel(body="crank"))
    arm = np.array([0.1 * np.cos(start) - 0.03 * np.sin(start), 0.1 * np.sin(start) + 0.03 * np.cos(start)])
    np.testing.assert_allclose(forces[:2], weight + 1.2 * spin**2 * arm, rtol=0, atol=1e-12)
    assert forces[2] == pytest.approx(arm[0] * weight[1] - arm[1] * weight[0], abs=1e-12)


def test_a_state_of_a_motion_has_the_equations_of_the_motion(linkage_motion):
    moving = jn.constraint_equations(linkage_motion).isel(time=[1])
    state = {}
    for name in LINKAGE.bodies:
        position = linkage_motion.point(name, [0, 0]).values[1]
        state[name] = {"position": position, "angle": linkage_motion.angle(name).values[1]}
    still = jn.constraint_equations(LINKAGE, state, 0.5)
    assert list(still.right_side.derivative.values) == list(range(9))
    for name in ("residual", "jacobian", "right_side", "velocities", "position", "angle", "mass_matrix", "multipliers"):
        wanted, found = moving[name], still[name]
        if "derivative" in wanted.dims:
            count = 5 if name == "multipliers" else 7
            some = range(count) if name == "multipliers" else range(1, count + 1)
            wanted, found = wanted.sel(derivative=some), found.sel(derivative=some)
        scale = 1 + np.abs(wanted).max().item()
        np.testing.assert_allclose(found.values, wanted.values, rtol=0, atol=1e-12 * scale, err_msg=name)


@pytest.mark.slow
def test_redundant_rows_are_all_there():
    """A door on two hinges: what both bear has no multipliers, as they are not unique."""
    hinge = {"axis_i": [0, 0, 1], "axis_j": [0, 0, 1]}
    door = jn.Mechanism(
        space="spatial",
        bodies={"door": jn.Body([0, 0, 0], mass=3.0, inertia=[0.1, 0.2, 0.3])},
        joints={
            "lower": jn.spatial.Revolute(("ground", "door"), [0, 0, 0], [0, 0, 0], **hinge),
            "upper": jn.spatial.Revolute(("ground", "door"), [0, 0, 1], [0, 0, 1], **hinge),
        },
        drivers={"turn": jn.drivers.RotationDriver(("ground", "door"), [0, 0, 1], motion="3*t")},
    )
    solved = jn.constraint_equations(jn.solve(door, [0.0], order=2)).multipliers.sel(derivative=0)
    assert np.isnan(solved.sel(row=[f"{name}.{k}" for name in ("lower", "upper") for k in range(1, 6)])).all()
    assert np.isfinite(solved.sel(row="turn.1")).all()
    spin = [[0, 0, 3.0], [0, 0, 0]]
    state = {"door": {"position": np.zeros((3, 3)), "orientation": [1, 0, 0, 0], "angular_velocity": spin}}
    equations = jn.constraint_equations(door, state)
    assert equations.sizes["row"] == 11
    assert np.linalg.matrix_rank(equations.jacobian.values[0]) == 6
    assert "mass_matrix" in equations
    assert "multipliers" not in equations
    assert not equations.residual.any()
    gap = along(equations.jacobian, equations.velocities) - equations.right_side
    np.testing.assert_allclose(gap.sel(derivative=[1, 2]).values, 0, atol=1e-15)
    assert equations.right_side.sel(derivative=1, row="turn.1").item() == 3.0


def test_bodies_without_joints_and_motions_without_derivatives():
    free = jn.Mechanism(space="spatial", bodies={"stone": jn.Body([0, 0, 2.0], mass=2.0, inertia=[1, 2, 3])}, joints={})
    equations = jn.constraint_equations(free)
    assert equations.jacobian.shape == (1, 0, 6)
    assert equations.right_side.shape == (1, 1, 0)
    assert "multipliers" not in equations
    np.testing.assert_array_equal(equations.mass_matrix[0], np.diag([2.0, 2, 2, 1, 2, 3]))
    still = jn.constraint_equations(jn.solve(jn.load(example("four_bar")), [0.0, 0.1], order=0))
    assert still.right_side.shape == (2, 0, 6)
    assert still.jacobian.shape == (2, 6, 6)


def test_a_free_body_without_a_mass_leaves_multipliers_open():
    """Two arms on pins, one of them with no mass: nothing tells how it accelerates."""
    bodies = {"heavy": jn.Body([0, 0], mass=1.0, inertia=0.1, center_of_mass=[0.5, 0]), "light": jn.Body([1, 0])}
    pins = {name: jn.planar.Revolute(("ground", name), body.position, [0, 0]) for name, body in bodies.items()}
    state = {name: {"position": [body.position, [0, 0], [0, 0]], "angle": [0, 0, 1]} for name, body in bodies.items()}
    open_ones = jn.constraint_equations(jn.Mechanism(space="planar", bodies=bodies, joints=pins), state)
    assert "multipliers" not in open_ones
    bodies["light"] = jn.Body([1, 0], mass=1.0, inertia=0.1)
    found = jn.constraint_equations(jn.Mechanism(space="planar", bodies=bodies, joints=pins), state).multipliers
    np.testing.assert_allclose(found.sel(derivative=0).values[0, 2:], 0, atol=1e-15)
    assert np.isfinite(found.sel(derivative=0)).all()


def test_instants_that_were_not_solved_are_nan():
    """A crank pushed away from a point farther than it reaches."""
    reach = jn.drivers.DistanceDriver(("ground", "crank"), [1, 0], [1, 0], motion="0.5 + 2*t")
    mechanism = jn.Mechanism(
        space="planar",
        bodies={"crank": jn.Body([0, 0], angle=0.5)},
        joints={"O": jn.planar.Revolute(("ground", "crank"), [0, 0], [0, 0])},
        drivers={"reach": reach},
    )
    motion = jn.solve(mechanism, [0.0, 0.05, 1.0], order=2, strict=False)
    assert motion.status[0] == 0
    assert motion.status[-1] != 0
    equations = jn.constraint_equations(motion)
    assert np.isfinite(equations.jacobian[0]).all()
    assert np.isnan(equations.jacobian[-1]).all()


STATES = {
    "missing body": ({}, "state.arm"),
    "unknown body": ({"leg": {}}, "leg"),
    "unknown key": ({"arm": {"position": [0, 0], "angle": 0, "velocity": [1, 0]}}, "velocity"),
    "missing key": ({"arm": {"position": [0, 0]}}, "state.arm.angle"),
    "wrong size": ({"arm": {"position": [0, 0, 0], "angle": 0}}, "state.arm.position"),
    "not finite": ({"arm": {"position": [0, np.nan], "angle": 0}}, "state.arm.position"),
    "no numbers": ({"arm": {"position": ["x", 0], "angle": 0}}, "state.arm.position"),
    "unequal orders": ({"arm": {"position": [[0, 0], [0, 1]], "angle": 0}}, "state.arm.angle"),
}


@pytest.mark.parametrize("state, named", STATES.values(), ids=STATES)
def test_states_that_do_not_fit_are_refused(state, named):
    joints = {"O": jn.planar.Revolute(("ground", "arm"), [0, 0], [0, 0])}
    mechanism = jn.Mechanism(space="planar", bodies={"arm": jn.Body([0, 0])}, joints=joints)
    with pytest.raises(jn.MechanismError, match=named):
        jn.constraint_equations(mechanism, state)


def test_a_law_without_a_value_is_refused():
    joints = {"O": jn.planar.Revolute(("ground", "arm"), [0, 0], [0, 0])}
    driver = jn.drivers.CoordinateDriver(("ground", "arm"), "angle", motion="sqrt(t - 1)")
    mechanism = jn.Mechanism(space="planar", bodies={"arm": jn.Body([0, 0])}, joints=joints, drivers={"turn": driver})
    with pytest.raises(jn.MechanismError, match="turn"):
        jn.constraint_equations(mechanism, {"arm": {"position": [0, 0], "angle": 0}}, time=0.5)


@pytest.mark.slow  # to compile
def test_a_simulation_has_equations_too():
    pendulum = jn.load(example("simple_pendulum"))
    simulation = jn.simulate(pendulum, [0.0, 0.3], order=3)
    equations = jn.constraint_equations(simulation)
    gap = along(equations.jacobian, equations.velocities) - equations.right_side
    np.testing.assert_allclose(gap.sel(derivative=[1, 2, 3]).values, 0, atol=1e-11)
    at = equations.isel(time=1)
    joint = equations.jacobian.isel(time=1).values.T @ at.multipliers.sel(derivative=0).values
    reaction = jn.joint_reaction(simulation, next(iter(pendulum.joints))).force
    np.testing.assert_allclose(joint[:2], -reaction.sel(derivative=0)[1], rtol=1e-12)


SKEW = np.array([1.0, 2.0, 2.0]) / 3  # the axis of a flap in the global frame, and, turned, in that of the flap
TURN = np.array([0.8, 0.1, -0.5, 0.3]) / np.linalg.norm([0.8, 0.1, -0.5, 0.3])


def rotated(p, v):
    return v + 2 * np.cross(p[1:], np.cross(p[1:], v) + p[0] * v)


def flap():
    """Return a solid on a skew hinge, its frame drawn anyhow, its centre of mass and inertia off every axis."""
    tensor = np.array([[0.30, 0.02, -0.05], [0.02, 0.40, 0.03], [-0.05, 0.03, 0.35]])
    axis = rotated(TURN * [1, -1, -1, -1], SKEW)
    return jn.Mechanism(
        space="spatial",
        gravity=[1.0, -2.0, -9.81],
        bodies={
            "flap": jn.Body(
                [0.3, 0.1, 0.2], orientation=TURN.tolist(), mass=2.5, inertia=tensor, center_of_mass=[0.2, -0.1, 0.3]
            )
        },
        joints={
            "hinge": jn.spatial.Revolute(("ground", "flap"), [0.3, 0.1, 0.2], [0, 0, 0], SKEW.tolist(), axis.tolist())
        },
        drivers={"swing": jn.drivers.RotationDriver(("ground", "flap"), SKEW.tolist(), motion="0.7*sin(3*t)")},
    )


@pytest.mark.slow
def test_equations_of_motion_in_space_with_frames_drawn_anyhow():
    """Newton and Euler about the origin of the body, by NumPy; the first rates by differences of order eight."""
    mechanism, h = flap(), 1e-2
    instants = 0.4 + h * np.arange(-4, 5)
    equations = jn.constraint_equations(jn.solve(mechanism, instants, order=4))
    at = equations.isel(time=4)
    body = mechanism.bodies["flap"]
    m, c = body.mass, np.array(body.center_of_mass)
    about = np.asarray(body.inertia) + m * (c @ c * np.eye(3) - np.outer(c, c))
    p = at.attitude.sel(body="flap").values
    A = np.stack([rotated(p, v) for v in np.eye(3)], axis=1)
    w = at.velocities.sel(derivative=1).values[3:]
    lever = np.array([[0, -c[2], c[1]], [c[2], 0, -c[0]], [-c[1], c[0], 0]])
    matrix = np.block([[m * np.eye(3), -m * A @ lever], [m * lever @ A.T, about]])
    np.testing.assert_allclose(at.mass_matrix.values, matrix, rtol=0, atol=1e-14)
    np.testing.assert_allclose(matrix, matrix.T, rtol=0, atol=1e-14)
    g = np.array(mechanism.gravity)
    Q = np.concatenate([m * g - m * A @ np.cross(w, np.cross(w, c)), m * np.cross(c, A.T @ g) - np.cross(w, about @ w)])
    joined = at.jacobian.values.T @ at.multipliers.sel(derivative=0).values
    np.testing.assert_allclose(matrix @ at.velocities.sel(derivative=2).values + joined, Q, rtol=0, atol=1e-12)
    weights = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280]) / h
    for k in range(2):
        slope = weights @ equations.multipliers.sel(derivative=k).values
        np.testing.assert_allclose(slope, at.multipliers.sel(derivative=k + 1), rtol=0, atol=1e-8)


def test_a_time_without_a_state_is_refused(linkage_motion):
    with pytest.raises(jn.MechanismError, match=r"time.*0\.2"):
        jn.constraint_equations(linkage_motion, time=0.2)


def test_a_state_looked_at_with_a_motion_has_the_turns_of_the_motion(linkage_motion):
    state = {name: {"position": [0, 0], "angle": 0.1} for name in LINKAGE.bodies}
    one, other = jn.constraint_equations(linkage_motion, state, 0.2), jn.constraint_equations(LINKAGE, state, 0.2)
    xarray.testing.assert_identical(one, other)
