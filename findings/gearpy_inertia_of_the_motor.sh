#!/usr/bin/env bash
# gearpy 1.3.1: inertia in front of a gear counts by its ratio, not by the square of the ratio.
#
# gearpy simulates a motor that drives gears and a load. A motor of 1 kg m^2 turns ten times as fast as what it drives
# by a ratio of 10; one would expect it to count as 100 kg m^2 at the output, so that with a load of 100 kg m^2 a
# torque of 20 N m at the motor gives 200/(100 + 100) = 1 rad/s^2. It counts as 10 kg m^2: the load starts with 1.818
# rad/s^2, and gains more energy than the motor gives. There is no message. Output seen: "1.818 rad/s^2 at the output,
# 1 by the kinetic energy; 18.18 at the motor". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "gearpy==1.3.1"
MPLBACKEND=Agg "$folder/venv/bin/python" -W ignore - <<'PY'
import importlib.metadata

from gearpy import units
from gearpy.mechanical_objects import DCMotor, SpurGear
from gearpy.powertrain import Powertrain
from gearpy.solver import Solver
from gearpy.utils import add_fixed_joint, add_gear_mating


def inertia(value):
    return units.InertiaMoment(value, "kgm^2")


def start(of_motor, of_load):
    motor = DCMotor("motor", inertia(of_motor), units.AngularSpeed(1000, "rad/s"), units.Torque(20, "Nm"))
    pinion, wheel = SpurGear("pinion", 10, inertia(1e-9)), SpurGear("wheel", 100, inertia(of_load))
    add_fixed_joint(motor, pinion)
    add_gear_mating(pinion, wheel, 1)
    wheel.external_torque = lambda time, angular_position, angular_speed: units.Torque(0, "Nm")
    wheel.angular_position, wheel.angular_speed = units.AngularPosition(0, "rad"), units.AngularSpeed(0, "rad/s")
    Solver(Powertrain(motor)).run(units.TimeInterval(0.001, "sec"), units.TimeInterval(0.002, "sec"))
    return [body.time_variables["angular acceleration"][0].to("rad/s^2").value for body in (motor, wheel)]


print("gearpy", importlib.metadata.version("gearpy"))
fast, slow = start(1.0, 100.0)
print(f"{slow:.4g} rad/s^2 at the output, {200 / (100 + 10**2 * 1):.4g} by the kinetic energy; {fast:.4g} at the motor")
assert abs(fast - 10 * slow) < 1e-9, "the ratio is not 10"
assert abs(slow - 200 / (100 + 10 * 1)) < 1e-6, "the inertia of the motor counts otherwise now"
alone = start(1e-9, 100.0)[1]
assert abs(alone - 2) < 1e-6, "the load alone is not right"
PY
