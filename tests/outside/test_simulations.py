"""Free motions that people asked about in public, with values that do not come from this library.

Each test names its source, and says what is right and how that is known.
"""

import sys

import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce import jet
from tests.problems.own_types import taken_back

pytestmark = pytest.mark.slow  # `.ci/run` runs them all, as users do


def block(law, x0=0.0, v0=0.0, guess=0.0):
    """Return a block of 1 kg on a slide along x, under a force along x, with its position as output."""
    start = jn.drivers.SlideDriver(("ground", "block"), [0, 0], [0, 0], [1, 0], motion=f"{x0!r} + {v0!r}*t")
    return jn.Mechanism(
        space="planar",
        bodies={"block": jn.Body([guess, 0], mass=1.0, inertia=1.0)},
        joints={"slide": jn.planar.Prismatic(("ground", "block"), [0, 0], [0, 0], [1, 0], [1, 0])},
        forces={"f": jn.forces.SlideForce(("ground", "block"), [0, 0], [0, 0], [1, 0], law=law)},
        initial={"start": start},
        outputs={"x": jn.outputs.PointOutput("block", [0, 0])},
    )


with taken_back():

    class Wire(jn.joints.AbstractConstraint, type="outside_wire", space="planar"):
        """A wire with a bump at x = 1 m."""

        height: jn.joints.Scalar
        width: jn.joints.Scalar

        def residual(self, body_i, body_j, time):
            """Vanish where the bead is on the wire."""
            x, y = body_j.position[0], body_j.position[1]
            u = (x - 1.0) / self.width
            return y - self.height * jet.exp(-(u * u))


def bead(height, width, speed):
    """Return a bead on the wire that starts at x = 0."""
    return jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        bodies={"bead": jn.Body([0, 0], mass=1.0, inertia=1e-3)},
        joints={
            "wire": Wire(("ground", "bead"), height=height, width=width),
            "upright": jn.planar.Coordinate(("ground", "bead"), "angle", ratio=0.0),
        },
        initial={"go": jn.drivers.CoordinateDriver(("ground", "bead"), "x", motion=f"{speed}*t")},
        outputs={"p": jn.outputs.PointOutput("bead", [0, 0])},
    )


@pytest.mark.parametrize("height, passes", [(0.19, True), (0.22, False)])
def test_a_bead_passes_a_bump_only_with_energy_for_it(height, passes):
    """Bead on a wire of any shape (physicsanimations.org, "Bead on a Wire", checks kinetic plus potential energy).

    At 2 m/s it rises v^2 / 2 g = 0.2039 m: it passes a bump of 0.19 m, and turns back at one of 0.22 m.
    """
    x, speed = jn.simulate(bead(height, 0.06, 2.0), [0.0, 1.3], order=1).outputs["p"][-1, :, 0]
    assert speed == pytest.approx(2.0 if passes else -2.0, abs=1e-9)  # on the flat again
    assert (x > 1.0) == passes


def test_a_short_pulse_is_not_stepped_over():
    """Chebfun issue 1512: v' = -v, v(0) = 1, with 20 added for 1 < t < 1.05; the solver did not see it.

    Afterwards v = e^-t + 20 (e^(1.05 - t) - e^(1 - t)).
    """
    pulse = "-v + 5*(1 + (t - 1)/abs(t - 1))*(1 - (t - 1.05)/abs(t - 1.05))"
    speed = jn.simulate(block(pulse, v0=1.0), [0.0, 2.0], order=1).outputs["x"][-1, 1, 0]
    assert speed == pytest.approx(np.exp(-2) + 20 * (np.exp(-0.95) - np.exp(-1.0)), rel=1e-11)


def test_a_late_pulse_of_a_function_is_not_stepped_over():
    """QuTiP issue 2814: after a long delay the solver's steps are so long that it skips a pulse.

    A Gaussian push of 1 N s at t = 50 s, 10 ms wide, on a free block: it moves at 1 m/s afterwards.
    """
    width = 0.01

    def push(t):
        return jnp.exp(-0.5 * ((t - 50.0) / width) ** 2) / (width * jnp.sqrt(2 * jnp.pi))

    made = block(lambda x, v, t: jn.jet.compose(push, t) - 0.0 * x - 0.0 * v)
    x, speed = jn.simulate(made, [0.0, 52.0], order=1).outputs["x"][-1, :, 0]
    assert speed == pytest.approx(1.0, rel=1e-10)
    assert x == pytest.approx(2.0, rel=1e-10)


def test_all_three_roots_of_a_cubic_are_events():
    """SciPy issue 9228: x' = 3 t^2 + 12 t - 4, x(-8) = -120 crosses zero at -6, -2 and 2; one event was found.

    The polynomial is (t + 6)(t + 2)(t - 2).
    """
    t0 = -8.0
    v0 = 3 * t0**2 + 12 * t0 - 4
    made = block("6*t + 12", x0=-120.0 - t0 * v0, v0=v0, guess=-120.0)
    crossing = jn.Event(jn.outputs.PointOutput("block", [0, 0]))
    simulation = jn.simulate(made, [t0, 4.0], order=1, events=[crossing])
    np.testing.assert_allclose(simulation.events[0], [-6.0, -2.0, 2.0], atol=1e-11)


