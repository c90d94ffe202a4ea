"""The newest values win, stale ones are never solved, and what fails leaves the last motion."""

import jounce as jn
from jounce.viewer.page.player import Player
from jounce.viewer.page.session import Session
from tests.viewer.small import Slow


def test_the_newest_of_many_requests_wins():
    subject, arrived = Slow(), []
    session = Session(subject, 1, arrived.append)
    subject.began.clear()
    subject.gate.clear()
    session.request({"value": 2.0})
    assert subject.began.wait(20.0)  # the worker is at 2, so all that follow wait
    for value in range(3, 60):
        session.request({"value": float(value)})
    subject.gate.set()
    assert session.wait(20.0)
    session.close()
    assert subject.solved == [1.0, 2.0, 59.0]
    assert [recording.values["value"] for recording in arrived] == [2.0, 59.0]
    assert session.recording.values["value"] == 59.0
    assert session.error is None


def test_a_failure_is_reported_and_keeps_the_last_motion():
    subject, errors = Slow(), []
    session = Session(subject, 1, on_failure=errors.append)
    first = session.recording
    session.request({"value": -1.0})
    assert session.wait(20.0)
    assert session.recording is first
    assert isinstance(session.error, jn.errors.AssemblyError)
    assert errors == [session.error]
    assert (session.error.name, session.error.value) == ("value", -1.0)
    session.request({"value": 4.0})  # and a good value takes over again
    assert session.wait(20.0)
    session.close()
    assert session.error is None
    assert session.recording.values["value"] == 4.0


def test_a_part_of_a_motion_does_not_take_the_place_of_a_whole_one():
    subject = Slow()
    session = Session(subject, 1)
    session.request({"value": 200.0})
    assert session.wait(20.0)
    assert session.recording.values["value"] == 1.0
    assert "missing" in str(session.error)
    session.close()


def test_the_worker_survives_what_nobody_foresaw():
    errors, done = [], []
    session = Session(Slow(), 1, on_failure=errors.append)
    session.run_between_solves(lambda: 1 / 0)
    session.run_between_solves(lambda: done.append(True))
    assert session.wait(20.0)
    session.request({"value": 3.0})
    assert session.wait(20.0)
    session.close()
    assert "ZeroDivisionError" in str(errors[0])
    assert done == [True]
    assert session.recording.values["value"] == 3.0


def test_a_request_may_change_the_order_and_keeps_other_values():
    subject = Slow()
    session = Session(subject, 1)
    session.request({"value": 7.0})
    session.request(order=3)
    assert session.wait(20.0)
    session.close()
    assert session.order == 3
    assert subject.solved[-1] == 7.0


def test_a_player_stops_at_the_end_or_begins_again():
    player = Player(1.0, 3.0, print)
    player.now = 2.5
    assert player.advanced(0.25) == 2.75
    assert player.advanced(1.0) == 1.5
    player.loop, player.playing = False, True
    assert player.advanced(1.0) == 3.0
    assert not player.playing
