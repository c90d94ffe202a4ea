"""What user code computes is what counts, at every door: a number that it captures is never kept from an earlier use.

Each door is entered twice with the same objects, and in between a number changes that they read: an attribute, a list,
a global, a class attribute, a method. What is right is told by closed forms.
"""

import contextlib
import dataclasses
import sys
import types
from collections.abc import Callable, Iterator
from typing import Any

import equinox as eqx
import jax
import jax.monitoring
import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce import integrate, jet, trajectory
from jounce.constraints import MotionLaw
from jounce.execution import translated
from jounce.execution.backends import VARIABLE
from jounce.execution.store import programs
from tests.problems.own_types import taken_back

pytestmark = pytest.mark.long

GROUND = ("ground", "rod")
ROD = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 12, 1 / 12])
ARM = jn.Robot("arm", [jn.Link("base"), jn.Link("rod", ROD)], [jn.Joint("pin", "base", "rod", axis=[0, -1, 0])])
START = [[0.3], [0.0]]
gain = 1.0  # of functions that read a global


@pytest.fixture(autouse=True)
def _restored() -> Iterator[None]:
    """Leave the global as it was."""
    yield
    set_global(1.0)


def set_global(value: float) -> None:
    """Change the global that functions read."""
    sys.modules[__name__].gain = value  # pyright: ignore[reportAttributeAccessIssue]


def crank(motion: Any = "t", **parts: Any) -> jn.Mechanism:
    """Return a rod that a driver turns about a pin."""
    whole: dict[str, Any] = {
        "space": "planar",
        "bodies": {"rod": jn.Body([0, 0], mass=1.0, inertia=0.1)},
        "joints": {"pin": jn.planar.Revolute(GROUND, [0, 0], [0, 0])},
        "drivers": {"motor": jn.drivers.CoordinateDriver(GROUND, "angle", motion=motion)},
        "outputs": {"angle": jn.outputs.AngleOutput("rod")},
    }
    return jn.Mechanism(**whole | parts)


def spun(*forces: Any) -> jn.Mechanism:
    """Return a rod that turns freely about a pin, at first with 1 rad/s, under forces; its inertia is 0.1 kg m^2."""
    start = {"spin": jn.drivers.CoordinateDriver(GROUND, "angle", motion="t")}
    return crank(drivers={}, initial=start, forces={f"force_{k}": force for k, force in enumerate(forces)})


def angle_after_half(motion: Any) -> float:
    """Return the angle at half a second of a crank with a law."""
    return float(jn.solve(crank(motion), [0.0, 0.5], order=1).outputs["angle"][1, 0])


def rate_after_half(*forces: Any) -> float:
    """Return the rate of a free rod after half a second."""
    return float(jn.simulate(spun(*forces), [0.0, 0.5], order=1).outputs["angle"][1, 1])


# -- motion laws ------------------------------------------------------------------------------------------------------


class Wave:
    """A law that is an object, of which a method is one too."""

    def __init__(self) -> None:
        self.amplitude = 1.0

    def __call__(self, time: Any) -> Any:
        return self.amplitude * jnp.sin(time)

    def method(self, time: Any) -> Any:
        return self.amplitude * jnp.sin(time)


@dataclasses.dataclass(frozen=True)
class Settings:
    """Words of a law, one of which is not compared."""

    amplitude: Any = dataclasses.field(compare=False)


class WordedMotion(trajectory.AbstractMotion):
    settings: Settings = eqx.field(static=True)

    def __call__(self, time: jn.Jet) -> jn.Jet:
        return self.settings.amplitude[0] * jet.sin(time)


class ClassMotion(trajectory.AbstractMotion):
    amplitude = 1.0

    def __call__(self, time: jn.Jet) -> jn.Jet:
        return self.amplitude * jet.sin(time)


class PickingMotion(trajectory.AbstractMotion):
    """A law that looks at single coefficients, which is no composition of operations."""

    amplitude = 1.0

    def __call__(self, time: jn.Jet) -> jn.Jet:
        return jn.Jet(c if c is None else self.amplitude * c for c in jet.sin(time).coefficients)


