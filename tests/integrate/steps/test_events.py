"""Events: crossings of values by outputs and their derivatives, against closed forms of the motion."""

import numpy as np
import pytest
import xarray as xr

import jounce as jn
from jounce import drivers, jet, spatial
from jounce.dynamics.forward.accelerations import State
from jounce.integrate.marching.marching import DenseOutput
from jounce.integrate.steps.events import EventDetector, crossings
from jounce.kinematics.results.pose_outputs import output_group
from jounce.rigid.planar import PlanarPose


def stone(height=0.0, speed=5.0):
    """A stone thrown upward with the gravity 10 m/s^2: y = height + speed t - 5 t^2."""
    return jn.Mechanism(
        space="planar",
        gravity=[0.0, -10.0],
        parameters={"height": height, "speed": speed},
        bodies={"stone": jn.Body([0, "height"], mass=2.0, inertia=0.1)},
        joints={},
        initial={"up": drivers.CoordinateDriver(("ground", "stone"), "y", "height + speed*t")},
        outputs={"place": jn.outputs.PointOutput("stone", [0, 0])},
    )


def happened(*events, time=(0.0, 2.0), mechanism=None, **keywords):
    mechanism = stone() if mechanism is None else mechanism
    return jn.simulate(mechanism, list(time), 1, events=events, **keywords).events


def height(value=0.0, **keywords):
    return jn.Event(jn.outputs.PointOutput("stone", [0, 0]), value, component=1, **keywords)


@pytest.mark.slow
def test_values_are_crossed_when_the_closed_form_says():
    found = happened(height(1.0), height(1.0, direction=1), height(1.0, direction=-1), height(2.0))
    roots = (5 + np.array([-1, 1]) * np.sqrt(5)) / 10
    for times, expected in zip(found, (roots, roots[:1], roots[1:], []), strict=True):
        assert times == pytest.approx(list(expected), abs=1e-14)


def test_values_may_be_numbers_of_arrays_and_components_are_called_as_datasets_call_them():
    place = jn.outputs.PointOutput("stone", [0, 0])
    expected = happened(height(1.0))
    for value in (np.float32(1.0), np.int64(1), np.array(1.0), xr.DataArray(1.0)):
        assert happened(jn.Event(place, value, component="y")) == expected
    with pytest.raises(jn.errors.MechanismError, match=r"events.component: .*'z'.*; valid: x, y"):
        happened(jn.Event(place, component="z"))


@pytest.mark.slow
def test_derivatives_are_crossed():
    assert happened(height(derivative=1), height(3.0, derivative=1))[0] == pytest.approx([0.5], abs=1e-14)
    assert happened(height(3.0, derivative=1))[0] == pytest.approx([0.2], abs=1e-14)
    assert happened(height(-10.0, derivative=2)) == [[]]  # at the value always, never across it


@pytest.mark.slow
def test_what_begins_at_the_value_does_not_cross_it():
    assert happened(height(0.0))[0] == pytest.approx([1.0], abs=1e-14)  # the landing, not the throw
    assert happened(height(0.0, derivative=1), mechanism=stone(speed=0.0)) == [[]]


@pytest.mark.slow
def test_what_touches_the_value_and_turns_back_does_not_cross_it():
    assert happened(height(1.25), height(1.25 - 1e-9), height(1.25 + 1e-9)) == [
        [],
        pytest.approx([0.5 - np.sqrt(2e-10), 0.5 + np.sqrt(2e-10)], abs=1e-11),
        [],
    ]


def test_backward_in_time_the_direction_is_still_that_of_time():
    found = happened(height(-10.0), height(-10.0, direction=1), height(-10.0, direction=-1), time=(0.0, -3.0))
    back = (5 - np.sqrt(225)) / 10
    assert found == [pytest.approx([back], abs=1e-14)] * 2 + [[]]


def test_a_terminal_event_ends_the_run_and_what_follows_is_not_reached():
    motion = jn.simulate(stone(), [0.0, 0.5, 1.0, 1.5, 2.0], 1, events=[height(-6.0, terminal=True), height(-7.0)])
    end = (5 + np.sqrt(145)) / 10  # 1.704
    assert motion.events == [pytest.approx([end], abs=1e-14), []]
    assert motion.ended_at == pytest.approx(end, abs=1e-14)
    assert [jn.Status(s).name for s in motion.status] == ["OK"] * 4 + ["NOT_REACHED"]
    assert np.isnan(motion.outputs["place"][-1]).all()
    assert motion.at([end]).outputs["place"][0, 0, 1] == pytest.approx(-6.0, abs=1e-13)


