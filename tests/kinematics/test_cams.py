"""Plate cams from laws, against eccentric discs with known laws, and by following the profile."""

import math
import warnings

import numpy as np
import pytest

import jounce as jn

DISC, OFF, ROLLER, COUNT = 0.03, 0.01, 0.008, 181


def disc_law(follower, sense=1.0):
    """The law of a follower on a disc of 30 mm with its center 10 mm off the axis, toward y at angle zero."""

    def center(t):
        return -OFF * np.sin(sense * t), OFF * np.cos(sense * t)

    import jax.numpy as jnp

    def coordinate(t):
        x, y = -OFF * jnp.sin(sense * t), OFF * jnp.cos(sense * t)
        reach = DISC + follower.radius
        if isinstance(follower, jn.cams.TranslatingFollower):
            return y + DISC if follower.is_flat else y + jnp.sqrt(reach**2 - (follower.offset - x) ** 2)
        away = jnp.hypot(follower.center_distance - x, y)
        above = jnp.arctan2(y, follower.center_distance - x)
        if follower.is_flat:
            return above + jnp.arcsin((DISC + follower.face_offset) / away)
        return above + jnp.arccos((follower.arm**2 + away**2 - reach**2) / (2 * follower.arm * away))

    start = follower.start(DISC - OFF)
    return jn.laws.FunctionMotion(lambda t: coordinate(t) - start), center


FOLLOWERS = {
    "flat": jn.cams.TranslatingFollower("flat_face"),
    "roller": jn.cams.TranslatingFollower("roller", radius=ROLLER),
    "offset roller": jn.cams.TranslatingFollower("roller", radius=ROLLER, offset=0.006),
    "edge": jn.cams.TranslatingFollower("knife_edge", offset=-0.004),
    "rocker with a roller": jn.cams.OscillatingFollower("roller", center_distance=0.08, arm=0.07, radius=ROLLER),
    "rocker with a face": jn.cams.OscillatingFollower("flat_face", center_distance=0.08, face_offset=0.003),
}


QUICK = {("roller", "counterclockwise"), ("rocker with a face", "clockwise")}
DISCS = [
    pytest.param(name, sense, marks=() if (name, sense) in QUICK else pytest.mark.slow)
    for name in FOLLOWERS
    for sense in ("counterclockwise", "clockwise")
]


@pytest.mark.slow
@pytest.mark.parametrize("name, sense", DISCS)
def test_an_eccentric_disc_comes_back_from_its_law(name, sense):
    follower = FOLLOWERS[name]
    turn = 1.0 if sense == "counterclockwise" else -1.0
    law, _ = disc_law(follower, turn)
    cam = jn.cams.plate_cam(law, follower, DISC - OFF, sense=sense, count=COUNT)
    found = cam.table
    x, y = found.profile
    np.testing.assert_allclose(np.hypot(x, y - OFF), DISC, rtol=1e-12)
    np.testing.assert_allclose(found.curvature, 1 / DISC, rtol=1e-11)
    if follower.shape == "roller":
        np.testing.assert_allclose(1 / found.pitch_curvature, DISC + ROLLER, rtol=1e-11)
    np.testing.assert_allclose(cam.followed_lift, found.lift, atol=1e-12)
    assert cam.undercuts == ()
    assert cam.least_radius.value == pytest.approx(DISC, rel=1e-11)
    assert cam.least_concave_radius is None
    normal = (x / DISC, (y - OFF) / DISC)  # away from the disc
    for k in range(0, COUNT, 30):  # the normal in the ground, and the way that the follower goes
        c, s = math.cos(turn * cam.angle[k]), math.sin(turn * cam.angle[k])
        n = (c * normal[0][k] - s * normal[1][k], s * normal[0][k] + c * normal[1][k])
        place = found.profile if follower.is_flat else found.pitch
        p = (c * place[0][k] - s * place[1][k], s * place[0][k] + c * place[1][k])
        v = (0.0, 1.0) if not follower.turning else (p[1], follower.center_distance - p[0])
        angle = math.atan2(v[0] * n[1] - v[1] * n[0], v[0] * n[0] + v[1] * n[1])
        assert found.pressure_angle[k] == pytest.approx(turn * angle, abs=1e-12)


