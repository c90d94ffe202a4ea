"""Rigid bodies on jets: planar and spatial poses, points, directions and angular velocity of any order."""

from jounce.rigid.planar import PlanarPose as PlanarPose, perpendicular as perpendicular
from jounce.rigid.spatial import (
    SpatialPose as SpatialPose,
    body_axes as body_axes,
    to_body as to_body,
    to_global as to_global,
)
