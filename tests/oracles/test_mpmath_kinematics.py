"""The references of the bank against closed forms of the mechanisms, in thirty digits, to order 10."""

import json

import numpy as np
import pytest
from mpmath import mp, mpf

from tests.oracles.mp_joints import cross, dot
from tests.oracles.mp_series import Series, atan2, cos, sin, sin_cos, sqrt
from tests.oracles.mpmath_kinematics import solve_file
from tests.problems.make_references import make
from tests.problems.mechanisms import EXAMPLES, MECHANISMS, REFERENCES, example, reference

ORDER, DIGITS = 10, 45


def cm(text):
    return mpf(text) / 100


def deg(text):
    return mpf(text) * mp.pi / 180


def acos(x):
    return atan2(sqrt(1 - x * x), x)


def wave(t, tau=2):
    """Return sin(2 pi t / tau)."""
    return sin(t * (2 * mp.pi / tau))


def crank(t, start="30", delta="60"):
    return deg(start) + deg(delta) * wave(t)


def four_bar(t):
    AD, AB, BC, CD = cm("13.21"), cm("4.00"), cm("14.23"), cm("20.31")
    s, c = sin_cos(crank(t))
    x, y = AB * c - AD, AB * s
    f = sqrt(x * x + y * y)
    psi = atan2(y, x, mp.pi) - acos((f * f + (CD**2 - BC**2)) / (2 * CD * f))
    return {"psi": psi, "C": [AD + CD * cos(psi), CD * sin(psi)]}


def inverted_slider_crank(t):
    EF, FG = cm("7.00"), cm("2.00")
    d = cm("7.00") + cm("1.00") * wave(t)
    psi = acos((d * d - (EF**2 + FG**2)) / (2 * EF * FG))
    x, y = EF + FG * cos(psi), FG * sin(psi)
    return {"psi": psi, "guide_angle": atan2(y, x), "G": [x, y]}


def slider_crank(t):
    r, length, e = cm("5"), cm("15"), cm("1")
    theta = deg("30") + 2 * mp.pi * t + mpf("0.3") * wave(t, 1)
    s, c = sin_cos(theta)
    rise = e - r * s
    run = sqrt(length**2 - rise * rise)
    return {
        "stroke": [r * c + run, 0 * t + e],
        "rod_angle": atan2(rise, run),
        "crank_angle": theta,
        "middle": [r * c + run / 2, r * s + rise / 2],
    }


def hooke_joint(t):
    theta, beta = 2 * mp.pi * t + mpf("0.3") * wave(t), deg("25")
    s, c = sin_cos(theta)
    return {"theta": theta, "psi": atan2(s, c * mp.cos(beta), theta.c[0])}


def meeting(first, radius1, second, radius2):
    """Return the point at given distances of two points, on the left of the way from the first to the second."""
    x, y = second[0] - first[0], second[1] - first[1]
    square = x * x + y * y
    along = (square + (radius1**2 - radius2**2)) / (2 * square)
    across = sqrt(radius1**2 / square - along * along)
    return [first[0] + along * x - across * y, first[1] + along * y + across * x]


def ray(theta, length, x=0):
    """Return the point at a length and angle from (x, 0)."""
    s, c = sin_cos(theta)
    return [x + length * c, length * s]


def gear_pair(t):
    theta = mp.pi * t + mpf("0.25") * wave(t)
    gear2 = deg("40") - 2 * theta
    B, E = ray(theta, cm(6)), ray(gear2, cm(5), cm(30))
    C = meeting(B, cm(25), E, cm(22))
    rods = [atan2(C[1] - P[1], C[0] - P[0]) for P in (B, E)]
    return {"C": C, "gear2_angle": gear2, "rod1_angle": rods[0], "rod2_angle": rods[1]}


def six_bar_watt(t):
    theta = deg("60") + mp.pi * t + mpf("0.2") * wave(t)
    B, D, G = ray(theta, cm(10)), ray(0 * t, 0, cm(40)), ray(0 * t, 0, cm(85))
    C = meeting(B, cm(35), D, cm(25))
    rocker = atan2(C[1], C[0] - cm(40))
    F = meeting(ray(rocker + deg("-50"), cm(20), cm(40)), cm(40), G, cm(25))
    x, y = [(C[k] - B[k]) / cm(35) for k in range(2)]
    point = [B[0] + cm(15) * x - cm(10) * y, B[1] + cm(15) * y + cm(10) * x]
    return {"rocker_angle": rocker, "output_angle": atan2(F[1], F[0] - cm(85)), "F": F, "coupler_point": point}


