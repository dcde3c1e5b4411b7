"""Predictions against the closed form; reproducible; wrong calls are one line."""

import json
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from galileo_jax.api.predict import predict
from galileo_jax.commands import command
from galileo_jax.commands import predict as predict_command
from galileo_jax.prediction.extrapolate import crossing_s, extrapolate
from galileo_jax.report.html_page import write_page
from galileo_jax.report.prediction import is_over, prediction_lines
from galileo_jax.report.side_view import draw_still, view_of
from galileo_jax.report.style import object_colour, palette
from galileo_jax.results.run import Run
from tests.oracle_run import HIT, MISS, STILL, make_run
from tests.ramp_model import make_surroundings
from tests.reference_ramp import solve

CLIP_S = 0.9  # object 1 is on its way across the table
SECONDS = 1.6
CONTACT_M = 0.004  # MuJoCo's contacts at the foot and in the impact take time; a point's take none
CONTACT_S = 0.02


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    return {
        "hit": make_run(folder / "hit", HIT, CLIP_S),
        "miss": make_run(folder / "miss", MISS, CLIP_S),
        "still": make_run(folder / "still", STILL, CLIP_S),
    }


def call(run, out, seed=0):
    """What the function writes into a folder."""
    predict(run.folder, seconds=SECONDS, draws=60, seed=seed).save(out)
    return json.loads((out / "prediction.json").read_text())


def holds(entry, value, spare):
    return entry["q025"] - spare <= value <= entry["q975"] + spare


def test_rest_and_hit_agree_with_the_closed_form(runs, tmp_path):
    found = call(runs["hit"], tmp_path)
    times = np.linspace(0, CLIP_S + SECONDS, 20001)
    exact = solve(HIT, times)
    speed = np.hypot(*np.moveaxis(exact.velocity_m_s, 1, 0))
    for i, name in enumerate(("object1", "object2")):
        entry = found["objects"][name]
        assert entry["slides_probability"] == entry["stops_probability"] == 1
        assert holds(entry["rest_x_m"], exact.position_m[i, 0, -1], 0.0)
        assert entry["rest_x_m"]["mean"] == pytest.approx(exact.position_m[i, 0, -1], abs=CONTACT_M)
        assert holds(entry["rest_time_s"], times[np.flatnonzero(speed[i] > 0)[-1]], CONTACT_S)
        way = np.sum(speed[i]) * times[1]
        assert holds(entry["travelled_m"], way, CONTACT_M)
        beyond = np.sum(speed[i][times > CLIP_S]) * times[1]
        assert holds(entry["travelled_beyond_clip_m"], beyond, CONTACT_M)
    assert found["hit"]["probability"] == 1
    assert holds(found["hit"]["time_s"], exact.hit_s, CONTACT_S)
    assert found["num_failed"] == 0
    assert {path.name for path in tmp_path.iterdir()} == {
        "prediction.json",
        "prediction.svg",
        "prediction.html",
        "first_and_last.png",
    }


def test_the_report_gets_one_section(runs, tmp_path):
    report = tmp_path / "report.html"
    write_page(report, "fit", "a fit", "It fits.", ["<h2>Motion</h2>"])
    for _ in range(2):
        call(runs["hit"], tmp_path)
        page = report.read_text()
        assert page.count('<section id="prediction">') == 1
        assert page.count('href="#prediction"') == 1
        assert "will it slide?" in page and "data:image/png;base64," in page
        assert page.index("Motion") < page.index("will it slide?") < page.index("</main>")
    assert not (tmp_path / "prediction.html").exists()


def test_object_2_stays_where_nothing_reaches_it(runs, tmp_path):
    found = call(runs["miss"], tmp_path)
    assert found["hit"] == {"probability": 0.0, "time_s": None}
    assert found["objects"]["object1"]["slides_probability"] == 1
    assert found["objects"]["object2"]["slides_probability"] == 0
    assert found["objects"]["object2"]["rest_time_s"] is None
    assert found["objects"]["object2"]["travelled_m"]["mean"] < 1e-3


def test_nothing_slides_on_a_rough_ramp(runs, tmp_path, capsys):
    """The command, which prints the answers."""
    words = ["--seconds", "1", "--draws", "60", "--out", str(tmp_path)]
    assert command.run(predict_command.main, [str(runs["still"].folder), *words]) == 0
    found = json.loads((tmp_path / "prediction.json").read_text())
    assert [entry["slides_probability"] for entry in found["objects"].values()] == [0, 0]
    assert capsys.readouterr().out.count("will it slide? no") == 2


def test_the_same_seed_gives_the_same_file(runs, tmp_path):
    texts = []
    for name, seed in (("a", 5), ("b", 5), ("c", 6)):
        call(runs["hit"], tmp_path / name, seed)
        texts.append((tmp_path / name / "prediction.json").read_bytes())
        texts.append((tmp_path / name / "prediction.svg").read_bytes())
    assert texts[:2] == texts[2:4]
    assert texts[0] != texts[4]


