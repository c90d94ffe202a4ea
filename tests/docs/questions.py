"""Mechanisms of the public questions in docs/questions.md, and what jounce answers, by row of the table."""

import warnings

import numpy as np

import jounce as jn
from jounce import drivers, forces, planar, spatial
from jounce.constraints import Rope
from jounce.mechanism import build
from jounce.reporting.facts.mechanism.freedom_facts import StartingState
from jounce.reporting.facts.mechanism.line_facts import line_facts

O2, O3, X, Y, Z = [0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]
RPM = np.pi / 30
ANSWERS = {}


def answers(number):
    """Return what keeps a function as the one that answers a question."""

    def keep(function):
        ANSWERS[number] = function
        return function

    return keep


def pin(one, other, at=O2, on=O2):
    return planar.Revolute((one, other), at, on)


def turn(body, law, other="ground"):
    return drivers.CoordinateDriver((other, body), "angle", law)


def plane(bodies, joints, laws, outputs, **more):
    made = {name: jn.Body(*given) if isinstance(given, tuple) else given for name, given in bodies.items()}
    return jn.Mechanism(space="planar", bodies=made, joints=joints, drivers=laws, outputs=outputs, **more)


def train(sun, planet, ring, speed):
    """Return the speed of the arm of a planetary train whose ring is fixed."""
    arm = float(sun + planet)
    joints = {
        "S": pin("ground", "sun"),
        "A": pin("ground", "arm"),
        "P": pin("arm", "planet", [arm, 0.0]),
        "inner": planar.Gear(("sun", "planet"), None, None, O2, O2, float(sun), float(planet)),
        "outer": planar.Gear(("planet", "ground"), None, None, O2, O2, float(planet), -float(ring)),
    }
    bodies = {"sun": (O2,), "arm": (O2,), "planet": ([arm, 0.0],)}
    made = plane(bodies, joints, {"motor": turn("sun", f"{speed}*t")}, {"arm": jn.outputs.AngleOutput("arm")})
    return float(jn.solve(made, [0.0, 0.3], order=1).outputs["arm"][1, 1])


@answers(1)
def epicyclic():
    return [train(20, 40, 100, 60 * RPM) / RPM]


@answers(2)
def carrier_ratio():
    return [train(24, 30, 84, 1.0)]


@answers(3)
def platform():
    """Gears of 1 to 3, then a pinion of 13 teeth on a rack, 4 mm a tooth."""
    radius = 13 * 0.004 / (2 * np.pi)
    joints = {
        "M": pin("ground", "motor", [-1.0, 0.0]),
        "P": pin("ground", "pinion"),
        "pair": planar.Coordinate(("motor", "pinion"), "angle", -1 / 3),
        "guide": planar.Prismatic(("ground", "rack"), [0.0, radius], O2, X[:2], X[:2]),
        "mesh": planar.Rolling(("rack", "pinion"), O2, O2, X[:2], radius),
    }
    bodies = {"motor": ([-1.0, 0.0],), "pinion": (O2,), "rack": ([0.0, radius],)}
    rack = {"rack": jn.outputs.PointOutput("rack", O2)}
    made = plane(bodies, joints, {"motor": turn("motor", f"{240 * RPM}*t")}, rack)
    found = jn.solve(made, [0.0, 60.0], order=0).outputs["rack"]
    return [abs(float(found[1, 0, 0] - found[0, 0, 0])) * 1000]


def cardan(angle, speed, inertia=0.0):
    """Return a shaft that turns another by a universal joint: the extreme speeds of the second, and the motion."""
    axis = [np.cos(angle), np.sin(angle), 0.0]
    bodies = {
        "first": jn.Body(O3, mass=1.0, inertia=[1.0, 1.0, 1.0]),
        "second": jn.Body(
            O3,
            orientation=[np.cos(angle / 2), 0, 0, np.sin(angle / 2)],
            mass=1.0,
            inertia=[inertia or 1e-9] * 3,
        ),
    }
    joints = {
        "A": spatial.Revolute(("ground", "first"), O3, O3, X, X),
        "B": spatial.Dot1(("ground", "second"), Z, X),
        "C": spatial.Dot1(("ground", "second"), [-axis[1], axis[0], 0.0], X),
        "cross": spatial.Universal(("first", "second"), O3, O3, Y, Z),
    }
    made = jn.Mechanism(
        space="spatial",
        bodies=bodies,
        joints=joints,
        drivers={"motor": drivers.RotationDriver(("ground", "first"), X, f"{speed}*t")},
        outputs={
            "second": jn.outputs.RelativeAngleOutput(("ground", "second"), axis),
            "torque": jn.outputs.DriverTorqueOutput("motor"),
        },
    )
    turns = np.linspace(0.0, np.pi, 721) / speed
    return jn.solve(made, turns, order=2)