def rccc(t):
    """Angular velocity from the spherical four-bar that the directions of the axes make."""
    a1, a2, a3, a4 = (deg(x) for x in ("30", "70", "60", "80"))
    theta = mp.pi * t + mpf("0.2") * wave(t)
    n2 = [mp.sin(a1) * sin(theta), -mp.sin(a1) * cos(theta), 0 * t + mp.cos(a1)]
    n4 = [0 * t, 0 * t - mp.sin(a4), 0 * t + mp.cos(a4)]
    k, side = dot(n2, n4), cross(n2, n4)
    square = 1 - k * k
    p, q = (mp.cos(a2) - mp.cos(a3) * k) / square, (mp.cos(a3) - mp.cos(a2) * k) / square
    r = sqrt((1 - p * p - q * q - 2 * p * q * k) / square)
    n3 = [p * x + q * y + r * z for x, y, z in zip(n2, n4, side, strict=True)]
    rate = dot([Series(x.c[:-1]) for x in cross(n4, n3)], [x.differentiate() for x in n3]) / mp.sin(a3) ** 2
    return {"theta": theta, "output_spin": [0 * rate, -mp.sin(a3) * rate, mp.cos(a3) * rate]}


def epicyclic(t):
    sun = mp.pi * t + mpf("0.4") * wave(t)
    half = sin(t * (mp.pi / 2))
    carrier = mpf("0.5") * half * half
    planet = carrier - mpf(24) / 18 * (sun - carrier) + deg("10")
    ring = carrier + mpf(18) / 60 * (planet - carrier) + deg("2")
    arm, radius = mpf("0.042"), mpf("0.018")
    tooth = [arm * f(carrier) + radius * f(planet) for f in (cos, sin)]
    return {"ring_angle": ring, "planet_angle": planet, "tooth": tooth}


def scotch_yoke(t):
    theta, r = mp.pi * t + mpf("0.5") * wave(t), mpf("0.04")
    return {"yoke": [r * cos(theta) - mpf("0.25") * r * sin(theta), 0 * t]}


def rack_pinion(t):
    f = mpf("0.24") + mpf("0.06") * wave(t)
    x = sqrt(f * f - mpf("0.06") ** 2) - mpf("0.2")
    return {"rack": [x, 0 * t + mpf("0.05")], "pinion_angle": (mpf("0.02") - x) / mpf("0.05")}


def quick_return(t):
    s, c = sin_cos(mp.pi * t + mpf("0.1") * wave(t))
    x, y = mpf("0.08") * c, mpf("0.2") + mpf("0.08") * s
    arm, pin = atan2(y, x), sqrt(x * x + y * y)
    rise = mpf("0.33") - (mpf("0.5") * sin(arm) - mpf("0.2"))
    ram = mpf("0.5") * cos(arm) + sqrt(mpf("0.15") ** 2 - rise * rise)
    return {"arm_angle": arm, "pin_in_slot": pin, "ram": [ram, 0 * t + mpf("0.33")]}


def rolling_disc(t):
    table, R = deg("10") * wave(t), mpf("0.04")
    x = mpf("0.10") + mpf("0.05") * wave(t) - mpf("0.01") * cos(t * (2 * mp.pi))
    disc = table - x / R
    center = [x * cos(table) - R * sin(table), x * sin(table) + R * cos(table)]
    pin = [center[0] + mpf("0.03") * cos(disc), center[1] + mpf("0.03") * sin(disc)]
    rise = mpf("0.25") - pin[1]
    ram = pin[0] + sqrt(mpf("0.3") ** 2 - rise * rise)
    return {"disc_angle": disc, "pin": pin, "ram": [ram, 0 * t + mpf("0.25")]}


def rssr(t):
    OA, AB, CD, OD, BC = (cm(x) for x in ("20.43", "4.00", "10.00", "19.97", "30.42"))
    s, c = sin_cos(crank(t))
    depth, P, Q = AB * c - OD, 0 * t + 2 * OA * CD, 2 * AB * CD * s
    k = depth * depth + AB**2 * s * s + (OA**2 + CD**2 - BC**2)
    psi = atan2(P, Q) - acos(k / sqrt(P * P + Q * Q))
    return {"psi": psi, "C": [CD * sin(psi), 0 * t + OD, CD * cos(psi)]}


def rspu(t):
    OA, AB, OD = cm("20.43"), cm("4.00"), cm("19.97")
    d = cm("28.85") + cm("1.50") * wave(t)
    theta = acos(((OA**2 + AB**2 + OD**2) - d * d) / (2 * AB * OD))
    return {"theta": theta, "d": d, "B": [0 * t + OA, AB * cos(theta), AB * sin(theta)]}


def spatial_slider_crank(t):
    theta = deg("40") + mp.pi * t + mpf("0.2") * wave(t)
    x, y = cm(5) * cos(theta), cm(3) - cm(5) * sin(theta)
    return {"theta": theta, "stroke": [x + sqrt(cm(20) ** 2 - cm(4) ** 2 - y * y), 0 * t + cm(3), 0 * t + cm(4)]}


def screw_press(t):
    nut = 3 * mp.pi * t - mpf("2.5") * wave(t)
    return {"nut_angle": nut, "spindle": [0 * t, 0 * t, cm(5) - mpf("0.008") / (2 * mp.pi) * nut]}


def swash_plate(t):
    theta, R, slope = 2 * mp.pi * t + mpf("0.5") * wave(t), cm(6), -mp.tan(deg("20"))
    x, y = R * mp.cos(deg("120")), R * mp.sin(deg("120"))
    return {
        "piston1": [0 * t + R, 0 * t, slope * R * cos(theta)],
        "piston2": [0 * t + x, 0 * t + y, slope * (x * cos(theta) + y * sin(theta))],
        "theta": theta,
    }


