"""Rigid bodies on jets: poses, points, rotations, screws and angular velocity of any order."""

from jounce.rigid.attitude_samples import AttitudeSamples as AttitudeSamples
from jounce.rigid.orientation import (
    angle_rates as angle_rates,
    angular_velocity as angular_velocity,
    angular_velocity_from_angles as angular_velocity_from_angles,
    euler_angles as euler_angles,
    is_singular_orientation as is_singular_orientation,
    singularity_distance as singularity_distance,
    transfer_matrix as transfer_matrix,
)
from jounce.rigid.planar import PlanarPose as PlanarPose, perpendicular as perpendicular
from jounce.rigid.rotations import (
    FIXED_SEQUENCES as FIXED_SEQUENCES,
    MOVING_SEQUENCES as MOVING_SEQUENCES,
    SEQUENCES as SEQUENCES,
    rotation_about as rotation_about,
    rotation_matrix as rotation_matrix,
    simple_rotation as simple_rotation,
)
from jounce.rigid.screws import (
    ScrewAxis as ScrewAxis,
    product_of_exponentials as product_of_exponentials,
    screw_transform as screw_transform,
)
from jounce.rigid.spatial import (
    SpatialPose as SpatialPose,
    angular_product_matrices as angular_product_matrices,
    body_axes as body_axes,
    to_body as to_body,
    to_global as to_global,
)
from jounce.settings import compute_under_own_settings as _compute_under_own_settings

_compute_under_own_settings(__name__)