def motion_doors() -> dict[str, tuple[Any, Callable[[float], Any]]]:
    """Return laws ``a sin t``, and what changes a."""
    wave, cell, words = Wave(), [1.0], Settings([1.0])

    def changed(kind: type) -> Callable[[float], None]:
        return lambda a: setattr(kind, "amplitude", a)

    def of_list(time: Any) -> Any:
        return cell[0] * jnp.sin(time)

    def of_branch(time: Any) -> Any:  # functions within are traced by JAX once for each object
        return jax.lax.cond(time > -1.0, wave.method, lambda t: t, time)

    @jax.jit
    def compiled(time: Any) -> Any:
        return cell[0] * jnp.sin(time)

    @eqx.filter_jit
    def compiled_by_equinox(time: Any) -> Any:
        return cell[0] * jnp.sin(time)

    universal = jnp.frompyfunc(of_list, 1, 1)  # JAX compiles it when it is called

    def table(time: Any) -> Any:  # an array that is captured
        return jnp.interp(time, np.array([0.0, 0.5, 2.0]), np.sin([0.0, 0.5, 2.0]) * cell[0])

    def set_wave(a: float) -> None:
        wave.amplitude = a

    def set_list(a: float) -> None:
        cell[0] = a

    return {
        "object": (wave, set_wave),
        "bound method": (wave.method, set_wave),
        "list": (of_list, set_list),
        "global": (lambda t: gain * jnp.sin(t), set_global),
        "law of a function": (jn.laws.FunctionMotion(of_list), set_list),
        "branch": (of_branch, set_wave),
        "compiled by its user": (compiled, set_list),
        "compiled by Equinox": (compiled_by_equinox, set_list),
        "universal function": (lambda t: universal(t), set_list),
        "table": (table, set_list),
        "part of a law": (jn.laws.PiecewiseMotion([jn.laws.FunctionMotion(of_list), "t"], until=[1.0]), set_list),
        "leader": (jn.laws.FollowingMotion(jn.laws.ExpressionMotion("t"), jn.laws.FunctionMotion(of_list)), set_list),
        "class": (ClassMotion(), changed(ClassMotion)),
        "class that picks": (PickingMotion(), changed(PickingMotion)),
        "not compared": (WordedMotion(words), lambda a: words.amplitude.__setitem__(0, a)),
    }


MOTIONS = list(motion_doors())


@pytest.mark.parametrize("door", MOTIONS)
def test_laws_of_drivers(door):
    law, change = motion_doors()[door]
    for amplitude in (1.0, 2.0):
        change(amplitude)
        assert angle_after_half(law) == pytest.approx(amplitude * np.sin(0.5), abs=1e-14)
    change(1.0)


@pytest.mark.slow  # `.ci/run` runs it each time
@pytest.mark.parametrize("door", ["object", "list", "global", "class", "class that picks", "not compared"])
def test_laws_of_cams_that_turn_in_space(door):
    """Angle of the follower, and torque of the shaft, which is the force on the follower times the slope."""
    law, change = motion_doors()[door]
    pins = {
        name: jn.spatial.Revolute(("ground", name), *([0, 0, 0],) * 2, *([0, 0, 1],) * 2) for name in ("shaft", "rod")
    }
    turning = {name: jn.drivers.RotationDriver(pin.bodies, [0, 0, 1], law) for name, pin in pins.items()}
    made = jn.Mechanism(
        space="spatial",
        bodies={name: jn.Body([0, 0, 0], mass=1.0, inertia=[0.1] * 3) for name in pins},
        joints={**pins, "cam": jn.joints.Cam(turning["rod"], pins["shaft"])},
        drivers={"motor": dataclasses.replace(turning["shaft"], motion="t")},
        outputs={
            "angle": jn.outputs.RelativeAngleOutput(("ground", "rod"), [0, 0, 1]),
            "torque": jn.outputs.DriverTorqueOutput("motor"),
        },
    )
    for amplitude in (1.0, 2.0):
        change(amplitude)
        found = jn.solve(made, [0.0, 0.5], order=2).outputs
        assert float(found["angle"][1, 0]) == pytest.approx(amplitude * np.sin(0.5), abs=1e-13)
        torque = -0.1 * amplitude**2 * np.sin(0.5) * np.cos(0.5)
        assert float(found["torque"][1, 0]) == pytest.approx(torque, abs=1e-13)
    change(1.0)


@pytest.mark.parametrize("door", ["list", "class", "class that picks"])
def test_laws_of_trajectories(door):
    law, change = motion_doors()[door]
    law = jn.laws.FunctionMotion(law) if callable(law) and not isinstance(law, trajectory.AbstractMotion) else law
    path = jn.JointTrajectory({"pin": law}, start=0.0, stop=1.0)
    for amplitude in (1.0, 2.0):
        change(amplitude)
        found = path.derivatives([0.5], order=2)[0, :, 0]
        assert found == pytest.approx(amplitude * np.array([np.sin(0.5), np.cos(0.5), -np.sin(0.5)]), abs=1e-14)
    change(1.0)


# -- forces -----------------------------------------------------------------------------------------------------------


class Drag(jn.forces.AbstractForce):
    body_count = 1
    c = 0.1

    def displacement(self, body, time):
        return body.angle

    def force(self, displacement, velocity, time):
        return -self.c * velocity


class Lever(jn.forces.AbstractForce):
    """A moment of a constant size, on a part of the angle."""

    body_count = 1
    part = 1.0

    def displacement(self, body, time):
        return self.part * body.angle

    def force(self, displacement, velocity, time):
        return 0.1 + 0.0 * displacement


