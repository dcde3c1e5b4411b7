import csv
import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv, write_observation_csv
from galileo_jax.clip.track_noise import MIN_SD_M, position_noise_m
from galileo_jax.measurement.measure import measure
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.errors import InputError
from tests.clip.broken_clips import build_good_track


def make_observation(seed: int, is_isotropic: bool, num_frames: int = 40) -> Observation:
    rng = np.random.default_rng(seed)
    names = ("object1", "ball")
    position = rng.normal(size=(2, 2, num_frames))
    mask = rng.random((2, num_frames)) > 0.2
    sd = rng.uniform(1e-4, 1e-2, size=(2, 2, num_frames))
    correlation = rng.uniform(-0.9, 0.9, size=(2, num_frames))
    if is_isotropic:
        sd[:, 1], correlation[:] = sd[:, 0], 0.0
    shared = correlation * sd[:, 0] * sd[:, 1]
    covariance = np.array([[sd[:, 0] ** 2, shared], [shared, sd[:, 1] ** 2]]).transpose(2, 0, 1, 3)
    hidden = ~mask[:, None, :]
    position = np.where(hidden, np.nan, position)
    covariance = np.where(hidden[:, None], np.nan, covariance)
    return Observation(names, np.arange(num_frames) / 30, position, covariance, mask)


@settings(max_examples=20)
@given(seed=st.integers(0, 2**32 - 1), is_isotropic=st.booleans())
def test_written_track_reads_back(seed: int, is_isotropic: bool, tmp_path_factory) -> None:
    path = tmp_path_factory.getbasetemp() / "track.csv"
    observation = make_observation(seed, is_isotropic)
    write_observation_csv(path, observation)
    back = read_observation_csv(path)
    assert back.names == observation.names
    np.testing.assert_array_equal(back.times_s, observation.times_s)
    np.testing.assert_array_equal(back.position_m, observation.position_m)
    np.testing.assert_array_equal(back.mask, observation.mask)
    np.testing.assert_allclose(back.covariance_m2, observation.covariance_m2, rtol=1e-12)
    header = path.read_text().split("\n")[0]
    assert ("object1_sd_m" in header) == is_isotropic


def test_column_order_and_spaces_do_not_matter(tmp_path: Path) -> None:
    path = tmp_path / "track.csv"
    path.write_text(
        "\ufeffobject1_x_m, time_s, object1_sd_m, object1_y_m\n"
        + "".join(f"{0.01 * i}, {0.1 * i}, 0.001 ,{0.1 * i}\n" for i in range(6)),
        "utf-8",
    )
    back = read_observation_csv(path)
    np.testing.assert_allclose(back.position_m[0, 0], 0.01 * np.arange(6))
    np.testing.assert_allclose(back.covariance_m2[0, :, :, 0], 1e-6 * np.eye(2))


@pytest.mark.parametrize("sd_m", [1e-4, 3e-3])
@pytest.mark.parametrize("is_even", [True, False])
def test_noise_is_estimated_through_acceleration_and_impact(sd_m: float, is_even: bool) -> None:
    """Over 200 draws of 60 frames the median estimate is right and no draw is far off."""
    rng = np.random.default_rng(7)
    estimates = []
    for _ in range(200):
        steps = np.full(59, 1 / 30) if is_even else rng.uniform(0.02, 0.05, 59)
        times = np.concatenate([[0.0], np.cumsum(steps)])
        # Down a ramp, then braked on a table.
        after = np.clip(times - 1.0, 0, None)
        way = 0.5 * 1.5 * np.minimum(times, 1.0) ** 2 + 1.5 * after - 0.5 * 2.0 * after**2
        estimates.append(position_noise_m(times, way + rng.normal(0, sd_m, 60)))
    # 57 overlapping third differences: the MAD scatters by about 17 %.
    assert np.median(estimates) == pytest.approx(sd_m, rel=0.1)
    assert np.quantile(estimates, [0.02, 0.98]) == pytest.approx(sd_m, rel=0.6)


@pytest.mark.parametrize("rows", [6, 8, 10])
def test_few_rows_seldom_tell_too_small_an_error(rows: int) -> None:
    """Of 500 falls; a third of the truth at least in all but the odd one."""
    rng, times = np.random.default_rng(rows), np.arange(rows) / 20
    falls = 0.3 * times - 4.9 * times**2 + rng.normal(0, 2e-3, (500, rows))
    told = np.array([position_noise_m(times, fall) for fall in falls]) / 2e-3
    assert 1.0 < np.median(told) < 1.6
    assert (told < 1 / 3).mean() <= 0.02
    assert (told < 0.5).mean() <= 0.1