def extreme_speeds(angle, speed):
    found = cardan(angle, speed).outputs["second"][:, 1]
    return [float(found.max()), float(found.min())]


@answers(4)
def cardan_of_25_degrees():
    return extreme_speeds(np.radians(25), 100.0)


@answers(5)
def cardan_within_100_rpm():
    """The angle by bisection of what jounce finds."""
    low, high = 0.2, 0.4
    while high - low > 1e-9:
        middle = 0.5 * (low + high)
        most, least = extreme_speeds(middle, 1200.0)
        low, high = (middle, high) if most - least < 100.0 else (low, middle)
    return [float(np.degrees(low)), *extreme_speeds(low, 1200.0)]


@answers(6)
def intermediate_shaft():
    return [extreme_speeds(np.radians(20), 500.0)[1]]


@answers(7)
def torque_of_an_intermediate_shaft():
    found = cardan(np.radians(30), 2400 * RPM, 3.0).outputs["torque"][:, 0]
    return [float(found.max() - found.min())]


@answers(8)
def whitworth():
    """A crank of 150 mm drives a slotted arm about a pin 100 mm away: times between the dead points of the ram."""
    bodies = {"crank": (O2, 1.0), "block": ([0.08, 0.12], 1.0), "arm": ([0.1, 0.0], 1.4)}
    joints = {
        "A": pin("ground", "crank"),
        "P": pin("crank", "block", [0.15, 0.0]),
        "D": pin("ground", "arm", [0.1, 0.0]),
        "slot": planar.Prismatic(("arm", "block"), O2, O2, X[:2], X[:2]),
    }
    made = plane(bodies, joints, {"motor": turn("crank", "2*pi*t")}, {"arm": jn.outputs.AngleOutput("arm")})
    time = np.linspace(0.0, 1.0, 2001)
    angle = jn.solve(made, time, order=0).outputs["arm"][:, 0]
    # the line of stroke goes through D, across the fixed centers: the ram is at its ends where the arm lies along it
    dead = [np.interp(x, angle, time) for x in (np.pi / 2, 3 * np.pi / 2)] if angle[-1] > angle[0] else []
    part = dead[1] - dead[0]
    return [max(part, 1 - part) / min(part, 1 - part)]


def slider_crank(r, length, law, order, time):
    bodies = {"crank": (O2, 0.3), "rod": ([r, 0.0], -0.1), "piston": ([r + length, 0.0],)}
    joints = {
        "A": pin("ground", "crank"),
        "B": pin("crank", "rod", [r, 0.0]),
        "C": pin("rod", "piston", [length, 0.0]),
        "guide": planar.Prismatic(("ground", "piston"), O2, O2, X[:2], X[:2]),
    }
    outputs = {
        "piston": jn.outputs.PointOutput("piston", O2),
        "middle": jn.outputs.PointOutput("rod", [length / 2, 0.0]),
        "rod": jn.outputs.AngleOutput("rod"),
    }
    made = plane(bodies, joints, {"motor": turn("crank", law)}, outputs)
    return jn.solve(made, time, order=order).outputs


@answers(9)
def fastest_piston():
    speed = 5000 * RPM
    found = slider_crank(0.25, 1.0, f"{speed}*t", 2, np.linspace(0.0, np.pi / speed, 721))["piston"]
    here = int(np.argmax(np.abs(found[:, 1, 0])))
    angle = 180 * here / 720
    return [abs(float(found[here, 1, 0])), angle]


@answers(10)
def middle_of_the_rod():
    found = slider_crank(0.15, 0.6, f"-{300 * RPM}*t + 45*pi/180", 2, [0.0])
    return [float(np.linalg.norm(found["middle"][0, 1])), abs(float(found["rod"][0, 2]))]


