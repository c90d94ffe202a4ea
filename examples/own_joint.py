"""A joint of one's own: a cam with a roller follower, in Python and from a mechanism file.

Run it as a script, or let a mechanism file use the joint:

    jounce run examples/own_joint/cam.yaml --import examples/own_joint.py
"""

from pathlib import Path

import numpy as np

import jounce as jn
from jounce import jet


class HarmonicCam(jn.joints.AbstractConstraint, type="harmonic_cam", space="planar"):
    """The roller center on body j stays on the curve r = base + lift cos(lobes angle) of the cam, body i."""

    point_i: jn.joints.Vector  # m, center of the cam, in the frame of body i
    point_j: jn.joints.Vector  # m, center of the roller, in the frame of body j
    base: jn.joints.Scalar  # m
    lift: jn.joints.Scalar  # m
    lobes: jn.joints.Scalar = 1.0

    dimensions = {"base": "length", "lift": "length"}  # units that a mechanism file may give

    def residual(self, body_i, body_j, time):
        d = body_j.point(self.point_j) - body_i.point(self.point_i)
        angle = jet.atan2(d[1], d[0]) - body_i.angle
        return jet.sqrt(d.dot(d)) - self.base - self.lift * jet.cos(self.lobes * angle)


def main() -> None:
    mechanism = jn.load(Path(__file__).parent / "own_joint" / "cam.yaml")
    order = 6
    motion = jn.solve(mechanism, order=order)
    lift = motion.dataset["follower"].sel(component="y")

    # the cam turns at `speed` under a follower straight above it, so the lift is known in closed form
    base, rise, lobes, speed = (mechanism.parameter_values[name] for name in ("base", "rise", "lobes", "speed"))
    angle = lobes * (np.pi / 2 - speed * motion.time)
    print("derivative   largest value        largest error against the closed form, normalized")
    for k in range(order + 1):
        exact = (base if k == 0 else 0.0) + rise * (lobes * speed) ** k * np.cos(angle - k * np.pi / 2)
        largest = np.max(np.abs(exact))
        error = np.max(np.abs(lift.sel(derivative=k).values - exact)) / largest
        print(f"{k:>10}   {largest:<12.6g} m/s^{k}    {error:.1e}")
        if error > 1e-12:
            raise SystemExit(f"derivative {k} of the lift is wrong by {error:.1e}")


if __name__ == "__main__":
    main()