def test_noise_of_exact_positions_is_the_floor() -> None:
    times = np.arange(30) / 30
    assert position_noise_m(times, 4.9 * times**2) == MIN_SD_M


def test_missing_error_columns_are_estimated(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    times = np.arange(80) / 30
    x, y = times**2 + rng.normal(0, 2e-3, 80), -(times**2) + rng.normal(0, 5e-4, 80)
    path = tmp_path / "track.csv"
    rows = "".join(f"{t},{a},{b}\n" for t, a, b in zip(times, x, y, strict=True))
    path.write_text("time_s,ball_x_m,ball_y_m\n" + rows)
    observation = read_observation_csv(path)
    assert observation.names == ("ball",)
    sd = np.sqrt(np.diagonal(observation.covariance_m2[0, :, :, 5]))
    assert sd == pytest.approx([2e-3, 5e-4], rel=0.4)
    assert np.ptp(observation.covariance_m2[0, 0, 0]) == 0


def test_of_points_on_one_straight_line_the_distance_from_it_tells_nothing(tmp_path: Path) -> None:
    """Somebody measured a way and wrote it as x and y: the error is the way's, along the way."""
    rng = np.random.default_rng(2)
    times = np.arange(80) / 30
    way = times**2 + rng.normal(0, 1e-3, 80)
    along = np.array([np.cos(0.4), -np.sin(0.4)])
    path = tmp_path / "track.csv"
    rows = "".join(f"{t},{along[0] * w},{along[1] * w}\n" for t, w in zip(times, way, strict=True))
    path.write_text("time_s,ball_x_m,ball_y_m\n" + rows)
    observation = read_observation_csv(path)
    covariance = observation.covariance_m2[0, :, :, 5]
    assert np.sqrt(along @ covariance @ along) == pytest.approx(1e-3, rel=0.4)
    np.testing.assert_allclose(np.abs(observation.across[0, :, 5] @ along), 0.0, atol=1e-6)
    assert (observation.across[0] != 0).all()


ROWS = "".join(f"{i / 30:.4f},{0.01 * i:.3f},0.5,0.001\n" for i in range(12))
GOOD = "time_s,object1_x_m,object1_y_m,object1_sd_m\n" + ROWS


@pytest.mark.parametrize("old, new, message", [
    ("time_s", "t", r"column 't': unknown"),
    ("time_s,", "time,", r"column 'time': unknown; did you mean time_s"),
    ("object1_x_m", "object1_x_px", "did you mean object1_x_m"),
    ("object1_x_m", "object1_y_m", "'object1_y_m': given twice"),
    ("object1_y_m", "ball_y_m", "'object1_y_m': missing"),
    ("object1_sd_m", "object1_sd_x_m", "'object1_sd_y_m': missing"),
    (",object1_x_m,object1_y_m,object1_sd_m", "", "no object in the header|cells"),
    ("0.1000,0.030", "0.1000,thirty", "line 5: object1_x_m: 'thirty' is not a number"),
    ("0.1000,0.030", "0.1000,inf", "line 5: object1_x_m: 'inf' is not a number"),
    ("0.1000,0.030", "0.1000,", "line 5: object1: only one of x and y"),
    ("0.1000,0.030", ",0.030", "line 5: time_s: empty"),
    ("0.1000,0.030", "0.0667,0.030", "line 5: time_s: 0.0667 is not after 0.0667"),
    ("0.1000,0.030,0.5,0.001", "0.1000,0.030,0.5", "line 5: 3 cells; 4 expected"),
    ("0.1000,0.030,0.5,0.001", "0.1000,0.030,0.5,", "line 5: object1: standard deviation nan"),
    ("0.1000,0.030,0.5,0.001", "0.1000,0.030,0.5,-1", "line 5: object1: standard deviation -1"),
    ("0.1000,0.030,0.5,0.001", "0.1000,0.030,500,1", "500 m; metres expected"),
    (ROWS, ROWS[:46], "2 rows; at least 4"),
    (ROWS, ROWS.replace("0.5", ""), "only one of x and y"),
    (GOOD, "", "empty"),
    ("0.1000,0.030", "0.1000,1.234.5", "line 5: object1_x_m: '1.234.5' is not a number; .* 0.125"),
    ("0.1000,0.030", "0.1000,03. Jan", "line 5: object1_x_m: '03. Jan' is not a number"),
    ("0.1000,0.030", '0.1000,"1,234"', r"line 5: object1_x_m: '1,234', but line 2: time_s: '0.0000"
     "'; the same decimal mark"),
    ("0.1000,0.030,0.5", "0,1000,0,030,0,5", "line 5: 7 cells; 4 expected as in the header"),
    (GOOD, GOOD.replace(".", ","), "line 2: 8 cells; 4 .*; numbers with a decimal comma"),
    ("0.1000,0.030,0.5,0.001", "0.1000,0.030,0.5,0.001,7", "line 5: 5 cells; 4 expected"),
    ("time_s,object1_x_m", ",object1_x_m", "line 2: '0.0000' stands in column 1, .* no title"),
])  # fmt: skip
def test_wrong_track_names_the_place(old: str, new: str, message: str, tmp_path: Path) -> None:
    assert old in GOOD
    path = tmp_path / "track.csv"
    path.write_text(GOOD.replace(old, new, 1))
    with pytest.raises(InputError, match=rf"track\.csv: .*({message})"):
        read_observation_csv(path)


def write_still(path: Path, step_s: float) -> Path:
    """Nine rows of an object that rests, so far apart."""
    rows = "".join(f"{step_s * i},0,0,1\n" for i in range(9))
    path.write_text("time_s,a_x_m,a_y_m,a_sd_m\n" + rows)
    return path


@pytest.mark.parametrize(
    ("step_s", "message"),
    [
        (33.0, "33 s apart; seconds expected"),
        (1.0, "1 s apart; .*frame numbers"),
        (2.0, "2 s apart; .*frame numbers"),
    ],
)
def test_what_are_no_seconds_is_named(step_s: float, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        read_observation_csv(write_still(tmp_path / "track.csv", step_s))


@pytest.mark.parametrize("fps", [1.5, 15.0])
def test_slow_cameras_are_read(fps: float, tmp_path: Path) -> None:
    found = read_observation_csv(write_still(tmp_path / "track.csv", 1 / fps))
    assert len(found.times_s) == 9


def test_too_few_rows_to_estimate_the_error(tmp_path: Path) -> None:
    path = tmp_path / "track.csv"
    path.write_text("time_s,a_x_m,a_y_m\n" + "".join(f"{i / 30},0,{i}\n" for i in range(5)))
    with pytest.raises(InputError, match=r"a: too few rows \(6 expected\).* a column a_sd_m"):
        read_observation_csv(path)


def test_who_states_no_errors_has_them_told_by_so_many_rows(tmp_path: Path) -> None:
    path, places = tmp_path / "track.csv", np.random.default_rng(0).standard_normal((20, 2))
    rows = [f"{i / 30},{x},{y}" for i, (x, y) in enumerate(places)]
    path.write_text("\n".join(["time_s,a_x_m,a_y_m", *rows]))
    assert read_observation_csv(path).rows_of_noise == 20
    path.write_text("\n".join(["time_s,a_x_m,a_y_m,a_sd_m", *(f"{row},1" for row in rows)]))
    assert read_observation_csv(path).rows_of_noise == 0


@settings(max_examples=200)
@given(text=st.text(alphabet='time_s,object1_x_m\n\r\t0123.e-"; nai\0', max_size=80))
def test_garbage_gives_one_line(text: str, tmp_path_factory) -> None:
    path = tmp_path_factory.getbasetemp() / "garbage.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=r"garbage\.csv"):
        read_observation_csv(path)


def test_keys_that_a_track_does_not_need_are_told_of(tmp_path):
    """But not where the same yaml declares the video, which needs them."""
    path = build_good_track(tmp_path)
    assert load_clip(path).warnings == ()
    text = path.read_text() + "origin_px: [160.0, 150.0]\n"
    text = text.replace("name: object1", "name: object1\n    point_px: [73.1, 108.8]")
    path.write_text(text)
    point, origin = load_clip(path).warnings
    assert point.startswith(f"{path}: objects[0].point_px: not used")
    assert origin.startswith(f"{path}: origin_px: not used")
    path.write_text(text.replace("track: clip.csv", "video: clip.mp4"))
    assert load_clip(tmp_path / "clip.csv").warnings == ()


@st.composite
def spreadsheets(draw: st.DrawFn) -> Callable[[str], bytes]:
    """What a spreadsheet may make of a csv text when it saves it again."""
    mark = draw(st.sampled_from([",", ";", "\t"]))
    has_decimal_commas = draw(st.booleans())
    quotes = csv.QUOTE_ALL if draw(st.booleans()) else csv.QUOTE_MINIMAL
    end = draw(st.sampled_from(["\n", "\r\n"]))
    encoding = draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]))
    empty_columns, empty_rows = draw(st.integers(0, 3)), draw(st.integers(0, 2))
    is_ragged, names_mark, is_one_cell = (draw(st.booleans()) for _ in range(3))

    def save(text: str) -> bytes:
        rows = list(csv.reader(io.StringIO(text)))
        if has_decimal_commas:
            rows = [rows[0], *([cell.replace(".", ",") for cell in row] for row in rows[1:])]
        out = io.StringIO()
        writer = csv.writer(out, delimiter=mark, quoting=quotes, lineterminator=end)
        for row in rows:
            row = row + [""] * empty_columns
            while is_ragged and not row[-1]:
                row.pop()
            writer.writerow(row)
        for _ in range(empty_rows):
            writer.writerow([""] * (len(rows[0]) + empty_columns))
        saved = out.getvalue()
        if is_one_cell:  # opened where the separator is another one
            whole = io.StringIO()
            writer = csv.writer(whole, quoting=csv.QUOTE_ALL, lineterminator=end)
            writer.writerows([line] for line in saved.splitlines())
            saved = whole.getvalue()
        elif names_mark:
            saved = f"sep={mark}{end}{saved}"
        return saved.encode(encoding)

    return save


