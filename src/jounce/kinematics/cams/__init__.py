"""Plate cams: from the law of a follower to the profile, and what is to be known of it."""

from jounce.kinematics.cams.followers import (
    OscillatingFollower as OscillatingFollower,
    TranslatingFollower as TranslatingFollower,
)
from jounce.kinematics.cams.plate_cams import PlateCam as PlateCam, plate_cam as plate_cam
from jounce.kinematics.cams.results import Extreme as Extreme, Undercut as Undercut
