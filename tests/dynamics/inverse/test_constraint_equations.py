"""The equations of a mechanism as users see them: identities, multipliers, states that are no motion's."""

import numpy as np
import pytest
import xarray

import jounce as jn
from tests.problems.mechanisms import example


def along(jacobian, velocities):
    return xarray.dot(jacobian, velocities, dim="column")


@pytest.mark.slow
def test_rows_and_columns_are_those_of_the_file_whatever_the_types():
    """The solver keeps joints of one type together; the rows of the file stand as they are written."""
    mechanism = jn.load(example("inverted_slider_crank_slide"))
    equations = jn.constraint_equations(mechanism)
    rows = ["E.1", "E.2", "F.1", "F.2", "slide.1", "slide.2", "G.1", "G.2", "d.1"]
    assert list(equations.row.values) == rows
    columns = [f"{body}.{c}" for body in ("guide", "block", "rocker") for c in ("x", "y", "angle")]
    assert list(equations.column.values) == columns
    assert list(equations.column_unit.values) == ["m", "m", "rad"] * 3
    assert (equations.position.attrs["units"], equations.angle.attrs["units"]) == ("m", "rad")
    pinned = equations.jacobian.isel(time=0).sel(row=["F.1", "F.2"])
    np.testing.assert_array_equal(pinned.sel(column=["rocker.x", "rocker.y"]), np.eye(2))
    assert not pinned.sel(column=columns[:6]).any()
    spatial_columns = jn.constraint_equations(jn.load(example("rssr"))).column.values
    assert list(spatial_columns[:6]) == [f"crank.{c}" for c in ("x", "y", "z", "wx", "wy", "wz")]


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


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_state_of_a_motion_has_the_equations_of_the_motion(linkage_motion):
    moving = jn.constraint_equations(linkage_motion).isel(time=[1])
    state = {}
    for name in LINKAGE.bodies:
        position = linkage_motion.point(name, [0, 0]).values[1]
        state[name] = {"position": position, "angle": linkage_motion.angle(name).values[1]}
    still = jn.constraint_equations(LINKAGE, state, 0.5)
    assert list(still.right_side.derivative.values) == list(range(9))
    for name in ("residual", "jacobian", "right_side", "velocities", "position", "angle", "mass_matrix", "multipliers"):
        expected, found = moving[name], still[name]
        if "derivative" in expected.dims:
            count = 5 if name == "multipliers" else 7
            some = range(count) if name == "multipliers" else range(1, count + 1)
            expected, found = expected.sel(derivative=some), found.sel(derivative=some)
        scale = 1 + np.abs(expected).max().item()
        np.testing.assert_allclose(found.values, expected.values, rtol=0, atol=1e-12 * scale, err_msg=name)


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


@pytest.mark.slow
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


@pytest.mark.slow
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
    with pytest.raises(jn.errors.MechanismError, match=named):
        jn.constraint_equations(mechanism, state)


def test_a_law_without_a_value_is_refused():
    joints = {"O": jn.planar.Revolute(("ground", "arm"), [0, 0], [0, 0])}
    driver = jn.drivers.CoordinateDriver(("ground", "arm"), "angle", motion="sqrt(t - 1)")
    mechanism = jn.Mechanism(space="planar", bodies={"arm": jn.Body([0, 0])}, joints=joints, drivers={"turn": driver})
    with pytest.raises(jn.errors.MechanismError, match="turn"):
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
    """Return a solid on a skew hinge, its frame drawn anyhow, its center of mass and inertia off every axis."""
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
    with pytest.raises(jn.errors.MechanismError, match=r"time.*0\.2"):
        jn.constraint_equations(linkage_motion, time=0.2)


def test_a_state_looked_at_with_a_motion_has_the_turns_of_the_motion(linkage_motion):
    state = {name: {"position": [0, 0], "angle": 0.1} for name in LINKAGE.bodies}
    one, other = jn.constraint_equations(linkage_motion, state, 0.2), jn.constraint_equations(LINKAGE, state, 0.2)
    xarray.testing.assert_identical(one, other)
