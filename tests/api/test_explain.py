"""`explain`: the parts in their order, nothing done twice, nothing written unasked."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

import galileo_jax as gx
from galileo_jax.api import explain as module
from galileo_jax.api.compare import compare
from galileo_jax.diagnosis.verdict import Verdict
from galileo_jax.report.diagnosis_text import adequacy
from galileo_jax.runtime.errors import InputError
from tests.api.test_understand import filmed


@pytest.fixture(scope="module")
def board(tmp_path_factory) -> Path:
    """A simulated board without an effect."""
    path = tmp_path_factory.mktemp("board") / "board.csv"
    gx.simulate(path, scenario="incline", seed=3, track_only=True)
    return path


@pytest.fixture(scope="module")
def plain(board) -> gx.Explanation:
    """Of a clip in which nothing is missing."""
    return gx.explain(board)


def test_what_nothing_is_missing_in_is_fitted_once_and_not_diagnosed(board, monkeypatch):
    import galileo_jax.api.compare as compare_module

    monkeypatch.setattr(module, "diagnose_fitted", None)
    monkeypatch.setattr(compare_module, "GradientFitter", None)  # would fit again
    before = sorted(board.parent.iterdir())
    stages: list[str] = []
    found = gx.explain(board, on_progress=lambda stage, share, partial: stages.append(stage))
    assert found.diagnosis is None and found.check.fit is found.fit and found.files == ()
    assert sorted(board.parent.iterdir()) == before, "nothing is written"
    assert stages[0] == "looking" and stages[-1] == "explained"
    assert found.look.seen is not None and found.look.seen.num_rows > 10


def test_the_paragraph_tells_the_friction_of_the_fit(plain):
    told = float(plain.paragraph.partition("a friction coefficient of ")[2].split()[0])
    assert plain.paragraph.startswith("The block slid with")
    assert told == pytest.approx(plain.fit.parameters["k1"]["mean"], abs=1e-3)
    assert "nothing is missing (p = " in plain.paragraph
    assert plain.paragraph in repr(plain)


def test_what_could_not_have_been_seen_is_what_a_diagnosis_says(plain):
    """No effect is fitted for it, and it is the same to the last digit but for roundings."""
    assert "could not have been seen" in plain.paragraph
    found = gx.diagnose(plain.fit.measurements[0].clip)
    told = found.document["could_not_see"]
    assert found.verdict.status == "none" and set(told) == set(plain.could_not_see)
    for name, one in plain.could_not_see.items():
        assert one["unit"] == told[name]["unit"]
        assert (one["strength"] is None) == (told[name]["strength"] is None)
        if one["strength"] is not None:
            assert one["strength"] == pytest.approx(told[name]["strength"], rel=0.05)


def test_what_is_saved_is_a_run_whose_page_begins_with_the_paragraph(plain, tmp_path):
    saved = plain.save(tmp_path / "out")
    assert all(path.is_file() for path in saved.files)
    assert {path.name for path in saved.files} == {"report.html", "result.json", "compare.json"}
    page = (tmp_path / "out" / "report.html").read_text()
    lead = page.index('<p class="lead')
    assert lead < page.index(plain.paragraph[:40]) < page.index("<main>")
    assert gx.load_run(tmp_path / "out").parameters["k1"] == plain.fit.parameters["k1"]


def test_where_the_check_fails_the_same_track_is_diagnosed(board, plain, monkeypatch):
    """The clip is not fitted without effects again; the fit that is told is the diagnosis's."""
    handed = []

    def failed(fit):
        made = compare(fit)
        return replace(made, found=replace(made.found, p_value=1e-9))

    def diagnosed(fit, **options):
        handed.append(fit)
        return SimpleNamespace(best=plain.fit, document={})

    monkeypatch.setattr(module, "compare", failed)
    monkeypatch.setattr(module, "diagnose_fitted", diagnosed)
    found = gx.explain(board, seed=0)
    assert handed == [found.check.fit]
    assert found.fit is plain.fit and found.diagnosis is not None