class Helped(jn.forces.Torque):
    """A torque of this package, with a method of a user."""

    share = 1.0

    def force(self, displacement, velocity, time):
        return self.share * jn.forces.Torque.force(self, displacement, velocity, time)


def replaced(self, displacement, velocity, time):
    return -0.5 * velocity


def test_law_of_a_force():
    values = {"c": 0.1}
    torque = jn.forces.Torque(GROUND, lambda x, v, t: -values["c"] * v)
    for c in (0.1, 0.5):
        values["c"] = c
        assert rate_after_half(torque) == pytest.approx(np.exp(-5 * c), abs=1e-13)


@pytest.mark.slow  # `.ci/run` runs it each time
def test_law_of_time_of_a_force():
    wave = Wave()
    torque = jn.forces.Torque(GROUND, jn.laws.FunctionMotion(lambda t: wave.amplitude * jnp.cos(t)))
    for wave.amplitude in (1.0, 2.0):
        assert rate_after_half(torque) == pytest.approx(1 + 10 * wave.amplitude * np.sin(0.5), abs=1e-12)


@pytest.mark.slow
def test_two_laws_of_one_form_are_two(monkeypatch):
    values = [0.1, 0.2]
    torques = [jn.forces.Torque(GROUND, lambda x, v, t, k=k: -values[k] * v) for k in range(2)]
    for values[1] in (0.2, 0.4):
        assert rate_after_half(*torques) == pytest.approx(np.exp(-5 * sum(values)), abs=1e-13)


@pytest.mark.slow  # `.ci/run` runs it each time
def test_class_and_methods_of_a_force(monkeypatch):
    drag = Drag(("rod",))
    for c in (0.1, 0.5):
        monkeypatch.setattr(Drag, "c", c)
        assert rate_after_half(drag) == pytest.approx(np.exp(-5 * c), abs=1e-13)
    monkeypatch.setattr(Drag, "force", lambda self, x, v, t: -0.2 * v)
    assert rate_after_half(drag) == pytest.approx(np.exp(-1), abs=1e-13)
    for part in (1.0, 2.0):
        monkeypatch.setattr(Lever, "part", part)
        assert rate_after_half(Lever(("rod",))) == pytest.approx(1 + 0.5 * part, abs=1e-13)
    for share in (1.0, 3.0):
        monkeypatch.setattr(Helped, "share", share)
        assert rate_after_half(Helped(GROUND, 0.2)) == pytest.approx(1 + share, abs=1e-13)


@pytest.mark.slow  # `.ci/run` runs it each time
def test_a_method_of_this_package_that_is_replaced(monkeypatch):
    torque = jn.forces.Torque(GROUND, 0.2)
    assert rate_after_half(torque) == pytest.approx(2, abs=1e-13)
    monkeypatch.setattr(jn.forces.Torque, "force", replaced)
    assert rate_after_half(torque) == pytest.approx(np.exp(-2.5), abs=1e-13)


@pytest.mark.slow
def test_a_class_that_is_defined_again():
    def defined(c: float) -> type[jn.forces.AbstractForce]:
        class Brake(jn.forces.AbstractForce):
            body_count = 1

            def displacement(self, body, time):
                return body.angle

            def force(self, displacement, velocity, time):
                return -c * velocity

        return Brake

    for c in (0.1, 0.5):
        assert rate_after_half(defined(c)(("rod",))) == pytest.approx(np.exp(-5 * c), abs=1e-13)


class Scaling(jn.forces.AbstractForce):
    """A brake whose size is a parameter, times a number of the class."""

    body_count = 1
    size: jn.joints.Scalar
    part = 0.1

    def displacement(self, body, time):
        return body.angle

    def force(self, displacement, velocity, time):
        return -self.part * self.size * velocity


@pytest.mark.slow  # `.ci/run` runs it each time
def test_batches_and_gradients_of_forces(monkeypatch):
    braked = dataclasses.replace(spun(Scaling(("rod",), size="size")), parameters={"size": 1.0})

    def rate(size: Any) -> Any:
        return jn.simulate(braked.with_parameters(size=size), [0.0, 0.5], order=1).outputs["angle"][1, 1]

    for part in (0.1, 0.2):
        monkeypatch.setattr(Scaling, "part", part)
        many = jn.simulate_batch(braked, {"size": [1.0, 2.0]}, [0.0, 0.5], order=1)
        assert many.outputs["angle"][:, 1, 1] == pytest.approx(np.exp([-5 * part, -10 * part]), abs=1e-13)
        assert float(jax.grad(rate)(1.0)) == pytest.approx(-5 * part * np.exp(-5 * part), abs=1e-12)


# -- friction of joints -----------------------------------------------------------------------------------------------