@answers(11)
def piston_without_acceleration():
    angles = np.linspace(1.0, 1.3, 3001)
    found = slider_crank(0.1, 0.2, "t", 2, angles)["piston"][:, 2, 0]
    here = int(np.argmax(found > 0))
    return [float(np.degrees(np.interp(0.0, found[here - 1 : here + 1], angles[here - 1 : here + 1])))]


@answers(12)
def slider_crank_of_homework():
    found = slider_crank(5.0, 10.0, "pi/6 + 50*t", 2, [0.0])
    return [float(found["rod"][0, 1]), float(found["piston"][0, 1, 0]), float(found["piston"][0, 2, 0])]


def four_bar(base, crank, coupler, rocker, law, time, order, guess):
    end = [crank * np.cos(guess[0]), crank * np.sin(guess[0])]
    bodies = {"crank": (O2, guess[0]), "coupler": (end, guess[1]), "rocker": ([base, 0.0], guess[2])}
    joints = {
        "A": pin("ground", "crank"),
        "B": pin("crank", "coupler", [crank, 0.0]),
        "C": pin("coupler", "rocker", [coupler, 0.0], [rocker, 0.0]),
        "D": pin("ground", "rocker", [base, 0.0]),
    }
    outputs = {name: jn.outputs.AngleOutput(name) for name in ("coupler", "rocker")}
    made = plane(bodies, joints, {"motor": turn("crank", law)}, outputs)
    return jn.solve(made, time, order=order, strict=False)


@answers(13)
def four_bar_of_homework():
    found = four_bar(8.0, 2.0, 5.0, 4.0, "pi/3 + 45*t", [0.0], 2, (1.05, 0.3, 2.2)).outputs
    return [float(found["rocker"][0, 1]), float(found["rocker"][0, 2])]


@answers(14)
def grashof():
    """Whether the shortest bar turns fully with the longest one fixed; of the second how far it goes."""
    full = four_bar(9.0, 2.0, 4.5, 7.0, "t", np.linspace(0, 2 * np.pi, 91), 0, (0.0, 1.0, 1.9))
    stops = four_bar(9.0, 2.0, 3.5, 7.0, "1 + t", np.linspace(0, 2, 2001), 0, (1.0, 0.6, 2.4))
    last = int(np.argmax(stops.status != 0)) - 1
    return [float((full.status == 0).all()), float(np.degrees(1 + stops.time[last]))]


@answers(15)
def cam_of_harmonic_segments():
    made = [("harmonic", 1 / 3, 0.05), ("dwell", 1 / 12, None), ("harmonic", 1 / 6, 0.0), ("dwell", 5 / 12, None)]
    law = jn.laws.SegmentedMotion(
        [jn.laws.Segment(kind, 2 * np.pi * part, to=to) for kind, part, to in made], beyond="repeat"
    )
    bodies = {"shaft": (O2,), "valve": (O2,)}
    joints = {
        "A": pin("ground", "shaft"),
        "guide": planar.Prismatic(("ground", "valve"), O2, O2, [0.0, 1.0], [0.0, 1.0]),
    }
    motor = turn("shaft", f"{100 * RPM}*t")
    joints["cam"] = jn.joints.Cam(drivers.CoordinateDriver(("ground", "valve"), "y", law), motor)
    made = plane(bodies, joints, {"motor": motor}, {"valve": jn.outputs.PointOutput("valve", O2)})
    found = jn.solve(made, np.linspace(0.0, 0.6, 3601)[:-1], order=2).outputs["valve"][:, :, 1]
    up, down = found[1:1200], found[1501:2100]
    return [float(np.abs(part[:, k]).max()) for k in (1, 2) for part in (up, down)]


