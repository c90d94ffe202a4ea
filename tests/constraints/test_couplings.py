"""Couplings of shafts, welds and the planar joint in mechanisms, against closed forms and equations in mpmath."""

import mpmath as mp
import numpy as np
import pytest

import jounce as jn
from jounce import drivers, forces, planar, spatial
from jounce.dynamics import DriverTorqueOutput, JointForceOutput, JointTorqueOutput

pytestmark = pytest.mark.slow

ORIGIN, X, Y, Z = [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]
TIME = np.linspace(0.0, 2.0, 9)
TILT = 0.6
PLACES = {"first": [0.0, 0.0, 0.0], "second": [0.02, 0.0, 0.0], "disc": [0.015, 0.008, 0.0]}
AXIS = np.array([0.0, np.sin(TILT), np.cos(TILT)])  # of the shaft that is driven by the other
LAW = "0.3 + 2*t + 0.4*sin(3*t)"


def law(order=4):
    """Derivatives of the law at the instants, shape (time, order + 1)."""
    found = [0.3 + 2 * TIME + 0.4 * np.sin(3 * TIME), 2 + 1.2 * np.cos(3 * TIME)]
    found += [0.4 * 3.0**k * np.sin(3 * TIME + k * np.pi / 2) for k in range(2, order + 1)]
    return np.stack(found, axis=1)


def shafts(coupling, drawn=(1.0, 0.0, 0.0, 0.0), **extra):
    """Two shafts whose axes meet in the origin, the second loaded, with an arbitrary body frame."""
    back = np.array([drawn[0], *(-np.array(drawn[1:]))])
    local = turned(back, AXIS).tolist()
    joints = {"one": spatial.Revolute(("ground", "first"), ORIGIN, ORIGIN, Z, Z), "coupling": coupling(local)}
    joints["two"] = spatial.Cylindrical(("ground", "second"), AXIS.tolist(), local, AXIS.tolist(), local)
    return jn.Mechanism(
        space="spatial",
        bodies={"first": jn.Body(ORIGIN, mass=1.0, inertia=[1.0] * 3), "second": jn.Body(ORIGIN, orientation=drawn)},
        joints=joints,
        drivers={"motor": drivers.RotationDriver(("ground", "first"), Z, LAW)},
        forces={"load": forces.SpatialTorque(("ground", "second"), AXIS.tolist(), "-5 - 2*v")},
        outputs={
            "turn": jn.outputs.RelativeAngleOutput(("ground", "second"), AXIS.tolist()),
            "motor": DriverTorqueOutput("motor"),
            "moment": JointTorqueOutput("coupling"),
        },
        **extra,
    )


def turned(q, vector):
    e = np.asarray(q[1:])
    return np.asarray(vector) + 2 * np.cross(e, np.cross(e, vector) + q[0] * np.asarray(vector))


@pytest.mark.parametrize("drawn", [(1.0, 0.0, 0.0, 0.0), (0.5, 0.5, -0.5, 0.5), (0.0, 0.6, 0.0, 0.8)], ids=str)
def test_shafts_of_a_constant_velocity_joint_turn_alike(drawn):
    made = shafts(lambda axis: spatial.ConstantVelocity(("first", "second"), ORIGIN, ORIGIN, Z, axis), drawn)
    found = jn.solve(made, TIME, order=4).outputs
    expected = law()
    turn = found["turn"] - found["turn"][:1, :1] * np.eye(5)[0] + expected[0, 0] * np.eye(5)[0]
    assert np.abs((turn - expected) / np.abs(expected).max(axis=0)).max() < 1e-12
    # what drives the second shaft is along the bisector of both, as the balls lie in the plane across it
    load = -5.0 * np.eye(3)[0] - 2.0 * expected[:, 1:4]
    bisector = np.array([0.0, np.sin(TILT / 2), np.cos(TILT / 2)])
    moment = -load[..., None] * bisector / np.cos(TILT / 2)
    assert np.abs(found["moment"][:, :3] - moment).max() < 1e-11 * np.abs(load).max()
    motor = expected[:, 2:] - load
    assert np.abs((found["motor"][:, :3] - motor) / np.abs(motor).max(axis=0)).max() < 1e-12