class Worn(jn.joints.Friction):
    """Friction of which a share is left that the class knows."""

    share = 1.0

    def resisting(self, slip):
        return jn.joints.Friction.resisting(self, slip) * self.share


class Loose(jn.planar.Prismatic):
    """A guide that a part of its reaction presses, which the class knows."""

    part = 1.0

    def pressing(self, bodies, force):
        return force * self.part


class Slippery(jn.planar.Prismatic):
    """A guide whose surfaces slip faster than its bodies, by a factor that the class knows."""

    factor = 1.0

    def slip(self, bodies, moving):
        return jn.planar.Prismatic.slip(self, bodies, moving) * self.factor


class Toothed(jn.planar.Rolling):
    """A rack that passes on a share that the class knows."""

    share = 1.0

    def passed_on(self, multiplier):
        return jn.planar.Rolling.passed_on(self, multiplier) * self.share


def hoist(one: Any, two: Any, teeth: Any = jn.planar.Rolling, **parts: Any) -> jn.Mechanism:
    """Return a motor that lifts 30 N by a belt of efficiency one, 1:3, and a rack of efficiency two on 0.05 m."""
    loss = [jn.joints.GearFriction(speed=1e-4, efficiency=x) for x in (one, two)]
    whole: dict[str, Any] = {
        "space": "planar",
        "bodies": {"motor": jn.Body([0, 0.5]), "disc": jn.Body([0, 0]), "rack": jn.Body([0, 0.05], mass=1.0)},
        "joints": {
            "M": jn.planar.Revolute(("ground", "motor"), [0, 0.5], [0, 0]),
            "D": jn.planar.Revolute(("ground", "disc"), [0, 0], [0, 0]),
            "R": jn.planar.Prismatic(("ground", "rack"), [0, 0.05], [0, 0], [1, 0], [1, 0]),
            "belt": jn.planar.Belt(("motor", "disc"), [0, 0], [0, 0], 0.02, 0.06, friction=loss[0]),
            "teeth": teeth(("rack", "disc"), [0, 0], [0, 0], [1, 0], 0.05, friction=loss[1]),
        },
        "forces": {"pull": jn.forces.PointForce("rack", [0, 0], ["30", "0"])},
        "drivers": {"turn": jn.drivers.CoordinateDriver(("ground", "motor"), "angle", "t")},
        "outputs": {"torque": jn.outputs.DriverTorqueOutput("turn")},
    }
    return jn.Mechanism(**whole | parts)


def braked(friction: Any, joint: Any = jn.planar.Prismatic, **parts: Any) -> jn.Mechanism:
    """Return a sled of 2 kg, pressed with 20 N on its guide, that a driver pushes."""
    guide = joint(GROUND, [0, 0], [0, 0], [1, 0], [1, 0], friction=friction)
    whole: dict[str, Any] = {
        "space": "planar",
        "gravity": [0, -10.0],
        "bodies": {"rod": jn.Body([0, 0], mass=2.0, inertia=1.0)},
        "joints": {"guide": guide},
        "drivers": {"push": jn.drivers.CoordinateDriver(GROUND, "x", motion="t")},
        "outputs": {"force": jn.outputs.DriverForceOutput("push"), "place": jn.outputs.PointOutput("rod", [0, 0])},
    }
    return jn.Mechanism(**whole | parts)


def pushing(mechanism: jn.Mechanism) -> float:
    """Return the force of the driver, and assert that the power of friction is that."""
    motion = jn.solve(mechanism, [0.0, 0.5], order=3)
    force = float(motion.outputs["force"][1, 0])
    taken = jn.energy.power_balance(motion)["friction"].sel(derivative=0).values[1]
    assert float(taken) == pytest.approx(-force, abs=1e-12)
    return force


def rate_of_sled(mechanism: jn.Mechanism) -> float:
    """Return the velocity of the free sled after 0.1 s, from 2 m/s."""
    start = {"go": jn.drivers.CoordinateDriver(GROUND, "x", "2*t")}
    outputs = {"place": mechanism.outputs["place"]}
    free = dataclasses.replace(mechanism, drivers={}, initial=start, outputs=outputs)
    return float(jn.simulate(free, [0.0, 0.1], order=1).outputs["place"][1, 1, 0])


def test_friction_of_ones_own_is_refused_by_name():
    with pytest.raises(jn.errors.UnsupportedError, match="a law of friction of your own is not supported"):
        jn.solve(braked(Worn(0.3, 1e-3)), [0.0], order=1)
    with pytest.raises(jn.errors.UnsupportedError, match="cannot have friction, as its `pressing` is yours"):
        jn.solve(braked(jn.joints.Friction(0.3, 1e-3), Loose), [0.0], order=1)
    with pytest.raises(jn.errors.UnsupportedError, match="cannot have friction, as its `slip` is yours"):
        jn.solve(braked(jn.joints.Friction(0.3, 1e-3), Slippery), [0.0], order=1)
    with pytest.raises(jn.errors.UnsupportedError, match="cannot have friction, as its `passed_on` is yours"):
        jn.solve(hoist(0.9, 0.8, teeth=Toothed), [0.0], order=1)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [float, np.float32, jnp.asarray])
