"""Derivatives of forces and energies by the design: closed forms, and powers of energies in fifty digits."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from mpmath import mp

import jounce as jn
from tests.oracles.mp_files import read, value
from tests.oracles.mpmath_kinematics import solve_file
from tests.problems.mechanisms import example

TIME = np.array([0.1, 0.7])


def arm(m, c, stiffness):
    return jn.Mechanism(
        space="planar",
        gravity=[0, -10.0],
        bodies={"arm": jn.Body([0, 0], mass=m, inertia=0.2, center_of_mass=[c, 0])},
        joints={"O": jn.planar.Revolute(("ground", "arm"), [0, 0], [0, 0])},
        drivers={"turn": jn.drivers.CoordinateDriver(("ground", "arm"), "angle", motion="t**3")},
        forces={"spring": jn.forces.TorsionalSpring(("ground", "arm"), stiffness=stiffness, angle=0.0)},
        outputs={"torque": jn.outputs.DriverTorqueOutput("turn"), "energy": jn.outputs.KineticEnergyOutput()},
    )


def closed_form(values, t):
    m, c, stiffness = values
    return (0.2 + m * c**2) * 6 * t + m * c * 10.0 * jnp.cos(t**3) + stiffness * t**3


@pytest.mark.slow
def test_torque_of_an_arm_with_rates():
    def torque(values):
        return jn.solve(arm(*values), TIME, order=2).outputs["torque"]

    def truth(values):
        law = lambda t: closed_form(values, t)  # noqa: E731 - differentiated thrice
        rates = [law, jax.grad(law), jax.grad(jax.grad(law))]
        return jnp.stack([jnp.stack([rate(t) for rate in rates]) for t in TIME])

    values = jnp.array([2.0, 0.3, 4.0])
    np.testing.assert_allclose(jax.jacrev(torque)(values), jax.jacfwd(truth)(values), rtol=1e-11, atol=1e-11)


@pytest.mark.slow
def test_energies_springs_and_bearings_of_an_arm():
    def found(values):
        motion = jn.solve(arm(*values), TIME, order=3)
        pin = jn.joint_reaction(motion, "O", frame="body")
        return {
            "kinetic": motion.outputs["energy"][:, 0],
            "total": jn.energy.kinetic_energy(motion).total.sel(derivative=0).data,
            "potential": jn.dynamics.potential_energy(motion).sel(derivative=0).data,
            "spring": jn.dynamics.applied_force(motion, "spring").sel(derivative=0).data,
            "along": pin.force.sel(derivative=0, component="x").data,
        }

    m, c, stiffness = 2.0, 0.3, 4.0
    angle, speed = TIME**3, 3 * TIME**2
    zero = 0 * TIME
    slopes = jax.jit(jax.jacfwd(found))(jnp.array([m, c, stiffness]))
    expected = {
        "kinetic": [0.5 * c**2 * speed**2, m * c * speed**2, zero],
        "potential": [10 * c * np.sin(angle), 10 * m * np.sin(angle), zero],
        "spring": [zero, zero, -angle],
        "along": [-c * speed**2 + 10 * np.sin(angle), -m * speed**2, zero],
    }
    for name, columns in (expected | {"total": expected["kinetic"]}).items():
        np.testing.assert_allclose(slopes[name], np.stack(columns, axis=-1), rtol=1e-11, atol=1e-12)


def point_masses(name, masses):
    """Return a mechanism of an example whose bodies are masses in points, (body, mass, place), and nothing else."""
    known = jn.load(example(name))
    bodies = dict(known.bodies)
    for body, mass, place in masses:
        kept = bodies[body]
        bodies[body] = jn.Body(kept.position, kept.angle, kept.orientation, mass=mass, center_of_mass=place)
    return jn.Mechanism(
        space=known.space,
        bodies=bodies,
        joints=known.joints,
        drivers=known.drivers,
        outputs={"torque": jn.outputs.DriverTorqueOutput("theta")},
        parameters=known.parameters,
    )


def torque_from_energy(name, parameter, points, order, step):
    """Return the torque of the driver of point masses, with rates, as ``E' / theta'`` in fifty digits."""
    description = read(example(name))
    given, time = description["parameters"], description["time"]
    description["time"] = time | {"stop": 40 * time["step"]}  # the judge follows the motion step by step
    with mp.workdps(50):
        nominal = mp.nstr(value(given[parameter], {}), 40)
        changed = {**description, "parameters": {**given, parameter: f"{nominal} + ({step})"}}
        times, found = solve_file(changed, order + 3, 50, 2)
        torques = []
        for k in range(len(times)):
            series = lambda d: [x / mp.factorial(j) for j, x in enumerate(d)]  # noqa: E731
            energy = [mp.mpf(0)] * (order + 2)
            for output, mass in points:
                for component in found[output][k]:
                    c = series(component[1:])
                    for n in range(order + 2):
                        energy[n] += mp.mpf(mass) / 2 * sum(c[j] * c[n - j] for j in range(n + 1))
            power = [(n + 1) * energy[n + 1] for n in range(order + 1)]
            law = mp.taylor(lambda t: mp.pi / 3 * mp.sin(mp.pi * t), mp.mpf(times[k]), order + 1)  # of both files
            speed = [(n + 1) * law[n + 1] for n in range(order + 1)]
            torque = []
            for n in range(order + 1):
                rest = sum(torque[j] * speed[n - j] for j in range(n))
                torque.append((power[n] - rest) / speed[0])
            torques.append([x * mp.factorial(n) for n, x in enumerate(torque)])
        return times, torques


@pytest.mark.slow
@pytest.mark.parametrize(
    "name, parameter, masses, points, order",
    [
        ("four_bar", "BC", [("rocker", 2.0, ["CD", 0])], [("C", 2.0)], 4),
        ("rsur", "BC", [("follower", 2.0, [0, 0, "CD"])], [("C", 2.0)], 2),
    ],
)
def test_torque_rates_in_fifty_digits(name, parameter, masses, points, order):
    times, after = torque_from_energy(name, parameter, points, order, "1e-13")
    _, before = torque_from_energy(name, parameter, points, order, "-1e-13")
    with mp.workdps(50):
        slope = [
            [float((a - b) / mp.mpf("2e-13")) for a, b in zip(*pair, strict=True)]
            for pair in zip(after, before, strict=True)
        ]
    mechanism = point_masses(name, masses)

    def torque(length):
        return jn.solve(mechanism.with_parameters(**{parameter: length}), times, order=order).outputs["torque"]

    found = np.asarray(jax.jit(jax.jacfwd(torque))(mechanism.parameter_values[parameter]))
    size = np.abs(slope).max(axis=0)
    assert (np.abs(found - slope) / size).max() < 1e-10
