"""Kinematics: assembly, positions, all derivatives from one factorisation, diagnosis, and the result."""

from jounce.kinematics.motion import Motion as Motion
from jounce.kinematics.solve import raise_for_status as raise_for_status, solve as solve
from jounce.kinematics.status import Status as Status
