"""What the modes may explain and what not: wobble across the path, nothing before a hit."""

from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.observation.observation import Observation
from galileo_jax.similarity import hit_discrepancy
from galileo_jax.similarity.discrepancy import (
    LENS_SD,
    ROUGH_SD_M,
    SCALE_SD,
    WOBBLE_S,
    WOBBLE_SD_M,
    across_path,
    modes,
)
from galileo_jax.similarity.gaussian_likelihood import whitening_in
from galileo_jax.similarity.hit_discrepancy import (
    CLOSE_M,
    HIT_END_S,
    PUSH_SD_M_S2,
    _pushes,
    _speeds_at,
)
from galileo_jax.similarity.level_discrepancy import level_modes
from galileo_jax.similarity.noise_scale import fitted_noise_scale
from tests.oracle_trials import observe
from tests.ramp_model import HIT, make_surroundings
from tests.reference_ramp import solve

SCENE = make_surroundings(HIT)
STOPS = replace(HIT, friction=(0.34, 0.2))  # before object 2


def covariance(observation):
    """`[object, 2, frame, object, 2, frame]`, m^2."""
    return covariance_of(modes(observation, SCENE))


def covariance_of(patterns):
    return np.einsum("moit,mpju->oitpju", patterns, patterns)


@pytest.fixture(scope="module")
def hit():
    return observe(HIT, 0, noise_m=0.0)


def along_and_across(observation):
    """Unit vectors `[2, 2, frame]` of object 1's path."""
    x, corner = observation.position_m[0, 0], SCENE.corner_m[0]
    slope = np.where(x < corner, HIT.angle_rad, 0.0)
    along = np.stack([np.cos(slope), -np.sin(slope)])
    return along, np.stack([np.sin(slope), np.cos(slope)])


def test_wobble_is_across_the_path_and_of_its_size(hit):
    """All of it across, none along."""
    wobble = covariance_of(np.array(across_path(hit, SCENE, rough_sd_m=0.0)))[0, :, :, 0]
    along, across = along_and_across(hit)
    frames = range(len(hit.times_s))
    for t in frames:
        assert across[:, t] @ wobble[:, t, :, t] @ across[:, t] == pytest.approx(
            WOBBLE_SD_M**2, rel=0.05
        )
        assert abs(along[:, t] @ wobble[:, t, :, t] @ along[:, t]) < 1e-3 * WOBBLE_SD_M**2
    # Neighbours in time wobble together, and the ends of the clip do not.
    first, last = frames[0], frames[-1]
    near = across[:, first] @ wobble[:, first, :, first + 1] @ across[:, first + 1]
    far = across[:, first] @ wobble[:, first, :, last] @ across[:, last]
    assert near > 0.8 * WOBBLE_SD_M**2
    assert abs(far) < 0.05 * WOBBLE_SD_M**2


def test_what_is_not_seen_in_a_part_of_a_clip_has_no_patterns(hit):
    """Before object 2 of a film comes into sight."""
    mask = hit.mask.copy()
    mask[1] = False
    hidden = np.where(mask[:, None, None], hit.covariance_m2, np.nan)
    place = np.where(mask[:, None], hit.position_m, np.nan)
    found = modes(replace(hit, mask=mask, position_m=place, covariance_m2=hidden), SCENE)
    assert np.isfinite(found[..., mask[0]]).all()


def test_what_is_not_smooth_across_the_path_does_not_tell_the_noise(hit):
    """To and fro every frame: beside what is allowed for, noise of half a millimetre is nothing."""
    _, across = along_and_across(hit)
    to_and_fro = across * (-1.0) ** np.arange(len(hit.times_s)) / np.sqrt(len(hit.times_s))
    whole = covariance_of(np.array(across_path(hit, SCENE)))[0, :, :, 0]
    assert np.einsum("it,itju,ju", to_and_fro, whole, to_and_fro) > 0.9 * ROUGH_SD_M**2


@pytest.mark.parametrize("noise_m", [2e-5, 2e-4])
def test_how_a_path_lies_is_known_as_if_nothing_were_rough(hit, noise_m):
    """A ramp that is a degree steeper, and a table a degree aslant: what they stand out by."""
    x, corner = hit.position_m[0, 0], SCENE.corner_m[0]
    _, across = along_and_across(hit)
    for piece in (x < corner, x >= corner):
        away = (across * np.where(piece, np.deg2rad(1.0) * (x - corner), 0.0)).ravel()
        noise = noise_m**2 * np.eye(len(away))
        stands_out = []
        for rough in (0.0, ROUGH_SD_M):
            cover = covariance_of(np.array(across_path(hit, SCENE, rough)))[0, :, :, 0]
            cover = cover.reshape(noise.shape) + noise
            stands_out.append(away @ np.linalg.solve(cover, away))
        assert stands_out[1] > 0.7 * stands_out[0] > 3.0


