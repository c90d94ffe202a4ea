"""Suspensions that others published with their hard points and the numbers that they computed from them."""

import numpy as np
import pytest

import jounce as jn

# Suspension Explorer (github.com/suspension-explorer/suspension-explorer-core, tests/data/geometry.yaml, sweep.yaml and
# e2e/output.csv, 2026): a double wishbone; the wheel travels from -40 to 120 mm while its rack moves from -40 to 40 mm.
# Its program solves the distances between points by least squares to about 1e-6 mm, so the toe to 2e-6 deg.
POINTS = """
space: spatial
parameters: {height: 0 mm, bump: 0 mm, rack: 0 mm, steering: 0 mm, duration: 1 s}
bodies: {lower: {position: [0, 0, 0]}, upper: {position: [0, 0, 0]}, upright: {position: [0, 0, 0]}, bar: {position:
    [0, 0, 0]}}
joints:
  lower_axis: {type: revolute, bodies: [ground, lower], points: [[250 mm, 400 mm, 200 mm], [250 mm, 400 mm, 200 mm]],
      axes: [[500, -50, 0], [500, -50, 0]]}
  upper_axis: {type: revolute, bodies: [ground, upper], points: [[225 mm, 350 mm, 500 mm], [225 mm, 350 mm, 500 mm]],
      axes: [[1, 0, 0], [1, 0, 0]]}
  lower_ball: {type: spherical, bodies: [lower, upright], points: [[0, 900 mm, 200 mm], [0, 900 mm, 200 mm]]}
  upper_ball: {type: spherical, bodies: [upper, upright], points: [[-25 mm, 750 mm, 500 mm], [-25 mm, 750 mm, 500 mm]]}
  housing: {type: prismatic, bodies: [ground, bar], points: [[50 mm, 0, 250 mm], [50 mm, 0, 250 mm]], axes: [[0, 1,
      0], [0, 1, 0]], normals: [[1, 0, 0], [1, 0, 0]]}
  tie_rod:
    type: double_spherical
    bodies: [bar, upright]
    points: [[50 mm, 200 mm, 250 mm], [150 mm, 800 mm, 275 mm]]
    length: sqrt(0.1**2 + 0.6**2 + 0.025**2)
drivers:
  wheel: {type: slide, bodies: [ground, upright], points: [[0, 0, 313.426 mm], [-20 mm, 950 mm, 313.426 mm]], vector:
      [0, 0, 1], motion: height + bump*t/duration}
  steering: {type: slide, bodies: [ground, bar], points: [[0, 0, 0], [0, 0, 0]], vector: [0, 1, 0], motion: rack +
      steering*t/duration}
outputs:
  center: {body: upright, point: [-20 mm, 950 mm, 313.426 mm]}
  bar: {body: bar, point: [0, 0, 0]}
  toe: {bodies: [ground, upright], quantity: angle, axis: [0, 0, -1], vectors: [[0, 1, 0], [0, 150, 5]]}
  camber: {bodies: [ground, upright], quantity: angle, axis: [-1, 0, 0], vectors: [[0, 1, 0], [0, 150, 5]]}
  caster: {bodies: [ground, upright, upright], quantity: projected_angle, normal: [0, -1, 0], vector: [0, 0, 1],
      points: [[0, 900 mm, 200 mm], [-25 mm, 750 mm, 500 mm]]}
  kingpin: {bodies: [ground, upright, upright], quantity: projected_angle, normal: [1, 0, 0], vector: [0, 0, 1],
      points: [[0, 900 mm, 200 mm], [-25 mm, 750 mm, 500 mm]]}
"""
# share of the sweep; camber, caster, kingpin inclination and toe, deg
PUBLISHED = {
    -1.0: (-2.3292600759179005, 4.731133895486483, 26.63398130366389, 14.232369285129703),
    -0.5: (-2.2883267889551306, 4.763609403984007, 26.565115771610454, 7.0141984346625055),
    -0.25: (-2.1682282494272553, 4.75678826948298, 26.578427553107087, 3.650434724706233),
    0.0: (-1.998564995017115, 4.734042486282273, 26.621600255359283, 0.39958588324431693),
    0.25: (-1.786109966457867, 4.694910706028385, 26.693938252706793, -2.7651103322304293),
    0.5: (-1.5348435955852011, 4.638854575978666, 26.7953393941029, -5.865205287107846),
    1.0: (-0.9219445415811739, 4.4732549906991, 27.087909275011352, -11.94181439216663),
}
# at the share 0: deg/mm by the height of the wheel, the rack held, and by the rack, the wheel held; mm/mm
BY_HEIGHT = {
    "toe": 0.005817352187262235,
    "camber": -0.0032743219565330335,
    "caster": -0.0014845566991644745,
    "kingpin": 0.002781883208804564,
    "center_x": 0.00535538347675139,
}
BY_RACK = {"toe": -0.3320166443090963, "camber": 0.025740919286019546}


@pytest.fixture(scope="module")
def corner(tmp_path_factory):
    """Return the suspension."""
    path = tmp_path_factory.mktemp("corner") / "corner.yaml"
    path.write_text(POINTS)
    return jn.load(path)


@pytest.mark.slow
def test_toe_and_camber_over_travel_and_steering_are_those_of_suspension_explorer(corner):
    swept = corner.with_parameters(height=0.04, bump=0.08, steering=0.04)
    motion = jn.solve(swept, list(PUBLISHED), order=0)
    for k, name in enumerate(("camber", "caster", "kingpin", "toe")):
        found, published = np.rad2deg(motion.outputs[name][:, 0]), [row[k] for row in PUBLISHED.values()]
        np.testing.assert_allclose(found, published, rtol=0, atol=3e-6)


@pytest.mark.slow
@pytest.mark.parametrize("given, by, published", [("bump", "center_z", BY_HEIGHT), ("steering", "bar_y", BY_RACK)])
def test_bump_steer_is_that_of_suspension_explorer(corner, given, by, published):
    motion = jn.solve(corner.with_parameters(height=0.04, **{given: 0.1}), [0.0], order=1)
    for name, expected in published.items():
        found = float(motion.evaluate(jn.outputs.DerivativeOutput(name, by)).values[0, 0])
        found = found if name == "center_x" else np.rad2deg(found) / 1e3
        np.testing.assert_allclose(found, expected, rtol=1e-6)
