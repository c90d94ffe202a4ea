#!/usr/bin/env bash
# InterpolatePy 3.3.2: the velocity of a CubicSplineWithAcceleration1 jumps at one of its points, here by 3 /s.
#
# CubicSplineWithAcceleration1 and CubicSplineWithAcceleration2 are splines through points with given velocities and
# accelerations at both ends, the first by two additional points, the second by a quartic at each end. One would expect
# what a spline is, continuous positions, velocities and accelerations. The first has continuous positions and
# accelerations, and its velocity jumps at the third point from the end of those that are given, for even and uneven
# instants alike: a drive that follows it gets an impulse. The second has no jumps. There is no message. Output seen for
# 0 1 3 2 4 at 0 1 2 3 4 s: "jumps of the velocity at 1 2 3 s: 0 -3 0, of the acceleration 0 0 0; of the other class 0 0
# 0 and 0 0 0". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "interpolatepy==3.3.2" numpy scipy
"$folder/venv/bin/python" -W ignore - <<'PY'
import importlib.metadata

import interpolatepy

POINTS = [0.0, 1.0, 3.0, 2.0, 4.0]
ENDS = {"v0": 1.0, "vn": -1.0, "a0": 0.5, "an": 0.2}
NEAR = 1e-9


def value(spline, name, time):
    return float(getattr(spline, name)(time))


def jumps(kind, name, instants):
    if kind is interpolatepy.CubicSplineWithAcceleration1:
        spline = kind(instants, POINTS, **ENDS)
    else:
        spline = kind(instants, POINTS, interpolatepy.SplineParameters(**ENDS))
    for time, point in zip(instants, POINTS, strict=True):
        assert abs(value(spline, "evaluate", time) - point) < 1e-9, "the spline does not go through its points"
    assert abs(value(spline, "evaluate_velocity", instants[0]) - 1.0) < 1e-9, "the first velocity changed"
    assert abs(value(spline, "evaluate_acceleration", instants[-1]) - 0.2) < 1e-9, "the last acceleration changed"
    return [
        round(value(spline, name, time + NEAR) - value(spline, name, time - NEAR), 5) + 0.0 for time in instants[1:-1]
    ]


def words(values):
    return " ".join(f"{x:g}" for x in values)


EVEN, UNEVEN = [0.0, 1.0, 2.0, 3.0, 4.0], [0.0, 1.0, 2.5, 3.0, 5.0]
first, second = interpolatepy.CubicSplineWithAcceleration1, interpolatepy.CubicSplineWithAcceleration2
seen = [jumps(kind, f"evaluate_{name}", EVEN) for kind in (first, second) for name in ("velocity", "acceleration")]
print("interpolatepy", importlib.metadata.version("interpolatepy"))
print(f"jumps of the velocity at 1 2 3 s: {words(seen[0])}, of the acceleration {words(seen[1])};", end=" ")
print(f"of the other class {words(seen[2])} and {words(seen[3])}")
assert seen[1] == seen[2] == seen[3] == [0.0, 0.0, 0.0], "other derivatives jump now"
assert seen[0] == [0.0, -3.0, 0.0], "the velocity is continuous now"
assert abs(jumps(first, "evaluate_velocity", UNEVEN)[1]) > 1, "the velocity is continuous now for uneven instants"
PY