@answers(16)
def cam_with_a_weak_spring():
    """Rise of 10 mm in 90 degrees, 7.5 kg, 100 N/m with 10 N: the least contact force, and the preload needed."""
    made = [("polynomial_3_4_5", 90, 0.01), ("dwell", 45, None), ("polynomial_3_4_5", 180, 0.0), ("dwell", 45, None)]
    law = jn.laws.SegmentedMotion(
        [jn.laws.Segment(kind, np.radians(part), to=to) for kind, part, to in made], beyond="repeat"
    )
    bodies = {
        "shaft": jn.Body(O2, mass=1.0, inertia=1.0),
        "follower": jn.Body(O2, mass=7.5, inertia=1.0),
    }
    joints = {
        "A": pin("ground", "shaft"),
        "guide": planar.Prismatic(("ground", "follower"), O2, O2, [0.0, 1.0], [0.0, 1.0]),
    }
    motor = turn("shaft", "10*t")
    joints["cam"] = jn.joints.Cam(drivers.CoordinateDriver(("ground", "follower"), "y", law), motor)
    made = plane(
        bodies,
        joints,
        {"motor": motor},
        {"contact": jn.dynamics.CamForceOutput("cam")},
        forces={"spring": forces.SlideSpring(("ground", "follower"), O2, O2, [0.0, 1.0], 100.0, -0.1, 2.74)},
    )
    time = np.linspace(0.0, 0.2 * np.pi, 2001)
    found = jn.solve(made, time, order=2).outputs["contact"][:, 0]
    spring = jn.dynamics.contact_spring(made, "cam", "spring", time)
    return [float(found.min()), -100.0 * spring.free]


@answers(17)
def eccentric():
    """A flat follower on a disc whose center is 10 mm off its axis: a pin in a slot across the travel."""
    bodies = {"cam": (O2,), "follower": (O2,)}
    joints = {
        "A": pin("ground", "cam"),
        "guide": planar.Prismatic(("ground", "follower"), O2, O2, [0.0, 1.0], [0.0, 1.0]),
        "face": planar.Parallel2(("follower", "cam"), O2, [0.01, 0.0], X[:2]),
    }
    made = plane(bodies, joints, {"motor": turn("cam", "2*pi*t")}, {"y": jn.outputs.PointOutput("follower", O2)})
    found = jn.solve(made, [0.0, 0.125], order=1).outputs["y"]
    return [float(found[1, 0, 1]) * 1000, float(found[0, 1, 1]) * 1000]


def hung(masses, rope, length, start, directions):
    """Return accelerations of blocks on a rope, released from rest, and its tension."""
    bodies = {name: jn.Body(at, mass=mass, inertia=1.0) for name, (at, mass) in masses.items()}
    joints = {
        name: planar.Prismatic(("ground", name), bodies[name].position, O2, directions[name], directions[name])
        for name in bodies
    }
    joints["rope"] = Rope(*rope, length)
    outputs = {name: jn.outputs.PointOutput(name, O2) for name in bodies}
    outputs["tension"] = jn.outputs.JointForceOutput("rope")
    made = jn.Mechanism(
        space="planar", gravity=[0, -9.81], bodies=bodies, joints=joints, initial=start, outputs=outputs
    )
    return jn.simulate(made, [0.0, 0.01], order=2).outputs


@answers(18)
def two_blocks_two_pulleys():
    """1 kg hangs on a rope over a pulley, round one on a block of 2 kg on a table, and back to a wall."""
    down, along = [0.0, -1.0], [1.0, 0.0]
    found = hung(
        {"hanging": ([0.0, -1.0], 1.0), "sliding": ([-2.0, 0.0], 2.0)},
        (("hanging", "ground", "sliding", "ground"), [O2, O2, O2, [0.0, 0.0]]),
        5.0,
        {"rest": drivers.CoordinateDriver(("ground", "hanging"), "y", "-1")},
        {"hanging": down, "sliding": along},
    )
    return [abs(float(found["hanging"][0, 2, 1])), abs(float(found["sliding"][0, 2, 0]))]


@answers(19)
def atwood():
    down = [0.0, -1.0]
    results = []
    for light, heavy in ((4.0, 5.0), (1.0, 2.0)):
        found = hung(
            {"light": ([-0.1, -1.0], light), "heavy": ([0.1, -1.0], heavy)},
            (("light", "ground", "ground", "heavy"), [O2, [-0.1, 0.0], [0.1, 0.0], O2]),
            2.2,
            {"rest": drivers.CoordinateDriver(("ground", "light"), "y", "-1")},
            {"light": down, "heavy": down},
        )
        results += [float(found["light"][0, 2, 1]), float(found["tension"][0, 0])]
    return results