@pytest.mark.slow
def test_handbook_formulas_of_rollers_and_faces():
    """tan(pressure angle) = (s' - e)/(y0 + s) of an offset roller; R = base + s + s'' and contact s' under a face."""
    law = jn.laws.SegmentedMotion([
        jn.laws.Segment("cycloidal", 2.0, to=0.015), jn.laws.Segment("dwell", 0.6),
        jn.laws.Segment("polynomial_4_5_6_7", 2.2, to=0.0), jn.laws.Segment("dwell", 2 * math.pi - 4.8),
    ])  # fmt: skip
    base, offset = 0.03, 0.007
    angle = np.linspace(0.05, 6.2, 41)
    s, v, a = (np.asarray(x) for x in law(jn.Jet.variable(angle, 2)).derivatives())
    roller = jn.cams.plate_cam(law, jn.cams.TranslatingFollower("roller", ROLLER, offset), base, count=COUNT)
    start = math.sqrt((base + ROLLER) ** 2 - offset**2)
    pressure = np.tan(roller.at(angle).pressure_angle)
    np.testing.assert_allclose(pressure, (v - offset) / (start + s), rtol=1e-12, atol=1e-14)
    radial = jn.cams.plate_cam(law, jn.cams.TranslatingFollower("roller", ROLLER), base, count=COUNT)
    r = base + ROLLER + s
    bend = (r * r + 2 * v * v - r * a) / (r * r + v * v) ** 1.5  # of a polar curve
    np.testing.assert_allclose(radial.at(angle).pitch_curvature, bend, rtol=1e-12)
    np.testing.assert_allclose(1 / radial.at(angle).curvature, 1 / bend - ROLLER, rtol=1e-10)
    flat = jn.cams.plate_cam(law, jn.cams.TranslatingFollower("flat_face"), base, count=COUNT)
    np.testing.assert_allclose(1 / flat.at(angle).curvature, base + s + a, rtol=1e-11)
    np.testing.assert_allclose(flat.at(angle).contact, v, atol=1e-15)
    low, high = flat.face
    assert high.value == pytest.approx(2 * 0.015 / 2.0, rel=1e-12)  # of a cycloid, in the middle of the rise
    assert high.angle == pytest.approx(1.0, abs=1e-6)
    assert low.value == pytest.approx(-2.1875 * 0.015 / 2.2, rel=1e-12)
    assert flat.continuity.smoothness == 2
    mirrored = jn.cams.plate_cam(
        law, jn.cams.TranslatingFollower("roller", ROLLER, -offset), base, sense="clockwise", count=COUNT
    )
    np.testing.assert_allclose(mirrored.table.profile * [[-1], [1]], roller.table.profile, atol=1e-15)


@pytest.mark.slow
def test_undercut_is_reported_with_the_angle_and_what_is_lost():
    law = jn.laws.SegmentedMotion([
        jn.laws.Segment("cycloidal", 0.9, to=0.02), jn.laws.Segment("cycloidal", 0.9, to=0.0),
        jn.laws.Segment("dwell", 2 * math.pi - 1.8)])  # fmt: skip
    for follower in (jn.cams.TranslatingFollower("flat_face"), jn.cams.TranslatingFollower("roller", 0.03)):
        cam = jn.cams.plate_cam(law, follower, 0.025, count=721)
        assert cam.is_undercut
        assert len(cam.undercuts) == (1 if follower.is_flat else 2)  # the roller has a part on each flank
        first, last = cam.undercuts[0], cam.undercuts[-1]
        assert 0 < first.start < first.angle < first.stop < 1.8
        assert first.start + last.stop == pytest.approx(1.8, abs=0.02)  # the law is the same backwards
        assert first.lost == pytest.approx(last.lost, rel=0.1)
        assert first.lost > 1e-4
        assert cam.least_radius.value < 0
        rest = cam.angle > 3.0
        np.testing.assert_allclose(cam.followed_lift[rest], cam.table.lift[rest], atol=1e-12)
    sound = jn.cams.plate_cam(law, jn.cams.TranslatingFollower("roller", 0.005), 0.1, count=721)
    assert not sound.is_undercut
    assert sound.least_concave_radius.value > 0
    least = sound.least_radius
    around = sound.at(least.angle + np.linspace(-0.01, 0.01, 101))
    assert (1 / around.curvature[around.turned > 0]).min() >= least.value - 1e-12


@pytest.mark.slow
def test_units_do_not_matter():
    fall = jn.laws.Segment("cycloidal", 2 * math.pi - 3.0, to=0.0)
    law, large = (jn.laws.SegmentedMotion([jn.laws.Segment("cycloidal", 3.0, to=x), fall]) for x in (0.02, 20.0))
    first = jn.cams.plate_cam(law, jn.cams.TranslatingFollower("roller", 0.03), 0.02, count=361)
    second = jn.cams.plate_cam(large, jn.cams.TranslatingFollower("roller", 30.0), 20.0, count=361)
    assert len(first.undercuts) == len(second.undercuts)
    np.testing.assert_allclose(second.followed_lift, 1e3 * first.followed_lift, rtol=1e-9, atol=1e-9)


IN_DEGREES = jn.laws.SplineMotion(np.arange(0.0, 361.0, 30.0), np.zeros(13), beyond="repeat")


