"""A ball in space that bounces is found out, whatever air and spin do to it before."""

from pathlib import Path

import numpy as np
import pytest

from galileo_jax.clip.load import load_clip
from galileo_jax.measurement.measure import measure
from galileo_jax.measurement.segments.blow import bounce_frame
from galileo_jax.measurement.segments.segments import STRUCK
from galileo_jax.observation.observation import Observation
from tests.measurement.seen import seen

FPS, FRAMES, AT = 145.0, 50, 22


def flown(seed: int, rebound: float | None, late_s: float = 0.0) -> Observation:
    """A table-tennis ball at 9 m/s, with drag and a sideways lift, places known to 0.7 mm.

    Its times are uncertain by 0.4 ms. It meets the table between two frames and leaves it with
    `rebound` of its vertical speed, or not at all; from a later frame on times are `late_s` late.
    """
    rng = np.random.default_rng(seed)
    times = np.arange(FRAMES) / FPS
    read_s = times + 4e-4 * rng.standard_normal(FRAMES)
    read_s[AT + 12 :] += late_s
    hit_s = times[AT] + rng.uniform(0.2, 0.8) / FPS
    fine = np.arange(-100, 4500) * 1e-4
    place, velocity = np.array([0.0, 0.3, 0.0]), np.array([0.4, -1.6, -9.0])
    spin, path = rng.normal(0, 12, 3), []
    for t in fine:
        if rebound is not None and t <= hit_s < t + 1e-4:
            velocity = velocity * (0.95, -rebound, 0.93)
        drag = 0.13 * np.linalg.norm(velocity) * velocity
        force = np.array([0.0, -9.81, 0.0]) - drag + 0.1 * np.cross(spin, velocity)
        velocity = velocity + force * 1e-4
        place = place + velocity * 1e-4
        path.append(place)
    shown = np.stack([np.interp(read_s, fine, axis) for axis in np.transpose(path)])
    return seen(shown + 7e-4 * rng.standard_normal(shown.shape), times, 2e-3)


@pytest.mark.parametrize("rebound", [0.6, 0.9])
def test_a_ball_that_grazes_the_table_bounces(rebound: float) -> None:
    found = [bounce_frame(flown(seed, rebound)) for seed in range(8)]
    assert found == [AT] * 8


def test_air_and_spin_are_no_bounce() -> None:
    assert [bounce_frame(flown(seed, None)) for seed in range(20)] == [None] * 20


def test_times_that_jump_are_no_bounce() -> None:
    assert [bounce_frame(flown(seed, None, 5e-3)) for seed in range(20)] == [None] * 20


def test_too_few_frames_tell_nothing() -> None:
    short = flown(0, 0.9)
    short.mask[:, AT + 3 :] = False
    short.mask[:, : AT - 1] = False
    assert bounce_frame(short) is None


def test_a_flight_in_space_ends_where_it_bounces(tmp_path: Path) -> None:
    ball = flown(4, 0.6)  # which is too faint for `blow_frame`
    rows = [
        ",".join(f"{value:.5f}" for value in row)
        for row in zip(ball.times_s, *ball.position_m[0], strict=True)
    ]
    head = "time_s,object1_x_m,object1_y_m,object1_z_m"
    (tmp_path / "ball.csv").write_text("\n".join([head, *rows]) + "\n")
    (tmp_path / "ball.yaml").write_text(
        "track: ball.csv\nscenario: flight\nobjects:\n"
        "  - {name: object1, shape: sphere, size_m: [0.02], mass_kg: 0.0027}\n"
    )
    (ended,) = measure(load_clip(tmp_path / "ball.yaml")).cuts
    assert (ended.side, ended.why) == ("after", STRUCK)
    assert ended.time_s == pytest.approx(AT / FPS, abs=1e-4)