@settings(max_examples=150)
@given(seed=st.integers(0, 2**32 - 1), is_isotropic=st.booleans(), save=spreadsheets())
def test_what_a_spreadsheet_saves_again_is_the_same(
    seed: int, is_isotropic: bool, save: Callable[[str], bytes], tmp_path_factory
) -> None:
    path = tmp_path_factory.getbasetemp() / "saved.csv"
    write_observation_csv(path, make_observation(seed, is_isotropic, 20))
    written = read_observation_csv(path)
    path.write_bytes(save(path.read_text()))
    back = read_observation_csv(path)
    assert back.names == written.names
    for field in ("times_s", "position_m", "covariance_m2", "mask"):
        np.testing.assert_array_equal(getattr(back, field), getattr(written, field))


def test_rows_in_one_cell_of_which_the_last_has_only_a_time(tmp_path: Path) -> None:
    path = tmp_path / "saved.csv"
    write_observation_csv(path, make_observation(1, False, 20))
    written = read_observation_csv(path)
    *lines, last = path.read_text().splitlines()
    lines.append(last.split(",")[0])
    path.write_text("".join(f'"{line}"\n' for line in lines))
    back = read_observation_csv(path)
    np.testing.assert_array_equal(back.times_s, written.times_s)
    assert not back.mask[:, -1].any()


