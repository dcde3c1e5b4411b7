"""The loop from Python alone: the numbers that the commands write, silent, in any precision."""

import json
import threading
import types
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import galileo_jax as gx
from galileo_jax import __main__
from galileo_jax.commands import command


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("api")


@pytest.fixture(scope="module")
def video(folder) -> Path:
    """A rendered clip without an effect."""
    gx.simulate(folder / "clip.mp4", seed=7, size=(480, 270), seconds=1.6)
    return folder / "clip.mp4"


@pytest.fixture(scope="module")
def drag(folder) -> Path:
    """A track with a hidden drag."""
    gx.simulate(
        folder / "drag.csv", seed=3, effects={"air_drag": {}}, strength=1.0, track_only=True
    )
    return folder / "drag.csv"


@pytest.fixture(scope="module")
def alone(drag) -> dict[int, Mapping]:
    """By seed, what a fit of the track says that nothing else runs beside."""
    return {seed: gx.fit(drag, seed=seed).parameters for seed in (0, 1)}


def galileo(*words: object) -> None:
    assert command.run(__main__.main, [str(word) for word in words]) == 0


def without_times(path: Path) -> dict:
    content = json.loads(path.read_text())
    return {key: value for key, value in content.items() if key not in ("timings_s", "seconds")}


def test_importing_gives_names_and_no_jax():
    assert set(gx.__all__) <= set(dir(gx))
    for name in gx.__all__:
        assert getattr(gx, name) is not None
        is_documented = not isinstance(getattr(gx, name), types.FunctionType | type)
        assert is_documented or getattr(gx, name).__doc__, name


@pytest.mark.parametrize("verb", ["effects", "fit"])
def test_a_verb_as_a_module_does_not_hide_its_function(verb):
    assert import_module(f"galileo_jax.{verb}") is getattr(gx, verb)
    assert callable(getattr(gx, verb))


def test_fit_compare_predict_are_the_commands(video, folder, capfd):
    """On a video; and nothing is printed."""
    assert jnp.zeros(1).dtype == jnp.float32, "this caller has not asked for 64 bit"
    stages = []
    track = gx.track(video, on_progress=lambda stage, share, _: stages.append((stage, share)))
    fit = gx.fit(track, seed=2)
    check = gx.compare(fit)
    ahead = gx.predict(fit, seconds=0.5)
    assert capfd.readouterr() == ("", "")
    assert jnp.zeros(1).dtype == jnp.float32
    shares = [share for _, share in stages]
    assert shares == sorted(shares) and shares[-1] == 1.0

    galileo("fit", video, "--seed", 2, "--out", folder / "run")
    fit.save(folder / "saved")
    assert without_times(folder / "saved" / "result.json") == without_times(
        folder / "run" / "result.json"
    )
    galileo("compare", video, "--seed", 2, "--out", folder / "compare")
    check.save(folder / "check")
    assert without_times(folder / "check" / "compare.json") == without_times(
        folder / "compare" / "compare.json"
    )
    galileo("predict", folder / "run", "--seconds", 0.5)
    told = json.loads((folder / "run" / "prediction.json").read_text())
    for name, entry in told["objects"].items():
        assert ahead.objects[name]["end_x_m"]["mean"] == pytest.approx(
            entry["end_x_m"]["mean"], rel=1e-9
        )

    loaded = gx.load_run(folder / "run")
    assert loaded.parameters == json.loads(json.dumps(fit.parameters))
    left = (loaded.residuals.x_white - fit.residuals.x_white).abs().max()
    assert left < 1e-9
    assert check.p_value >= 0.01 and check.is_adequate
    assert {"clip", "object", "axis", "phase", "z"} <= set(check.cells.columns)
    assert fit.summary().loc["k1", "identified"]
    for figure in (track.plot(), fit.plot(), check.plot(), ahead.plot()):
        assert figure.data
    for one in (track, fit, check, ahead):
        assert "<" in one._repr_html_() and "\n" not in repr(one)
    (page,) = fit.report(folder / "page.html")
    assert page.read_text().startswith("<!doctype html>")


@pytest.mark.slow
def test_the_loop_on_a_hidden_drag(drag, folder, capfd):
    parts = []
    found = gx.diagnose(drag, on_progress=lambda _, share, part: parts.append((share, part)))
    assert capfd.readouterr() == ("", "")
    assert (found.verdict.status, found.verdict.effects) == ("named", ("air_drag",))
    rounds = [part["round"] for _, part in parts if isinstance(part, dict) and "round" in part]
    assert [row["effects"] for row in rounds] == [[], ["air_drag"]]
    streamed = {
        part["candidate"]["effect"]
        for _, part in parts
        if isinstance(part, dict) and "candidate" in part
    }
    assert {"air_drag", "viscous_drag"} <= streamed
    assert found.rounds.chi2_per_dof.iloc[1] < 1.5 < found.rounds.chi2_per_dof.iloc[0]
    assert found.candidates.effect.iloc[0] == "air_drag" and found.missing_force is None
    better = gx.fit(drag, effects=found.verdict.effects)
    assert better.parameters["k1"]["mean"] == pytest.approx(
        found.best.parameters["k1"]["mean"], abs=0.1 * better.parameters["k1"]["sd"]
    )
    galileo("diagnose", drag, "--out", folder / "diagnosis")
    found.save(folder / "found")
    assert without_times(folder / "found" / "diagnosis.json") == without_times(
        folder / "diagnosis" / "diagnosis.json"
    )
    assert found.plot().data and "air_drag" in found._repr_html_()


