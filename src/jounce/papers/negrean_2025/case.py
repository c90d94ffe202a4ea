"""The measured motions and the arm of section 4, with stand-ins for data that the text of the paper lacks.

The third link of a Fanuc LR Mate 100 iB turns from 0 to pi in 1.7 s. An accelerometer on it measures the tangential
acceleration every 0.033 s, once in a motion at high speed, once with a sudden stop. Only figures 4 and 5 show the
samples, and only figure 6 shows the masses, so this module chooses both.
"""

import dataclasses
from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from jounce.errors import TrajectoryError
from jounce.rigid.inertia import Inertia
from jounce.robot import JointAxis, Robot, from_screws
from jounce.trajectory import PolynomialMotion

Samples = Float[np.ndarray, " instants"]

ANGLE = np.pi  # rad, section 4
DURATION = 1.7  # s, section 4
SEGMENTS = 51  # section 4; the spacing of the samples is then 0.0333 s
CONTINUITY = 4  # m of equations 61 and 62: segments of degree 5
KNOTS = np.linspace(0.0, DURATION, SEGMENTS + 1)

RIPPLE = ((0.08, 29.0, 0.7), (0.05, 41.0, 2.1))  # rad/s^2, rad/s, rad: disturbances of the accelerometer
STOP = 0.9  # s, when braking begins
BRAKING = 0.2  # s, duration of braking
TURNS, SETTLED = 500, 1e-13  # iterations and tolerance for removing gravity from readings
RINGING = (6.0, 32.0, 8.0)  # rad/s^2, rad/s, 1/s: oscillation of the arm after braking


@dataclasses.dataclass(frozen=True)
class Link:
    """The link that turns: its masses in figure 6 of the paper, and the place of the accelerometer.

    Parameters
    ----------
    mass : float
        Mass, kg.
    center_x, center_z : float
        Coordinates of the center of mass in the frame of the link, from the axis, m.
    inertia_x, inertia_y, inertia_z : float
        Moments of inertia about the center of mass, kg m^2; y is along the axis.
    radius : float
        Distance from the axis to the accelerometer, m.
    sensor_angle : float, default 0
        Angle from x of the link to the accelerometer, in the sense in which the link turns, rad.
    """

    mass: float
    center_x: float
    center_z: float
    inertia_x: float
    inertia_y: float
    inertia_z: float
    radius: float
    sensor_angle: float = 0.0

    def robot(self) -> Robot:
        """Return the robot of one joint: the link on its axis, y, horizontal."""
        moments = (self.inertia_x, self.inertia_y, self.inertia_z)
        link = Inertia(self.mass, (self.center_x, 0.0, self.center_z), moments)
        return from_screws([JointAxis((0.0, 1.0, 0.0), inertia=link)], name="arm")

    @property
    def inertia_about_axis(self) -> float:
        """Moment of inertia about the axis, ``M (x_C^2 + z_C^2) + I_y`` of equations 141-146, kg m^2."""
        return self.mass * (self.center_x**2 + self.center_z**2) + self.inertia_y


STAND_IN = Link(  # for figure 6
    mass=6.5, center_x=0.12, center_z=0.03, inertia_x=0.020, inertia_y=0.060, inertia_z=0.055, radius=0.25
)


def arm() -> Robot:
    """Return the robot of one joint with stand-ins for its masses: the third link on its axis, y, horizontal."""
    return STAND_IN.robot()


def rest_to_rest(time: Samples) -> tuple[Samples, Samples]:
    """Return speed and acceleration of the polynomial of degree 7 from 0 to pi, at rest to the third derivative."""
    s = time / DURATION
    speed = 140 * s**3 * (1 - s) ** 3
    acceleration = 420 * s**2 * (1 - s) ** 2 * (1 - 2 * s)
    return speed * ANGLE / DURATION, acceleration * ANGLE / DURATION**2


def high_speed() -> Samples:
    """Return the angular acceleration in the motion at high speed, rad/s^2, one sample for each knot."""
    return rest_to_rest(KNOTS)[1] + ripple(KNOTS)


def sudden_stop() -> Samples:
    """Return the angular acceleration in a motion that stops from 0.9 s on, rad/s^2, one sample for each knot."""
    angles = KNOTS - STOP
    phase = np.clip(angles / BRAKING, 0.0, 1.0)
    braking = -rest_to_rest(np.array([STOP]))[0] / BRAKING * (1 - np.cos(2 * np.pi * phase))
    size, frequency, decay = RINGING
    after = np.clip(angles - BRAKING, 0.0, None)
    ringing = size * np.exp(-decay * after) * np.sin(frequency * after)
    return np.where(angles < 0, rest_to_rest(KNOTS)[1], braking + ringing) + ripple(KNOTS)