class Sine(jn.outputs.AbstractOutput):
    """Sine of the angle of a body."""

    unit = "1"

    def evaluate(self, body):
        return jet.sin(body.angle)


def test_an_output_of_ones_own_and_many_crossings_in_one_step():
    spinning = jn.Mechanism(
        space="planar",
        bodies={"wheel": jn.Body([0, 0], mass=1.0, inertia=1.0)},
        joints={},
        initial={"turn": drivers.CoordinateDriver(("ground", "wheel"), "angle", "7*t")},
    )
    motion = jn.simulate(spinning, [0.0, 1.0], 1, events=[jn.Event(Sine("wheel"), 0.5, direction=1)])
    assert motion.steps == 1  # free of forces the motion is a polynomial
    assert motion.events[0] == pytest.approx([np.pi / 6 / 7, (np.pi / 6 + 2 * np.pi) / 7], abs=1e-12)


@pytest.mark.slow
def test_turns_of_an_angle_in_space_count():
    z, x, origin, bodies = [0, 0, 1], [1, 0, 0], [0, 0, 0], ("ground", "rotor")
    angle = jn.outputs.RelativeAngleOutput(bodies, z, x, x)
    rotor = jn.Mechanism(
        space="spatial",
        bodies={"rotor": jn.Body(origin, mass=1.0, inertia=[1.0, 1.0, 2.0])},
        joints={"O": spatial.Revolute(bodies, origin, origin, z, z)},
        initial={"turn": drivers.RotationDriver(bodies, z, "20*t", x, x)},
        outputs={"angle": angle},
    )
    events = [jn.Event(angle, value) for value in (50.0, np.pi, -1.0)]
    motion = jn.simulate(rotor, [0.0, 10.0], 1, events=events)
    assert motion.events == [pytest.approx([2.5], abs=1e-13), pytest.approx([np.pi / 20], abs=1e-13), []]
    assert np.allclose(motion.outputs["angle"], [[0, 20], [200, 20]], rtol=1e-13)
    assert np.allclose(motion.at([7.0]).outputs["angle"], [[140, 20]], rtol=1e-13)  # also where asked for alone


def flight(begun, start, speed, length):
    """A step of a stone free of forces, that begins at a height and rises with a speed."""
    still = np.zeros((1, 2, 1, 1))
    position = np.array([[[[0.0], [start]], [[0.0], [speed]]]])
    polynomial = State(position, still, still, still)
    return DenseOutput(np.array([begun]), np.array([length]), polynomial, np.array([-1]), ())


@pytest.mark.parametrize("beyond", [0.0, 1e-10, -1e-10])
def test_a_crossing_where_two_steps_meet_is_one(beyond):
    """Found at the very end of one step, and again at the beginning of the next."""
    event = height(1.0 + beyond, direction=1)
    detector = EventDetector(event, output_group(event.output, stone()), PlanarPose)
    first = detector.detect(flight(0.0, 0.0, 1.0, 1.0))
    second = detector.detect(flight(1.0, 1.0, 1.0, 1.0))
    assert [when for _, when in first] == pytest.approx([1.0], abs=1e-9)
    assert second == []
    assert [when for _, when in detector.detect(flight(2.0, 0.5, 1.0, 1.0))] == pytest.approx([0.5 + beyond])


def chebyshev(*roots, lead=1.0):
    power = lead * np.polynomial.Polynomial.fromroots(roots)
    return power.convert(domain=[0, 1], kind=np.polynomial.Chebyshev, window=[-1, 1]).coef


@pytest.mark.parametrize(
    "roots, expected",
    [
        ((0.3,), [(0.3, 1)]),
        ((0.2, 0.7), [(0.2, -1), (0.7, 1)]),
        ((0.5, 0.5), []),
        ((0.4, 0.4, 0.4), [(0.4, 1)]),
        ((0.5, 0.5, 0.8), [(0.8, 1)]),
        ((0.1, 0.1 + 1e-5), [(0.1, -1), (0.1 + 1e-5, 1)]),
        ((1.0,), [(1.0, 1)]),
        ((1.2, -0.2), []),
        ((0.5 + 1e-3j, 0.5 - 1e-3j), []),
    ],
)
def test_crossings_of_polynomials_with_known_roots(roots, expected):
    found = crossings(chebyshev(*roots).real)
    assert [sense for _, sense in found] == [sense for _, sense in expected]
    places = [place for place, _ in found]
    assert places == pytest.approx([place for place, _ in expected], abs=1e-4 if len(roots) == 3 else 1e-9)