def test_efficiencies_of_any_kind_of_number_are_followed(kind):
    """Of a belt and a rack that lift 30 N: 0.5 N m at the motor without losses; changed after a first solution."""
    for one, two in ((0.5, 0.75), (0.75, 1.0)):
        motion = jn.solve(hoist(kind(one), kind(two)), [0.0, 0.5], order=1)
        assert float(motion.outputs["torque"][1, 0]) == pytest.approx(0.5 / (one * two), rel=1e-9)
    named = hoist("one", "two", parameters={"one": kind(0.5), "two": 0.75})
    for one in (0.5, 0.8125):
        found = jn.solve(named.with_parameters(one=kind(one)), [0.0, 0.5], order=1).outputs["torque"][1, 0]
        assert float(found) == pytest.approx(0.5 / (one * 0.75), rel=1e-9)
    lifted = jn.solve_batch(named, {"one": [0.5, 0.625]}, [0.0, 0.5], order=1)["torque"]
    np.testing.assert_allclose(lifted[:, 1, 0], 0.5 / (np.array([0.5, 0.625]) * 0.75), rtol=1e-9)

    def torque(one: Any) -> Any:
        return jn.solve(named.with_parameters(one=one), [0.0, 0.5], order=1).outputs["torque"][1, 0]

    assert float(jax.grad(torque)(0.5)) == pytest.approx(-0.5 / (0.25 * 0.75), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [float, jnp.asarray])
def test_coefficients_of_worms_are_followed(kind):
    lead = np.arctan(0.1)
    axes = {"screw": [1.0, 0, 0], "wheel": [0, 1.0, 0]}
    thread = jn.joints.GearFriction(speed=1e-3, coefficient="mu", lead_angle=float(lead))
    gearhead = jn.Mechanism(
        space="spatial",
        parameters={"mu": kind(0.05)},
        bodies={name: jn.Body([0, 0, 0], mass=0.1, inertia=[1e-3] * 3) for name in axes},
        joints={
            **{k: jn.spatial.Revolute(("ground", k), [0, 0, 0], [0, 0, 0], axis, axis) for k, axis in axes.items()},
            "mesh": jn.spatial.Gear(("screw", "wheel", "ground"), *axes.values(), "1/30", friction=thread),
        },
        forces={"load": jn.forces.SpatialTorque(("ground", "wheel"), axes["wheel"], "-60")},
        drivers={"turn": jn.drivers.RotationDriver(("ground", "screw"), axes["screw"], "3*t")},
        outputs={"torque": jn.outputs.DriverTorqueOutput("turn")},
    )
    for mu in (0.05, 0.25, 0.125):
        found = jn.solve(gearhead.with_parameters(mu=kind(mu)), [0.0, 0.5], order=1).outputs["torque"][1, 0]
        assert float(found) == pytest.approx(2.0 * np.tan(lead + np.arctan(mu)) / np.tan(lead), rel=1e-9)


@pytest.mark.slow  # `.ci/run` runs it each time
@pytest.mark.parametrize("kind", [float, np.float64, np.float32, np.array, jnp.asarray])
def test_coefficients_of_any_kind_of_number_are_followed(kind):
    for mu in (0.25, 0.5):
        assert pushing(braked(jn.joints.Friction(kind(mu), kind(1e-3)))) == pytest.approx(20 * mu, abs=1e-9)
    named = braked(jn.joints.Friction("2*mu", "slow"), parameters={"mu": kind(0.125), "slow": 1e-3})
    for mu in (0.125, 0.25):  # changed after a first solution
        assert pushing(named.with_parameters(mu=kind(mu))) == pytest.approx(40 * mu, abs=1e-12)
        assert rate_of_sled(named.with_parameters(mu=kind(mu))) == pytest.approx(2 - 2 * mu, abs=1e-9)

    def force(mu: Any) -> Any:
        return jn.solve(named.with_parameters(mu=mu), [0.0, 0.5], order=1).outputs["force"][1, 0]

    assert float(jax.grad(force)(0.25)) == pytest.approx(40, abs=1e-12)


# -- joints, drivers and outputs --------------------------------------------------------------------------------------


class Hook(jn.joints.AbstractConstraint):
    """A pin at a place of the rod that the class knows."""

    place = 0.5

    def residual(self, body_i, body_j, time):
        return body_j.point([self.place, 0.0]) - body_i.point([0.0, 0.0])


