"""What is told of a cam: extremes with the cam angles where they are, and undercut."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class Extreme:
    """A largest or a smallest value of a cam.

    Attributes
    ----------
    value : float
        m, or rad.
    angle : float
        Of the cam, rad.
    """

    value: float
    angle: float


@dataclasses.dataclass(frozen=True)
class Undercut:
    """A part of a law that a cam cannot give the follower, since the cutter takes away what it should touch.

    Attributes
    ----------
    start, stop : float
        Cam angles between which lift is lost, rad; of a part through zero, the start is greater than the stop.
    angle : float
        Where most is lost, rad.
    lost : float
        How much there, m or rad.
    """

    start: float
    stop: float
    angle: float
    lost: float
