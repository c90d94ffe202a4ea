"""The type of planar and spatial poses."""

from jounce.rigid.planar import PlanarPose
from jounce.rigid.spatial import SpatialPose

Pose = PlanarPose | SpatialPose
"""Pose of one or many bodies, in the plane or in space."""