def belt(radii, distance, *, crossed=False):
    """Return what `jounce inspect` tells of a belt, and the speed of the second pulley over that of the first."""
    joints = {
        "A": pin("ground", "first"),
        "B": pin("ground", "second", [distance, 0.0]),
        "belt": planar.Belt(("first", "second"), O2, O2, *radii, crossed),
    }
    bodies = {"first": (O2,), "second": ([distance, 0.0],)}
    made = plane(bodies, joints, {"motor": turn("first", "t")}, {"second": jn.outputs.AngleOutput("second")})
    (facts,) = line_facts(StartingState(made, build(made), 0.0))
    return facts, float(jn.solve(made, [0.0], order=1).outputs["second"][0, 1])


@answers(20)
def belt_of_12_meters():
    return [belt([0.8, 0.25], 12.0, crossed=crossed)[0]["length"] for crossed in (False, True)]


@answers(21)
def belt_of_1_meter():
    facts, ratio = belt([0.1, 0.15], 1.0)
    return [facts["length"], float(np.degrees(facts["wraps"][0])), 400 * ratio]


@answers(22)
def housing_of_a_gear():
    """10 N m on the output of a reducer, 1 to 4: of the motor, and of what holds the housing."""
    bodies = dict.fromkeys(("housing", "input", "output"), (O2,))
    joints = {
        "feet": pin("ground", "housing"),
        "a": pin("housing", "input"),
        "b": pin("housing", "output"),
        "gear": planar.Gear(("input", "output", "housing"), ratio=0.25),
    }
    laws = {"motor": turn("input", "3*t", "housing"), "brake": turn("housing", "0*t")}
    outputs = {
        "motor": jn.outputs.DriverTorqueOutput("motor"),
        "housing": jn.outputs.JointTorqueOutput("gear", "housing"),
        "brake": jn.outputs.DriverTorqueOutput("brake"),
    }
    made = plane(bodies, joints, laws, outputs, forces={"load": forces.Torque(("ground", "output"), "10")})
    found = jn.solve(made, [0.0], order=1).outputs
    return [float(found[name][0, 0]) for name in outputs]


@answers(23)
def crank_rocker_over_two_turns():
    motion = four_bar(1.0, 0.5, 1.2, 0.8, "t", np.linspace(0, 4 * np.pi, 1441), 0, (0.0, 0.8, 1.5))
    angle = np.degrees(motion.outputs["rocker"][:, 0])
    return [float(angle.min()), float(angle.max()), float(abs(angle[720] - angle[0]))]


@answers(24)
def past_the_dead_point():
    motion = four_bar(1.0, 0.9, 0.4, 0.6, "0.9 + t", np.linspace(0, 0.4, 4001), 0, (0.9, -0.6, 1.9))
    return [float(np.degrees(0.9 + motion.time[int(np.argmax(motion.status != 0)) - 1]))]


@answers(25)
def place_of_the_second_pin():
    """A parallelogram of bars 3, 1, 3, 1 with its crank at 0.31 rad."""
    found = four_bar(3.0, 1.0, 3.0, 1.0, "0.31 + t", [0.0], 0, (0.31, 0.0, 0.31)).outputs["rocker"][0, 0]
    return [3.0 + float(np.cos(found)), float(np.sin(found))]


@answers(26)
def box_in_two_hands():
    """2 kg, held by pins 400 mm apart that are one too many: the least forces."""
    body = {"box": jn.Body(O2, mass=2.0, inertia=0.01)}
    joints = {
        "left": pin("ground", "box", [-0.2, 0.0], [-0.2, 0.0]),
        "right": pin("ground", "box", [0.2, 0.0], [0.2, 0.0]),
    }
    outputs = {name: jn.outputs.JointForceOutput(name, "box") for name in joints}
    made = plane(body, joints, {}, outputs, gravity=[0, -9.81], redundant_reactions="least_norm")
    found = jn.solve(made, [0.0], order=0).outputs
    return [float(found[name][0, 0, 1]) for name in joints]


