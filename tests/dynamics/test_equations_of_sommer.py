"""Sommer 2024, equations 1-8 and appendix A, against the equations of a mechanism at random states."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from tests.oracles import (
    sommer_appendix as appendix,
    sommer_general as general,
    sommer_planar as planar,
    sommer_spatial as spatial,
)
from tests.problems.states import planar_state, spatial_state

ROUNDING = 3e-13
T, LAW_AT = 0.3, "sin(2*t) + t**3"
STEP = 1e-5  # of central differences


class Pair:
    """Two bodies joined by one joint or driver at a random state, and the dataset of their equations.

    Attributes
    ----------
    i, j : Body
        As the oracles of S take them.
    points : tuple of array
        On both bodies.
    """

    def __init__(self, joint, space, seed=3):
        random = np.random.default_rng(seed)
        self.space, size = space, 2 if space == "planar" else 3
        self.points, self.vectors = random.normal(size=(2, size)), random.normal(size=(2, size))
        if space == "planar":
            self.i, self.j = planar_state(random), planar_state(random)
            self.state = {n: {"position": b.r, "angle": b.phi} for n, b in (("i", self.i), ("j", self.j))}
        else:
            (self.i, p), (self.j, q) = spatial_state(random), spatial_state(random)
            self.state = {
                name: {"position": body.r, "orientation": turn.tolist(), "angular_velocity": body.w}
                for name, body, turn in (("i", self.i, p), ("j", self.j, q))
            }
        element = joint(self)
        kind = "drivers" if element.role == "driver" else "joints"
        bodies = {name: jn.Body([0.0] * size) for name in "ij"}
        self.mechanism = jn.Mechanism(space=space, bodies=bodies, **{"joints": {}, kind: {"C": element}})
        self.equations = self.at(self.state)

    def at(self, state):
        return jn.constraint_equations(self.mechanism, state, T).isel(time=0)

    @property
    def two(self):
        return self.i, self.j, *self.points

    def right_side(self, k):
        return self.equations.right_side.sel(derivative=k).values

    def velocities(self, k):
        return self.equations.velocities.sel(derivative=k).values

    def rates_of(self, body, k):
        return self.equations.velocities.sel(derivative=k, column=COLUMNS[self.space](body)).values

    def slopes(self, k):
        """Return the derivatives of ``Phi_q q^(k)`` by all coordinates, q^(k) held: (rows, columns)."""
        found = []
        for column in self.equations.column.values:
            sides = [self.at(self._displaced(column, h)).jacobian.values @ self.velocities(k) for h in (STEP, -STEP)]
            found.append((sides[0] - sides[1]) / (2 * STEP))
        return np.stack(found, axis=1)

    def _displaced(self, column, step):
        body, _, letter = column.partition(".")
        state = {name: dict(values) for name, values in self.state.items()}
        if letter in "xyz":
            position = np.array(state[body]["position"])
            position[0, "xyz".index(letter)] += step
            state[body]["position"] = position
        elif letter == "angle":
            state[body]["angle"] = state[body]["angle"] + step * np.eye(len(state[body]["angle"]))[0]
        else:
            e0, *e = state[body]["orientation"]
            c, s = np.cos(step / 2), np.sin(step / 2) * np.eye(3)["xyz".index(letter[1])]
            state[body]["orientation"] = [e0 * c - np.dot(e, s), *(e0 * s + c * np.array(e) + np.cross(e, s))]
        return state


COLUMNS = {
    "planar": lambda body: [f"{body}.{c}" for c in ("x", "y", "angle")],
    "spatial": lambda body: [f"{body}.{c}" for c in ("x", "y", "z", "wx", "wy", "wz")],
}


def near(found, expected):
    np.testing.assert_allclose(found, expected, rtol=0, atol=ROUNDING * (1 + np.abs(expected).max()))


def planar_point(q, s):
    c, n = jnp.cos(q[2]), jnp.sin(q[2])
    return q[:2] + jnp.array([c * s[0] - n * s[1], n * s[0] + c * s[1]])


@pytest.mark.slow
def test_equations_001_to_005_any_constraint():
    """The general equations, by nested derivatives of Phi(q, t), for a driver that has all their terms."""
    bodies = ("i", "j")
    pair = Pair(lambda p: jn.drivers.SlideDriver(bodies, *p.points.tolist(), p.vectors[0].tolist(), LAW_AT), "planar")
    s_i, s_j, a_i = *pair.points, pair.vectors[0]

    def phi(q, t):
        d = planar_point(q[3:], s_j) - planar_point(q[:3], s_i)
        a = planar_point(q[:3], a_i) - q[:2]
        return a @ d / np.linalg.norm(a_i) - (jnp.sin(2 * t) + t**3)

    q = jnp.concatenate([x for b in (pair.i, pair.j) for x in (b.r[0], b.phi[:1])])
    rates = [jnp.asarray(pair.velocities(k)) for k in range(1, 5)]
    D = general.Derivatives(phi, q, T)
    near(pair.equations.residual.values[0], general.equation_001(phi, q, T))
    near(pair.equations.jacobian.values[0], np.asarray(jax.grad(phi)(q, T)))
    near(pair.right_side(1)[0], general.equation_002(D))
    for k, equation in ((2, general.equation_003), (3, general.equation_004), (4, general.equation_005)):
        near(pair.right_side(k)[0], equation(D, rates))


def turned(A, w):
    """Return A skew(w)."""
    x, y, z = w
    return A @ jnp.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


@pytest.mark.slow
def test_equations_004_and_005_hold_in_body_axes_with_the_order_of_their_factors():
    """With body-fixed angular velocities 4 and 5 as printed are wrong; what is computed is the right form."""
    pair = Pair(lambda p: jn.spatial.Dot1(("i", "j"), *p.vectors.tolist()), "spatial")
    a_i, a_j = pair.vectors

    def split(v):
        return v[:3], v[3:6], v[6:9], v[9:]

    def tangent(q, v):
        r, w, s, u = split(v)
        return r, turned(q[1], w), s, turned(q[3], u)

    q = tuple(jnp.asarray(x) for x in (pair.i.r[0], pair.i.A, pair.j.r[0], pair.j.A))
    rates = [jnp.asarray(pair.velocities(k)) for k in range(1, 5)]
    D = general.Derivatives(lambda q, t: (q[1] @ a_i) @ (q[3] @ a_j), q, T, tangent)
    near(pair.right_side(3)[0], general.equation_004_body_axes(D, rates))
    near(pair.right_side(4)[0], general.equation_005_body_axes(D, rates))
    assert abs(general.equation_004(D, rates) - pair.right_side(3)[0]) > 0.1
    assert abs(general.equation_005(D, rates) - pair.right_side(4)[0]) > 0.1


@pytest.fixture(scope="module")
def revolute():
    return Pair(lambda p: jn.planar.Revolute(("i", "j"), *p.points.tolist()), "planar")


@pytest.fixture(scope="module")
def ball():
    return Pair(lambda p: jn.spatial.Spherical(("i", "j"), *p.points.tolist()), "spatial")


@pytest.mark.slow
def test_equations_006_to_008_constraints_without_time(revolute, ball):
    q = jnp.concatenate([x for b in (revolute.i, revolute.j) for x in (b.r[0], b.phi[:1])])
    s_i, s_j = revolute.points
    plane = general.Derivatives(lambda q, t: planar_point(q[3:], s_j) - planar_point(q[:3], s_i), q, T)
    p_i, p_j = ball.points
    place = tuple(jnp.asarray(x) for x in (ball.i.r[0], ball.i.A, ball.j.r[0], ball.j.A))

    def tangent(q, v):
        return v[:3], turned(q[1], v[3:6]), v[6:9], turned(q[3], v[9:])

    space = general.Derivatives(lambda q, t: q[2] + q[3] @ p_j - q[0] - q[1] @ p_i, place, T, tangent)
    for pair, D in ((revolute, plane), (ball, space)):
        rates = [jnp.asarray(pair.velocities(k)) for k in range(1, 5)]
        assert not pair.right_side(1).any()
        for k, equation in ((2, general.equation_006), (3, general.equation_007), (4, general.equation_008)):
            near(pair.right_side(k), equation(D, rates))


def test_appendix_01_to_16_the_revolute(revolute):
    """Jacobian, gamma, eta and sigma, and each product on the way to them."""
    two, jacobian = revolute.two, revolute.equations.jacobian.values
    near(jacobian, np.column_stack(appendix.appendix_02(*two)))
    near(revolute.right_side(2), appendix.appendix_03(*two))
    near(revolute.rates_of("i", 2), appendix.appendix_05(revolute.i))
    near(jacobian @ revolute.velocities(2), appendix.appendix_06(*two))
    slopes = revolute.slopes(2)
    np.testing.assert_allclose(slopes, np.column_stack(appendix.appendix_07(*two)), rtol=0, atol=1e-9)
    np.testing.assert_allclose(slopes @ revolute.velocities(1), appendix.appendix_08(*two), rtol=0, atol=1e-9)
    near(revolute.right_side(3), appendix.appendix_09(*two))
    near(revolute.right_side(3), appendix.appendix_01(appendix.appendix_04(*two), appendix.appendix_08(*two)))
    near(revolute.rates_of("i", 3), appendix.appendix_12(revolute.i))
    near(jacobian @ revolute.velocities(3), appendix.appendix_13(*two))
    slopes = revolute.slopes(3)
    np.testing.assert_allclose(slopes, np.column_stack(appendix.appendix_14(*two)), rtol=0, atol=1e-9)
    np.testing.assert_allclose(slopes @ revolute.velocities(1), appendix.appendix_15(*two), rtol=0, atol=1e-9)
    near(revolute.right_side(4), appendix.appendix_16(*two))
    near(revolute.right_side(4), appendix.appendix_10(appendix.appendix_11(*two), appendix.appendix_15(*two)))


def test_appendix_17_to_34_the_spherical(ball):
    """The same in space, by body-fixed angular velocities."""
    two, jacobian = ball.two, ball.equations.jacobian
    by = jacobian.sel
    (r_i, r_j), (pi_i, pi_j) = appendix.appendix_18(), appendix.appendix_19(*two)
    near(by(column=COLUMNS["spatial"]("i")).values, np.column_stack([r_i, pi_i]))
    near(by(column=COLUMNS["spatial"]("j")).values, np.column_stack([r_j, pi_j]))
    near(ball.right_side(2), appendix.appendix_20(*two))
    near(ball.rates_of("i", 2), appendix.appendix_22(ball.i))
    near(jacobian.values @ ball.velocities(2), appendix.appendix_23(*two))
    turns = [3, 4, 5, 9, 10, 11]
    spins = ball.velocities(1)[turns]
    slopes = ball.slopes(2)
    np.testing.assert_allclose(slopes[:, turns], np.column_stack(appendix.appendix_24(*two)), rtol=0, atol=1e-9)
    np.testing.assert_allclose(np.delete(slopes, turns, axis=1), 0, atol=1e-9)
    np.testing.assert_allclose(slopes[:, turns] @ spins, appendix.appendix_25(*two), rtol=0, atol=1e-9)
    near(ball.right_side(3), appendix.appendix_26(*two))
    near(ball.right_side(3), appendix.appendix_17(appendix.appendix_21(*two), appendix.appendix_25(*two)))
    near(ball.rates_of("i", 3), appendix.appendix_30(ball.i))
    near(jacobian.values @ ball.velocities(3), appendix.appendix_31(*two))
    slopes = ball.slopes(3)
    np.testing.assert_allclose(slopes[:, turns], np.column_stack(appendix.appendix_32(*two)), rtol=0, atol=1e-9)
    np.testing.assert_allclose(slopes[:, turns] @ spins, appendix.appendix_33(*two), rtol=0, atol=1e-9)
    near(ball.right_side(4), appendix.appendix_34(*two))
    near(ball.right_side(4), appendix.appendix_27(appendix.appendix_28(*two), appendix.appendix_33(*two)))


def test_driver_of_equation_056():
    start, delta, tau = 0.5, 1.1, 2.0
    law = jn.laws.ExpressionMotion("start + delta*sin(2*pi*t/tau)", {"start": start, "delta": delta, "tau": tau})
    found = np.array(law(jn.Jet.variable(0.37, order=4)).derivatives())
    near(found, planar.equation_056(0.37, start, delta, tau))
    pair = Pair(lambda p: jn.drivers.CoordinateDriver(("i", "j"), "angle", "0.5 + 1.1*sin(pi*t)"), "planar")
    rights = [pair.right_side(k)[0] for k in range(1, 5)]
    near(rights, planar.equation_056(T, start, delta, tau)[1:])
    assert pair.equations.residual.values[0] == pytest.approx(
        pair.j.phi[0] - pair.i.phi[0] - planar.equation_056(T, start, delta, tau)[0], abs=1e-14
    )
    assert spatial.equation_103(planar.equation_056(T, start, delta, tau))[0] == pytest.approx(rights[0], abs=1e-13)