def test_friction_of_constant_size_takes_the_same_from_every_swing():
    """Marchewka, Abbott, Beichner, American Journal of Physics 72 (2004) 477: Coulomb friction on a spring.

    Turning points lie 2 f / k nearer with every half swing of pi sqrt(m / k); so do they on euphonics.org, section
    8.2.3. Here f = 0.05 N, k = 4 N/m: 25 mm a half swing, which takes pi/2 s.
    """
    made = block("-4*x - 0.05*v/abs(v)", x0=1.05, v0=-1e-3)
    turning = jn.Event(jn.outputs.PointOutput("block", [0, 0]), derivative=1)
    simulation = jn.simulate(made, [0.0, 5.0], order=1, events=[turning])
    first = 0.0125 - np.hypot(1.05 - 0.0125, 1e-3 / 2)  # an ellipse about f / k
    found = simulation.at(simulation.events[0]).outputs["x"][:, 0, 0]
    np.testing.assert_allclose(found, [first, -first - 0.025, first + 0.05], atol=1e-11)
    np.testing.assert_allclose(np.diff(simulation.events[0]), np.pi / 2, atol=1e-11)


def test_a_spring_that_is_stiffer_on_one_side():
    """SciPy issue 18039: solve_ivp is inaccurate for systems that are smooth in pieces.

    x'' = -x for x > 0 and -4 x for x < 0: half periods of pi and pi/2, amplitudes 1 and 1/2; after ten periods the
    start comes back.
    """
    made = block("-2.5*x + 1.5*abs(x)", x0=1.0)
    period = 1.5 * np.pi
    x, speed = jn.simulate(made, [0.0, 10 * period], order=1).outputs["x"][-1, :, 0]
    assert x == pytest.approx(1.0, abs=1e-11)
    assert speed == pytest.approx(0.0, abs=1e-10)


def test_a_relay_keeps_its_period_for_ten_periods():
    """A relay on a double integrator (DifferentialEquations.jl issue 167: steps are too long for right sides with if).

    x'' = -sign(x) from 1 m at rest: arcs of parabolas, period 4 sqrt(2) s, back at 1 m after each.
    """
    made = block("-x/abs(x)", x0=1.0)
    x, speed = jn.simulate(made, [0.0, 40 * np.sqrt(2.0)], order=1).outputs["x"][-1, :, 0]
    assert x == pytest.approx(1.0, abs=1e-11)
    assert speed == pytest.approx(0.0, abs=1e-11)


class Tuned:
    """A controller as people write it for a loop over gains."""

    stiffness = 1.0

    def __call__(self, t, q, rate):
        """Return the torque of the joint."""
        return -self.stiffness * q - 2.0 * rate


def test_a_loop_over_gains_of_one_controller_object():
    """A notebook that tunes a gain (the question behind JAX's "jit captures globals at trace time").

    q'' + 2 q' + K q = 0, q(0) = 0.3 at rest: q = 0.3 e^-t (cos wt + sin wt / w), w = sqrt(K - 1), inertia 1 kg m^2.
    """
    rod = jn.Inertia(1.0, center_of_mass=[0, 0, 0], tensor=[1.0, 1.0, 1.0])
    arm = jn.Robot("arm", [jn.Link("base"), jn.Link("rod", rod)], [jn.Joint("pin", "base", "rod", axis=[0, 0, 1])])
    controller = Tuned()
    for gain in (5.0, 50.0):
        controller.stiffness = gain
        w = np.sqrt(gain - 1.0)
        found = jn.simulate(arm, [0.0, 1.0], torque=controller, state=[[0.3], [0.0]]).q[-1, 0, 0]
        assert found == pytest.approx(0.3 * np.exp(-1) * (np.cos(w) + np.sin(w) / w), abs=1e-13)


DRAG = 0.5  # N s/m


def drag(x, v, t):
    """Return a force that a global constant decides."""
    return -DRAG * v


def test_a_global_constant_changed_in_the_next_cell(monkeypatch):
    """A notebook whose second cell sets a constant of a module (marimo 8802 is one of many on stale globals).

    v' = -c v, v(0) = 1: v(1) = e^-c.
    """
    for value in (0.5, 2.0):
        monkeypatch.setattr(sys.modules[__name__], "DRAG", value)
        speed = jn.simulate(block(drag, v0=1.0), [0.0, 1.0], order=1).outputs["x"][-1, 1, 0]
        assert speed == pytest.approx(np.exp(-value), abs=1e-13)


def test_a_table_changed_in_place():
    """A cam table held in a NumPy array that is edited between runs; the law interpolates it by `jnp.interp`."""
    heights = np.array([0.0, 1.0, 0.0])

    def motion(t):
        return jnp.interp(t, jnp.arange(3.0), jnp.asarray(heights))

    for top in (1.0, 3.0):
        heights[1] = top
        made = jn.Mechanism(
            space="planar",
            bodies={"block": jn.Body([0, 0])},
            joints={"slide": jn.planar.Prismatic(("ground", "block"), [0, 0], [0, 0], [1, 0], [1, 0])},
            drivers={"cam": jn.drivers.SlideDriver(("ground", "block"), [0, 0], [0, 0], [1, 0], motion=motion)},
            outputs={"x": jn.outputs.PointOutput("block", [0, 0])},
        )
        x = jn.solve(made, [0.0, 0.25, 0.5], order=1).outputs["x"]
        np.testing.assert_allclose(x[1:, :, 0], [[0.25 * top, top], [0.5 * top, top]], atol=1e-14)