def tripod_in_mpmath(instant, tilt, radius):
    """Rotation, slide and remaining tilt of a shaft driven by a tripod joint, all from matrices."""

    def about(axis, angle):
        c, s = mp.cos(angle), mp.sin(angle)
        k = "xyz".index(axis)
        i, j = (k + 1) % 3, (k + 2) % 3
        m = mp.eye(3)
        m[i, i] = m[j, j] = c
        m[j, i], m[i, j] = s, -s
        return m

    def turn(t):
        return mp.mpf("0.3") + 2 * t + mp.mpf("0.4") * mp.sin(3 * t)

    def gaps(t, a, b, c):
        tulip = about("z", turn(t))
        spider = about("x", -tilt) * about("x", a) * about("y", b) * about("z", c)
        end = mp.matrix([0, mp.sin(tilt), mp.cos(tilt)])  # where the second shaft is held by a ball
        center = end - spider * mp.matrix([0, 0, 1])
        found = []
        for k in range(3):
            across = tulip * about("z", 2 * mp.pi * k / 3) * mp.matrix([0, 1, 0])
            roller = center + spider * about("z", 2 * mp.pi * k / 3) * mp.matrix([radius, 0, 0])
            found.append((across.T * roller)[0])
        return found

    def solved(t):
        return mp.findroot(lambda a, b, c: gaps(t, a, b, c), (mp.mpf(0), mp.mpf(0), turn(t)), tol=1e-50)

    def place(t, row):
        a, b, c = solved(t)
        spider = about("x", -tilt) * about("x", a) * about("y", b) * about("z", c)
        end = mp.matrix([0, mp.sin(tilt), mp.cos(tilt)])
        return (end - spider * mp.matrix([0, 0, 1]) + spider * mp.matrix([radius, 0, 0]))[row]

    with mp.workdps(60):
        step = mp.mpf(10) ** -9
        return np.array(
            [
                [float(mp.diff(lambda t, row=row: place(t, row), instant, k, h=step)) for row in range(3)]
                for k in range(5)
            ]
        )


def test_a_tripod_joint_is_that_of_three_rollers_in_mpmath():
    tilt, radius = 0.25, 0.3
    axis = [0.0, float(np.sin(tilt)), float(np.cos(tilt))]
    made = jn.Mechanism(
        space="spatial",
        bodies={"first": jn.Body(ORIGIN), "second": jn.Body(ORIGIN, orientation={"axis": X, "angle": -tilt})},
        joints={
            "one": spatial.Revolute(("ground", "first"), ORIGIN, ORIGIN, Z, Z),
            "far": spatial.Spherical(("ground", "second"), axis, Z),
            "tripod": spatial.Tripod(("first", "second"), ORIGIN, ORIGIN, Z, Z, X, X, radius),
        },
        drivers={"motor": drivers.RotationDriver(("ground", "first"), Z, LAW)},
        outputs={"roller": jn.outputs.PointOutput("second", [radius, 0, 0])},
    )
    found = jn.solve(made, TIME, order=4).outputs["roller"]
    for place in (0, 3):
        expected = tripod_in_mpmath(mp.mpf(float(TIME[place])), mp.mpf(tilt), mp.mpf(radius))
        assert np.abs((found[place] - expected) / np.abs(found).max(axis=(0, 2))[:, None]).max() < 1e-10


def test_the_disc_of_an_oldham_coupling_runs_round_twice_a_turn():
    apart = 0.02
    made = jn.Mechanism(
        space="spatial",
        bodies={name: jn.Body(place, mass=0.5, inertia=[0.1, 0.1, 0.1]) for name, place in PLACES.items()},
        joints={
            "one": spatial.Revolute(("ground", "first"), ORIGIN, ORIGIN, Z, Z),
            "two": spatial.Spherical(("ground", "second"), [apart, 0.0, 0.0], ORIGIN),
            "coupling": spatial.Oldham(("first", "second"), ORIGIN, ORIGIN, Z, Z, X, Y),
            "slot": spatial.Prismatic(("first", "disc"), ORIGIN, ORIGIN, X, X, Y, Y),
            "other": spatial.Dot2(("second", "disc"), ORIGIN, ORIGIN, X),
        },
        drivers={"motor": drivers.RotationDriver(("ground", "first"), Z, LAW)},
        outputs={
            "turn": jn.outputs.RelativeAngleOutput(("first", "second"), Z),
            "disc": jn.outputs.PointOutput("disc", ORIGIN),
        },
    )
    found = jn.solve(made, TIME, order=2).outputs
    assert np.abs(found["turn"][:, 0] - found["turn"][0, 0]).max() < 1e-13
    assert np.abs(found["turn"][:, 1:]).max() < 1e-11
    angle, rate = law()[:, 0], law()[:, 1]
    disc = apart / 2 * np.stack([1 + np.cos(2 * angle), np.sin(2 * angle), 0 * angle], axis=1)
    assert np.abs(found["disc"][:, 0] - disc).max() < 1e-14
    speed = apart * rate[:, None] * np.stack([-np.sin(2 * angle), np.cos(2 * angle), 0 * angle], axis=1)
    assert np.abs(found["disc"][:, 1] - speed).max() < 1e-13