@pytest.mark.parametrize(
    "law, follower, options, words",
    [
        ("0.01*t", jn.cams.TranslatingFollower("flat_face"), {}, "does not close.*0.0628"),
        ("-0.03*(1 - cos(t))", jn.cams.TranslatingFollower("flat_face"), {}, "through the axis"),
        ("0", jn.cams.TranslatingFollower("roller", 0.01, offset=0.04), {}, "misses the cam"),
        ("0", jn.cams.OscillatingFollower("roller", 0.1, arm=0.2, radius=0.01), {}, "from 0.07 m to 0.13 m"),
        ("0", jn.cams.OscillatingFollower("flat_face", 0.01), {}, "more than 0.02 m"),
        ("1/t", jn.cams.TranslatingFollower("flat_face"), {}, "no finite value"),
        ("0", jn.cams.TranslatingFollower("flat_face"), {"sense": "left"}, "unknown sense"),
        ("0", jn.cams.TranslatingFollower("flat_face"), {"count": 3}, "from 16"),
        (IN_DEGREES, jn.cams.TranslatingFollower("flat_face"), {}, r"if that is in degrees, .* 'angle \[deg\]'"),
    ],
)
def test_what_is_wrong_is_named(law, follower, options, words):
    with pytest.raises(jn.JounceError, match=words):
        jn.cams.plate_cam(law, follower, 0.02, **options)


def test_followers_refuse_what_does_not_go_together():
    with pytest.raises(jn.errors.MechanismError, match="only a roller has a radius"):
        jn.cams.TranslatingFollower("flat_face", radius=0.01)
    with pytest.raises(jn.errors.TrajectoryError, match="greater than zero"):
        jn.cams.TranslatingFollower("roller")
    with pytest.raises(jn.errors.MechanismError, match="unknown shape"):
        jn.cams.TranslatingFollower("mushroom")


def test_samples_too_noisy_for_the_curvature_of_a_cam_are_named():
    angle = np.linspace(0.0, 2 * math.pi, 181)
    lift = 0.006 * (1 - np.cos(angle))  # its second derivative is 6 mm/rad^2 at most
    noise = 1e-6 * np.random.default_rng(0).standard_normal(181)
    noise[-1] = noise[0]
    follower = jn.cams.TranslatingFollower("roller", radius=ROLLER)

    def cam(values):
        return jn.cams.plate_cam(jn.laws.SplineMotion(angle, values, beyond="repeat"), follower, 0.03)

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        smooth = cam(lift)
    with pytest.warns(jn.errors.SampleWarning, match=r"'law' do not support its derivative of order [12]"):
        rough = cam(lift + noise)
    second = [np.abs(c.law(jn.jet.Jet.variable(angle, 2)).coefficients[2] * 2).max() for c in (smooth, rough)]
    assert abs(second[0] - 0.006) < 1e-6
    assert second[1] > 1.1 * second[0]  # what is read off such a law is noise


CAM = """
parameters: {{base: 30 mm, roller: 10 mm, lift: 5 mm}}
cam: {{base_radius: {base}, count: 37}}
follower: {{type: translating, shape: roller, radius: {radius}}}
law: {law}
"""


def cam_file(folder, base="base", radius="roller", law="lift*(1 - cos(t))", lifts=None):
    if lifts is not None:
        angles = np.linspace(0.0, 360.0, 37)
        rows = [f"{x},{lifts * (1 - math.cos(math.radians(x)))}" for x in angles]
        (folder / "lift.csv").write_text("\n".join(["angle [deg],lift", *rows, ""]))
        law = "{samples: lift.csv}"
    path = folder / "cam.yaml"
    path.write_text(CAM.format(base=base, radius=radius, law=law))
    return path


@pytest.mark.parametrize(
    "changes, words",
    [
        ({"law": "5*(1 - cos(t))"}, r"cam.yaml, line 5, law: goes to 10 m, 500 times the other lengths: 10 mm\?"),
        ({"law": "1*(1 - cos(t))"}, r"law: goes to 2 m, 100 times"),
        ({"lifts": 4.0}, r"law: goes to 8 m, 400 times"),
        ({"base": "30"}, r"line 3, cam.base_radius: 30 m, 3000 times the other lengths: 30 mm\?"),
        ({"radius": "10"}, r"line 4, follower.radius: 10 m, 500 times the other lengths"),
    ],
)
def test_lengths_of_a_cam_that_are_likely_in_millimeters_are_reported(tmp_path, changes, words):
    """Ratios by hand: the median of the other two lengths is 20 mm, but 10 mm where the base radius is in doubt."""
    with pytest.warns(jn.errors.UnitWarning, match=words):
        jn.cams.load_cam(cam_file(tmp_path, **changes))


@pytest.mark.parametrize(
    "changes",
    [{}, {"base": "0.03", "radius": "0.01"}, {"base": "300 mm"}, {"radius": "200 mm"}, {"law": "0.02*(1 - cos(t))"},
     {"lifts": 0.005}],
)  # fmt: skip
def test_lengths_of_a_cam_as_they_are_meant_are_not_doubted(tmp_path, changes):
    jn.cams.load_cam(cam_file(tmp_path, **changes))  # warnings are errors here