def test_a_saved_track_is_known_for_ours(tmp_path: Path) -> None:
    """Also as a clip: by its titles, whatever separates them."""
    path = build_good_track(tmp_path)
    expected = read_observation_csv(tmp_path / "clip.csv")
    text = (tmp_path / "clip.csv").read_text()
    for saved in (
        text.replace(",", ";").replace(".", ","),
        "sep=;\n" + text.replace(",", ";").replace(".", ","),
        "".join(f'"{line}"\r\n' for line in text.splitlines()),
    ):
        (tmp_path / "clip.csv").write_text("\ufeff" + saved)
        assert load_clip(path).fps == pytest.approx(30.0, rel=1e-3)
        found = measure(load_clip(path)).observation
        np.testing.assert_array_equal(found.position_m, expected.position_m)


def test_places_in_millimetres_within_a_hundred_are_refused(tmp_path: Path) -> None:
    """Pucks that go nine centimetres: a fall may be of 90 m, but not of 135 m/s."""
    rows = [f"{k / 60},{90 * k / 40},{0.5 * k / 40}" for k in range(40)]
    path = tmp_path / "mm.csv"
    path.write_text("\n".join(["time_s,object1_x_m,object1_y_m", *rows]) + "\n")
    with pytest.raises(InputError, match=r"object1: moves at 135 m/s; .* millimetres"):
        read_observation_csv(path)
