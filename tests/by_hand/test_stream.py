"""The clock of a stream: frames that go on, come late, set it back or jump, by hand."""

import numpy as np
import pytest

from pedpred.online.stream import Arrival, StreamClock


def after(*times_s, people=1, longest_s=2.0):
    """The clock after frames, and what the last one was; late ones are dropped."""
    clock = StreamClock(longest_s)
    for time_s in times_s:
        clock, arrival = clock.accept(time_s, people if np.isfinite(clock.now_s) else 0)
        if arrival is Arrival.LATE:
            clock = clock.dropped(time_s)
    return clock, arrival


@pytest.mark.parametrize(
    ("time_s", "arrival"),
    [
        (10.1, Arrival.NEXT),
        (12.0, Arrival.NEXT),
        (12.001, Arrival.JUMP),
        (10.0, Arrival.LATE),
        (10.0 + 5e-7, Arrival.LATE),  # the same instant
        (10.0 + 2e-6, Arrival.NEXT),
        (8.0, Arrival.LATE),
        (7.999, Arrival.JUMP),
    ],
)
def test_frames_go_on_come_late_or_jump(time_s, arrival):
    """After one at 10 s; gaps of more than 2 s are jumps."""
    clock, _ = after(10.0)
    assert clock.arrival(time_s) is arrival
    assert clock.accept(time_s, 1)[0].now_s == (10.0 if arrival is Arrival.LATE else time_s)


def test_the_first_frame_begins_a_stream():
    clock, arrival = after(-7.0, people=0)
    assert (clock.now_s, clock.jumps, arrival) == (-7.0, 0, Arrival.JUMP)


def test_frames_that_are_earlier_for_0_3_s_set_the_clock_back():
    """9.4, 9.5, 9.6 and 9.7 s after 10 s, each later than the one before."""
    clock, arrival = after(10.0, 9.4, 9.5, 9.6)
    assert (clock.now_s, clock.dropped_s, arrival) == (10.0, (9.4, 9.6), Arrival.LATE)
    clock, arrival = clock.accept(9.7, 1)
    assert (clock.now_s, clock.dropped_s, clock.jumps) == (9.7, (np.inf, np.inf), 1)
    assert arrival is Arrival.SET_BACK


@pytest.mark.parametrize("between_s", [10.1, 9.6])
def test_earlier_frames_must_follow_each_other(between_s):
    """A later frame, and one that is not later than the last that was dropped, begin the count again."""
    _, arrival = after(10.0, 9.4, 9.5, 9.6, between_s, 9.7)
    assert arrival is Arrival.LATE


def test_completing_the_last_frame_begins_the_count_again():
    clock, _ = after(10.0, 9.4, 9.5, 9.6)
    assert clock.completed().arrival(9.7) is Arrival.LATE


def test_setting_back_takes_twice_as_long_until_5_s_are_calm():
    """0.3 s, then 0.6 s; frames count as calm from when the last one was dropped."""
    clock, _ = after(10.0, 9.4, 9.7 + 1e-9)
    assert clock.set_back_s == 0.6
    for time_s, wait_s in ((11.5, 0.6), (13.0, 0.6), (15.0, 0.6), (15.1, 0.3)):
        clock, _ = clock.accept(time_s, 1)
        assert clock.set_back_s == wait_s


def test_of_several_long_gaps_the_first_one_is_told(caplog):
    """Jumps back are told each time; nothing is where nobody is known."""
    after(0.0, 10.0, 20.0, 30.0)
    assert [record.args[:2] for record in caplog.records] == [(0.0, 10.0)]
    caplog.clear()
    clock, _ = after(0.0, 10.0, people=0)
    assert (clock.jumps, caplog.records) == (0, [])
    for time_s, jumps in ((20.0, 1), (30.0, 2), (5.0, 3)):
        clock, _ = clock.accept(time_s, 3)
        assert clock.jumps == jumps
    assert [record.args[:2] for record in caplog.records] == [(10.0, 20.0), (30.0, 5.0)]


def test_of_dropped_frames_the_first_one_is_told(caplog):
    after(10.0, 9.8, 9.9, 9.9, 9.95)
    assert [record.args[0] for record in caplog.records if "dropped" in record.msg] == [9.8, 9.9]
