"""Joints that follow another with ranges that leave it no room: told of, and the one that they follow keeps its own."""

import pytest

import jounce as jn
from jounce.errors import RobotFileError
from jounce.io.robots.elements import followers
from jounce.io.robots.elements.faults import Faults
from jounce.io.robots.loader import load_robot
from jounce.robot.model.links_and_joints import has_room

FULL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
KEPT = {  # range of the leader; of each follower: range, multiplier, offset; what the leader keeps
    "signs agree": ((0, 0.8), [((-0.8757, 0), -1, 0)], (0, 0.8)),
    "a tighter follower": ((0, 0.8), [((0, 0.6), 2, 0)], (0, 0.3)),
    "shifted": ((0, 0.8), [((0.5, 1.5), -1, 1)], (0, 0.5)),
    "it does not move": ((0, 0.8), [((5, 6), 0, 0)], (0, 0.8)),
}
FAULTS = {  # the same, and which of the followers do not count
    "sign of the multiplier": ((0, 0.8), [((0, 0.8757), -1, 0)], (0, 0.8), [0]),
    "sign of the leader": ((-0.8, 0), [((0, 0.8757), 1, 0)], (-0.8, 0), [0]),
    "nothing in common": ((0, 0.8), [((1, 2), 1, 0)], (0, 0.8), [0]),
    "the offset": ((0, 0.8), [((0, 0.8), 1, 0.8)], (0, 0.8), [0]),
    "the offset but for rounding": ((0, 0.7854), [((0, 0.785398), 1, 0.785397)], (0, 0.7854), [0]),
    "one of two": ((0, 0.8), [((0, 0.5), 1, 0), ((0, 0.8757), -1, 0)], (0, 0.5), [1]),
    "two against each other": ((-1, 1), [((0.2, 1), 1, 0), ((-1, -0.2), 1, 0)], (-1, 1), [0, 1]),
    "a third that suits": ((-1, 1), [((0.2, 1), 1, 0), ((0.2, 1), -1, 0), ((-1, 0.9), 1, 0)], (-1, 0.9), [0, 1]),
}


def urdf(leader, followers, chained):
    def joint(name, child, limits, mimic=""):
        return (
            f'<link name="{child}">{FULL}</link><joint name="{name}" type="prismatic"><parent link="base"/>'
            f'<child link="{child}"/><limit lower="{limits[0]}" upper="{limits[1]}" effort="1" velocity="2"/>{mimic}'
            "</joint>\n"
        )

    text = joint("lead", "link", leader)
    for k, (limits, factor, offset) in enumerate(followers):
        mimic = f'<mimic joint="lead" multiplier="{factor}" offset="{offset}"/>'
        if chained:  # through one between that moves twice as far, without a range
            between = '<mimic joint="lead" multiplier="2"/>'
            text += joint(f"between{k}", f"piece{k}", (0, 0), between)
            mimic = f'<mimic joint="between{k}" multiplier="{factor / 2}" offset="{offset}"/>'
        text += joint(f"f{k}", f"link{k}", limits, mimic)
    return f'<robot name="g"><link name="base"/>\n{text}</robot>'


def mjcf(leader, followers, _):
    def body(name, limits):
        return (
            '<body><inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/>'
            f'<joint name="{name}" type="slide" limited="true" range="{limits[0]} {limits[1]}"/></body>\n'
        )

    ties = "".join(
        f'<joint joint1="f{k}" joint2="lead" polycoef="{offset} {factor} 0 0 0"/>\n'
        for k, (_, factor, offset) in enumerate(followers)
    )
    bodies = body("lead", leader) + "".join(body(f"f{k}", limits) for k, (limits, *_) in enumerate(followers))
    return f"<mujoco><worldbody>\n{bodies}</worldbody><equality>{ties}</equality></mujoco>"


def sdf(leader, followers, _):
    def joint(name, limits, mimic=""):
        low, high = limits
        link = f'<link name="of_{name}"><inertial><mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia>'
        return (
            f'{link}</inertial></link>\n<joint name="{name}" type="prismatic"><parent>world</parent>'
            f"<child>of_{name}</child><axis><xyz>0 0 1</xyz><limit><lower>{low}</lower><upper>{high}</upper></limit>"
            f"{mimic}</axis></joint>\n"
        )

    text = joint("lead", leader)
    for k, (limits, factor, offset) in enumerate(followers):
        law = f"<multiplier>{factor}</multiplier><offset>{offset}</offset><reference>0</reference>"
        text += joint(f"f{k}", limits, f'<mimic joint="lead">{law}</mimic>')
    return f'<sdf version="1.11"><model name="g">\n{text}</model></sdf>'