def test_ideal_tracks_have_the_noise_that_they_are_drawn_with():
    """With a wobble as large as the noise, that is not there, a tenth was missing."""
    found = []
    for seed in range(12):
        seen, clean = observe(HIT, seed, 2e-4), observe(HIT, seed, 0.0)
        data = whitening_in(seen, SCENE)
        left = data.whiten_batch(seen.position_m - clean.position_m, 1.0)
        found.extend(fitted_noise_scale(left[None], np.ones(1), np.zeros(1), 1e3, data))
    assert 0.93 < np.mean(found) < 1.02


def test_a_hit_loosens_only_what_follows(hit):
    """Object 2 stands still until then: nothing of a hit's modes is in its first frames."""
    stops = observe(STOPS, 0, noise_m=0.0)
    assert len(modes(hit, SCENE)) > len(modes(stops, SCENE))
    hit_s = solve(HIT, hit.times_s).hit_s
    assert hit_s is not None
    frame = 1 / 30
    calm, moved = hit.times_s < hit_s - frame, hit.times_s > hit_s + 2 * frame
    x = covariance(hit)[1, 0, :, 1, 0, :]
    # Of displacements from the first frame: offsets and keystone are common to both.
    spread = np.diag(x) - 2 * x[0] + x[0, 0]
    assert np.abs(spread[calm]).max() < 1e-4**2
    assert spread[moved].min() > 1e-4**2


def test_without_a_camera_only_the_bodies_are_left(hit):
    """No keystone, roll, scale and drift: of both objects after the hit, else of all."""
    both, bodies = modes(hit, SCENE), modes(hit, SCENE, is_filmed=False)
    kept = np.array([any(np.array_equal(mode, other) for other in bodies) for mode in both])
    assert len(bodies) == kept.sum() < len(both) - 4
    is_everywhere = (both[~kept][..., 0] != 0).any(axis=(1, 2))
    assert is_everywhere.sum() == 4, "two keystones, roll, scale; the others begin at the hit"


def test_a_scale_that_says_how_well_it_is_known_is_not_widened_again(hit):
    both, stated = modes(hit, SCENE), modes(hit, replace(SCENE, is_scale_stated=True))
    kept = np.array([any(np.array_equal(mode, other) for other in stated) for mode in both])
    (left_out,) = both[~kept]
    assert left_out == pytest.approx(SCALE_SD * np.nan_to_num(hit.position_m))
    assert len(stated) == len(both) - 1


def thrown(bend_m: np.ndarray | float = 0.0) -> Observation:
    """A throw of 1 m, seen to 0.2 mm, `bend_m` `[2, frame]` off its parabola."""
    times = np.linspace(0.0, 0.7, 15)
    place = np.stack([1.5 * times, 3.0 * times - 9.81 * times**2 / 2]) + bend_m
    error = 2e-4**2 * np.eye(2)[None, :, :, None]
    seen = np.ones((1, len(times)), bool)
    covariance = np.broadcast_to(error, (1, 2, 2, len(times)))
    return Observation(("object1",), times, place[None], covariance, seen)


def cost(bend_m: np.ndarray) -> float:
    """chi2 of a throw `bend_m` off, of its modes alone."""
    alone = replace(HIT, object2_x_m=None)
    flight = replace(
        make_surroundings(alone),
        has_table=False,
        has_surface=False,
        comes_down=(False,),
        moves_in_plane=True,
        angle_rad=0.0,
    )
    data = whitening_in(thrown(bend_m), flight)
    difference = data.observed_m - thrown().position_m
    return float(np.sum(data.whiten_batch(difference, 1.0) ** 2))


def test_a_lens_that_bends_a_flight_is_no_misfit():
    """A barrel about a point off the middle, and a bend as large that no lens makes."""
    place = thrown().position_m[0]
    aside = place - np.array([[0.65], [0.2]])
    edge = np.abs(aside).max()
    barrel = -LENS_SD * aside * (aside**2).sum(axis=0) / edge**2
    ripple = np.abs(barrel).max() * np.array([[1.0], [0.0]]) * np.sin(12 * place[0])
    assert np.abs(barrel).max() > 10 * 2e-4, "it shows"
    assert cost(barrel) < 4
    assert cost(ripple) > 100


def soft_ends(experiment, monkeypatch):
    """What of the modes is only there because hits end late."""
    seen = observe(experiment, 0, noise_m=0.0)
    whole = modes(seen, SCENE, is_filmed=False)
    monkeypatch.setattr("galileo_jax.similarity.hit_discrepancy.HIT_END_S", 0.0)
    less = modes(seen, SCENE, is_filmed=False)
    return seen.times_s, [a - b for a, b in zip(whole, less, strict=True) if (a != b).any()]


def test_a_hit_that_ends_late_parts_bodies_slower(monkeypatch):
    """By what friction does to their relative speed meanwhile; momentum is kept."""
    parts = replace(HIT, friction=(0.2, 0.1))
    times, (mode,) = soft_ends(parts, monkeypatch)
    hit_s = solve(parts, times).hit_s
    assert hit_s is not None
    after = (times > hit_s + 0.05) & (times < hit_s + 0.25)
    rear, ahead = (np.polyfit(times[after], x[after], 1)[0] for x in mode[:, 0])
    lacks = 9.81 * (0.2 - 0.1) * HIT_END_S
    assert rear - ahead == pytest.approx(lacks, rel=0.15)
    m1, m2 = parts.mass_kg
    assert m1 * rear + m2 * ahead == pytest.approx(0.0, abs=0.1 * m1 * rear)
    assert not mode[:, :, times < hit_s - 1 / 30].any()