with taken_back():

    class Geared(jn.joints.AbstractConstraint, type="captured_ratio", space="planar", role="driver"):
        """A driver of a gear whose ratio the class knows."""

        motion: MotionLaw
        ratio = 1.0

        def residual(self, body_i, body_j, time):
            return body_j.angle - body_i.angle - self.ratio * self.motion(time)

        def admissible(self, time):
            return abs(self.ratio) * jnp.ones_like(time.coefficients[0]) < 5.0


class Scaled(jn.outputs.AbstractOutput):
    """The angle in a unit that the class knows."""

    unit = "rad"
    scale = 1.0

    def evaluate(self, body):
        return self.scale * body.angle


def test_class_and_residual_of_a_joint(monkeypatch):
    tip = {"tip": jn.outputs.PointOutput("rod", [1.0, 0.0])}
    held = crank(joints={"pin": Hook(GROUND)}, outputs=tip)
    for place in (0.5, 0.25):
        monkeypatch.setattr(Hook, "place", place)
        right = (1 - place) * np.array([np.cos(0.5), np.sin(0.5)])
        assert jn.solve(held, [0.0, 0.5], order=1).outputs["tip"][1, 0] == pytest.approx(right, abs=1e-14)

    def aside(self, body_i, body_j, time):
        return body_j.point([0.0, 0.0]) - body_i.point([2.0, 0.0])

    monkeypatch.setattr(Hook, "residual", aside)
    right = [2 + np.cos(0.5), np.sin(0.5)]
    assert jn.solve(held, [0.0, 0.5], order=1).outputs["tip"][1, 0] == pytest.approx(right, abs=1e-14)


@pytest.mark.slow
def test_class_of_a_driver(monkeypatch):
    driven = crank(drivers={"motor": Geared(GROUND, motion="sin(t)")})
    for ratio in (1.0, 2.0):
        monkeypatch.setattr(Geared, "ratio", ratio)
        found = jn.solve(driven, [0.0, 0.5], order=1).outputs["angle"][1, 0]
        assert found == pytest.approx(ratio * np.sin(0.5), abs=1e-14)
    monkeypatch.setattr(Geared, "ratio", 7.0)
    with pytest.raises(jn.errors.SolveError):
        jn.solve(driven, [0.0, 0.5], order=1)


@pytest.mark.slow  # `.ci/run` runs it each time
def test_class_of_an_output_and_its_events_and_gradients(monkeypatch):
    shown = crank(outputs={"scaled": Scaled("rod")}, parameters={"rate": 1.0}, motion="rate*t")

    def value(rate: Any) -> Any:
        return jn.solve(shown.with_parameters(rate=rate), [0.0, 0.5], order=1).outputs["scaled"][1, 0]

    for scale in (1.0, 3.0):
        monkeypatch.setattr(Scaled, "scale", scale)
        assert value(1.0) == pytest.approx(0.5 * scale, abs=1e-14)
        assert float(jax.grad(value)(1.0)) == pytest.approx(0.5 * scale, abs=1e-13)
        run = jn.simulate(spun(), [0.0, 1.0], order=1, events=[jn.Event(Scaled("rod"), 0.6)])
        assert run.events[0] == pytest.approx([0.6 / scale], abs=1e-12)


@pytest.mark.slow
def test_gradients_of_a_law_follow_its_function():
    cell = [1.0]
    moved = crank(
        drivers={"motor": jn.drivers.CoordinateDriver(GROUND, "angle", lambda t: cell[0] * t, offset="start")},
        parameters={"start": 0.0},
        outputs={"tip": jn.outputs.PointOutput("rod", [1.0, 0.0])},
    )

    def height(start: Any) -> Any:
        return jn.solve(moved.with_parameters(start=start), [0.0, 0.5], order=1).outputs["tip"][1, 0, 1]

    for cell[0] in (1.0, 2.0):
        assert float(jax.grad(height)(0.1)) == pytest.approx(np.cos(0.1 + 0.5 * cell[0]), abs=1e-13)


class Halves(jn.Taylor):
    """Steps of a length that the class knows."""

    part = 1.0

    def prepared(self, expansion, length, tolerance, singular, usual):
        start, step, allowed = jn.Taylor.prepared(self, expansion, length, tolerance, singular, usual)
        return start, self.part * step, allowed


@pytest.mark.slow  # `.ci/run` runs it each time
def test_own_integrators(monkeypatch):
    torque, method, steps = jn.forces.Torque(GROUND, lambda x, v, t: -0.5 * x), Halves(), []
    for part in (1.0, 0.25):
        monkeypatch.setattr(Halves, "part", part)
        run = jn.simulate(spun(torque), [0.0, 10.0], order=1, method=method)
        steps.append(len(run.dense_output.start))
    assert steps[1] >= 3 * steps[0]


# -- robots -----------------------------------------------------------------------------------------------------------