def ripple(time: Samples) -> Samples:
    """Return the disturbances of the accelerometer, rad/s^2."""
    parts = (size * np.sin(frequency * time + phase) for size, frequency, phase in RIPPLE)
    return np.sum(list(parts), axis=0)


def law(accelerations: Samples, knots: Samples = KNOTS) -> PolynomialMotion:
    """Return the quintic segments through samples of the acceleration, from rest at zero, without jerk at the ends."""
    start = {0: 0.0, 1: 0.0}
    return PolynomialMotion.from_accelerations(knots, accelerations, CONTINUITY, start=start, ends="clamped")


def without_gravity(readings: Samples, link: Link, knots: Samples) -> Samples:
    """Return the angular accelerations of an arm, from tangential readings that contain gravity, rad/s^2.

    An accelerometer reads ``r q'' - g cos(q + b)`` along the tangent; b is its angle on the link, which at angle zero
    is level and turns down. The angle follows from the accelerations, so an iteration finds both in turn; it converges,
    because each angle depends on earlier accelerations only.

    Raises
    ------
    TrajectoryError
        If the iteration does not converge.
    """
    weight = -float(link.robot().gravity[2])
    accelerations = readings / link.radius
    for _ in range(TURNS):
        motion = law(accelerations, knots)
        angle = np.append(motion.coefficients[0], end_of(motion)[0]) + link.sensor_angle
        latest = (readings + weight * np.cos(angle)) / link.radius
        change = np.max(np.abs(latest - accelerations))
        accelerations = latest
        if change <= SETTLED * np.max(np.abs(latest)):
            return accelerations
    message = "gravity cannot be taken off the readings: angles and accelerations do not settle; give a shorter motion"
    raise TrajectoryError(message, name="samples", value=float(knots[-1] - knots[0]))


def end_of(motion: PolynomialMotion) -> Float[np.ndarray, "2"]:
    """Return angle and speed at the last knot, rad and rad/s."""
    local = float(motion.stop - motion.breakpoints[-1])
    piece = np.polynomial.Polynomial(motion.coefficients[:, -1])
    return np.array([piece(local), piece.deriv()(local)])


def at_rest(accelerations: Samples, angle: float | None) -> Samples:
    """Return samples without their bias, and if an angle is given, their drift, so that the motion ends at rest.

    Parameters
    ----------
    accelerations : array of shape (knots,)
        Samples, rad/s^2.
    angle : float or None
        Angle at which the motion ends at rest, rad; None if it is not known.
    """
    shapes = [np.ones(len(KNOTS)), KNOTS] if angle is not None else [np.ones(len(KNOTS))]
    columns = slice(None) if angle is not None else slice(1, 2)
    target = np.array([angle or 0.0, 0.0])[columns]
    effect = np.stack([end_of(law(shape))[columns] for shape in shapes], axis=1)
    amounts = np.linalg.solve(effect, target - end_of(law(accelerations))[columns])
    return accelerations + amounts @ np.stack(shapes)


@dataclasses.dataclass(frozen=True)
class Case:
    """One of the two measured motions.

    Parameters
    ----------
    name : str
        Name in the files.
    title : str
        Title in figures.
    samples : callable
        Function that returns the samples of the angular acceleration, rad/s^2, one for each knot.
    angle : float or None
        Angle at the end of the motion, rad, if it is known.
    link : Link, default the stand-in
        The moving link.
    knots : array of shape (knots,), default those of the paper
        Instants of the samples, s.
    measured : bool, default False
        Whether the samples are measured data of the user, kept unchanged.
    """

    name: str
    title: str
    samples: Callable[[], Samples]
    angle: float | None
    link: Link = STAND_IN
    knots: Samples = dataclasses.field(default_factory=lambda: KNOTS)
    measured: bool = False

    @property
    def accelerations(self) -> Samples:
        """Samples without bias and drift, rad/s^2, through which the law goes."""
        return self.samples() if self.measured else at_rest(self.samples(), self.angle)

    @property
    def motion(self) -> PolynomialMotion:
        """The law of the angle."""
        return law(self.accelerations, self.knots)


CASES = {
    case.name: case
    for case in (
        Case("high_speed", "High-speed motion", high_speed, ANGLE),
        Case("sudden_stop", "Sudden stop", sudden_stop, None),
    )
}
