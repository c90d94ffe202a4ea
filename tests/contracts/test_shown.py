"""What results are called on a terminal and in a notebook: no traceback, whatever the result, and no flood of text."""

import functools

import numpy as np
import pytest

import jounce as jn
from jounce.base.display import Displayed
from jounce.design.optimization.result import Comparison
from tests import public_names
from tests.problems.small import four_bar

LONGEST, LONGEST_PAGE = 500, 20_000  # characters
SLOW = jn.Limits(lower=-3.0, upper=3.0, velocity=1.0, acceleration=1.0, effort=10.0)
ROD = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 12, 1 / 12])
LINKS = [jn.Link("base"), jn.Link("rod", ROD), jn.Link("end", ROD)]
PINS = [jn.Joint("a", "base", "rod", limits=SLOW), jn.Joint("b", "rod", "end", position=[1.0, 0, 0], limits=SLOW)]
ROBOT = jn.Robot("two", LINKS, PINS)
FREE = jn.Robot("free", LINKS, [jn.Joint("a", "base", "rod"), jn.Joint("b", "rod", "end")])
TRAJECTORY = jn.JointTrajectory({"a": "0.2*t", "b": "0.3 + t**2/10"}, 0.0, 2.0)
U = np.linspace(0.0, 1.0, 9)


@functools.cache
def made(name):
    return MAKERS[name]()


def pendulum():
    joints = {"pin": jn.planar.Revolute(("ground", "rod"), [0, 0], [0, 0])}
    rod = jn.Body([0, 0], -1.5, mass=1.0, inertia=0.1, center_of_mass=[0.5, 0])
    return jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        bodies={"rod": rod},
        joints=joints,
        outputs={"a": jn.outputs.AngleOutput("rod")},
    )


MAKERS = {
    "Mechanism": four_bar,
    "Motion": lambda: jn.solve(four_bar(), [0.0, 0.1], order=1),
    "Robot": lambda: ROBOT,
    "JointTrajectory": lambda: TRAJECTORY,
    "Assemblies": lambda: jn.assemblies(four_bar(), circuits=False),
    "Assembly": lambda: made("Assemblies")[0],
    "Curve": lambda: jn.trace(four_bar(), order=0),
    "CurveBranch": lambda: made("Curve").branches[0],
    "Simulation": lambda: jn.simulate(pendulum(), [0.0, 0.1], order=2),
    "RobotSimulation": lambda: jn.simulate(ROBOT, [0.0, 0.1], order=2, state=np.zeros((2, 2))),
    "Batch": lambda: jn.integrate.Batch(
        U, {"l": U[:2]}, {"a": np.zeros((2, 9, 3))}, np.zeros((2, 9), int), np.ones(2, int), four_bar(), 2
    ),
    "Equilibrium": lambda: jn.equilibrium(pendulum()),
    "Linearization": lambda: jn.linearize(pendulum()),
    "Modes": lambda: made("Linearization").modes,
    "LimitReport": lambda: jn.check_limits(ROBOT, TRAJECTORY),
    "LimitReport, no limits": lambda: jn.check_limits(FREE, TRAJECTORY),
    "OptimizedDesign": lambda: jn.design.OptimizedDesign(
        four_bar(),
        {"BC": 0.142},
        1.3,
        "optimal",
        "no design nearby is better",
        (Comparison("objective", "peak(psi, 1)", 1.4, 1.3), Comparison("parameter", "BC", 0.1423, 0.142, 0.142, 0.143)),
        0.1,
        1e-9,
        1e-9,
        (1.3,),
        20,
    ),
    "RetimedTrajectory": lambda: jn.retime(ROBOT, [[0.0, 0.0], [1.0, 1.0]]),
    "ToolPath": lambda: jn.planning.ToolPath(["1.5 - 0.3*t", "0.3*t", "0"], start=0.0, stop=1.0),
    "ToolPathMotion": lambda: jn.planning.follow_tool_path(
        ROBOT, "end", made("ToolPath"), point=[1.0, 0, 0], start=[0.7, -1.4], time=[0.5], order=1
    ),
    "JointPoses": lambda: jn.inverse_kinematics(ROBOT, "end", [1.5, 0.1, 0.0], point=[1.0, 0, 0]),
    "Feedforward": lambda: jn.planning.feedforward(
        ROBOT, TRAJECTORY, {"a": jn.planning.Drive(stiffness=100.0, rotor_inertia=0.1)}
    ),
    "Mobility": lambda: jn.mobility(four_bar()),
    "PlateCam": lambda: jn.cams.plate_cam(
        "0.01*(1 - cos(t))", jn.cams.TranslatingFollower("roller", radius=0.005), 0.03
    ),
}


@pytest.mark.parametrize("name", MAKERS)
def test_what_is_shown_is_short_and_no_traceback(name):
    thing = made(name)
    assert name.partition(",")[0] == type(thing).__name__
    assert 10 < len(repr(thing)) <= LONGEST
    assert len(str(thing)) <= LONGEST
    if isinstance(thing, Displayed):
        page = thing._repr_html_()
        assert page.startswith('<div class="jounce">')
        assert len(page) <= LONGEST_PAGE


def test_all_that_a_notebook_shows_is_made_here():
    kinds = [value for value in public_names.offered().values() if isinstance(value, type)]
    offered = {kind.__name__ for kind in kinds if issubclass(kind, Displayed)}
    assert offered <= {name.partition(",")[0] for name in MAKERS}


def test_a_report_of_limits_says_what_is_nearest():
    worst = made("LimitReport").worst
    words = f"{worst.quantity} of {worst.joint} takes {worst.ratio:.6g} of its limit at t = {worst.time:.6g} s"
    assert words in repr(made("LimitReport"))
    assert "<table>" in made("LimitReport")._repr_html_()