def test_bodies_that_friction_presses_together_do_not_part(monkeypatch):
    _, found = soft_ends(replace(HIT, friction=(0.1, 0.2)), monkeypatch)
    assert found == []


def pushes(experiment):
    """The modes of a push between bodies that are close, and when they come apart."""
    seen = observe(experiment, 0, noise_m=0.0)
    after = int(np.argmax(seen.times_s > solve(experiment, seen.times_s).hit_s)) + 1
    hit = _speeds_at(after - 2, 1, seen.position_m, seen)
    assert hit is not None
    return seen.times_s, hit, np.array(_pushes(hit, seen.position_m, seen))


@pytest.mark.parametrize("friction", [(0.2, 0.1), (0.1, 0.2)])
def test_a_push_between_close_bodies_conserves_momentum(friction):
    experiment = replace(HIT, friction=friction)
    times, hit, found = pushes(experiment)
    before = times < times[hit.frame]
    assert found.any() and not found[..., before].any() and not found[:, :, 1].any()
    m1, m2 = experiment.mass_kg
    both = hit.both[:-1]
    moved = m1 * found[:, 0, 0][:, both] + m2 * found[:, 1, 0][:, both]
    assert np.abs(moved).max() < 0.1 * m1 * np.abs(found[:, 0, 0]).max()
    # Their squares sum to what a random push of that size does: sd t^2 / 2 while it lasts.
    apart = found[:, 1, 0] - found[:, 0, 0]
    soon = times[both[3]] - (times[both[0]] + times[both[0] - 1]) / 2
    expected = PUSH_SD_M_S2 * soon**2 / 2
    assert np.sqrt((apart[:, both[3]] ** 2).sum()) == pytest.approx(expected, rel=0.1)


def test_bodies_that_are_far_apart_no_longer_push():
    """Friction pulls these apart: when they are, nothing but the speed then gained goes on."""
    parts = replace(HIT, friction=(0.15, 0.01))
    times, hit, found = pushes(parts)
    apart = np.diff(solve(parts, times).position_m[:, 0], axis=0)[0]
    far = hit.both[apart[hit.both] - apart[hit.both[0]] > 2 * CLOSE_M][:-1]
    assert len(far) >= 4
    gained = (found[:, 1, 0] - found[:, 0, 0])[:, far]
    speed = np.diff(gained, axis=1) / np.diff(times[far])
    assert np.abs(speed).max() > 1e-4
    assert np.abs(np.diff(speed, axis=1)).max() < 1e-6


def test_bodies_that_close_in_by_more_than_that_in_one_frame_do_not_push():
    seen = observe(HIT, 0, noise_m=0.0)
    after = int(np.argmax(seen.times_s > solve(HIT, seen.times_s).hit_s)) + 1
    hit = _speeds_at(after - 2, 1, seen.position_m, seen)
    assert hit is not None
    seen.position_m[1, 0, hit.both[0]] += 2 * CLOSE_M
    assert _pushes(hit, seen.position_m, seen) == []


def test_pucks_wander_in_full_however_fast():
    """Between neighbouring frames, too, the wander changes as much as it says."""
    count, fps = 200, 240.0
    still = Observation(
        ("object1",),
        np.arange(count) / fps,
        np.zeros((1, 2, count)),
        np.broadcast_to(1e-8 * np.eye(2)[None, :, :, None], (1, 2, 2, count)),
        np.ones((1, count), bool),
    )
    scene = replace(SCENE, names=("object1",), half_length_m=(0.02,))
    x = level_modes(still, scene, is_filmed=True)[:, 0, 0]
    step = np.diff(x, axis=1)
    expected = 2 * WOBBLE_SD_M**2 * (1 - np.exp(-1 / fps / WOBBLE_S))
    assert np.sum(step**2, axis=0) == pytest.approx(np.full(count - 1, expected), rel=0.01)


def test_a_video_tracked_here_drifts_past_a_hit_by_a_quarter_of_what_others_do():
    frames = 60
    times = np.arange(frames) / 60
    x = np.stack([0.3 * times, 0.15 + 0.2 * np.maximum(times - 0.5, 0.0)])
    seen = Observation(
        names=("object1", "object2"),
        times_s=times,
        position_m=np.stack([x, 0 * x], axis=1),
        covariance_m2=1e-8 * np.tile(np.eye(2)[None, ..., None], (2, 1, 1, frames)),
        mask=np.ones((2, frames), bool),
    )
    hit, both = 30, (0, 1)
    others, own = (
        np.stack(hit_discrepancy._drift(hit, both, seen.position_m, one))
        for one in (seen, replace(seen, noise_known_to=0.15))
    )
    np.testing.assert_allclose(np.sum(own**2), np.sum(others**2) / 16, rtol=0.01)