CLOSED_FORMS = {
    "four_bar": four_bar,
    "inverted_slider_crank_slide": inverted_slider_crank,
    "inverted_slider_crank_distance": inverted_slider_crank,
    "slider_crank": slider_crank,
    "hooke_joint": hooke_joint,
    "gear_pair": gear_pair,
    "six_bar_watt": six_bar_watt,
    "rccc": rccc,
    "epicyclic": epicyclic,
    "scotch_yoke": scotch_yoke,
    "rack_pinion": rack_pinion,
    "quick_return": quick_return,
    "rolling_disc": rolling_disc,
    "rssr": rssr,
    "rsur": rssr,
    "rspu_distance": rspu,
    "rspu_slide": rspu,
    "spatial_slider_crank": spatial_slider_crank,
    "screw_press": screw_press,
    "swash_plate": swash_plate,
}


@pytest.mark.parametrize("name", CLOSED_FORMS)
def test_reference_agrees_with_closed_form_to_thirty_digits(name):
    stored = json.loads((REFERENCES / f"{name}.json").read_text(encoding="utf-8"))
    with mp.workdps(DIGITS):
        for n, instant in enumerate(stored["time"]):
            t = Series([mpf(float(instant)), mpf(1), *[mpf(0)] * ORDER])
            for output, closed in CLOSED_FORMS[name](t).items():
                for component, expected in enumerate(closed if isinstance(closed, list) else [closed]):
                    for k, d in enumerate(expected.derivatives()[: ORDER + 1]):
                        found = mpf(stored["outputs"][output][n][component][k])
                        assert abs(found - d) <= mpf("1e-29") * abs(d) + mpf("1e-30"), (output, instant, component, k)


def test_platform_reference_is_a_rigid_body():
    """Two of its points: relative velocity is angular velocity cross relative position, and so on in acceleration."""
    _, outputs = reference("stewart_platform")
    d, w = outputs["corner"] - outputs["center"], outputs["spin"]
    np.testing.assert_allclose(np.linalg.norm(d[0], axis=-1), np.hypot(0.2, 0.05), rtol=1e-14)
    np.testing.assert_allclose(d[1], np.cross(w[0], d[0]), rtol=0, atol=1e-14)
    np.testing.assert_allclose(d[2], np.cross(w[1], d[0]) + np.cross(w[0], d[1]), rtol=0, atol=1e-13)
    sizes = [np.linalg.norm(outputs[name][0], axis=-1) for name in ("spin", "body_spin")]
    np.testing.assert_allclose(*sizes, rtol=1e-14)


def test_every_reference_has_its_file():
    assert set(MECHANISMS) <= {path.stem for path in EXAMPLES.glob("*.yaml")}
    assert len(MECHANISMS) >= 14


@pytest.mark.parametrize("name", MECHANISMS)
def test_references_move_up_to_jounce(name):
    """Every mechanism has an output with jerk and jounce, and numbers of at least 25 digits."""
    stored = json.loads((REFERENCES / f"{name}.json").read_text(encoding="utf-8"))
    time, outputs = reference(name)
    assert time.size == 11
    assert (np.diff(time) > 0).all()
    assert any(np.abs(table[3]).max() > 0 and np.abs(table[4]).max() > 0 for table in outputs.values())
    assert all(len(table) == ORDER + 1 for table in outputs.values())
    texts = [x for v in stored["outputs"].values() for instant in v for component in instant for x in component]
    digits = [len(x.lstrip("-").split("e")[0].replace(".", "").lstrip("0")) for x in texts if float(x)]
    assert np.median(digits) >= 29


def test_solver_makes_the_four_bar_reference_again():
    """Positions from the file to jounce, at three instants, in forty digits."""
    times, found = solve_file(example("four_bar"), order=4, digits=40, count=3)
    with mp.workdps(DIGITS):
        for n, instant in enumerate(times):
            expected = four_bar(Series([mpf(instant), mpf(1), *[mpf(0)] * 3]))["psi"].derivatives()
            for got, d in zip(found["psi"][n][0], expected, strict=True):
                assert abs(got - d) < mpf("1e-32") * (1 + abs(d))


# in the plane, where it takes no time, and the platform, which has no closed form
MADE_AGAIN = [
    *(name for name in MECHANISMS if "space: planar" in example(name).read_text(encoding="utf-8")),
    "stewart_platform",
]


@pytest.mark.slow
@pytest.mark.parametrize("name", MADE_AGAIN)
def test_references_are_made_again(name):
    stored = json.loads((REFERENCES / f"{name}.json").read_text(encoding="utf-8"))
    again = make(example(name))
    assert again["time"] == stored["time"]
    for output, instants in again["outputs"].items():
        np.testing.assert_allclose(
            np.array(instants, dtype=float), np.array(stored["outputs"][output], dtype=float), rtol=1e-15, atol=1e-25
        )
