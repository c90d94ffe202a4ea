"""Laws that every joint and driver of the catalogue keeps, and a user's own one too: those of `jounce.testing`."""

import pytest

from jounce.testing import check_joint
from tests.problems.bank import Case, cases

pytestmark = pytest.mark.long

CASES = cases()
ABSOLUTE = ("x", "y")  # words of joints by a coordinate in the global frame


@pytest.fixture(params=CASES, ids=str)
def case(request) -> Case:
    return request.param


def checked(case, *contracts, **claims):
    """Hold a case to contracts; return why those that say nothing of it do not."""
    claims = {"values": case.given, "bodies": case.joined, "period": case.period, **claims}
    report = check_joint(case.kind, space=case.space, optional=case.optional, contracts=contracts, **claims)
    assert {*report.held, *report.left_out} == {*contracts}
    return report.left_out


@pytest.mark.parametrize("contract", ["jacobian", "derivatives", "instances", "expressions", "one program"])
def test_a_residual_is_one_function_on_jets(case, contract):
    assert not checked(case, contract)


@pytest.mark.parametrize("case", [case for case in CASES if case.word not in ABSOLUTE], ids=str)
def test_common_motion_of_all_bodies_changes_nothing(case):
    ratio = {"ratio": 1.0} if case.kind.type_name == "coordinate" else {}
    assert not checked(case, "frames", values={**case.given, **ratio})


def test_a_joint_is_what_its_class_states(case):
    assert not checked(case, "rank", "facts")


def test_copies_and_files_hold_the_same_joint(case):
    left_out = checked(case, "copies", "files")
    assert set(left_out) == ({"copies", "files"} if not case.kind.__module__.startswith("jounce.") else set())


def test_machine_code_and_xla_agree(case):
    assert not checked(case, "back ends")