@answers(27)
def geared_motor():
    """2 N m on a rotor that turns 25 times for a turn of the joint: what holds the joint."""
    joints = {
        "A": pin("ground", "rotor"),
        "B": pin("ground", "joint"),
        "gear": planar.Coordinate(("rotor", "joint"), "angle", 1 / 25),
    }
    made = plane(
        {"rotor": (O2,), "joint": (O2,)},
        joints,
        {"hold": turn("joint", "0*t")},
        {"hold": jn.outputs.DriverTorqueOutput("hold")},
        forces={"motor": forces.Torque(("ground", "rotor"), "2")},
    )
    return [-float(jn.solve(made, [0.0], order=0).outputs["hold"][0, 0])]


@answers(28)
def locked_cylinder():
    """A boom of 3 m with 200 kg at its tip, level, on a cylinder from 0.5 m below its hinge to 1 m along it."""
    joints = {"hinge": pin("ground", "boom")}
    body = {"boom": jn.Body(O2, mass=200.0, inertia=1e-9, center_of_mass=[3.0, 0.0])}
    hold = drivers.DistanceDriver(("ground", "boom"), [0.0, -0.5], [1.0, 0.0], "sqrt(1.25)")
    outputs = {"force": jn.outputs.DriverForceOutput("hold"), "hinge": jn.outputs.JointForceOutput("hinge", "boom")}
    found = jn.solve(plane(body, joints, {"hold": hold}, outputs, gravity=[0, -9.81]), [0.0], order=0).outputs
    return [float(found["force"][0, 0]), *found["hinge"][0, 0].tolist()]


@answers(29)
def harmonic_return():
    law = jn.laws.SegmentedMotion(
        [jn.laws.Segment("harmonic", np.pi / 2, to=-0.03), jn.laws.Segment("dwell", 1.5 * np.pi)]
    )
    found = jn.laws.FollowingMotion(law, f"{800 * RPM}*t")
    time = np.linspace(0.0, np.pi / 2 / (800 * RPM), 1001)[1:-1]
    rates = found(jn.Jet.variable(time, 2)).derivatives()
    return [float(np.abs(np.asarray(rates[k])).max()) for k in (1, 2)]


@answers(30)
def legs_between_balls():
    """A level platform of 60 kg on six legs of two bodies that may spin, between balls: the pull of each actuator."""
    base, top, height = 0.5, 0.3, 0.8
    bodies = {"platform": jn.Body([0.0, 0.0, height], mass=60.0, inertia=[2.0, 2.0, 4.0])}
    joints, laws, outputs = {}, {}, {}
    for k in range(6):
        low = np.radians(120 * (k // 2) + (-12 if k % 2 else 12))
        high = np.radians(120 * (k // 2) + (-48 if k % 2 else 48))
        foot, head = [base * np.cos(low), base * np.sin(low), 0.0], [top * np.cos(high), top * np.sin(high), 0.0]
        leg = np.subtract([*head[:2], height], foot)
        length, along = float(np.linalg.norm(leg)), leg / np.linalg.norm(leg)
        half = np.array([1.0 + along[2], -along[1], along[0], 0.0])
        attitude = (half / np.linalg.norm(half)).tolist()
        bodies |= {f"barrel{k}": jn.Body(foot, orientation=attitude), f"rod{k}": jn.Body(foot, orientation=attitude)}
        joints |= {
            f"foot{k}": spatial.Spherical(("ground", f"barrel{k}"), foot, O3),
            f"ram{k}": spatial.Prismatic((f"barrel{k}", f"rod{k}"), O3, O3, Z, Z, X, X),
            f"head{k}": spatial.Spherical((f"rod{k}", "platform"), [0.0, 0.0, length], head),
        }
        laws[f"leg{k}"] = drivers.SpatialSlideDriver((f"barrel{k}", f"rod{k}"), O3, O3, Z, "0*t")
        outputs[f"leg{k}"] = jn.outputs.DriverForceOutput(f"leg{k}")
    made = jn.Mechanism(
        space="spatial", gravity=[0, 0, -9.81], bodies=bodies, joints=joints, drivers=laws, outputs=outputs
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", jn.errors.IdleMotionWarning)
        found = jn.solve(made, [0.0], order=0).outputs
    return [float(found[f"leg{k}"][0, 0]) for k in (0, 5)]
