"""Rigid bodies on jets: planar and spatial poses, points, directions and angular velocity of any order."""

from jounce.rigid.planar import PlanarPose as PlanarPose, perpendicular as perpendicular
from jounce.rigid.spatial import (
    SpatialPose as SpatialPose,
    attitude_matrix as attitude_matrix,
    to_body as to_body,
    to_global as to_global,
)
