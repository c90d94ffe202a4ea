"""Plate cams: the profile from the law of a follower, pressure angle, curvature and undercut."""

from jounce.kinematics.cams.followers import (
    OscillatingFollower as OscillatingFollower,
    TranslatingFollower as TranslatingFollower,
)
from jounce.kinematics.cams.plate_cams import PlateCam as PlateCam, plate_cam as plate_cam
from jounce.kinematics.cams.results import Extreme as Extreme, Undercut as Undercut
