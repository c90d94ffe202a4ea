"""Curves of configurations: the positions of a mechanism with one driver free, through dead and change points."""

from jounce.kinematics.curves.curve import Curve as Curve
from jounce.kinematics.curves.trace import trace as trace