def test_the_callers_precision_makes_no_difference(drag, alone):
    with jax.enable_x64(True):
        assert gx.fit(drag).parameters == alone[0]


def test_two_threads_at_once(drag, alone):
    """Each has its own progress, and the numbers that it has alone."""
    found, stages = {}, {0: [], 1: []}

    def work(seed: int) -> None:
        def on_progress(stage: str, share: float, _: object) -> None:
            stages[seed].append((stage, threading.get_ident()))

        found[seed] = gx.fit(drag, seed=seed, on_progress=on_progress).parameters

    threads = [threading.Thread(target=work, args=(seed,), daemon=True) for seed in (0, 1)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(240)
    assert found == alone, "or they wait for each other"
    for seed, seen in stages.items():
        assert len({thread for _, thread in seen}) == 1, seed


def test_cancelling_stops_between_two_batches(drag):
    stop = threading.Event()
    seen = []

    def on_progress(stage: str, share: float, _: object) -> None:
        seen.append(stage)
        if stage == "searching":
            stop.set()

    with pytest.raises(gx.Cancelled):
        gx.fit(drag, on_progress=on_progress, cancel=stop)
    assert seen[-1] == "searching"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"effects": "air_drga"}, "did you mean air_drag"),
        ({"method": "gard"}, "--method: unknown method 'gard'"),
        ({"sampler": "random_walk"}, "--sampler: of --method mh, not of grad"),
        ({"method": "mh", "max_steps": 7}, "--max-steps: 7"),
        ({"motion": "free", "engine": "mjx"}, "--engine mjx: it moves objects in a plane"),
        ({"free": "speed_of_light"}, "free: unknown quantity"),
    ],
    ids=lambda value: str(value)[:30],
)
def test_a_wrong_call_is_one_sentence(options, said, drag):
    with pytest.raises(gx.InputError) as error:
        gx.fit(drag, **options)
    assert said in str(error.value) and "\n" not in str(error.value)


def test_a_track_is_tracked_once(video, monkeypatch):
    """By content: under another name it is known, too."""
    from galileo_jax.tracking import clip

    first = gx.track(video)

    def again(*_):
        raise AssertionError("tracked again")

    monkeypatch.setattr(clip, "track_clip", again)
    second = gx.track(video)
    assert first.pixels is not None and second.pixels is not None
    np.testing.assert_array_equal(first.pixels.position_px, second.pixels.position_px)
    for suffix in (".mp4", ".yaml"):
        text = video.with_suffix(suffix).read_bytes().replace(b"clip.mp4", b"same.mp4")
        video.with_name(f"same{suffix}").write_bytes(text)
    third = gx.track(video.with_name("same.mp4"))
    assert third.pixels is not None
    np.testing.assert_array_equal(first.pixels.position_px, third.pixels.position_px)


def test_a_clip_built_in_python_and_a_saved_track(video, folder, monkeypatch):
    track = gx.track(video)
    track.save(folder / "metres.csv")
    monkeypatch.chdir(folder)
    keys = {name: getattr(track.clip, name) for name in ("scenario", "ramp_angle_deg")}
    sizes = [
        {"name": item.name, "shape": item.shape, "size_m": list(item.size_m or ())}
        for item in track.clip.objects
    ]
    clip = gx.load({"track": "metres.csv", **keys, "objects": sizes})
    np.testing.assert_allclose(
        gx.track(clip).observation.position_m, track.observation.position_m, atol=1e-9
    )
    assert len(track.to_dataframe()) == 2 * track.clip.frame_count
    assert "air_drag" in gx.effects().index and "ramp" in gx.scenarios().index


def test_a_scale_given_for_a_loaded_clip_is_checked_and_repeated(video):
    """It stands in the command on the page, and a wrong one is refused."""
    clip = gx.load(video)
    with pytest.raises(gx.InputError, match="pixels_per_metre"):
        gx.track(clip, pixels_per_metre=-3.0)
    scale = clip.pixels_per_metre
    assert f"--pixels-per-metre {scale}" in gx.compare(clip, pixels_per_metre=scale).command
