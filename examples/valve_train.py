"""A cam with a flat-faced tappet as a joint of one's own: the valve train of an engine, over one turn of the cam.

Run it as a script, or let a mechanism file use the joint:

    jounce run examples/own_joint/valve_train.yaml --import examples/valve_train.py
"""

from pathlib import Path

import numpy as np

import jounce as jn
from jounce import jet


class FlatFaceCam(jn.joints.AbstractConstraint, type="flat_face_cam", space="planar"):
    """The flat face of body j touches the cam of body i: it is as far from its center as the support function says.

    The cam is the curve whose tangent across the direction at an angle a from the x axis of body i is
    ``base + lift ((1 + cos a) / 2)^sharpness`` from its center: a base circle and one nose, smooth to any order.
    """

    point_i: jn.joints.Vector  # m, center of the cam, in the frame of body i
    point_j: jn.joints.Vector  # m, a point of the face, in the frame of body j
    normal: jn.joints.Vector  # of the face, away from the cam, in the frame of body j
    base: jn.joints.Scalar  # m
    lift: jn.joints.Scalar  # m
    sharpness: jn.joints.Scalar

    dimensions = {"base": "length", "lift": "length", "normal": "ratio", "sharpness": "ratio"}

    def residual(self, body_i, body_j, time):
        normal = body_j.direction(self.normal)
        height = normal.dot(body_j.point(self.point_j) - body_i.point(self.point_i)) / jet.sqrt(normal.dot(normal))
        angle = jet.atan2(normal[1], normal[0]) - body_i.angle
        return height - self.base - self.lift * (0.5 * (1.0 + jet.cos(angle))) ** self.sharpness


def main() -> None:
    mechanism = jn.load(Path(__file__).parent / "own_joint" / "valve_train.yaml")
    motion = jn.solve(mechanism, order=4)
    valve = motion.dataset["valve"].sel(component="y")
    base, lift, sharpness = (mechanism.parameter_values[name] for name in ("base", "lift", "sharpness"))
    # the radius of curvature of the cam, support + its second derivative, must stay positive under a flat face
    angle = np.linspace(-np.pi, np.pi, 2001)
    bump = ((1 + np.cos(angle)) / 2) ** sharpness
    curved = -sharpness / 2 * np.cos(angle) * ((1 + np.cos(angle)) / 2) ** (sharpness - 1)
    curved += sharpness * (sharpness - 1) / 4 * np.sin(angle) ** 2 * ((1 + np.cos(angle)) / 2) ** (sharpness - 2)
    print(f"smallest radius of curvature of the cam: {1e3 * np.min(base + lift * (bump + curved)):.2f} mm")
    print(f"the valve opens by {1e3 * float(valve.sel(derivative=0).max() - valve.sel(derivative=0).min()):.2f} mm")
    for k, name in enumerate(("velocity", "acceleration", "jerk", "jounce"), 1):
        print(f"largest {name}: {float(abs(valve.sel(derivative=k)).max()):.5g} m/s^{k}")


if __name__ == "__main__":
    main()
