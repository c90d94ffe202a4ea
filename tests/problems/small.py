"""Small mechanisms written in Python, of which the motion is known in closed form."""

import jounce as jn
from jounce import drivers, planar, spatial


def law(start=0.0, rate=0.0, wave=0.0, rise=0.0):
    """A motion law of which the values are data, so that all laws of this form are compiled once.

    ``start + rate t + wave sin(pi t)``, and a rise by `rise` at t = 0.5 within a few hundredths of a second.
    """
    values = {"start": start, "rate": rate, "wave": wave, "rise": rise}
    return jn.laws.ExpressionMotion("start + rate*t + wave*sin(pi*t) + rise/2*(1 + tanh((t - 0.5)/0.01))", values)


def crank(motion, outputs=None, **keywords):
    """A planar crank at the origin, turned by a motion law."""
    return jn.Mechanism(
        space="planar",
        bodies={"crank": jn.Body([0, 0])},
        joints={"O": planar.Revolute(("ground", "crank"), [0, 0], [0, 0])},
        drivers={"turn": drivers.CoordinateDriver(("ground", "crank"), "angle", motion)},
        outputs={"angle": jn.outputs.AngleOutput("crank"), "tip": jn.outputs.PointOutput("crank", [1, 0])}
        if outputs is None
        else outputs,
        **keywords,
    )


def four_bar(crank_angle="30*deg", rocker_angle="100*deg", motion="30*deg+60*deg*sin(2*pi*t/tau)", **lengths):
    """A planar four-bar with a massless coupler; lengths AD, AB, BC, CD are parameters."""
    parameters = {"AD": 0.1321, "AB": 0.04, "BC": 0.1423, "CD": 0.2031, "tau": 2.0} | lengths
    return jn.Mechanism(
        space="planar",
        parameters=parameters,
        bodies={"crank": jn.Body([0, 0], crank_angle), "rocker": jn.Body(["AD", 0], rocker_angle)},
        joints={
            "A": planar.Revolute(("ground", "crank"), [0, 0], [0, 0]),
            "D": planar.Revolute(("ground", "rocker"), ["AD", 0], [0, 0]),
            "BC": planar.DoubleRevolute(("crank", "rocker"), ["AB", 0], ["CD", 0], "BC"),
        },
        drivers={"theta": drivers.CoordinateDriver(("ground", "crank"), "angle", motion)},
        outputs={"psi": jn.outputs.AngleOutput("rocker"), "C": jn.outputs.PointOutput("rocker", ["CD", 0])},
    )


def slider_crank(slider_motion=None):
    """A planar slider-crank, crank 1 and rod 3, driven at the crank by its angle t, or at the slider."""
    if slider_motion is None:
        driver = drivers.CoordinateDriver(("ground", "crank"), "angle", "t")
    else:
        driver = drivers.SlideDriver(("ground", "slider"), [0, 0], [0, 0], [1, 0], slider_motion)
    return jn.Mechanism(
        space="planar",
        bodies={"crank": jn.Body([0, 0], 1.0), "rod": jn.Body([0.5, 0.8], -0.3), "slider": jn.Body([3.4, 0])},
        joints={
            "O": planar.Revolute(("ground", "crank"), [0, 0], [0, 0]),
            "A": planar.Revolute(("crank", "rod"), [1, 0], [0, 0]),
            "B": planar.Revolute(("rod", "slider"), [3, 0], [0, 0]),
            "guide": planar.Prismatic(("ground", "slider"), [0, 0], [0, 0], [1, 0], [1, 0]),
        },
        drivers={"drive": driver},
        outputs={"x": jn.outputs.PointOutput("slider", [0, 0]), "angle": jn.outputs.AngleOutput("crank")},
    )


def distance_slider(motion):
    """A block on a line, driven by its distance from the origin."""
    return jn.Mechanism(
        space="planar",
        bodies={"block": jn.Body([0.5, 0])},
        joints={"guide": planar.Prismatic(("ground", "block"), [0, 0], [0, 0], [1, 0], [1, 0])},
        drivers={"reach": drivers.DistanceDriver(("ground", "block"), [0, 0], [0, 0], motion)},
        outputs={"x": jn.outputs.PointOutput("block", [0, 0])},
    )


def spindle(motion, axis=(0.0, 0.0, 1.0), vectors=None):
    """A body on a hinge in space, turned by a motion law, with its angle measured in both ways."""
    axis = list(axis)
    return jn.Mechanism(
        space="spatial",
        bodies={"spindle": jn.Body([0, 0, 0])},
        joints={"O": spatial.Revolute(("ground", "spindle"), [0, 0, 0], [0, 0, 0], axis, axis)},
        drivers={"turn": drivers.RotationDriver(("ground", "spindle"), axis, motion, *(vectors or ()))},
        outputs={
            "angle": jn.outputs.RelativeAngleOutput(("ground", "spindle"), axis),
            "between": jn.outputs.RelativeAngleOutput(("ground", "spindle"), axis, [1.0, 0.2, 0.3], [1.0, 0.2, 0.3]),
            "spin": jn.outputs.AngularVelocityOutput("spindle"),
            "body_spin": jn.outputs.AngularVelocityOutput("spindle", "body"),
        },
    )


def screw(lead, motion, driven="rotation"):
    """A nut on a screw along z, driven by its rotation or by its slide."""
    z, origin, bodies = [0, 0, 1], [0, 0, 0], ("ground", "nut")
    driver = (
        drivers.RotationDriver(bodies, z, motion)
        if driven == "rotation"
        else drivers.SpatialSlideDriver(bodies, origin, origin, z, motion)
    )
    return jn.Mechanism(
        space="spatial",
        bodies={"nut": jn.Body(origin)},
        joints={"thread": spatial.Screw(bodies, origin, origin, z, z, lead)},
        drivers={"drive": driver},
        outputs={"p": jn.outputs.PointOutput("nut", origin), "angle": jn.outputs.RelativeAngleOutput(bodies, z)},
    )


def four_hinges():
    """A planar four-bar built of four spatial hinges: three constraints are redundant."""
    z, o = [0, 0, 1], [0, 0, 0]
    return jn.Mechanism(
        space="spatial",
        bodies={"crank": jn.Body(o), "coupler": jn.Body([0.1, 0, 0]), "rocker": jn.Body([0.3, 0, 0])},
        joints={
            "A": spatial.Revolute(("ground", "crank"), o, o, z, z),
            "B": spatial.Revolute(("crank", "coupler"), [0.1, 0, 0], o, z, z),
            "C": spatial.Revolute(("coupler", "rocker"), [0.25, 0, 0], [0.2, 0, 0], z, z),
            "D": spatial.Revolute(("ground", "rocker"), [0.3, 0, 0], o, z, z),
        },
        drivers={"turn": drivers.RotationDriver(("ground", "crank"), z, "0.5 + t")},
    )
