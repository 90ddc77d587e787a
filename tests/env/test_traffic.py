"""The table of random traffic: as large as its events need, with all of them in it, and bounded."""

import numpy as np
import pytest

from lanekeep_env.scenario.traffic import EVENTS, LARGEST_TABLE, MOST_EVENTS, Traffic


def test_the_table_holds_every_event_and_no_more():
    """Beside timelines drawn one by one: the longest fills its row."""
    rng = np.random.default_rng(0)
    for _ in range(30):
        count, duration = int(rng.integers(1, 40)), float(np.exp(rng.uniform(-3.0, 7.0)))
        traffic = Traffic(count=count, duration=duration, seed=int(rng.integers(1000)))
        table, draws = traffic.build(), np.random.default_rng([traffic.seed, 0x7AFF])
        timelines = [traffic._random(draws) for _ in range(count)]
        assert table.shape == (count, max(map(len, timelines)), 4)
        for row, events in zip(table, timelines, strict=True):
            assert np.isinf(row[len(events) :]).all()
            for (time, kind, *numbers), (when, word, given) in zip(row.tolist(), events, strict=False):
                assert (time, kind, numbers[: len(given)]) == (when, EVENTS[word][0], list(given))


@pytest.mark.parametrize("count", [1, 256, 3000, 10_000])
def test_the_largest_table_is_bounded(count):
    """A timeline has at most an event each 6 s, one at its start and one behind its end."""
    with pytest.raises(ValueError, match=rf"traffic.duration=1e\+18 .* s for {count} timelines") as error:
        Traffic(count=count, duration=1e18)
    longest = float(str(error.value).rpartition("<= ")[2].split()[0])
    assert Traffic(count=count, duration=longest).duration == longest <= 1e6
    assert (longest / 6.0 + 2.0) * count * 4 * 8 <= LARGEST_TABLE
    Traffic(count=count)  # the default lasts 60 s
    with pytest.raises(ValueError, match="duration"):
        Traffic(count=count, duration=np.nextafter(longest, np.inf))


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"duration": float("inf")}, "traffic.duration=inf"),
        ({"duration": 10**400}, "traffic.duration=<an integer of 400 digits>"),
        ({"count": 10**400}, "traffic.count=<an integer of 400 digits>"),
        ({"seed": 10**400}, "traffic.seed=<an integer of 400 digits>"),
        ({"events": [(0, "speed", 5)] * (MOST_EVENTS + 1)}, "has 10001 events, allowed are 10000"),
        ({"events": [(0, "speed", 5), (1e7, "stop", 5)]}, "traffic.events time=10000000.0"),
        ({"events": [(0, "speed", 5), (10**400, "stop", 5)]}, "traffic.events time=<an integer of 400 digits>"),
        ({"events": [(0, "speed", 10**400)]}, "traffic.events speed=<an integer of 400 digits>"),
        ({"events": [(0, "speed", [5] * 10**6)]}, "takes 1 numbers"),
        ({"events": [(5, "speed", 5), *[(4, "stop", 5)] * 5000]}, "must rise"),
        ({"events": ["x" * 10**6]}, "traffic.events time='x'"),
        ({"events": [(0, "speed", 5), (3, "lead_speed", 5, 1)]}, "'lead_speed' at 3 s is not allowed: no 'lead'"),
        ({"events": [(0, "speed", 5), (3, "position_speed", 5, 1)]}, "no 'position' is there by then"),
        (
            {"events": [(0, "speed", 5), (1, "lead", 9, 5), (2, "lead_gone"), (2, "lead_speed", 5, 1)]},
            "'lead_speed' at 2 s is not allowed",
        ),
    ],
)
def test_what_no_traffic_has_is_one_short_line(keywords, words):
    with pytest.raises(ValueError) as error:
        Traffic(**keywords)
    assert words in str(error.value) and "\n" not in str(error.value) and len(str(error.value)) < 300
