"""The profile of uneven friction, against a motion that nothing of the package made."""

import numpy as np
import pytest

import galileo_jax as gx
from galileo_jax.assembly.build_problem import make_joint_problem
from galileo_jax.diagnosis.friction_along_way import SHOWN, friction_along_way
from galileo_jax.search.imperfect import fit_worlds

ANGLE, K, NOISE_M, FPS, G = np.radians(25.0), 0.2, 1e-4, 60.0, 9.81
CENTRE_M, WIDTH_M = 0.4, 0.05


def friction(path_m, more):
    return K + more * np.exp(-(((path_m - CENTRE_M) / WIDTH_M) ** 2))


def slid(more: float) -> tuple[np.ndarray, np.ndarray]:
    """Times, and the way down a slope by Heun's steps of ten microseconds."""
    dt, path, speed, ways = 1e-5, 0.0, 0.0, []
    steps = int(0.75 / dt)
    for _ in range(steps):
        ways.append(path)

        def gains(path):
            return G * (np.sin(ANGLE) - friction(path, more) * np.cos(ANGLE))

        now = gains(path)
        ahead = path + dt * speed
        path += dt * (speed + 0.5 * dt * now)
        speed += 0.5 * dt * (now + gains(ahead))
    frames = np.arange(int(0.74 * FPS))
    return frames / FPS, np.array(ways)[np.rint(frames / FPS / dt).astype(int)]


def found(folder, more: float):
    times, way = slid(more)
    place = np.stack([np.cos(ANGLE) * way, -np.sin(ANGLE) * way])
    place += 0.02 * np.array([np.sin(ANGLE), np.cos(ANGLE)])[:, None]  # half the box's height
    place += NOISE_M * np.random.default_rng(3).standard_normal(place.shape)
    rows = "".join(f"{t},{x},{y},{NOISE_M}\n" for t, x, y in zip(times, *place, strict=True))
    (folder / "board.csv").write_text("time_s,box_x_m,box_y_m,box_sd_m\n" + rows)
    (folder / "board.yaml").write_text(
        "track: board.csv\nscenario: incline\nramp_angle_deg: 25\n"
        "objects: [{name: box, shape: box, size_m: [0.04, 0.04, 0.04]}]\n"
    )
    track = gx.track(folder / "board.csv")
    trials = make_joint_problem([track.clip], [track.observation])
    world = fit_worlds(trials, 0, may_be_exact=False).best
    assert world.fit.sizes is not None
    assert "friction_roughness" in world.fit.sizes.unusual
    return friction_along_way(world.trials, world.fit)


@pytest.mark.parametrize("more", [0.4, -0.5])
def test_stretches_hold_the_friction_that_is_there(tmp_path, more):
    """Means within their sds, on short stretches and long ones; what pushes is no friction."""
    profile, (times, way) = found(tmp_path, more), slid(more)
    for steps in (2, SHOWN, 8):
        own = [one for one in profile if one.steps == steps]
        truth = []
        for ends in ((one.from_m, one.to_m) for one in own):
            # Over the time that it takes, in which speeds change evenly.
            begin, end = np.interp(ends, way, times)
            at = np.linspace(begin, end, 200)
            truth.append(friction(np.interp(at, times, way), more).mean())
        z = (np.array([one.mean for one in own]) - truth) / [one.sd for one in own]
        assert np.mean(z**2) < 2.0, (steps, z)
        assert np.mean(np.abs(z) < 2) > 0.85
    there = max((one for one in profile if one.steps == SHOWN), key=lambda one: abs(one.mean - K))
    assert abs((there.from_m + there.to_m) / 2 - CENTRE_M) < WIDTH_M
    assert there.mean - K == pytest.approx(more, abs=0.2)
    assert any(one.pushes for one in profile) == (more < 0)
    for one in profile:
        if one.pushes:
            assert one.from_m < CENTRE_M + WIDTH_M and one.to_m > CENTRE_M - WIDTH_M