def test_a_clip_that_cannot_tell_is_not_diagnosed(board, plain, monkeypatch):
    def failed(fit):
        made = compare(fit)
        return replace(made, found=replace(made.found, p_value=1e-9, no_verdict="too few frames"))

    monkeypatch.setattr(module, "compare", failed)
    monkeypatch.setattr(module, "diagnose_fitted", None)
    assert gx.explain(board).diagnosis is None


def test_what_has_to_be_checked_first_is_not_diagnosed(tmp_path, monkeypatch):
    """A throw that is said to fall."""
    monkeypatch.setattr(module, "diagnose_fitted", None)
    t = np.arange(25) / 30
    noise = 1e-3 * np.random.default_rng(0).standard_normal((2, 25))
    x, y = np.stack([2.0 * t, 3.4 * t - 4.905 * t**2]) + noise
    rows = "\n".join(f"{a:.4f},{b:.4f},{c:.4f}" for a, b, c in zip(t, x, y, strict=True))
    (tmp_path / "a.csv").write_text(f"t (s),x (m),y (m)\n{rows}\n")
    found = gx.explain(tmp_path / "a.csv", scenario="fall")
    assert found.diagnosis is None
    assert found.paragraph.startswith("Check first: object1 goes along a path that bends")


def test_a_folder_is_trials_of_the_same_objects(tmp_path):
    for n in (1, 2):
        path = tmp_path / "trials" / f"{n}.csv"
        gx.simulate(path, scenario="incline", seed=3, track_only=True)
    assert module.sources_of(tmp_path / "trials") == [
        tmp_path / "trials" / "1.csv", tmp_path / "trials" / "2.csv"
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ([], "no clip given"),
        ("empty", "no film and no table"),
        ("run", "a run, which is a result"),
        ("none.csv", "no such file"),
    ],
)
def test_what_is_no_clip_is_one_line(given, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "result.json").write_text("{}")
    with pytest.raises(InputError, match=said):
        gx.explain(given)


def test_an_answer_goes_before_the_yaml(board):
    clip = module.understood(board, {"ramp_angle_deg": 22.0})
    assert isinstance(clip, gx.Clip) and clip.ramp_angle_deg == 22.0
    with pytest.raises(InputError, match="a table says itself where things are"):
        gx.explain(board, point=(10.0, 20.0))


@pytest.mark.video
def test_points_of_a_call_are_where_declared_objects_are(tmp_path):
    way = 0.09 * np.maximum(np.arange(30.0) - 4, 0) ** 2
    film = filmed(tmp_path, np.stack([40 + way, 30 + 0.36 * way, 0 * way], axis=1))
    objects = [{"name": "block", "shape": "box", "point_px": [5, 5], "first_frame": 2}]
    declared = {"video": film.name, "scenario": "incline", "objects": objects}
    for more in ({}, {"pixels_per_metre": 300, "ramp_angle_deg": 20}):  # left open, and not
        film.with_suffix(".yaml").write_text(yaml.safe_dump(declared | more))
        said = {"ramp_angle_deg": 20.0, "pixels_per_metre": 300.0}
        (clip,), _ = module.answered_clips([film], {**said, "points": [(41.0, 31.0)]})
        (block,) = clip.objects
        assert (block.name, block.point_px, block.first_frame) == ("block", (41.0, 31.0), 2)
        with pytest.raises(InputError, match=r"1 declared, but 2 points in the call; delete"):
            module.answered_clips([film], {**said, "points": [(41.0, 31.0), (60.0, 40.0)]})


def thrown(path: Path, drag_per_m: float) -> Path:
    """A table of a throw with a drag that grows with the square of the speed, .25 mm of noise."""
    step, place, velocity = 1e-4, np.zeros(2), 3.5 * np.array([np.cos(0.75), np.sin(0.75)])
    rows = []
    for i in range(7500):
        if i % 167 == 0:
            rows.append([i * step, *place])
        pull = np.array([0.0, -9.81]) - drag_per_m * np.linalg.norm(velocity) * velocity
        place = place + velocity * step + pull * step**2 / 2
        velocity = velocity + pull * step
    table = np.array(rows)
    table[:, 1:] += np.random.default_rng(4).normal(0, 2.5e-4, (len(table), 2))
    names = "time_s,object1_x_m,object1_y_m"
    np.savetxt(path, table, delimiter=",", header=names, comments="", fmt="%.6f")
    return path