class Controller:
    """Gains of a joint, and methods that use them."""

    stiffness, damping = 10.0, 2.0

    def torque(self, time, q, rate):
        return -self.stiffness * q - self.damping * rate

    def single(self, time, q, rate):
        return -self.stiffness * q[0] - self.damping * rate[0]

    def force(self, time):
        return jnp.array([0.0, 0.0, self.stiffness]) * jnp.cos(time)

    def of_state(self, time, q, rate):
        return jnp.array([0.0, 0.0, -self.stiffness]) * q[0]

    def crossing(self, time, q, rate):
        return q[0] - self.stiffness

    def of_motor(self, time, q, rate, motor, motor_rate):
        return -self.stiffness * (motor - 0.1) - self.damping * motor_rate


def fresh(stiffness: float) -> Controller:
    """Return another controller, of another class."""
    kind = types.new_class("Other", (Controller,))
    kind.stiffness = stiffness
    return kind()


def last_angle(order: int = 1, **given: Any) -> float:
    return float(jn.simulate(ARM, [0.0, 1.0], order=order, state=START, **given).q[-1, 0, 0])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["torque", "single", "driven"])
def test_controllers(name):
    controller = Controller()

    def run(c: Controller) -> float:
        if name == "driven":
            law = jn.laws.FunctionMotion(lambda t: c.stiffness * t**2)
            return last_angle(driven={"pin": law})
        return last_angle(torque=c.torque if name == "torque" else {"pin": c.single})

    found = []
    for controller.stiffness in (10.0, 100.0):
        found.append(run(controller))
        assert found[-1] == pytest.approx(run(fresh(controller.stiffness)), abs=1e-14)
    assert abs(found[1] - found[0]) > 0.1


@pytest.mark.slow  # `.ci/run` runs it each time
def test_wrenches():
    controller = Controller()
    pushes = [
        jn.robot.Wrench("rod", force=controller.force, point=[1.0, 0, 0]),
        jn.robot.Wrench("rod", force=controller.of_state),
    ]
    for controller.stiffness in (2.0, 5.0):
        torque = jn.inverse_dynamics(ARM, [[0.0], [0.0], [0.0]], wrenches=pushes[:1], time=0.0)
        assert torque[0, 0] == pytest.approx(9.81 / 2 - controller.stiffness, abs=1e-13)
        found = jn.forward_dynamics(ARM, [[0.0], [0.0]], [[0.0]], wrenches=pushes[:1], time=0.0)
        assert np.ravel(found)[-1] == pytest.approx((controller.stiffness - 9.81 / 2) * 3, rel=1e-13)
        other = fresh(controller.stiffness)
        both = [
            jn.robot.Wrench("rod", force=other.force, point=[1.0, 0, 0]),
            jn.robot.Wrench("rod", force=other.of_state),
        ]
        assert last_angle(wrenches=pushes) == pytest.approx(last_angle(wrenches=both), abs=1e-14)


@pytest.mark.slow
def test_a_run_keeps_the_wrenches_that_it_had():
    controller = Controller()
    runs = [jn.simulate(ARM, [0.0, 0.5], order=3, state=START, wrenches=[jn.robot.Wrench("rod", force=f)])
            for f in (controller.force, controller.of_state)]  # fmt: skip
    controller.stiffness = 1000.0
    assert all(np.abs(run.torque[:, 0]).max() < 1e-10 for run in runs)


def test_events_of_joints():
    controller = Controller()
    event = integrate.JointEvent(controller.crossing)
    for controller.stiffness in (0.2, -0.2):
        run = jn.simulate(ARM, [0.0, 0.5], order=1, state=START, events=[event])
        crossed = run.at([run.events[0][0]]).q[0, 0, 0]
        assert crossed == pytest.approx(controller.stiffness, abs=1e-11)


@pytest.mark.slow
def test_feedback_of_motors():
    drives = {"pin": jn.planning.Drive(stiffness=1000.0, rotor_inertia=0.01, gear_ratio=10)}
    controller, found = Controller(), []
    for controller.stiffness in (10.0, 100.0):
        for c in (controller, fresh(controller.stiffness)):
            run = jn.planning.simulate_elastic(ARM, drives, [0.0, 0.2], torque=c.of_motor, state=START)
            found.append(float(run.q[-1, 0, 0]))
    assert found[0] == pytest.approx(found[1], abs=1e-14)
    assert found[2] == pytest.approx(found[3], abs=1e-14)
    assert abs(found[0] - found[2]) > 1e-4


# -- with and without machine code and a folder -----------------------------------------------------------------------


class Kept:
    """A store of programs."""

    def __init__(self) -> None:
        self.entries: dict[str, bytes] = {}

    def get(self, key: str) -> bytes | None:
        return self.entries.get(key)

    def put(self, key: str, value: bytes) -> None:
        self.entries[key] = value

    def drop(self, key: str) -> None:
        self.entries.pop(key, None)


