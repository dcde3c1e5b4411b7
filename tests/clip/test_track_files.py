"""Files of other tools: the same motion comes out of each, and what is missing is asked for."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from galileo_jax.clip.load import load_clip
from galileo_jax.clip.schema import Clip
from galileo_jax.measurement.measure import measure
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.errors import InputError
from tests.clip import track_file_makers as make

YAML = """\
track: {name}
scenario: incline
ramp_angle_deg: 20.0
{keys}objects:
{objects}"""

ROUNDING_M = 1e-5  # of the texts, which have six digits


def clip_of(
    folder: Path, name: str, content: str | bytes, keys: str = "", objects: str = "object1"
) -> Clip:
    (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return clip_beside(folder / name, keys, objects)


def clip_beside(path: Path, keys: str = "", objects: str = "object1") -> Clip:
    items = "".join(f"  - {{name: {item}, shape: box}}\n" for item in objects.split(" + "))
    text = YAML.format(name=path.name, keys="".join(f"{k}\n" for k in keys.split("; ") if k),
                       objects=items)  # fmt: skip
    path.with_suffix(".yaml").write_text(text)
    return load_clip(path)


def observation_of(clip: Clip) -> Observation:
    return measure(clip).observation


def check_motion(observation: Observation, index: int = 0, shift_m: float = 0.0) -> None:
    expected = make.path_m() + np.array([[shift_m], [0.0]])
    seen = observation.mask[index]
    np.testing.assert_allclose(observation.times_s, make.times(), atol=1e-6)
    np.testing.assert_allclose(
        observation.position_m[index][:, seen], expected[:, seen], atol=ROUNDING_M
    )
    sd = np.sqrt(observation.covariance_m2[index, 0, 0][seen])
    assert 2e-4 < sd[0] < 8e-4  # 4e-4 was put in
    assert observation.rows_of_noise == len(observation.times_s)


TEXTS = {
    "tracker_text": ("txt", make.tracker_text(), "track_units: cm"),
    "tracker_text_in_german": ("txt", make.tracker_text("\t", ","), "track_units: cm"),
    "tracker_text_semicolons": ("csv", make.tracker_text(";", ","), "track_units: cm"),
    "table": ("csv", make.plain_table(), "track_units: mm; track_y: down"),
    "table_with_units": ("csv", make.plain_table(True), "track_y: down"),
    "table_utf16": ("csv", make.plain_table(True).encode("utf-16"), "track_y: down"),
}


@pytest.mark.parametrize("suffix, content, keys", TEXTS.values(), ids=TEXTS)
def test_text_of_one_object(suffix: str, content: str, keys: str, tmp_path: Path) -> None:
    clip = clip_of(tmp_path, f"slide.{suffix}", content, keys)
    check_motion(observation_of(clip))
    assert clip.fps == pytest.approx(make.FPS, rel=1e-4)
    assert clip.warnings == ()


def test_trk(tmp_path: Path) -> None:
    clip = clip_of(tmp_path, "slide.trk", make.trk())
    check_motion(observation_of(clip))
    assert (clip.pixels_per_metre, clip.origin_px) == (make.SCALE_PX_PER_M, make.ORIGIN_PX)
    assert clip.fps == pytest.approx(make.FPS)
    assert clip.warnings == ()


def test_trz_and_unknown_suffix_are_known_by_content(tmp_path: Path) -> None:
    check_motion(observation_of(clip_of(tmp_path, "slide.trz", make.trz(make.trk()))))
    check_motion(observation_of(clip_of(tmp_path, "other.dat", make.trk())))


def test_trk_with_a_unit(tmp_path: Path) -> None:
    scale = make.SCALE_PX_PER_M / 100
    check_motion(observation_of(clip_of(tmp_path, "a.trk", make.trk(scale=scale, unit="cm"))))
    clip = clip_of(tmp_path, "b.trk", make.trk(scale=scale, unit=None), "track_units: cm")
    check_motion(observation_of(clip))


def test_trk_without_calibration_has_no_scale(tmp_path: Path) -> None:
    clip = clip_of(tmp_path, "slide.trk", make.trk(scale=1.0))
    assert clip.pixels_per_metre is None
    assert not clip.is_scale_known
    known = clip_of(tmp_path, "slide.trk", make.trk(scale=1.0), "pixels_per_metre: 800.0")
    check_motion(observation_of(known))


@pytest.mark.parametrize("fps", [30.0, 240.0])
def test_declared_frame_rate_wins_over_the_trk(fps: float, tmp_path: Path) -> None:
    clip = clip_of(tmp_path, "slide.trk", make.trk(), f"fps: {fps}")
    assert clip.fps == fps
    assert f"fps: {fps:g} declared, slide.trk says 60" in clip.warnings[0]
    assert np.diff(observation_of(clip).times_s) == pytest.approx(1 / fps)


def test_axes_laid_along_the_slope_are_made_level(tmp_path: Path) -> None:
    clip = clip_of(tmp_path, "slide.trk", make.trk(angle_deg=-20.0))
    check_motion(observation_of(clip))
    assert "turned by -20.00 degrees; interpreted as laid along a slope" in clip.warnings[0]


def test_leaning_camera_is_set_upright(tmp_path: Path) -> None:
    clip = clip_of(tmp_path, "slide.trk", make.trk(angle_deg=1.5))
    assert "a camera that leans by 1.50 degrees" in clip.warnings[0]
    x, y = make.path_m()
    turn = np.radians(1.5)
    expected = [np.cos(turn) * x + np.sin(turn) * y, np.cos(turn) * y - np.sin(turn) * x]
    np.testing.assert_allclose(observation_of(clip).position_m[0], expected, atol=ROUNDING_M)


@pytest.mark.parametrize("content", [make.tracker_multi(), make.trk(("mass A", "mass B"))])
def test_two_objects_by_their_names(content: str, tmp_path: Path) -> None:
    suffix = "trk" if content.startswith("<") else "csv"
    path = tmp_path / f"slide.{suffix}"
    path.write_text(content)
    text = YAML.format(name=path.name, keys="track_units: m\n", objects="").replace(
        "scenario: incline", "scenario: ramp"
    )
    path.with_suffix(".yaml").write_text(
        text + "  - {name: mass_B, shape: box, size_m: [0.05, 0.05, 0.05]}\n"
        "  - {name: first, shape: box, size_m: [0.05, 0.05, 0.05], track_name: mass A}\n"
    )
    observation = observation_of(load_clip(path))
    assert observation.names == ("mass_B", "first")
    check_motion(observation, 0, 0.1)
    check_motion(observation, 1)
    assert observation.mask.sum() == 2 * make.NUM_FRAMES - (5 if suffix == "csv" else 0)


def test_logger_pro(tmp_path: Path) -> None:
    for content in (make.logger_pro(), make.logger_pro(";", ",")):
        path = tmp_path / "slide.csv"
        path.write_text(content)
        text = YAML.format(name=path.name, keys="", objects="")
        path.with_suffix(".yaml").write_text(
            text + "  - {name: block, shape: box, track_name: '2'}\n"
        )
        check_motion(observation_of(load_clip(path)), 0, 0.1)


@pytest.mark.parametrize("form", ["csv", "h5", "fixed"])
def test_deeplabcut(form: str, tmp_path: Path) -> None:
    path = tmp_path / ("slide.csv" if form == "csv" else "slide.h5")
    if form == "csv":
        path.write_text(make.dlc_csv())
    else:
        (make.dlc_h5 if form == "h5" else make.dlc_h5_fixed)(path)
    keys = f"fps: 60.0; pixels_per_metre: 800.0; origin_px: {list(make.ORIGIN_PX)}"
    observation = observation_of(clip_beside(path, keys, "block"))
    assert not observation.mask[0, 20]
    assert observation.mask.sum() == make.NUM_FRAMES - 1
    check_motion(observation)


def test_direction_and_origin_of_lengths(tmp_path: Path) -> None:
    rows = "".join(f"{t:.6f},{0.3 - x:.6f},{y + 0.2:.6f}\n"
                   for t, x, y in zip(make.times(), *make.path_m(), strict=True))  # fmt: skip
    clip = clip_of(
        tmp_path,
        "slide.csv",
        "t,x,y\n" + rows,
        "track_units: m; track_y: up; track_origin: [0.3, 0.2]; direction: left",
    )
    check_motion(observation_of(clip))


@pytest.mark.parametrize("key", ["", "; direction: left"])
def test_a_table_tells_which_way_its_ramp_goes(key: str, tmp_path: Path) -> None:
    rows = "".join(f"{t:.6f},{-x:.6f},{y:.6f}\n"
                   for t, x, y in zip(make.times(), *make.path_m(), strict=True))  # fmt: skip
    told = f"track_units: m; track_y: up{key}"
    clip = clip_of(tmp_path, "slide.csv", "t,x,y\n" + rows, told)
    check_motion(observation_of(clip))
    assert clip.direction == "left"
    assert any("direction: left, as the motion shows" in one for one in clip.warnings) == (not key)


def test_a_table_without_any_place_is_refused_in_a_line(tmp_path: Path) -> None:
    rows = "".join(f"{t:.6f},nan,nan\n" for t in make.times())
    with pytest.raises(InputError, match=r"slide\.csv: seen in 0 rows"):
        clip_of(tmp_path, "slide.csv", "t,x,y\n" + rows, "track_units: m; track_y: up")


OWN_CSV = "time_s,object1_x_m,object1_y_m\n" + "".join(
    f"{t:.6f},{x:.6f},{y:.6f}\n" for t, x, y in zip(make.times(), *make.path_m(), strict=True)
)


@pytest.mark.parametrize(
    "keys", ["track_units: cm", "track_y: down", "track_origin: [0.3, 0.2]", "direction: left"]
)
def test_own_csv_refuses_what_its_columns_say(keys: str, tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=f"slide.yaml: {keys.split(':')[0]}: .*correct the columns"
    ):
        clip_of(tmp_path, "slide.csv", OWN_CSV, keys)


def test_own_csv_may_be_told_what_it_says(tmp_path: Path) -> None:
    """So a run's yaml, which has every key, loads again."""
    keys = "track_units: m; track_y: up; track_origin: [0, 0]; direction: right"
    check_motion(observation_of(clip_of(tmp_path, "slide.csv", OWN_CSV, keys)))