def test_a_weld_carries_what_the_welded_body_weighs_and_takes_to_move():
    """Against the closed form of a body that turns about a fixed axis."""
    mass, inertia, arm, reach = 2.0, 0.3, 0.5, 0.4
    made = jn.Mechanism(
        space="planar",
        gravity=[0.0, -9.81],
        bodies={"arm": jn.Body([0.0, 0.0]), "load": jn.Body([arm, 0.0], angle=0.4, mass=mass, inertia=inertia,
                                                           center_of_mass=[reach, 0.0])},
        joints={
            "pivot": planar.Revolute(("ground", "arm"), [0, 0], [0, 0]),
            "weld": planar.Fixed(("arm", "load"), [arm, 0], [0, 0]),
        },
        drivers={"motor": drivers.CoordinateDriver(("ground", "arm"), "angle", LAW)},
        outputs={"force": JointForceOutput("weld"), "moment": JointTorqueOutput("weld"),
                 "end": jn.outputs.AngleOutput("load")},
    )  # fmt: skip
    found = jn.solve(made, TIME, order=4).outputs
    angle = law()
    assert np.abs(found["end"] - angle - 0.4 * np.eye(5)[0]).max() < 1e-11
    theta, w, a = angle[:, 0], angle[:, 1], angle[:, 2]

    def polar(r, phi):
        return r * np.stack([np.cos(phi), np.sin(phi)], axis=1)

    lever = polar(reach, theta + 0.4)
    center = polar(arm, theta) + lever
    acceleration = a[:, None] * np.stack([-center[:, 1], center[:, 0]], axis=1) - (w**2)[:, None] * center
    force = mass * (acceleration + np.array([0.0, 9.81]))
    assert np.abs(found["force"][:, 0] - force).max() < 1e-12 * np.abs(force).max()
    moment = inertia * a + lever[:, 0] * force[:, 1] - lever[:, 1] * force[:, 0]
    assert np.abs(found["moment"][:, 0] - moment).max() < 1e-12 * np.abs(moment).max()


def test_a_body_on_a_plane_of_a_moving_one_slides_and_turns():
    """A plane that tilts carries a puck held by a spring: a point on it moves by the closed form."""
    made = jn.Mechanism(
        space="spatial",
        bodies={"table": jn.Body(ORIGIN), "puck": jn.Body([0.2, 0.1, 0.1])},
        joints={
            "hinge": spatial.Revolute(("ground", "table"), ORIGIN, ORIGIN, X, X),
            "plane": spatial.PlaneOnPlane(("table", "puck"), [0, 0, 0.1], ORIGIN, Z, Z),
        },
        drivers={
            "tilt": drivers.RotationDriver(("ground", "table"), X, "0.3*sin(t)"),
            "spin": drivers.RotationDriver(("table", "puck"), Z, "2*t"),
            "along": drivers.SpatialSlideDriver(("table", "puck"), ORIGIN, ORIGIN, X, "0.2 + 0.1*t"),
            "across": drivers.SpatialSlideDriver(("table", "puck"), ORIGIN, ORIGIN, Y, "0.1*cos(t)"),
        },
        outputs={"rim": jn.outputs.PointOutput("puck", [0.05, 0.0, 0.0])},
    )
    found = jn.solve(made, TIME, order=3).outputs["rim"]

    def path(t):
        tilt, x, y = mp.mpf("0.3") * mp.sin(t), mp.mpf("0.2") + t / 10, mp.cos(t) / 10
        x, y, z = x + mp.cos(2 * t) / 20, y + mp.sin(2 * t) / 20, mp.mpf("0.1")
        return [x, y * mp.cos(tilt) - z * mp.sin(tilt), y * mp.sin(tilt) + z * mp.cos(tilt)]

    with mp.workdps(40):
        for place in (0, 5):
            for row in range(3):
                expected = mp.taylor(lambda t, row=row: path(t)[row], mp.mpf(float(TIME[place])), 3)
                plain = [float(c * mp.factorial(k)) for k, c in enumerate(expected)]
                assert np.abs(found[place, :, row] - plain).max() < 1e-12