MODES = [
    (True, True),
    pytest.param(False, False, marks=pytest.mark.slow),
    pytest.param(True, False, marks=pytest.mark.slow),
    pytest.param(False, True, marks=pytest.mark.slow),
]


@pytest.mark.parametrize("machine_code, folder", MODES)
def test_machine_code_and_kept_programs(monkeypatch, machine_code, folder):
    if not machine_code:
        monkeypatch.setenv(VARIABLE, "0")
    wave, controller, c = Wave(), Controller(), [0.1]
    torque = jn.forces.Torque(GROUND, lambda x, v, t: -c[0] * v)
    store = Kept() if folder else None
    programs.use_store(store)
    try:
        for again in range(2):
            for wave.amplitude, c[0] in ((1.0, 0.1), (2.0, 0.5)):
                assert angle_after_half(wave) == pytest.approx(wave.amplitude * np.sin(0.5), abs=1e-14)
                monkeypatch.setattr(Drag, "c", c[0])
                right = np.exp(-10 * c[0])
                assert rate_after_half(torque, Drag(("rod",))) == pytest.approx(right, abs=1e-13)
                controller.stiffness = 100 * c[0]
                moved = last_angle(3, torque=controller.torque)  # of an order that no program before was for
                assert moved == pytest.approx(last_angle(3, torque=fresh(controller.stiffness).torque), abs=1e-14)
            if not again:
                jax.clear_caches()  # what is found again comes from the store
    finally:
        programs.use_store(None)
    assert store is None or store.entries


# -- nothing is compiled for a number ---------------------------------------------------------------------------------


@contextlib.contextmanager
def compilations(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """Count what is compiled, by XLA or to machine code."""
    found: list[str] = []
    made = translated.object_file

    def counted(*arguments: Any, **keywords: Any) -> Any:
        found.append("machine code")
        return made(*arguments, **keywords)

    def listener(event: str, duration_secs: float, **_: Any) -> None:
        del duration_secs
        if "backend_compile" in event:
            found.append(event)

    monkeypatch.setattr(translated, "object_file", counted)
    jax.monitoring.register_event_duration_secs_listener(listener)
    try:
        yield found
    finally:
        jax.monitoring.unregister_event_duration_listener(listener)


@pytest.mark.slow  # `.ci/run` runs it each time
def test_two_hundred_gains_compile_once(monkeypatch):
    c = [0.1]

    def run() -> float:
        monkeypatch.setattr(Drag, "c", c[0])
        torque = jn.forces.Torque(GROUND, lambda x, v, t: -c[0] * v)
        return rate_after_half(torque, Drag(("rod",)))

    run()
    with compilations(monkeypatch) as found:
        for c[0] in np.linspace(0.1, 0.3, 200).tolist():
            assert run() == pytest.approx(np.exp(-10 * c[0]), abs=1e-13)
    assert not found


@pytest.mark.slow  # `.ci/run` runs it each time
def test_two_hundred_controllers_compile_once(monkeypatch):
    controller = Controller()

    def run(stop: float = 0.1) -> float:
        parts: dict[str, Any] = {
            "torque": lambda t, q, rate: controller.torque(t, q, rate),
            "wrenches": [jn.robot.Wrench("rod", force=controller.of_state)],
            "events": [integrate.JointEvent(lambda t, q, rate: q[0] - 0.01 * controller.stiffness)],
        }
        return float(jn.simulate(ARM, [0.0, stop], order=1, state=START, **parts).q[-1, 0, 0])

    run(1.0)
    with compilations(monkeypatch) as found:
        angles = [run() for controller.stiffness in np.linspace(5.0, 20.0, 200).tolist()]
    assert not found
    assert len(set(angles)) == 200


@pytest.mark.parametrize("kind", [ClassMotion, Wave])
def test_laws_with_other_numbers_compile_once(monkeypatch, kind):
    law = kind()
    angle_after_half(law)
    with compilations(monkeypatch) as found:
        for amplitude in (1.5, 2.5, 3.5):
            monkeypatch.setattr(law if kind is Wave else kind, "amplitude", amplitude)
            assert angle_after_half(law) == pytest.approx(amplitude * np.sin(0.5), abs=1e-14)
    assert not found


@pytest.mark.slow
def test_another_operation_is_another_program():
    power = [2]
    for power[0], right in ((2, 0.25), (3, 0.125)):
        assert angle_after_half(lambda t: t ** power[0]) == pytest.approx(right, abs=1e-14)
    rising = [True]
    for rising[0], right in ((True, 0.5), (False, -0.25)):
        assert angle_after_half(lambda t: t if rising[0] else -(t**2)) == pytest.approx(right, abs=1e-14)
