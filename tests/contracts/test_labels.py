"""Labels of datasets: the time has its unit, and a plot of a derivative does not claim that of the quantity."""

import matplotlib as mpl
import numpy as np
import pytest

import jounce as jn
from tests.problems.small import four_bar

mpl.use("Agg")

ROD = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 12, 1 / 12])
ROBOT = jn.Robot("one", [jn.Link("base"), jn.Link("rod", ROD)], [jn.Joint("a", "base", "rod")])
TRAJECTORY = jn.JointTrajectory({"a": "t**2"}, 0.0, 1.0, np.linspace(0.0, 1.0, 11))
DRIVE = jn.planning.Drive(stiffness=100.0, rotor_inertia=0.1)
U = [0.0, 0.1, 0.2]


def motion():
    return jn.solve(four_bar(), U, order=3)


LABELED = {
    "motion": lambda: motion().dataset,
    "point": lambda: motion().point("rocker", [0.0, 0.0]),
    "driver": lambda: motion().driver("theta"),
    "constraint equations": lambda: jn.constraint_equations(motion()),
    "batch": lambda: jn.solve_batch(four_bar(), {"BC": [0.142, 0.143]}, U, order=3),
    "torques": lambda: jn.dynamics.trajectory_torques(ROBOT, TRAJECTORY, rates=3),
    "simulation of a robot": lambda: jn.simulate(ROBOT, U, state=[[0.0], [0.0]], order=3).dataset,
    "feedforward": lambda: jn.planning.feedforward(ROBOT, TRAJECTORY, {"a": DRIVE}).dataset,
}  # fmt: skip


@pytest.mark.parametrize("name", LABELED)
def test_the_time_has_its_unit(name):
    found = LABELED[name]()
    assert found["time"].attrs == {"units": "s", "long_name": "time"}
    assert found["derivative"].attrs == {"long_name": "order of the time derivative"}
    if hasattr(found, "data_vars") and name != "constraint equations":
        for variable in found.data_vars.values():
            if "derivative" in variable.dims:
                assert variable.attrs["long_name"] == f"{variable.name}, each derivative by s"


def test_a_plot_says_that_its_unit_is_that_of_the_quantity():
    (line,) = motion().dataset["psi"].sel(derivative=3).plot()
    assert line.axes.get_ylabel().replace("\n", " ") == "psi, each derivative by s [rad]"
    assert line.axes.get_xlabel() == "time [s]"
    assert line.axes.get_title() == "derivative = 3"