def test_the_beginning_of_a_run_is_no_crossing():
    assert crossings(chebyshev(0.0), first=False) == [(pytest.approx(0.0, abs=1e-15), 1.0)]
    assert crossings(chebyshev(0.0), first=True) == []
    assert crossings(np.zeros(5)) == []
    assert crossings(np.array([np.nan, 1.0])) == []


@pytest.mark.parametrize(
    "keywords, words",
    [
        ({"value": np.nan}, "value: must be a finite number"),
        ({"value": [1.0]}, "value: must be a finite number"),
        ({"value": True}, "value: must be a finite number"),
        ({"derivative": 5}, "derivative: must be a whole number from 0 to 4"),
        ({"component": -1}, "component: must be a whole number"),
        ({"direction": 2}, "direction: must be -1, 0 or 1"),
    ],
)
def test_an_event_that_is_none(keywords, words):
    with pytest.raises(jn.errors.MechanismError, match=words):
        jn.Event(jn.outputs.AngleOutput("stone"), **keywords)


@pytest.mark.parametrize(
    "events, words",
    [
        (height(), "must be a list of jn.Event"),
        ("psi", "must be a list of jn.Event"),  # its letters are not taken for events
        (["landing"], "must be a jn.Event"),
        ([jn.Event(jn.outputs.AngleOutput("stone"), component=1)], "has 1 component, counted from 0, got 1"),
        ([jn.Event(jn.outputs.AngleOutput("ston"))], "did you mean 'stone'"),
        ([jn.Event(jn.outputs.RelativeAngleOutput(("ground", "stone"), [0, 0, 1]))], "is spatial"),
    ],
)
def test_events_that_do_not_fit_are_refused(events, words):
    with pytest.raises(jn.errors.MechanismError, match=words):
        jn.simulate(stone(), [0.0, 1.0], events=events)


def test_an_event_needs_an_output_of_poses():
    with pytest.raises(jn.errors.MechanismError, match="an event watches an output of the poses"):
        jn.Event("angle")


@pytest.mark.slow
@pytest.mark.parametrize("miss", [1.0, 0.1, 1e-3, 1e-6])
def test_points_that_pass_each_other_in_a_small_part_of_a_step(miss):
    along = jn.drivers.CoordinateDriver(("ground", "point"), "x", motion="-5 + 2*t")
    beside = jn.drivers.CoordinateDriver(("ground", "point"), "y", motion="miss")
    flight = jn.Mechanism(
        space="planar",
        parameters={"miss": miss},
        bodies={"point": jn.Body([-5, "miss"], mass=1.0, inertia=1.0)},
        joints={},
        initial={"along": along, "beside": beside},
    )
    distance = jn.outputs.DistanceOutput(("ground", "point"), [0, 0], [0, 0])
    values = [1.001 * miss, 2 * miss, 3.0]
    found = jn.simulate(flight, [0.0, 5.0], 1, events=[jn.Event(distance, value) for value in values])
    for times, value in zip(found.events, values, strict=True):
        half = np.sqrt(value**2 - miss**2) / 2
        np.testing.assert_allclose(times, [2.5 - half, 2.5 + half], rtol=0, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("miss", [0.3, 0.02, 1e-4])
def test_an_angle_about_an_axis_that_its_vector_passes(miss):
    ball = jn.Mechanism(
        space="spatial",
        parameters={"miss": miss},
        bodies={"ball": jn.Body([0, 0, 0], mass=1.0, inertia=[1.0, 1.0, 1.0])},
        joints={"pin": jn.spatial.Spherical(("ground", "ball"), [0, 0, 0], [0, 0, 0])},
        initial={"spin": jn.drivers.RotationDriver(("ground", "ball"), [0, "cos(miss)", "sin(miss)"], "3*t")},
    )
    angle = jn.outputs.RelativeAngleOutput(("ground", "ball"), [0, 0, 1], [1, 0, 0], [1, 0, 0])
    values = [1.0, 2.5, 4.0, 7.0]
    found = jn.simulate(ball, [0.0, 3.0], 1, events=[jn.Event(angle, value) for value in values])
    for times, value in zip(found.events, values, strict=True):
        turn = np.arctan2(np.sin(value) / np.sin(miss), np.cos(value))  # tan(value) = sin(miss) tan(turn)
        turn += 2 * np.pi * np.round((value - turn) / (2 * np.pi))
        np.testing.assert_allclose(times, [turn / 3], rtol=0, atol=1e-11)
