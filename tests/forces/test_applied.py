"""Effect of every force on its bodies, with rates, against the mechanics of points and moments in forty digits."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from mpmath import mp, mpf

import jounce as jn
from jounce import forces
from tests.forces.motions import INSTANT, ORDER, applied, moving_bodies, pose_of, quickly, system_of
from tests.oracles.mp_wrenches import cross, dot, minus, rates, times, wrench

pytestmark = pytest.mark.long

P, Q, U = [0.3, -0.2, 0.4], [-0.5, 0.1, 0.2], [1.0, 0.5, -0.7]
K, C, L = 3.0, 0.4, 0.25


def local(vector, components):
    """Return a vector of the plane or of space, and the same in space."""
    return vector[:components], [*vector[:components], *[0.0] * (3 - components)]


def along_line(law):
    """Return the loads of a force along the line of P on body i and Q on body j, positive apart."""

    def loads(i, j, t, components):
        p, q = local(P, components)[1], local(Q, components)[1]
        start, end = i.point(p, t), j.point(q, t)
        d, rate = minus(end, start), minus(j.velocity(q, t), i.velocity(p, t))
        length = mp.sqrt(dot(d, d))
        force = times(d, law(length, dot(d, rate) / length, t) / length)
        return wrench(i, t, [(start, times(force, -1))]), wrench(j, t, [(end, force)])

    return loads


def along_slide(law):
    """Return the loads of a force along U of body i, from P on body i to Q on body j."""

    def loads(i, j, t, components):
        p, q, u = (local(v, components)[1] for v in (P, Q, U))
        end = j.point(q, t)
        axis = times(i.direction(u, t), 1 / mp.sqrt(dot(u, u)))
        d = minus(end, i.point(p, t))
        rate = minus(j.velocity(q, t), i.velocity(p, t))
        force = times(axis, law(dot(axis, d), dot(axis, rate) + dot(cross(i.spin(t), axis), d), t))
        return wrench(i, t, [(end, times(force, -1))]), wrench(j, t, [(end, force)])

    return loads


def about_z(law):
    """Return the loads of a torque between bodies of the plane."""

    def loads(i, j, t, components):
        angle = j.angles[0](t) - i.angles[0](t)
        torque = law(angle, j.angles[0].rate(t) - i.angles[0].rate(t), t)
        return wrench(i, t, moments=[[0, 0, -torque]]), wrench(j, t, moments=[[0, 0, torque]])

    return loads


def linear(s, v, t):
    return -K * (s - L) - C * v


def swinging(s, v, t):
    return mp.sin(5 * t) * s**2 - 0.3 * v * abs(v)


LAW = "sin(5*t)*x**2 - c*v*abs(v)"
SAME_IN_BOTH = {
    "spring": (lambda p, q, u: forces.Spring(("a", "b"), p, q, "k", L, C), along_line(linear)),
    "distance_force": (lambda p, q, u: forces.DistanceForce(("a", "b"), p, q, LAW), along_line(swinging)),
    "slide_spring": (lambda p, q, u: forces.SlideSpring(("a", "b"), p, q, u, K, L, "c2"), along_slide(linear)),
    "slide_force": (
        lambda p, q, u: forces.SlideForce(("a", "b"), p, q, u, lambda x, v, t: jn.jet.sin(5 * t) * x**2),
        along_slide(lambda s, v, t: mp.sin(5 * t) * s**2),
    ),
}
PLANE_ONLY = {
    "torsional_spring": (lambda p, q, u: forces.TorsionalSpring(("a", "b"), K, L, C), about_z(linear)),
    "torque": (lambda p, q, u: forces.Torque(("a", "b"), LAW), about_z(swinging)),
}


def check_between(make, loads, components):
    i, j = moving_bodies(components, components)
    p, q, u = (local(v, components)[0] for v in (P, Q, U))
    system, _ = system_of({"F": make(p, q, u)}, components, {"k": K, "c": 0.3, "c2": C})
    found = applied(system, pose_of([i, j], components))
    exact = np.array(rates(lambda t: [x for w in loads(i, j, t, components) for x in w], INSTANT, ORDER - 1))
    exact = exact.reshape(ORDER, 2, 6)
    if components == 2:
        exact = exact[:, :, [0, 1, 5]]
    for body in (0, 1):
        np.testing.assert_allclose(found[:, :, body + 1], exact[:, body], rtol=1e-12, atol=1e-11)
    assert not found[:, :, 0].any()


@pytest.mark.slow
@pytest.mark.parametrize("components", [2, 3], ids=["planar", "spatial"])
@pytest.mark.parametrize("name", SAME_IN_BOTH)
def test_force_between_bodies(name, components):
    check_between(*SAME_IN_BOTH[name], components)


@pytest.mark.parametrize("name", PLANE_ONLY)
def test_torque_of_the_plane(name):
    check_between(*PLANE_ONLY[name], 2)


@pytest.mark.parametrize("frame", ["global", "body"])
@pytest.mark.parametrize("components", [2, 3], ids=["planar", "spatial"])
def test_point_force(components, frame):
    """The force depends on position, velocity and time; along the axes of the body it turns with the body."""
    kind = forces.PointForce if components == 2 else forces.SpatialPointForce
    law = ["-c*vx + x", "2*t*vy", "y*t - vz"][:components]
    other, body = moving_bodies(7, components)
    p, whole = local(P, components)
    system, _ = system_of({"F": kind("b", p, law, frame=frame)}, components, {"c": 0.3})

    def exact(t):
        place, velocity = body.point(whole, t), body.velocity(whole, t)
        if frame == "body":
            velocity = body.seen(velocity, t)
        force = [-0.3 * velocity[0] + place[0], 2 * t * velocity[1], place[1] * t - velocity[2]]
        force = force if components == 3 else [*force[:2], 0]
        if frame == "body":
            force = body.direction(force, t)
        return wrench(body, t, [(place, force)])

    found = applied(system, pose_of([other, body], components))
    expected = np.array(rates(exact, INSTANT, ORDER - 1))
    np.testing.assert_allclose(
        found[:, :, 2], expected if components == 3 else expected[:, [0, 1, 5]], rtol=1e-12, atol=1e-11
    )
    assert not found[:, :, :2].any()


def test_moment_of_the_plane():
    other, body = moving_bodies(3, 2)
    system, _ = system_of({"F": forces.Moment("b", "-c*v + sin(x)*t")}, 2, {"c": 0.3})
    exact = rates(lambda t: [-mpf(0.3) * body.angles[0].rate(t) + mp.sin(body.angles[0](t)) * t], INSTANT, ORDER - 1)
    found = applied(system, pose_of([other, body], 2))
    np.testing.assert_allclose(found[:, 2, 2], np.array(exact)[:, 0], rtol=1e-13)
    assert not found[:, :2].any()


@pytest.mark.parametrize("frame", ["global", "body"])
def test_moment_in_space(frame):
    other, body = moving_bodies(4, 3)
    system, _ = system_of({"F": forces.SpatialMoment("b", ["-wx + t", "wx*wy", 0.5], frame=frame)}, 3)

    def exact(t):
        spin = body.spin(t)
        if frame == "body":
            spin = body.seen(spin, t)
        moment = [-spin[0] + t, spin[0] * spin[1], mpf(0.5)]
        return wrench(body, t, moments=[body.direction(moment, t) if frame == "body" else moment])

    found = applied(system, pose_of([other, body], 3))
    np.testing.assert_allclose(found[:, :, 2], rates(exact, INSTANT, ORDER - 1), rtol=1e-12, atol=1e-11)


AXIS, V_I, V_J = [0.2, 0.3, 1.0], [1.0, 0.1, 0.0], [0.9, -0.4, 0.3]


def angle_between(i, j, t, vectors, turn_i=None, turn_j=None):
    """Return the angle of body j about an axis of body i, by projection or by Euler parameters, after small turns."""
    a_i, a_j = i.attitude(t), j.attitude(t)
    if turn_i is not None:
        a_i = a_i * turn_i
    if turn_j is not None:
        a_j = a_j * turn_j
    axis = mp.matrix(AXIS) / mp.norm(mp.matrix(AXIS))
    relative = a_i.T * a_j
    if vectors:
        # the vector on j counts by its part across the axis, as in the position assembled: no turn of one frame
        lies = mp.matrix(V_J) - axis * dot(axis, V_J)
        b, a = list(relative * lies), V_I
        return mp.atan2(dot(axis, cross(a, b)), dot(a, b) - dot(axis, a) * dot(axis, b))
    trace = relative[0, 0] + relative[1, 1] + relative[2, 2]
    e0 = mp.sqrt(1 + trace) / 2
    e = [(relative[2, 1] - relative[1, 2]), (relative[0, 2] - relative[2, 0]), (relative[1, 0] - relative[0, 1])]
    return 2 * mp.atan2(dot(axis, e) / (4 * e0), e0)


def small_turn(k, angle):
    """Return a turn about axis k, right to first order and better."""
    skew = mp.matrix(3)
    m, n = (k + 1) % 3, (k + 2) % 3
    skew[m, n], skew[n, m] = -angle, angle
    return mp.eye(3) + skew


@pytest.mark.parametrize("kind, vectors", [("torque", True), ("torsional_spring", False)])
def test_torque_about_an_axis_in_space(kind, vectors):
    """Its moment on each body is the torque times how the angle changes with turns of that body, here differenced.

    The bodies move freely, so that the angle is that of a general relative attitude, and not of a hinge alone.
    """
    i, j = moving_bodies(11, 3)
    given = {"vector_i": V_I, "vector_j": V_J} if vectors else {}
    if kind == "torque":
        force, law = forces.SpatialTorque(("a", "b"), AXIS, "x**3 - 0.3*v", **given), lambda x, v: x**3 - 0.3 * v
    else:
        force = forces.SpatialTorsionalSpring(("a", "b"), AXIS, K, L, C, **given)
        law = lambda x, v: linear(x, v, 0)  # noqa: E731
    system, _ = system_of({"F": force}, 3)

    def exact(t):
        angle = angle_between(i, j, t, vectors)
        torque = law(angle, mp.diff(lambda s: angle_between(i, j, s, vectors), t))
        slopes = []
        for key in ("turn_i", "turn_j"):
            for k in range(3):
                along = mp.diff(lambda e, k=k, key=key: angle_between(i, j, t, vectors, **{key: small_turn(k, e)}), 0)
                slopes.append(torque * along)
        return slopes

    found = applied(system, pose_of([i, j], 3).truncate(2))
    expected = np.array(rates(exact, INSTANT, 1))
    np.testing.assert_allclose(found[:2, 3:, 1], expected[:, :3], rtol=1e-12, atol=1e-11)
    np.testing.assert_allclose(found[:2, 3:, 2], expected[:, 3:], rtol=1e-12, atol=1e-11)
    assert np.abs(found[:, :3]).max() < 1e-12


def all_forces(components):
    p, q, u = (local(v, components)[0] for v in (P, Q, U))
    law = ["-c*vx + x", "2*t*vy", "y*t - vz"][:components]
    made = {name: make(p, q, u) for name, (make, _) in SAME_IN_BOTH.items()}
    made["on the ground"] = forces.Spring(("ground", "b"), q, p, 2.0, 0.0)
    if components == 2:
        made |= {name: make(p, q, u) for name, (make, _) in PLANE_ONLY.items()}
        kind, made["moment"] = forces.PointForce, forces.Moment("b", "-v**3")
    else:
        made["torque"] = forces.SpatialTorque(("a", "b"), AXIS, "x**3 - v")
        kind, made["moment"] = forces.SpatialPointForce, forces.SpatialMoment("b", ["-wx", "t", 0], frame="body")
    return made | {"point": kind("a", p, law, frame="body"), "other": kind("b", q, law)}


@pytest.mark.slow
@pytest.mark.parametrize("components", [2, pytest.param(3, marks=pytest.mark.slow)], ids=["planar", "spatial"])
def test_power_is_that_of_the_loads_and_forces_of_a_kind_are_stacked(components):
    """Force times velocity, summed over forces, equals load times velocity of the bodies, with all rates."""
    bodies = moving_bodies(5, components)
    system, model = system_of(all_forces(components), components, {"k": K, "c": 0.3, "c2": C})
    assert ("spring", "on the ground") in model.forces
    assert len(model.forces) == len(all_forces(components)) - 1
    pose, time = pose_of(bodies, components).truncate(2), jn.Jet.variable(jnp.full((1, 1), INSTANT), 2)

    def both(pose):
        load = system.applied_forces(pose, time)
        spin = pose.angle.differentiate()[None] if components == 2 else pose.angular_velocity
        shifts = pose.position.differentiate()
        by_bodies = load[:components].dot(shifts) + load[components:].dot(spin)
        by_forces = [jnp.sum(group.power(pose, time).derivatives(), axis=1) for group in system.forces]
        return jnp.sum(by_bodies.derivatives(), axis=1), sum(by_forces)

    found, expected = quickly(both)(pose)
    np.testing.assert_allclose(found, expected, rtol=1e-11)
    assert np.abs(expected).min() > 1e-2


@pytest.mark.parametrize("components", [2, 3], ids=["planar", "spatial"])
def test_power_of_springs_is_what_their_energy_loses(components):
    p, q, u = (local(v, components)[0] for v in (P, Q, U))
    twist = forces.TorsionalSpring(("a", "b"), K, L)
    if components == 3:
        twist = forces.SpatialTorsionalSpring(("a", "b"), AXIS, K, L)
    made = {"line": forces.Spring(("a", "b"), p, q, K, L), "slide": forces.SlideSpring(("a", "b"), p, q, u, K, L)}
    system, _ = system_of(made | {"twist": twist, "force": forces.DistanceForce(("a", "b"), p, q, "x")}, components)
    bodies = moving_bodies(6, components)
    pose, time = pose_of(bodies, components), jn.Jet.variable(jnp.full((1, 1), INSTANT), ORDER)
    for group in system.forces[:3]:
        energy, power = group.energy(pose, time), group.power(pose, time)
        np.testing.assert_allclose(-energy.differentiate().derivatives(), power.derivatives(), rtol=1e-12, atol=1e-12)
        assert float(energy.coefficients[0][0, 0]) > 1e-3
    assert not np.asarray(system.forces[3].energy(pose, time).derivatives()).any()  # what a law has stored is unknown

    first, second = (local(v, components)[1] for v in (P, Q))
    d = minus(bodies[1].point(second, INSTANT), bodies[0].point(first, INSTANT))
    stored = K * (mp.sqrt(dot(d, d)) - L) ** 2 / 2
    np.testing.assert_allclose(system.forces[0].energy(pose, time).coefficients[0], [[float(stored)]], rtol=1e-14)


def test_loads_may_be_differentiated_again():
    """The moment of a thruster by the attitude of its body: nothing is hidden from differentiation."""
    system, _ = system_of({"F": forces.SpatialPointForce("b", P, ["x*y", 2.0, "vx"], frame="body")}, 3)
    pose = pose_of(moving_bodies(8, 3), 3).truncate(1)
    time = jn.Jet.variable(jnp.full((1, 1), INSTANT), 1)

    @quickly
    def load(angle):
        turn = jnp.zeros((3, 3, 1)).at[:, 2, 0].set(angle * jnp.array([0.3, -0.5, 0.8]))
        moved = pose.truncate(0).displaced(jnp.zeros((3, 3, 1)), turn)
        moved = moved.extended(pose.position.coefficients[1], pose.angular_velocity.coefficients[0])
        return system.applied_forces(moved, time).coefficients[0][:, 2, 0]

    slope = jax.jacfwd(load)(0.0)
    errors = [np.abs((load(h) - load(-h)) / (2 * h) - slope).max() for h in (1e-2, 5e-3)]
    assert np.abs(slope).max() > 1
    assert 3.8 < errors[0] / errors[1] < 4.2  # central differences converge to it with order 2


def test_instants_at_which_a_force_is_no_finite_number():
    made = {"log": forces.Torque(("a", "b"), "log(x)"), "spring": forces.Spring(("a", "b"), [0, 0], [0, 0], 1.0, 0.5)}
    system, model = system_of(made, 2)
    assert model.forces == (("log",), ("spring",))
    angle, apart = np.array([1.0, -1.0, 1.0]), np.array([1.0, 1.0, 0.0])
    position = jnp.zeros((2, 3, 3)).at[0, 2].set(apart)
    angles = jnp.zeros((3, 3)).at[2].set(angle)
    pose = jn.rigid.PlanarPose.from_jets(jn.Jet.constant(position, 1), jn.Jet.constant(angles, 1))
    found = system.finite_forces(pose, jn.Jet.variable(jnp.zeros((1, 3)), 1))
    np.testing.assert_array_equal(found, [[True, False, True], [True, True, False]])


def test_no_forces_do_nothing():
    system, model = system_of({}, 3)
    pose = pose_of(moving_bodies(1, 3), 3)
    found = applied(system, pose)
    assert model.forces == ()
    assert found.shape == (ORDER, 6, 3)
    assert not found.any()
    assert dataclasses.replace(system, forces=()).finite_forces(pose, jn.Jet([jnp.zeros((1, 2))])).shape == (0, 2)