FORMATS = {"urdf": (urdf, False), "chained.urdf": (urdf, True), "xml": (mjcf, False), "sdf": (sdf, False)}


@pytest.fixture(params=FORMATS)
def write(request, tmp_path):
    def written(leader, followers):
        make, chained = FORMATS[request.param]
        path = tmp_path / f"gripper.{request.param}"
        path.write_text(make(leader, followers, chained))
        return path

    return written


def kept(robot):
    limits = robot.limits["lead"]
    return pytest.approx((limits.lower, limits.upper), abs=1e-12)


@pytest.mark.parametrize("case", KEPT)
def test_ranges_that_leave_room_count(write, case):
    leader, followers, expected = KEPT[case]
    assert expected == kept(load_robot(write(leader, followers), strict=True))


@pytest.mark.parametrize("case", FAULTS)
def test_ranges_that_leave_no_room_are_reported_and_do_not_count(write, case):
    leader, followers, expected, bad = FAULTS[case]
    path = write(leader, followers)
    with pytest.warns(
        jn.errors.RobotWarning, match="ranges of joints that leave the joint that they follow no room"
    ) as caught:
        robot = load_robot(path)
    assert len(caught) == 1
    message = str(caught[0].message)
    for k in range(len(followers)):
        assert (f"f{k}, which follows lead (line" in message) == (k in bad)
    assert expected == kept(robot)
    with pytest.raises(RobotFileError, match=r"leaves lead, which it follows, .* no room to move") as refused:
        load_robot(path, strict=True)
    assert refused.value.name == f"joints.f{bad[0]}.limit"
    assert refused.value.line is not None


def test_a_robot_built_with_such_ranges_is_refused_where_limits_are_asked_for():
    ranges = [jn.Limits(lower=0.0, upper=0.8), jn.Limits(lower=0.0, upper=0.9)]
    joints = [jn.Joint("lead", "base", "a", "prismatic", limits=ranges[0])]
    joints.append(jn.Joint("f0", "base", "b", "prismatic", limits=ranges[1], mimic=jn.robot.Mimic("lead", -1.0)))
    robot = jn.Robot("gripper", [jn.Link("base"), *(jn.Link(name, jn.Inertia(1.0)) for name in "ab")], joints)
    with pytest.raises(jn.errors.RobotError, match=r"lead: one coordinate alone keeps the range .* \(f0\)"):
        _ = robot.limits


def test_a_leader_that_is_held_in_one_place_by_its_own_range():
    joints = [jn.Joint("lead", "base", "a", "prismatic", limits=jn.Limits(lower=0.4, upper=0.4))]
    limits = jn.Limits(lower=0.0, upper=0.8)
    joints.append(jn.Joint("f0", "base", "b", "prismatic", limits=limits, mimic=jn.robot.Mimic("lead")))
    robot = jn.Robot("gripper", [jn.Link("base"), *(jn.Link(name, jn.Inertia(1.0)) for name in "ab")], joints)
    assert (robot.limits["lead"].lower, robot.limits["lead"].upper) == (0.4, 0.4)


@pytest.mark.parametrize("against", [False, True])
def test_ranges_are_compared_in_proportion_to_the_joints(monkeypatch, against):
    seen = []
    monkeypatch.setattr(followers, "has_room", lambda limits, some: seen.extend(some) or has_room(limits, some))
    left_out = []
    for count in (50, 200):
        rest = [
            jn.Joint(f"f{k}", "b", f"l{k}", limits=jn.Limits(lower=0.2, upper=1.0), mimic=jn.robot.Mimic("lead"))
            for k in range(count)
        ]
        turned = jn.Joint("turned", "b", "t", limits=jn.Limits(lower=-1.0, upper=-0.2), mimic=jn.robot.Mimic("lead"))
        single = [jn.Joint(f"a{k}", "b", f"c{k}") for k in range(count)]
        lead = jn.Joint("lead", "b", "l", limits=jn.Limits(lower=-1.0, upper=1.0))
        seen.clear()
        faults, every = Faults("robot.urdf"), [lead, *rest, *single, *([turned] if against else [])]
        followers.with_room(every, faults, lambda error: RobotFileError(error.message))
        left_out.append(len(faults.unread.get(followers.NO_ROOM, ())))
        assert len(seen) <= 12 * count  # each with itself, with the tightest, and all together
    assert left_out == ([51, 201] if against else [0, 0])