def test_misplaced_own_csv_is_not_advised_to_take_such_keys(tmp_path: Path) -> None:
    (tmp_path / "slide.csv").write_text(OWN_CSV)
    text = YAML.format(name="slide.csv", keys="", objects="")
    item = "  - {name: object1, shape: box, size_m: [0.9, 0.9, 0.9]}\n"
    (tmp_path / "slide.yaml").write_text(text + item)
    with pytest.raises(
        InputError, match=r"inside the ramp .*correct .*size_m or the csv"
    ) as caught:
        load_clip(tmp_path / "slide.yaml")
    assert not any(key in str(caught.value) for key in ("track_", "direction", "_px"))


def broken(content: str, old: str, new: str) -> str:
    assert old in content
    return content.replace(old, new)


TRK, DLC, LOGGER, TABLE = make.trk(), make.dlc_csv(), make.logger_pro(), make.plain_table()
DLC_KEYS = "fps: 60.0; pixels_per_metre: 800.0"
BROKEN = {
    # name: (file, content, keys, words of the one line)
    "trk_truncated": ("a.trk", TRK[: len(TRK) // 2], "", "a.trk: not whole XML"),
    "trk_of_another_program": ("a.trk", "<?xml version='1.0'?><gpx/>", "", "holds gpx; a tab"),
    "trk_tabset": (
        "a.trk",
        broken(TRK, "tracker.TrackerPanel", "tracker.TFrame"),
        "",
        "holds TFrame; a tab",
    ),
    "trk_without_marks": ("a.trk", broken(TRK, "PointMass", "LineProfile"), "", "no point mass"),
    "trk_mark_is_text": (
        "a.trk",
        broken(TRK, 'name="x" type="double">', 'name="x" type="double">n/a'),
        "",
        "a.trk: mass A, frame 12: x: 'n/a",
    ),
    "trk_mark_is_nan": ("a.trk", broken(TRK, ">560.0<", ">NaN<"), "", "yorigin: 'NaN'"),
    "trk_unit_missing": ("a.trk", make.trk(unit=None), "", "track_units: missing; a.trk was calib"),
    "trk_moving_axes": ("a.trk", make.trk(drift_px=3.0), "", "coordinate system moves"),
    "trk_with_entities": ("a.trk", "<!DOCTYPE a [<!ENTITY b 'c'>]>" + TRK[39:], "", "entities"),
    "trz_cut_off": ("a.trz", make.trz(TRK)[:900], "", "not a whole"),
    "export_of_names_only": ("a.txt", "mass_A\nt\tx\ty\n", "track_units: m",
                             "no row of numbers; line 1 has 'mass_A'"),
    "export_without_unit": ("a.txt", make.tracker_text(), "", "track_units: m | cm"),
    "export_with_a_word": ("a.txt", broken(make.tracker_text(), "0.000000000E0", "x"),
                           "track_units: cm", "line 3: t: 'x' is not a number"),
    "table_without_unit": ("a.csv", TABLE, "track_y: up", "a.yaml: track_units: missing"),
    "table_in_wrong_unit": ("a.csv", TABLE, "track_units: m; track_y: down", "moves at 912 m/s"),
    "table_of_two_units": ("a.csv", broken(make.plain_table(True), "x (mm)", "x (px)"), "",
                           "in different units: mm, px"),
    "logger_pro_without_y": ("a.csv", broken(LOGGER, "Y (m)", "Q (m)"), "", "no column y"),
    "logger_pro_two_points": ("a.csv", LOGGER, "", "track_name: object1"),
    "nothing_moves": ("a.csv", "\n".join(["t (s),x (m),y (m)", *(f"{n / 30:.4f},0.3,2" for n in
                      range(20))]), "", "a.csv: nothing moves: all rows have the same place"),
    "times_stand_still": ("a.csv", broken(LOGGER, "0.250000", "0.200000"), "", "times must"),
    "dlc_without_fps": ("a.csv", DLC, "", "a.yaml: fps: missing; a.csv counts frames"),
    "dlc_never_likely": ("a.csv", broken(DLC, "0.999", "0.1"), DLC_KEYS, "seen in 0 rows"),
    "h5_truncated": ("a.h5", b"\x89HDF\r\n\x1a\n" + b"\0" * 90, DLC_KEYS, "not an h5 file of"),
    "empty": ("a.csv", "", "", "a.csv: empty"),
    "blank": ("a.trk", " \n\n", "", "a.trk: empty"),
    "unknown": ("a.csv", "mass;colour\n1;red\n", "", "which columns are places is not told by "
                "'mass', 'colour'; titles such as t (s), x (m), y (m) expected"),
    "binary": ("a.csv", bytes(range(256)), "", "not a text: a byte 0 at 0"),
    "unknown_unit": ("a.csv", TABLE, "track_units: furlong", "known: m, cm, mm"),
    "unknown_axis": ("a.csv", TABLE, "track_units: m; track_y: left", "track_y: unknown value"),
}  # fmt: skip


@pytest.mark.parametrize("name, content, keys, words", BROKEN.values(), ids=BROKEN)
def test_broken_file_gives_one_line(
    name: str, content: str | bytes, keys: str, words: str, tmp_path: Path
) -> None:
    objects = "block" if "track_name: " in words or "bodyparts" in str(content) else "object1"
    with pytest.raises(InputError) as caught:
        clip_of(tmp_path, name, content, keys, objects)
    line = str(caught.value)
    assert words in line
    assert "\n" not in line
    assert len(line) < 500


def test_h5_with_code_in_its_names_is_not_run(tmp_path: Path) -> None:
    import h5py

    path = make.dlc_h5(tmp_path / "slide.h5")
    with h5py.File(path, "a") as file:
        file["df_with_missing/table"].attrs["values_block_0_kind"] = np.bytes_(
            b"cos\nsystem\n(S'touch pwned'\ntR."
        )
    with pytest.raises(InputError, match=r"slide\.h5: not an h5 file of DeepLabCut \(os\.system"):
        clip_beside(path, DLC_KEYS, "block")


@settings(max_examples=150)
@given(
    which=st.sampled_from([TRK, DLC, LOGGER, TABLE, make.tracker_multi()]),
    at=st.floats(0, 1),
    junk=st.text(alphabet='t,x;y\t\n 0.-E"<>/:#()', max_size=6),
)
def test_damaged_file_gives_one_line_or_reads(which, at, junk, tmp_path_factory) -> None:
    folder = tmp_path_factory.getbasetemp() / "damaged"
    folder.mkdir(exist_ok=True)
    place = int(at * len(which))
    content = which[:place] + junk + which[place + len(junk) :]
    try:
        clip_of(folder, "a.csv", content, f"{DLC_KEYS}; track_units: m; track_y: up", "block")
    except InputError as error:
        assert "a." in str(error)


def test_track_name_must_be_in_the_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"track_name: 'mass C' is not in slide\.trk; it has mass"):
        path = tmp_path / "slide.trk"
        path.write_text(TRK)
        path.with_suffix(".yaml").write_text(
            YAML.format(name=path.name, keys="", objects="")
            + "  - {name: a, shape: box, track_name: mass C}\n"
        )
        load_clip(path)
