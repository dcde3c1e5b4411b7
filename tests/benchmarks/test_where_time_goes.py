"""Stages of benchmarks/where_time_goes.py: they are told by a diagnosis, and sum to the whole."""

import itertools

from benchmarks.where_time_goes import StageClock


def test_stages_sum_to_the_whole() -> None:
    ticks = itertools.count(1)  # a clock that is read once a second
    clock = StageClock(lambda: float(next(ticks)))
    clock.begin("tracking")
    for told in ("fitting the model without effects", "searching", "searching on", "compared"):
        clock.on_progress(told, 0.1, None)
    clock.on_progress("fitting 27 candidates", 0.2, None)
    clock.on_progress("fitted", 0.2, {"candidate": {}})
    clock.on_progress("what the benchmark does not know", 0.3, None)
    clock.on_progress("diagnosed", 1.0, None)
    clock.begin("end")
    assert clock.seconds == {
        "start-up": 1.0,
        "tracking": 1.0,
        "base fit": 2.0,
        "second": 1.0,
        "document": 1.0,
        "candidates": 1.0,
        "replicates": 1.0,
    }
    assert sum(clock.seconds.values()) == next(ticks) - 1
