"""A force of one's own: the drag of air, in Python and from a mechanism file, against its closed form.

Run it as a script, or let a mechanism file use the force:

    jounce simulate examples/own_force/drop.yaml --import examples/own_force.py
"""

from pathlib import Path

import numpy as np

import jounce as jn
from jounce import jet


class AirDrag(jn.forces.AbstractForce, type="air_drag"):
    """Drag ``-c |v| v`` at a point of a body that moves through air at rest, in the plane or in space."""

    point: jn.joints.Vector  # m, in the frame of the body
    coefficient: jn.joints.Scalar  # kg/m: half the density of air times area times drag coefficient

    body_count = 1

    def displacement(self, body, time):
        return body.point(self.point)

    def force(self, displacement, velocity, time):
        return -self.coefficient * jet.sqrt(velocity.dot(velocity)) * velocity


def falling(time, gravity, ratio, speed):
    """Return the height and its derivatives of a fall with ``v' = g - ratio v^2`` from a speed, closed form."""
    last = np.sqrt(gravity / ratio)  # the speed that it approaches
    phase = np.arctanh(speed / last) + gravity * time / last
    v = last * np.tanh(phase)
    height = -np.log(np.cosh(phase) / np.cosh(phase[0])) / ratio
    first = gravity - ratio * v**2
    second = -2 * ratio * v * first
    third = -2 * ratio * (first**2 + v * second)
    return [height, -v, -first, -second, -third]


def main() -> None:
    mechanism = jn.load(Path(__file__).parent / "own_force" / "drop.yaml")
    simulation = jn.simulate(mechanism, order=4)
    height = simulation.dataset["ball"].sel(component="y")

    mass, drag, speed = (mechanism.parameter_values[name] for name in ("mass", "drag", "speed"))
    exact = falling(simulation.time - simulation.time[0], 9.81, drag / mass, speed)
    print("derivative   largest value        largest error against the closed form, normalized")
    for k, expected in enumerate(exact):
        largest = np.max(np.abs(expected))
        error = np.max(np.abs(height.sel(derivative=k).values - expected)) / largest
        print(f"{k:>10}   {largest:<12.6g} m/s^{k}    {error:.1e}")
        if error > 1e-12:
            raise SystemExit(f"derivative {k} of the height is wrong by {error:.1e}")


if __name__ == "__main__":
    main()
