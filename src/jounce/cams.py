"""Plate cams from the law of a follower, and their followers."""

from jounce.dynamics import ContactSpring as ContactSpring, contact_spring as contact_spring
from jounce.io import (
    load_cam as load_cam,
)
from jounce.kinematics import (
    Extreme as Extreme,
    OscillatingFollower as OscillatingFollower,
    PlateCam as PlateCam,
    TranslatingFollower as TranslatingFollower,
    Undercut as Undercut,
    plate_cam as plate_cam,
)