@pytest.mark.parametrize("friction", [0.0, 0.1])
def test_a_model_that_rests_on_imperfections_says_so(friction, tmp_path):
    """Pushes between two bodies that part after a hit stand for other friction on the table."""
    hidden = {"surface_friction": {"surface_friction": friction}} if friction else ()
    made = tmp_path / "a.csv"
    gx.simulate(made, scenario="ramp", seed=5, track_only=True, effects=hidden)
    check = gx.compare(gx.fit(made))
    assert check.is_adequate
    assert check.rests_on_imperfections == bool(friction)
    is_said = "beside imperfections" in adequacy(check.document)
    assert is_said == (check.rests_on_imperfections and not check.in_question)


@pytest.mark.parametrize("drag", [0.0, 0.15])
def test_what_imperfections_take_up_is_asked_for(drag, tmp_path):
    """The size of gusts is free: a throw with drag is one with strong gusts, too, and no worse."""
    found = gx.explain(thrown(tmp_path / "throw.csv", drag), scenario="flight")
    assert found.check.is_adequate
    across = found.fit.parameters["start_velocity_x"]
    assert abs(across["mean"] - 3.5 * np.cos(0.75)) < 3 * across["sd"]
    if not drag:
        assert found.diagnosis is None and "nothing is missing" in found.paragraph
        return
    assert "air_drag" in found.in_question
    assert "but air_drag" in adequacy(found.check.document)
    before = replace(found, diagnosis=None, fit=found.check.fit).paragraph
    assert "but air drag" in before and "may be missing" in before
    assert found.diagnosis is not None and found.diagnosis.verdict.effects == ("air_drag",)
    told = found.fit.result["derived"]["air_drag_per_mass"]
    assert told["identified"] and told["q025"] < drag < told["q975"]
    # Where more than noise is left, what takes nearly all of the error away gives the values, too.
    unsure = replace(found.diagnosis.found, verdict=Verdict("unknown", ()))
    best = unsure.candidates[0]
    for left, effects in ((0.05, ("air_drag",)), (0.2, ())):  # of what is more than noise
        chi2 = 1 + left * (unsure.base.error["chi2_per_dof"] - 1)
        doubted = replace(best, error={**best.error, "chi2_per_dof": chi2})
        of_it = replace(found.diagnosis, found=replace(unsure, candidates=(doubted,)))
        assert of_it.best.effects == effects


def test_a_fall_shows_gravity_and_a_slope_does_not(plain, tmp_path):
    path = tmp_path / "fall.csv"
    gx.simulate(path, scenario="fall", seed=1, track_only=True)
    found = gx.explain(path)
    assert found.diagnosis is None
    seen = found.gravity
    assert seen["q025"] < 9.81 < seen["q975"] and 0 < seen["sd"] < 0.1
    assert "Gravity, measured instead of taken as declared, is 9." in found.paragraph
    assert found.check_document["gravity"] == seen
    assert plain.gravity == {} and "Gravity" not in plain.paragraph


@pytest.mark.slow
def test_a_hidden_drag_is_named_and_its_strength_told(tmp_path):
    path = tmp_path / "drag.csv"
    gx.simulate(path, seed=3, effects={"air_drag": {}}, strength=1, track_only=True)
    found = gx.explain(path, out=tmp_path / "out")
    assert found.diagnosis is not None and found.fit.effects == ("air_drag",)
    assert "Air drag explains the data" in found.paragraph
    assert "could not have been seen" in found.paragraph
    names = {path.relative_to(tmp_path / "out").as_posix() for path in found.files}
    assert names >= {"report.html", "diagnosis/diagnosis.json", "diagnosis/report.html"}
    assert 'href="diagnosis/report.html"' in (tmp_path / "out" / "report.html").read_text()
