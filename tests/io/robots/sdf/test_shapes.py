"""Inertias that SDF files leave to collision shapes: numbers that Drake 1.51 gives, and identities of solids."""

import numpy as np
import pytest

import jounce as jn
from jounce.errors import RobotFileError, RobotWarning

POSED = "<pose>0.1 0.2 0.3 0.4 0.5 0.6</pose>"
CAPSULE = "<capsule><radius>0.1</radius><length>0.3</length></capsule>"
CYLINDER = "<cylinder><radius>0.1</radius><length>0.25</length></cylinder>"
BOX = "<box><size>0.1 0.2 0.3</size></box>"

MASS_A, CENTER_A = 36.44153708526133, [0.0027664477687, 0.1825002457934, 0.4547738214214]
TENSOR_A = [
    [50.5743698107603, -9.111672267454, -16.238550867413],
    [-9.111672267454, 44.908785265833, -21.3903926179982],
    [-16.238550867413, -21.3903926179982, 21.1576431162809],
]
CENTER_B = [0.1, 0.0631578947368, 0.3]
TENSOR_B = [
    [0.1401512022522, -0.0009474285165, -0.0008641483272],
    [-0.0009474285165, 0.0295834435736, 0.0068671149741],
    [-0.0008641483272, 0.0068671149741, 0.1294963098528],
]


def collision(shape, inside="", name="c"):
    return f'<collision name="{name}">{inside}<geometry>{shape}</geometry></collision>'


def link(inside, shapes, name="a"):
    return f'<link name="{name}"><inertial auto="true">{inside}</inertial>{shapes}</link>'


def load(tmp_path, *parts, strict=True):
    path = tmp_path / "robot.sdf"
    path.write_text(f'<sdf version="1.11"><model name="m">\n{"".join(parts)}</model></sdf>')
    return jn.load_robot(path, strict=strict)


def only_inertia(tmp_path, inside, *shapes, **options):
    return load(tmp_path, link(inside, "".join(shapes)), **options).links["a"].inertia


def test_shapes_of_several_kinds_add_up_as_in_drake(tmp_path):
    shapes = [
        collision(BOX, POSED),
        collision(CAPSULE, '<density>300</density><pose relative_to="b">0.1 -0.2 0.3 0.4 -0.5 0.6</pose>'),
        collision("<ellipsoid><radii>0.1 0.2 0.3</radii></ellipsoid>", "<pose>-0.3 0 0 1 0 0</pose>"),
        collision(CYLINDER, "<pose>0 -0.3 0 0 1 0</pose>"),
        collision("<sphere><radius>0.12</radius></sphere>", "<pose>0 0 0.4 0 0 1</pose>"),
    ]
    others = [
        "<pose>1 2 3 0.1 0.2 0.3</pose>",
        collision(CYLINDER, POSED),
        collision(CAPSULE, "<density>300</density><pose>0.1 -0.2 0.3 0.4 -0.5 0.6</pose>"),
    ]
    joint = '<joint name="j" type="revolute"><parent>a</parent><child>b</child><axis><xyz>0 0 1</xyz></axis></joint>'
    parts = [link("<density>700</density>", "".join(shapes)), link("<mass>3</mass>", "".join(others), "b"), joint]
    robot = load(tmp_path, *parts)
    first, second = (robot.links[name].inertia for name in "ab")
    expected = (
        (first, MASS_A, CENTER_A, TENSOR_A),
        (second, 3.0, CENTER_B, TENSOR_B),
    )
    for found, mass, center, tensor in expected:
        np.testing.assert_allclose(found.mass, mass, rtol=1e-12)
        np.testing.assert_allclose(found.center_of_mass, center, rtol=1e-9)
        np.testing.assert_allclose(found.tensor, tensor, rtol=1e-9)


def test_a_cone_stands_on_its_base_around_its_middle(tmp_path):
    cone = only_inertia(
        tmp_path, "<density>3</density>", collision("<cone><radius>0.3</radius><length>0.8</length></cone>")
    )
    np.testing.assert_allclose(cone.mass, 3 * np.pi * 0.3**2 * 0.8 / 3)
    np.testing.assert_allclose(cone.center_of_mass, [0, 0, -0.2], atol=1e-15)  # a quarter above the base, at -0.4


def test_two_halves_are_the_whole(tmp_path):
    half = "<box><size>0.1 0.2 0.15</size></box>"
    halves = [collision(half, f"<pose>0 0 {z} 0 0 0</pose>", name) for z, name in ((0.075, "c"), (-0.075, "d"))]
    whole = only_inertia(tmp_path, "<density>500</density>", collision(BOX))
    both = only_inertia(tmp_path, "<density>500</density>", *halves)
    np.testing.assert_allclose(both.tensor, whole.tensor, rtol=1e-13, atol=1e-18)
    scaled = only_inertia(tmp_path, "<mass>2</mass>", *halves)
    np.testing.assert_allclose(scaled.tensor, whole.tensor * 2 / whole.mass, rtol=1e-13, atol=1e-18)


@pytest.mark.parametrize(
    "inside, says", [("", "without a density"), ("<density>5</density><pose>1 0 0 0 0 0</pose>", "poses or moments")]
)
def test_what_sdf_takes_or_leaves_is_reported(tmp_path, inside, says):
    with pytest.warns(RobotWarning, match=rf"{says}.*: a \(line 2\)"):
        inertia = only_inertia(tmp_path, inside, collision(BOX), strict=False)
    assert inertia.mass == pytest.approx(0.006 * (5 if inside else 1000))
    np.testing.assert_allclose(inertia.center_of_mass, 0, atol=1e-15)
    with pytest.raises(RobotFileError, match=r"density|ignores this"):
        only_inertia(tmp_path, inside, collision(BOX))


@pytest.mark.parametrize(
    "inside, shapes, says",
    [
        ("", "", "the link has none; write mass and inertia"),
        ("", collision("<mesh><uri>a.obj</uri></mesh>"), "not computed.*got '<mesh>'"),
        ("", collision("<plane/>"), "not computed.*got '<plane>'"),
        ("", collision(BOX, '<pose relative_to="b">0 0 0 0 0 0</pose>'), "'b'"),
        ("<density>-1</density>", collision(BOX), "greater than zero"),
        ("<mass>0</mass>", collision(BOX), "inertial.mass: must be greater than zero"),
        ("", collision("<box><size>0 1 1</size></box>"), "line 2, links.a.collision.c.size: must be greater than zero"),
        ("", collision("<sphere/>"), "no <radius>"),
    ],
)
def test_shapes_without_an_inertia_are_refused(tmp_path, inside, shapes, says):
    with pytest.raises(RobotFileError, match=says):
        only_inertia(tmp_path, inside, shapes, strict=False)