def test_prediction_does_not_depend_on_its_length(runs):
    short, long = (extrapolate(runs["hit"], seconds, 8, 0) for seconds in (0.1, 1.1))
    until = short.times_s[-1]
    ends = [
        [np.interp(until, motions.times_s, x) for x in motions.position_m[:, 0, 0]]
        for motions in (short, long)
    ]
    assert ends[0] == pytest.approx(ends[1], abs=1e-5)


def test_the_stills_show_where_the_objects_are(runs, tmp_path):
    """The first still has both objects, in their colours, where the run starts."""
    run = runs["miss"]
    call(run, tmp_path)
    assert (tmp_path / "first_and_last.png").read_bytes().startswith(b"\x89PNG")
    scene, clip = run.problem.model.scene, run.clip
    start_m = np.array(scene.surroundings.start_m)
    view = view_of(clip, scene, np.stack([start_m, start_m], axis=-1))
    width_m, height_m = view.size_m
    figure = Figure(figsize=(9.6, 9.6 * height_m / width_m), dpi=100)
    canvas = FigureCanvasAgg(figure)
    draw_still(figure.add_axes((0, 0, 1, 1)), clip, scene, view, start_m)
    canvas.draw()
    picture = np.asarray(canvas.buffer_rgba())[..., :3]
    scale = picture.shape[1] / width_m
    for i, (x, y) in enumerate(start_m):
        column, row = int(scale * (x - view.left_m)), int(scale * (view.top_m - y))
        assert bytes(picture[row, column]).hex() == palette()[object_colour(i)][1:]


def test_what_slides_on_nothing_moves_and_has_a_height():
    lasting = {"mean": 0.25, "q025": 0.2, "q975": 0.3}
    entry = {"slides_probability": 1.0, "stops_probability": 0.0, "rest_x_m": None}
    entry |= {"rest_time_s": None, "travelled_m": lasting, "travelled_beyond_clip_m": lasting}
    entry |= {"end_x_m": lasting, "end_y_m": {"mean": -0.75, "q025": -0.8, "q975": -0.7}}
    found = {"predicted_until_s": 1.0, "seconds_beyond_clip_s": 0.5, "hit": None}
    found["objects"] = {"ball": entry}

    def said(**scene):
        surroundings = replace(make_surroundings(HIT), **scene)
        problem = SimpleNamespace(
            model=SimpleNamespace(scene=SimpleNamespace(surroundings=surroundings))
        )
        return "\n".join(prediction_lines(cast(Run, SimpleNamespace(problem=problem)), found))

    assert "will it slide?" in said() and "y = " not in said()
    assert "will it move?" in said(rolls=(True, False))
    falls = said(has_surface=False)
    assert "will it move?" in falls and "y = -0.750 m (-0.800 to -0.700)" in falls


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_what_goes_on_moving_crosses_no_speed():
    times = np.array([0.0, 0.5, 1.0])
    falling = np.array([[0.0, 2.0, 9.0], [4.0, 2.0, 0.0], [1.0, 1.0, 1.0]])
    found = crossing_s(times, falling, np.array([1, 1, 1]), 1.0)
    assert found == pytest.approx([1.0, 0.75, 0.5])


@pytest.mark.parametrize(
    ("beyond_m", "slides", "is_told"), [(0.0, 1.0, True), (0.1, 1.0, False), (0.0, 0.0, False)]
)
def test_what_is_over_is_called_past(beyond_m, slides, is_told):
    entry = {"slides_probability": slides, "stops_probability": 1.0}
    entry |= {"travelled_beyond_clip_m": {"q975": beyond_m}}
    assert is_over({"objects": {"object1": entry}}) == is_told


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["{tmp}/none", "--seconds", "1"], "no result.json"),
        (["{tmp}", "--seconds", "1"], "no result.json"),
        (["{file}", "--seconds", "1"], "is a file"),
        (["{run}", "--seconds", "0"], "seconds"),
        (["{run}", "--seconds", "-1"], "seconds"),
        (["{run}", "--seconds", "nan"], "seconds"),
        (["{run}"], "--seconds"),
        (["{run}", "--seconds", "1", "--draws", "1"], "--draws"),
        (["{run}", "--seconds", "1", "--seed", "x"], "--seed"),
        (["{run}", "--seconds", "1", "--draws", "20000"], "not a whole number, 2 to 10000"),
        (["{run}", "--seconds", "1", "--out", "{file}"], "is a file"),
    ],
)
def test_wrong_calls_are_one_line(runs, tmp_path, capsys, words, said):
    file = tmp_path / "file"
    file.write_text("")
    places = {"tmp": tmp_path, "file": file, "run": runs["hit"].folder}
    before = sorted(runs["hit"].folder.iterdir())
    assert command.run(predict_command.main, [word.format(**places) for word in words]) == 2
    told = capsys.readouterr().err
    assert told.startswith("error: ") and told.count("\n") == 1 and said in told
    assert sorted(runs["hit"].folder.iterdir()) == before
