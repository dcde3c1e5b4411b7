"""One throw, written as many programs and people write it, is read as the same numbers."""

import io
import json
import zipfile
from collections.abc import Callable
from datetime import date, datetime
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from galileo_jax.runtime.errors import InputError
from galileo_jax.table.read import read_table
from galileo_jax.table.spreadsheet import _written
from galileo_jax.table.track_table import TrackTable

ROWS = 21
STEP_S = 0.04
DIGITS = 4


def truth() -> np.ndarray:
    """`[3, row]`: t, x, y of a throw, rounded as it is printed."""
    t = STEP_S * np.arange(ROWS)
    return np.round(np.stack([t, 2.0123 * t, 3.7 * t - 4.905 * t**2]), DIGITS)


def lines(
    separator: str = ",",
    decimal: str = ".",
    form: Callable[[float], str] = lambda v: f"{v:.{DIGITS}f}",
    columns: tuple[int, ...] = (0, 1, 2),
) -> list[str]:
    rows = truth()[list(columns)].T
    return [separator.join(form(v).replace(".", decimal) for v in row) for row in rows]


def text(*heading: str, body: list[str] | None = None, after: tuple[str, ...] = ()) -> str:
    return "\n".join([*heading, *(lines() if body is None else body), *after]) + "\n"


def read(folder: Path, content: str | bytes, suffix: str = "csv", fps: float | None = None):
    path = folder / f"a.{suffix}"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_table(path, fps)


def check(table: TrackTable, index: int = 0) -> None:
    t, x, y = truth()
    assert not table.is_in_frames
    np.testing.assert_allclose(table.clock - table.clock[0], t, atol=1e-9)
    np.testing.assert_allclose(table.position[index], [x, y], atol=1e-12)


def clocked(form: Callable[[int], str]) -> list[str]:
    """Rows whose time is written by the row's number."""
    return [f"{form(n)};{x};{y}" for n, (_, x, y) in enumerate(truth().T)]


SEMI = lines(";", ",")
FORMS = {
    "plain": text("t,x,y"),
    "no_titles": text(),
    "tabs": text("t\tx\ty", body=lines("\t")),
    "semicolons_and_commas": text("t;x;y", body=SEMI),
    "spaces": text("t x y", body=lines("  ")),
    "comma_twice": text("t, x, y", body=lines(", ", ",")),
    "bars": text("t|x|y", body=lines("|")),
    "units_in_their_row": text("t;x;y", "(s);(m);(m)", body=SEMI),
    "units_without_brackets": text("t;x;y", "s;m;m", body=SEMI),
    "avimeca": text("Pointages Aviméca", "t\tx\ty", "(s)\t(m)\t(m)", body=lines("\t", ",")),
    "name_above": text("mass_A", "t,x,y"),
    "quoted_lines": "\n".join(f'"{one}"' for one in ["mass A", "t\tx\ty", *lines("\t")]),
    "trailing_separators": text("t,x,y,", body=[f"{one},,," for one in lines()]),
    "empty_rows": text("", "t,x,y", ",,", body=[*lines()[:5], "", ",,", *lines()[5:], ",,"]),
    "comments": text("# made by a program", "# t x y", body=lines(" "), after=("# the end",)),
    "numpy_savetxt": text("# t,x,y", body=lines(form=lambda v: f"{v:.18e}")),
    "german": text("Bild; Zeit (in s); Objekt 1 x-Koordinate; Objekt 1 y-Koordinate; Objekt 1 x-"
                   "Geschwindigkeit", body=[f"{n}; {one}; 2,0" for n, one in enumerate(
                       lines("; ", ","))]),
    "slashes": text("t / s,x / m,y / m"),
    "velocities_beside": text("t,x,y,v_x,v_y", body=[f"{one},1,2" for one in lines()]),
    "y_before_x": text("y,x,t", body=lines(columns=(2, 1, 0))),
    "titles_in_no_known_words": text("aikapiste,sivu,ylös"),
    "titles_swapped": text("X, Y, t"),
    "milliseconds": text("t (ms),x,y", body=[f"{40 * n},{x},{y}"
                                             for n, (_, x, y) in enumerate(truth().T)]),
    "microseconds": text("t (us),x,y", body=[f"{40000 * n},{x},{y}"
                                             for n, (_, x, y) in enumerate(truth().T)]),
    "unix_ms": text("timestamp;x;y", body=clocked(lambda n: str(1715672462033 + 40 * n))),
    "iso": text("time;x;y", body=clocked(lambda n: f"2024-05-14T09:31:0{n * 40 // 1000}."
                                         f"{n * 40 % 1000:03d}Z")),
    "minutes": text("time;x;y", body=clocked(lambda n: f"12:0{n * 40 // 1000}."
                                             f"{n * 40 % 1000:03d}")),
    "hundredths": text("time;x;y", body=clocked(
        lambda n: f"0:00:{58 + (80 + 4 * n) // 100:02d}:{(80 + 4 * n) % 100:02d}")),
    "frames_of_a_second": text("time;x;y", body=clocked(
        lambda n: f"0:00:{1 + (20 + n) // 25:02d}:{(20 + n) % 25:02d}")),
    "two_spaces_and_commas": text("t  x  y", body=lines("  ", ",")),
    "last_row_first": text("t,x,y", body=lines()[::-1]),
    "times_coarser_than_rows": text("t,x,y", body=[f"{0.04 * n:.1f},{x},{y}"
                                                   for n, (_, x, y) in enumerate(truth().T)]),
    "row_numbers_beside_times": text(body=[f"{n} {one}" for n, one in enumerate(lines(" "))]),
    "time_and_height_swapped": text("y,x,t"),
    "titles_again": text("t,x,y", body=[*lines()[:9], "", "t,x,y", *lines()[9:]]),
    "titles_over_two_rows": text("Units\tRate", "mm\t25", "Frame#\tTime\tball\t", "\t\tX1\tY1",
                                 body=[f"{n}\t{one}" for n, one in enumerate(lines("\t"))]),
    "a_number_alone_above": text("Trajectories", "100", "Frame,t,X,Y",
                                 body=[f"{n},{one}" for n, one in enumerate(lines())]),
    "unix_us": text("timestamp;x;y", body=clocked(lambda n: str(1715672462033000 + 40000 * n))),
    "a_date_in_german": text("Datum;x;y", body=clocked(
        lambda n: f"14.05.2024 09:31:0{n * 40 // 1000},{n * 40 % 1000:03d}")),
    "a_date_in_american": text("date;x;y", body=clocked(
        lambda n: f"5/14/2024 9:31:0{n * 40 // 1000}.{n * 40 % 1000:03d} AM")),
    "two_clocks_that_agree": text("t1 (s),x,y,t2 (ms)", body=[
        f"{one},{1000 * n * STEP_S + 7:.0f}" for n, one in enumerate(lines())]),
    "a_clock_of_twelve_hours": text("time;x;y", body=clocked(
        lambda n: f"9:31:0{n * 40 // 1000}.{n * 40 % 1000:03d} PM")),
    "over_midnight": text("t;x;y", body=clocked(lambda n: f"{(23 + (5960 + 4 * n) // 6000) % 24}:"
                          f"{59 * (n < 10):02d}:{(5960 + 4 * n) % 6000 / 100:05.2f}")),
    "a_clock_by_any_name": text("Hora;x;y", body=clocked(lambda n: f"09:15:0{n * 40 // 1000}."
                                                         f"{n * 40 % 1000:03d}")),
    "words_below": text("\tt\tx\ty", body=[f"\t{one}" for one in lines("\t")],
                        after=("", "End of data")),
    "boxes": text("t,x,y,w,h", body=[f"{one},18,19" for one in lines()]),
    "a_time_twice": text("t,x,y", body=[lines()[0], *lines()]),
}  # fmt: skip


@pytest.mark.parametrize("content", FORMS.values(), ids=FORMS)
def test_every_form_is_the_same_throw(content: str, tmp_path: Path) -> None:
    check(read(tmp_path, content))


@pytest.mark.parametrize(
    ("title", "unit"), [("Vinkel (°)", np.pi / 180), ("kąt / deg", np.pi / 180), ("góc (rad)", 1.0)]
)
@pytest.mark.parametrize("clock", ["Tid (s)", "t (s)"])
def test_what_is_in_degrees_is_an_angle(
    clock: str, title: str, unit: float, tmp_path: Path
) -> None:
    """Whatever it is called; 'tid' alone would number particles."""
    table = read(tmp_path, text(f"{clock};{title}", body=lines(";", columns=(0, 1))))
    assert table.axes == ("angle",)
    np.testing.assert_allclose(table.position[0, 0], unit * truth()[1])
    np.testing.assert_allclose(table.clock, truth()[0])


@pytest.mark.parametrize(
    "titles",
    ["tid (s);läge x (cm);höjd y (cm)", "idő [s];hely x [cm];táv y [cm]", "t;ort x;oops y",
     "시간(초);가로 위치(cm);세로 위치(cm)", "czas [s];położenie x [cm];wysokość y [cm]"],
)  # fmt: skip
def test_words_beside_x_and_beside_y_are_no_names(titles: str, tmp_path: Path) -> None:
    """Two bodies of one coordinate each are none."""
    table = read(tmp_path, text(titles, body=lines(";")))
    check(table)
    assert len(table.names) == 1 and table.axes == ("x", "y")


def test_seconds_since_1970_may_be_called_an_epoch(tmp_path: Path) -> None:
    body = clocked(lambda n: f"{1764500000000 + round(1000 * STEP_S * n)}")
    check(read(tmp_path, text("epoch_ms;x;y", body=body)))


def test_a_time_that_counts_the_frames_again_is_none(tmp_path: Path) -> None:
    """TrackMate's, of a film whose rate it was not told."""
    body = [f"{n}.0,{n},{x},{y}" for n, (_, x, y) in enumerate(truth().T)]
    table = read(tmp_path, text("T,Frame,X,Y", body=body), fps=25.0)
    assert table.is_in_frames
    np.testing.assert_array_equal(table.clock, np.arange(ROWS))


ENCODINGS = {
    "utf-8-sig": "t,x,y",
    "utf-16": "t,x,y",
    "utf-16-le": "t,x,y",
    "utf-32": "t,x,y",
    "gbk": "时间,水平 x,高度 y",
    "latin-1": "Pointages Aviméca\nt,x,y",
    "cp1251": "время,x,y",
    "shift_jis": "時間,x,y",
    "euc_kr": "시간,x,y",
}


@pytest.mark.parametrize("encoding, heading", ENCODINGS.items(), ids=ENCODINGS)
def test_every_encoding(encoding: str, heading: str, tmp_path: Path) -> None:
    table = read(tmp_path, text(heading).encode(encoding))
    check(table)
    titles = [one.title for one in table.columns]
    assert titles == heading.split("\n")[-1].split(",")


def test_letters_as_wide_as_characters_are_letters(tmp_path: Path) -> None:
    content = text("时间(秒),水平(cm),高度(cm)")
    wide = content.translate({one: one + 0xFEE0 for one in range(0x21, 0x7F)})
    table = read(tmp_path, wide.encode("gbk"))
    assert table.unit == "cm"
    check(table)


def test_exponents_of_double_precision(tmp_path: Path) -> None:
    body = lines("   ", form=lambda v: f"{v:.{DIGITS + 2}E}".replace("E", "D"))
    check(read(tmp_path, text("! t[s]  x[m]  y[m]", body=body), "dat"))


def test_a_unit_in_an_old_encoding_is_a_unit(tmp_path: Path) -> None:
    """Statistics of letters take it for another one."""
    body = [f"{40000 * n},{x},{y}" for n, (_, x, y) in enumerate(truth().T)]
    check(read(tmp_path, text("t (µs),x,y", body=body).encode("latin-1")))


def test_units_of_length_and_resolution(tmp_path: Path) -> None:
    table = read(tmp_path, text("t (s),x (cm),y (cm)"))
    assert (table.unit, table.resolution) == ("cm", (1e-4, 1e-4))
    in_figures = read(tmp_path, text("t,x,y", body=lines(form=lambda v: f"{v:.2E}")))
    assert in_figures.resolution[1] == pytest.approx(1e-3)  # three figures of less than 1 m


def test_thousands_marks(tmp_path: Path) -> None:
    body = [f"{n};{1000.5 + n:,.1f};{2000 + 3 * n:,.1f}" for n in range(12)]
    expected = [[1000.5 + n for n in range(12)], [2000.0 + 3 * n for n in range(12)]]
    np.testing.assert_array_equal(
        read(tmp_path, text("frame;x;y", body=body)).position[0], expected
    )
    swiss = [one.replace(",", "\u2019") for one in body]
    np.testing.assert_array_equal(
        read(tmp_path, text("frame;x;y", body=swiss)).position[0], expected
    )
    german = [one.replace(",", "_").replace(".", ",").replace("_", ".") for one in body]
    np.testing.assert_array_equal(
        read(tmp_path, text("frame;x;y", body=german)).position[0], expected
    )


def test_nothing_is_written_in_many_ways(tmp_path: Path) -> None:
    words = ["", "nan", "n.d.", "-", "NA", "<NA>", "n.a.", "#N/D", "#WERT!"]
    body = lines()
    for n, word in enumerate(words):
        body[2 * n] = f"{truth()[0, 2 * n]},{word},{word}"
    table = read(tmp_path, text("t,x,y", body=body))
    assert np.isnan(table.position[0, 0, : 2 * len(words) : 2]).all()
    assert np.isfinite(table.position[0]).all(axis=0).sum() == ROWS - len(words)


@pytest.mark.parametrize("word", ["0", "-1"])
def test_a_number_that_stands_for_nothing_is_no_place(word: str, tmp_path: Path) -> None:
    body, lost = lines(), [5, 6, 13]
    for n in lost:
        body[n] = f"{truth()[0, n]},{word},{word}"
    table = read(tmp_path, text("t,x,y", body=[one + "\n" for one in body]))
    assert np.flatnonzero(np.isnan(table.position[0, 0])).tolist() == lost
    assert "not seen" in table.warnings[-1]


def test_a_body_that_comes_to_a_place_again_was_there(tmp_path: Path) -> None:
    """Pixels without a fraction: up and down through the same numbers, and at rest."""
    places = np.concatenate([np.full(9, 0), np.rint(300 * np.sin(np.arange(60) / 6))]).astype(int)
    table = read(tmp_path, text("frame,y", body=[f"{n},{y}" for n, y in enumerate(places)]))
    np.testing.assert_array_equal(table.position[0, 0], places)


def test_hundredths_are_told_from_frames_by_the_declared_rate(tmp_path: Path) -> None:
    body = [f"0:00:00:{round(n / 0.6):02d} {x} {y}" for n, (_, x, y) in enumerate(truth().T)]
    clock = read(tmp_path, text("#T X Y", body=body), fps=60.0).clock
    np.testing.assert_allclose(clock, np.arange(ROWS) / 60, atol=0.006)
    with pytest.raises(InputError, match="frames or hundredths"):
        read(tmp_path, text("#T X Y", body=body))


def test_a_unit_and_a_rate_in_the_heading(tmp_path: Path) -> None:
    """As motion capture writes them: a word and its value beside it."""
    heading = "Format,1.23,Capture Frame Rate,25,Length Units,Meters"
    table = read(tmp_path, text(heading, ",,ball,", ",,Position,", "Frame,,X,Y", body=[
        f"{n},,{x},{y}" for n, (_, x, y) in enumerate(truth().T)]))  # fmt: skip
    assert (table.unit, table.frame_s) == ("m", 1 / 25)


@pytest.mark.parametrize(
    "heading",
    [
        ("t1,y1,t2,y2",),
        ("Time (s) Run #1,y Run #1,Time (s) Run #2,y Run #2",),
        ("run 1,,run 2,", "t,y,t,y"),
        ("t,y,t,y",),
    ],
)
def test_clocks_that_differ_are_those_of_runs(tmp_path: Path, heading) -> None:
    body = [f"{t},{y},{t + 0.003:.4f},{y}" for t, _, y in truth().T]
    table = read(tmp_path, text(*heading, body=body))
    assert len(table.starts) == 2 and len(table.names) == 1
    np.testing.assert_allclose(table.position[0, 0], np.tile(truth()[2], 2))


def test_an_empty_column_may_stand_between_runs(tmp_path: Path) -> None:
    body = [f"{t},{y},,{t + 0.003:.4f},{y}" for t, _, y in truth().T]
    assert len(read(tmp_path, text("t,y,,t,y", body=body)).starts) == 2


def test_bodies_with_one_clock_are_no_runs(tmp_path: Path) -> None:
    """The second comes into the picture later."""
    rows = [f"{t},{x},{y}" for t, x, y in truth().T]
    body = [f"{row},{rows[n + 4]}" if n + 4 < ROWS else f"{row},,," for n, row in enumerate(rows)]
    with pytest.raises(InputError, match="a time in every row"):
        read(tmp_path, text("a t,a x,a y,b t,b x,b y", body=body))


@pytest.mark.parametrize("titles", ["t,t2,x,y", "t,x,y,t2", "time,real time,x,y"])
def test_a_second_time_without_places_of_its_own_is_no_second_clock(titles, tmp_path: Path) -> None:
    at = [titles.split(",").index(one) for one in ("x", "y")]
    body = []
    for t, x, y in truth().T:
        cells = [t, t * t, t * t, t * t]
        cells[at[0]], cells[at[1]] = x, y
        body.append(",".join(f"{one:.6f}" for one in cells))
    check(read(tmp_path, text(titles, body=body)))


def test_a_rest_at_the_origin_is_no_mark_of_what_was_not_seen(tmp_path: Path) -> None:
    """It is struck while it is out of sight."""
    x = [0.0] * 11 + [np.nan] * 4 + [0.3 + 0.05 * n for n in range(10)]
    body = [
        f"{0.04 * n:.2f},{'' if np.isnan(one) else f'{one:.3f}'},{0 * n}" for n, one in enumerate(x)
    ]
    table = read(tmp_path, text("t,x,y", body=body))
    assert (table.position[0, 0, :11] == 0).all()


def test_dates_with_hours_and_minutes_are_minutes_apart(tmp_path: Path) -> None:
    body = [f"14.05.2024 09:{10 + n};{x};{y}" for n, (_, x, y) in enumerate(truth().T)]
    assert np.diff(read(tmp_path, text("t;x;y", body=body)).clock) == pytest.approx(60.0)


def test_a_row_for_each_particle(tmp_path: Path) -> None:
    rows = [",y,x,mass,frame,particle"]
    for n, (_, x, y) in enumerate(truth().T):
        for particle in (7, 0):
            if (n, particle) != (3, 7):
                rows.append(f"{len(rows) - 1},{y},{x + particle},4126.1,{n},{particle}")
    table = read(tmp_path, "\n".join(rows))
    assert table.names == ("0", "7")
    np.testing.assert_array_equal(table.clock, np.arange(ROWS))
    np.testing.assert_allclose(table.position[0], truth()[1:])
    assert np.isnan(table.position[1, :, 3]).all()
    np.testing.assert_allclose(np.delete(table.position[1, 0], 3), np.delete(truth()[1] + 7, 3))


def test_words_tell_the_bodies_of_a_row_for_each_apart(tmp_path: Path) -> None:
    """Whatever their title is; words beside times that come once are remarks."""
    rows = [f"{t};{name};{x + n};{y}" for t, x, y in truth().T for n, name in enumerate(("Q", "B"))]
    table = read(tmp_path, text("t (s);Kloß;x (m);y (m)", body=rows[:3] + rows[4:]))
    assert table.names == ("Q", "B") and "2 objects" in table.warnings[0]
    check(table)
    assert np.isnan(table.position[1, :, 1]).all()
    np.testing.assert_allclose(np.delete(table.position[1, 0], 1), np.delete(truth()[1] + 1, 1))
    remarks = [f"{t};{'up' if n < 8 else 'down'};{x};{y}" for n, (t, x, y) in enumerate(truth().T)]
    check(read(tmp_path, text("t (s);what;x (m);y (m)", body=remarks)))


@pytest.mark.parametrize("quote", ["", '"'])
def test_rows_that_have_numbers_without_a_title(quote: str, tmp_path: Path) -> None:
    """As R's write.table writes them."""
    body = [f"{quote}{n + 1}{quote} {row}" for n, row in enumerate(lines(" "))]
    titles = " ".join(f"{quote}{one}{quote}" for one in ("time", "x.mm", "y.mm"))
    table = read(tmp_path, text(titles, body=body), "txt")
    assert table.unit == "mm"
    check(table)


def test_comments_with_a_word_and_its_value_are_no_titles(tmp_path: Path) -> None:
    """As Octave saves a matrix."""
    heading = (
        "# Created by Octave 8.4.0",
        "# name: a",
        "# type: matrix",
        "# rows: 21",
        "# columns: 3",
    )
    check(read(tmp_path, text(*heading, body=lines(" ")), "txt"))


def test_how_a_body_is_turned_is_no_place(tmp_path: Path) -> None:
    """As robots record it."""
    pose = [f"field.pose.{one}" for one in ("position.x", "position.y", "orientation.x")]
    body = [f"{1718100000000000000 + round(1e9 * t)},{x},{y},0.1" for t, x, y in truth().T]
    table = read(tmp_path, text(",".join(["%time", *pose]), body=body))
    assert len(table.names) == 1 and table.axes == ("x", "y")
    np.testing.assert_allclose(table.clock - table.clock[0], truth()[0], atol=1e-6)
    np.testing.assert_allclose(table.position[0], truth()[1:])


def test_names_of_pictures_are_no_numbers_of_theirs(tmp_path: Path) -> None:
    body = [f"{n}.jpg,{x},{y}" for n, (_, x, y) in enumerate(truth().T)]
    table = read(tmp_path, text("image_id,a.x,a.y", body=body))
    assert table.is_counted
    np.testing.assert_allclose(table.position[0], truth()[1:])


def test_a_name_above_one_column_is_that_of_all(tmp_path: Path) -> None:
    table = read(tmp_path, text(",,block", "t in s,x in m,y in m"))
    assert table.names == ("block",)
    check(table)


def test_a_length_in_unknown_words_beside_one_axis_is_the_other(tmp_path: Path) -> None:
    """With a unit: else it may be anything."""
    table = read(tmp_path, text("t (s);x (cm);quer (cm)", body=SEMI))
    assert table.axes == ("x", "y") and "read as y" in table.warnings[0]
    check(table)
    assert read(tmp_path, text("t (s);x (cm);quer", body=SEMI)).axes == ("x",)


def test_numbers_of_bodies_and_words_for_rotations_stand_above_the_titles(tmp_path: Path) -> None:
    """As Motive writes rigid bodies: 'X' under 'Rotation' is no place."""
    heading = (
        "Format Version,1.23,Take Name,1,Rotation Type,Quaternion,Length Units,Meters",
        ",,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body",
        ",,block,block,block,block,block",
        ",,1,1,1,1,1",
        ",,Rotation,Rotation,Position,Position,Mean Marker Error",
        "Frame,Time (Seconds),X,Y,X,Y,",
    )
    body = [f"{n},{t},.1,.2,{x},{y},.001" for n, (t, x, y) in enumerate(truth().T)]
    table = read(tmp_path, text(*heading, body=body))
    assert len(table.names) == 1 and table.axes == ("x", "y") and table.unit == "m"
    check(table)


def test_each_title_in_a_line_of_its_own(tmp_path: Path) -> None:
    """As Regressi has them."""
    heading = ("EVARISTE REGRESSI WINDOWS 1.0", "&3 NOM VAR", "t", "x", "y", "&3 UNITE VAR")
    body = [f" {t:.6f} {x:.6f} {y:.6f}" for t, x, y in truth().T]
    table = read(tmp_path, text(*heading, "s", "cm", "cm", "&21 VALEUR VAR", body=body))
    assert table.unit == "cm" and table.axes == ("x", "y")
    check(table)


def test_titles_in_several_forms_above_each_other_are_no_names(tmp_path: Path) -> None:
    """As TrackMate writes them: for programs, for people, in short, and units."""
    heading = (
        "LABEL,ID,TRACK_ID,POSITION_X,POSITION_Y,POSITION_T,FRAME",
        "Label,Spot ID,Track ID,X,Y,T,Frame",
        "Label,Spot ID,Track ID,X,Y,T,Frame",
        ",,,(mm),(mm),(sec),",
    )
    body = [
        f"ID{2 * n + k},{2 * n + k},{k},{x + k},{y},{t},{n}"
        for n, (t, x, y) in enumerate(truth().T)
        for k in (0, 1)
    ]
    table = read(tmp_path, text(*heading, body=body))
    assert table.names == ("0", "1") and table.unit == "mm"
    check(table)


def test_several_objects_by_names_in_the_titles_or_above(tmp_path: Path) -> None:
    body = [f"{t},{x},{y},{x + 1},{y}" for t, x, y in truth().T]
    for heading in (
        ("t,x1,y1,x2,y2",),
        ("temps,abscisse1,ordonnée1,abscisse2,ordonnée2",),
        ("Zeit in s,x1 in m,y1 in m,x2 in m,y2 in m",),
        ("Time (s),X A (m),Y A (m),X B (m),Y B (m)",),
        ("t,ball_x,ball_y,box_x,box_y",),
        ("#multi:", ",mass A,,mass B,", "t,x,y,x,y"),
    ):
        table = read(tmp_path, text(*heading, body=body))
        assert len(table.names) == 2
        check(table)
        np.testing.assert_allclose(table.position[1, 0], truth()[1] + 1)


@pytest.mark.parametrize(("step", "scale"), [(1000 / 30, 1e-3), (25 / 3, 1e-3), (10.0, 1.0)])
def test_times_of_a_film_in_milliseconds_need_no_unit(tmp_path: Path, step, scale) -> None:
    """Ten seconds may be between two rows; a third of a hundred is between two pictures."""
    body = [f"{n * step:.1f},{0.01 * n:.3f},{1 - 0.001 * n * n:.4f}" for n in range(20)]
    table = read(tmp_path, text("t,x,y", body=body))
    np.testing.assert_allclose(table.clock, np.arange(20) * step * scale, rtol=0.01)
    assert any("milliseconds" in one for one in table.warnings) == (scale != 1.0)


def test_an_object_of_one_letter_is_told_from_an_acceleration(tmp_path: Path) -> None:
    body = [f"{t},{x},{y},{x},{y}" for t, x, y in truth().T]
    titles = "t (s),{0} x ({2}),{0} y ({2}),{1} x ({2}),{1} y ({2})"
    assert read(tmp_path, text(titles.format("a", "b", "m"), body=body)).names == ("a", "b")
    assert read(tmp_path, text(titles.format("a", "b", "cm"), body=body)).names == ("a", "b")


def test_motion_capture_names_its_markers_alone(tmp_path: Path) -> None:
    heading = ["NO_OF_FRAMES\t21", "FREQUENCY\t25", "MARKER_NAMES\tA\tB"]
    body = [f"{x}\t0\t{y}\t{x + 1}\t0\t{y}" for _, x, y in truth().T]
    table = read(tmp_path, "\n".join([*heading, *body]), "tsv")
    assert (table.names, table.axes, table.is_counted) == (("A", "B"), ("x", "y", "z"), True)
    assert table.frame_s == pytest.approx(STEP_S)


def test_no_times_count_the_rows(tmp_path: Path) -> None:
    table = read(tmp_path, text("x,y", body=lines(columns=(1, 2))))
    assert table.is_counted
    np.testing.assert_allclose(table.position[0], truth()[1:])


@pytest.mark.parametrize("title", ["y (m)", "s / m", "Weg", "высота", "位移", "?"])
def test_one_coordinate(title: str, tmp_path: Path) -> None:
    table = read(tmp_path, text(f"t;{title}", body=lines(";", columns=(0, 2))))
    assert len(table.axes) == 1
    np.testing.assert_allclose(table.position[0, 0], truth()[2])


def test_two_places_at_one_time_are_their_mean_and_said(tmp_path: Path) -> None:
    t, x, y = truth()[:, 4]
    body = [*lines()[:5], f"{t},{x + 0.02},{y}", *lines()[5:]]
    table = read(tmp_path, text("t,x,y", body=body))
    assert table.position[0, 0, 4] == pytest.approx(x + 0.01)
    assert table.position.shape[-1] == ROWS
    assert "line 6: 1 times stand in several rows, 1 of them with other places" in table.warnings[0]


@pytest.mark.parametrize("again", [slice(None), slice(4, 9), slice(9, None)])
def test_rows_that_were_pasted_again_count_once(again: slice, tmp_path: Path) -> None:
    body = lines()
    at = len(body) if again.stop is None else again.stop
    table = read(tmp_path, text("t,x,y", body=[*body[:at], *body[again][:at], *body[at:]]))
    check(table)
    assert table.starts == (0,)
    assert f"line {at + 2}: {len(body[again])} rows are rows of before" in table.warnings[0]


@pytest.mark.parametrize(
    "heading", ["Run 1: t (s),Run 1: x (m),Run 1: y (m),Latest: t (s),Latest: x (m),Latest: y (m)",
                "t (s),x (m),y (m),t (s),x (m),y (m)"])  # fmt: skip
def test_runs_side_by_side_are_motions_one_after_the_other(heading: str, tmp_path: Path) -> None:
    """The second is shorter; where nobody names them, the same times are of runs of one body."""
    body = [f"{t},{x},{y}," + (f"{t},{2 * x},{y}" if n < 12 else ",,")
            for n, (t, x, y) in enumerate(truth().T)]  # fmt: skip
    table = read(tmp_path, text(heading, body=body))
    assert table.starts == (0, ROWS)
    check(table.motion(1))
    np.testing.assert_allclose(table.motion(2).position[0, 0], 2 * truth()[1, :12])
    same = [f"{t},{x},{y},{t},{2 * x},{y}" for t, x, y in truth().T]
    if heading.startswith("t"):
        (tmp_path / "same.csv").write_text(text(heading, body=same))
        assert read_table(tmp_path / "same.csv").starts == (0, ROWS)
        with pytest.raises(InputError, match="x is given twice"):
            read_table(tmp_path / "same.csv", num_bodies=2)


@pytest.mark.parametrize("title", ["unix_ms", "elapsed (ms)", "verstrichen / ms"])
def test_a_title_in_a_unit_of_time_is_the_time(title: str, tmp_path: Path) -> None:
    """However uneven the steps are."""
    ms = np.cumsum(np.random.default_rng(3).integers(20, 50, ROWS))
    body = [f"{t};{y}" for t, y in zip(ms, truth()[2], strict=True)]
    table = read(tmp_path, text(f"{title};s (cm)", body=body))
    np.testing.assert_allclose(table.seconds(None), ms / 1000)


@pytest.mark.parametrize("title", ["v (m/s)", "v / m/s", "a (m/s^2)", "a in m/s²"])
def test_a_column_in_the_unit_of_a_speed_is_no_place(title: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="which columns are places is not told"):
        read(tmp_path, text(f"t (s),{title}", body=lines(columns=(0, 1))))


def test_a_velocity_alone_is_no_place(tmp_path: Path) -> None:
    body = [f"{t},{x}" for t, x, _ in truth().T]
    with pytest.raises(InputError, match="which columns are places is not told by"):
        read(tmp_path, text("Time (s),Velocity (m/s)", body=body))


def test_the_centre_of_mass_is_no_second_body(tmp_path: Path) -> None:
    body = [f"{n},{x},{y},{x + 0.1},{y},{n}" for n, (_, x, y) in enumerate(truth().T)]
    table = read(tmp_path, text(" ,X,Y,XM,YM,Slice", body=body))
    assert len(table.names) == 1
    np.testing.assert_allclose(table.position[0, 0], truth()[1])


@pytest.mark.parametrize(
    ("title", "way"), [("depth (cm)", "down"), ("Tiefe / mm", "down"), ("height (cm)", "up"),
                       ("Y cm (down)", "down"), ("y (cm)", None)])  # fmt: skip
def test_a_title_says_which_way_an_upright_axis_counts(title: str, way: str, tmp_path: Path):
    body = [f"{t};{y}" for t, _, y in truth().T]
    assert read(tmp_path, text(f"t (s);{title}", body=body)).y_axis == way


@pytest.mark.parametrize(
    ("separator", "decimal", "space"), [("\t", ".", " "), (";", ",", " "), (",", ".", "")]
)
def test_units_may_stand_behind_every_number(separator, decimal, space, tmp_path: Path) -> None:
    behind = (f"{space}s", f"{space}cm", f"{space}cm")
    rows = [
        separator.join(cell + unit for cell, unit in zip(row.split("|"), behind, strict=True))
        for row in lines("|", decimal)
    ]
    table = read(tmp_path, text(separator.join("txy"), body=rows))
    check(table)
    assert table.unit == "cm"


def named(t: list[float], x: list[float], y: list[float]) -> dict[str, object]:
    """Named lists in the ways that programs have them, by what they are."""
    records = [{"t": one, "pos": {"x": a, "y": b}} for one, a, b in zip(t, x, y, strict=True)]
    rows = [list(row) for row in zip(t, x, y, strict=True)]
    return {
        "lists": {"t": t, "x": x, "y": y, "comment": "a throw"},
        "records": {"track": records},
        "rows": rows,
        "across": {"data": [t, x, y]},
        "places": {"t": t, "position": [row[1:] for row in rows]},
        "two bodies": {"t": t, "A": {"x": x, "y": y}, "B": {"x": y, "y": x}},
    }


NAMED = tuple(named([], [], []))


@pytest.mark.parametrize("kind", NAMED)
def test_named_lists_of_json(kind: str, tmp_path: Path) -> None:
    content = named(*truth().tolist())[kind]
    table = read(tmp_path, json.dumps(content), "json")
    check(table)
    assert table.names == (("A", "B") if kind == "two bodies" else ("object1",))


@pytest.mark.parametrize("kind", ["lists", "across", "places", "two bodies"])
def test_named_arrays_of_matlab(kind: str, tmp_path: Path) -> None:
    """A dictionary is a structure there."""
    file = io.BytesIO()
    savemat(file, named(*truth().tolist())[kind])
    check(read(tmp_path, file.getvalue(), "mat"))


def test_a_rate_and_a_unit_beside_named_lists(tmp_path: Path) -> None:
    _, x, y = truth().tolist()
    table = read(tmp_path, json.dumps({"fps": 25, "unit": "cm", "x": x, "y": y}), "json")
    assert (table.frame_s, table.unit) == (STEP_S, "cm")


@pytest.mark.parametrize(
    ("content", "words"),
    [("[[1, [2]], 3]", "no lists of numbers"), ('{"fps": 30}', "no lists of numbers"),
     (json.dumps([{f"{n}": 1} for n in range(2100)]), "at most 4000000"),
     ("[" * 900 + "]" * 900, "no lists of numbers"),
     (b"MATLAB 5.0 MAT-file" + bytes(300), "not a whole MATLAB file"),
     (b"MATLAB 7.3 MAT-file" + bytes(600), "-v7")],
)  # fmt: skip
def test_named_lists_that_cannot_be_read(content: str | bytes, words: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=words):
        read(tmp_path, content)


def test_columns_in_different_units_of_length_are_read_in_one(tmp_path: Path) -> None:
    t, x, y = truth()
    body = [f"{a},{b},{100 * c:.2f}" for a, b, c in zip(t, x, y, strict=True)]
    table = read(tmp_path, text("t (s),x (m),y (cm)", body=body))
    check(table)
    assert table.unit == "m" and table.resolution == pytest.approx((1e-4, 1e-4))


def test_means_below_a_table_are_no_rows_of_it(tmp_path: Path) -> None:
    after = ("Mittelwert;1,2;0,3", "Standardabweichung;0,4;0,1")
    check(read(tmp_path, text("t;x;y", body=SEMI, after=after)))


def test_a_table_on_its_side_is_read_by_columns(tmp_path: Path) -> None:
    rows = zip(("t (s)", "x (m)", "y (m)"), truth(), strict=True)
    content = "\n".join(f"{title};{';'.join(map(str, row))}" for title, row in rows)
    check(read(tmp_path, content))


def test_the_header_of_a_data_logger_names_no_body(tmp_path: Path) -> None:
    """LabVIEW's: its time is X_Value, its unit stands above."""
    head = ["LabVIEW Measurement", "Separator\tTab", "Time\t10:11:12,1", "***End_of_Header***", ""]
    head += ["Channels\t1", "Y_Unit_Label\tcm", "X_Dimension\tTime", "***End_of_Header***"]
    body = lines("\t", ",", columns=(0, 2))
    table = read(tmp_path, text(*head, "X_Value\tPosition\tComment", body=body), "lvm")
    np.testing.assert_allclose([table.clock, table.position[0, 0]], truth()[[0, 2]], atol=1e-9)
    assert table.names == ("object1",)


@pytest.mark.parametrize("is_closed", [True, False])
def test_a_table_of_a_web_page(is_closed: bool, tmp_path: Path) -> None:
    """Ends of cells and rows may be left out there."""
    cell, row = ("</td>", "</tr>") if is_closed else ("", "")
    body = "".join(
        f"<tr>{''.join(f'<td><b>{value}</b>{cell}' for value in line)}{row}\n"
        for line in (("t (s)", "x (m)", "y (m)"), *truth().T)
    )
    page = f"<!DOCTYPE html><html><p>1,2,3</p><table border=1>{body}</table><p>4 &lt; 5</p></html>"
    check(read(tmp_path, page, "xls"))


@pytest.mark.parametrize("late_s", [0.0, 2.0])
def test_runs_of_one_coordinate_side_by_side(late_s: float, tmp_path: Path) -> None:
    """Numbered, each with its own clock, that may go on in step with the others'."""
    t, x, y = truth()
    rows = [f"{a};{b};{a + late_s:.2f};{c}" for a, b, c in zip(t, x, y, strict=True)]
    table = read(tmp_path, text("t1 (s);s1 (cm);t2 (s);s2 (cm)", body=rows))
    assert table.axes == ("line",) and len(table.names) == 1
    np.testing.assert_allclose(table.position[0, 0], [*x, *y])


def test_two_motions_that_begin_alike_are_two(tmp_path: Path) -> None:
    other = [row if n < 5 else f"{row.rpartition(',')[0]},0.5" for n, row in enumerate(lines())]
    table = read(tmp_path, text("t,x,y", body=[*lines(), *other]))
    assert table.starts == (0, ROWS) and not table.warnings


def spreadsheet(rows: list[list[str]]) -> bytes:
    """A minimal xlsx, by its parts."""
    cells = "".join(
        f'<row r="{n}">' + "".join(f'<c r="{chr(65 + k)}{n}"><v>{v}</v></c>'
                                   for k, v in enumerate(row)) + "</row>"
        for n, row in enumerate(rows, 1)
    )  # fmt: skip
    main = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    office = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
    package = "http://schemas.openxmlformats.org/package/2006"
    parts = {
        "[Content_Types].xml": f'<Types xmlns="{package}/content-types"><Default Extension="xml" '
        'ContentType="application/xml"/></Types>',
        "_rels/.rels": f'<Relationships xmlns="{package}/relationships"><Relationship Id="r1" '
        f'Type="{office}/officeDocument" Target="xl/workbook.xml"/></Relationships>',
        "xl/workbook.xml": f'<workbook xmlns="{main}" xmlns:r="{office}"><sheets><sheet name="a" '
        'sheetId="1" r:id="r1"/></sheets></workbook>',
        "xl/_rels/workbook.xml.rels": f'<Relationships xmlns="{package}/relationships">'
        f'<Relationship Id="r1" Type="{office}/worksheet" Target="worksheets/sheet1.xml"/>'
        "</Relationships>",
        "xl/worksheets/sheet1.xml": f'<worksheet xmlns="{main}"><sheetData>{cells}</sheetData>'
        "</worksheet>",
    }
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, part in parts.items():
            archive.writestr(name, f'<?xml version="1.0" encoding="UTF-8"?>{part}')
    return out.getvalue()


def test_a_spreadsheet(tmp_path: Path) -> None:
    check(read(tmp_path, spreadsheet([one.split(",") for one in lines()]), "xlsx"))


def test_midnight_keeps_its_clock() -> None:
    """Calamine gives a date alone for it."""
    assert _written(date(2025, 5, 7)) == "2025-05-07T00:00:00"
    assert _written(datetime(2025, 5, 7, 0, 0, 1)) == "2025-05-07T00:00:01"


def test_a_sheet_of_two_far_cells_is_refused_not_fatal(tmp_path: Path) -> None:
    """A range of 17,000 million cells, at which calamine ends its process."""
    with zipfile.ZipFile(io.BytesIO(spreadsheet([["1"]]))) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    parts["xl/worksheets/sheet1.xml"] = parts["xl/worksheets/sheet1.xml"].replace(
        b"</sheetData>",
        b'<row r="1048576"><c r="XFD1048576"><v>1</v></c></row></sheetData>',
    )
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for name, part in parts.items():
            archive.writestr(name, part)
    with pytest.raises(InputError, match=r"a\.xlsx: not a whole spreadsheet, or far too large"):
        read(tmp_path, out.getvalue(), "xlsx")


REFUSED = {
    "comma_twice_untold": (
        text("t,x,y", body=[*lines(",", ",")[:-1], "1,5,6"]),
        r"cells for 3 titles .*the comma used twice.*write decimal points, or semicolons",
    ),
    "more_cells_than_titles": (
        text("t,x", body=lines()),
        r"line 2: 3 cells for 2 titles \('t', 'x'\); give every column a title",
    ),
    "a_huge_number": (
        text("t,x,y").replace("0.0805", "8.05e239"),
        r"line 3: x: '8.05e239' is larger than anything",
    ),
    "a_word": (text("t,x,y").replace("0.0805", "about"), r"line 3: x: 'about' is not a number"),
    "both_marks": (
        text("t;x;y", body=[*lines(";"), "0,84;1,5;2,5"]),
        r"the same decimal mark, point or comma, in the whole file",
    ),
    "two_units": (text("t (s),x (m),y (px)"), "different units: m, px"),
    "an_angle_without_unit": (
        text("t,angle", body=lines(columns=(0, 1))),
        r"an angle without its unit; write \(deg\) or \(rad\)",
    ),
    "x_twice": (text("t,x,x"), "x is given twice"),
    "web_page": ("<!DOCTYPE html><html><p>1,2</p></html>", "a web page without a table"),
    "times_of_a_stopwatch": (
        "Height (m),t1 (s),t2 (s),t3 (s)\n0.5,0.32,0.27,0.32\n1.0,0.42,0.45,0.48\n",
        "3 times for each place",
    ),
    "many_columns_of_nothing_known": (
        text(body=[f"{one},1,2,3" for one in lines()]),
        "which columns are places is not told; titles",
    ),
    "words_only": ("a,b\nc,d\n", "no row of numbers; line 1 has 'a', 'b'"),
    "frames_or_hundredths": (
        text("time;x;y", body=clocked(lambda n: f"0:00:01:{n:02d}")),
        "whether its last field counts frames or hundredths",
    ),
    "another_clock": (
        text("time;x;y", body=[*clocked(lambda n: f"12:00.{n:03d}"), "later;1;2"]),
        "'later' is not a time such as '12:00.000'",
    ),
}


@pytest.mark.parametrize("content, words", REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_read_is_one_line(content: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=words) as caught:
        read(tmp_path, content)
    assert "a.csv: " in str(caught.value) and "\n" not in str(caught.value)


def unsure(title: str, share_sure: float) -> str:
    """A throw in pixels, some of whose points are elsewhere, and how sure somebody was of each."""
    rng = np.random.default_rng(4)
    is_sure = rng.random(ROWS) < share_sure
    rows = []
    for (t, x, y), sure in zip(truth().T, is_sure, strict=True):
        there = (400 * x, 900 - 400 * y) if sure else (700.0, 100.0)
        rows.append(
            f"{round(t / STEP_S)},{there[0]:.2f},{there[1]:.2f},{0.98 if sure else 0.1:.3f}"
        )
    return text(f"frame,nose_x,nose_y,{title}", body=rows)


@pytest.mark.parametrize("title", ["nose_likelihood", "nose_conf", "Vertrauen"])
def test_how_sure_a_program_was_counts_whatever_it_is_called(title: str, tmp_path: Path) -> None:
    table = read(tmp_path, unsure(title, 0.8))
    seen = np.isfinite(table.position[0, 0])
    np.testing.assert_array_equal(seen, np.random.default_rng(4).random(ROWS) < 0.8)
    assert table.unit == "px" and 0 < seen.sum() < ROWS


def test_a_column_beside_that_is_no_sureness_is_not_taken_for_one(tmp_path: Path) -> None:
    assert np.isfinite(read(tmp_path, unsure("area", 0.3)).position).all()


@pytest.mark.parametrize(
    "titles",
    [
        "time;temperature",
        "Zeit (s);Temp. 1",
        "t;U (V)",
        "t (s);I (mA)",
        "t;Druck",
        "Datum;Temperatur",
    ],
)
def test_a_column_of_another_kind_is_no_way(titles: str, tmp_path: Path) -> None:
    """Nor is it asked about; a title that nobody knows may be the way in some language."""
    rows = "\n".join(f"{n / 2};{20 + 30 * 0.9**n:.2f}" for n in range(30))
    path = tmp_path / "a.csv"
    path.write_text(f"{titles}\n{rows}\n")
    with pytest.raises(InputError, match="which columns are places"):
        read_table(path)
    path.write_text(f"{titles.split(';')[0]};matka (m)\n{rows}\n")
    assert read_table(path).axes == ("line",)


def _falling(copies: dict[int, int], digits: int, folder: Path) -> TrackTable:
    """A throw of 30 rows, in which rows have the height of others."""
    t = np.arange(30) / 30
    x, y = 1.5 * t, 1.0 + 4.0 * t - 4.905 * t**2
    for copy, of in copies.items():
        x[copy], y[copy] = x[of] + 1e-4, y[of]  # as a program that smooths x alone
    path = folder / "a.csv"
    rows = "\n".join(
        f"{a:.4f},{b:.{digits}f},{c:.{digits}f}" for a, b, c in zip(t, x, y, strict=True)
    )
    path.write_text(f"t (s),x (m),y (m)\n{rows}\n")
    return read_table(path)


@pytest.mark.parametrize("copies", [{0: 1}, {29: 28}, {0: 1, 29: 28}, {11: 10}, {5: 4, 6: 4, 7: 4}])
def test_a_copied_place_is_not_seen(copies, tmp_path: Path) -> None:
    """At either end, as of programs that lose a body or find it late, and in a gap."""
    table = _falling(copies, 9, tmp_path)
    assert np.flatnonzero(np.isnan(table.position[0, 1])).tolist() == sorted(copies)
    assert any("a copy" in one for one in table.warnings)


def test_equal_places_are_no_copies_where_a_path_turns_or_digits_are_few(tmp_path: Path) -> None:
    t = np.arange(-15.5, 15.5) / 30
    path = tmp_path / "b.csv"
    rows = "\n".join(f"{a:.4f},{1.5 * a:.9f},{-4.905 * a**2:.9f}" for a in t)
    path.write_text(f"t (s),x (m),y (m)\n{rows}\n")
    assert np.isfinite(read_table(path).position).all()  # the vertex lies between two rows
    rows = "\n".join(f"{a:.4f},{1.5 * a:.9f},0" for a in t)
    path.write_text(f"t (s),x (m),y (m)\n{rows}\n")
    assert np.isfinite(read_table(path).position).all()  # it moves along x alone
    rests = np.clip(np.abs(t) - 0.1, 0.0, None) * np.sign(t)
    rows = "\n".join(f"{a:.4f},{b:.9f}" for a, b in zip(t, rests, strict=True))
    path.write_text(f"t (s),x (m)\n{rows}\n")
    assert np.isfinite(read_table(path).position).all()  # it lies still for a while
    for moment in np.linspace(0.0, 0.09, 10):  # it is let go
        fallen = 2.0 - 4.905 * np.maximum(t - t[0] - moment, 0.0) ** 2
        rows = "\n".join(f"{a:.4f},{b:.9f}" for a, b in zip(t, fallen, strict=True))
        path.write_text(f"t (s),y (m)\n{rows}\n")
        assert np.isfinite(read_table(path).position).all()
    assert np.isfinite(_falling({11: 10}, 2, tmp_path).position).all()


@pytest.mark.parametrize("word", ["Średnia", "keskiarvo", "n.b. lost"])
def test_what_a_word_begins_below_an_empty_row_is_no_row(word: str, tmp_path: Path):
    path = tmp_path / "a.csv"
    rows = [f"{n / 20:.2f};{0.3 * n**2 / 400:.4f}" for n in range(20)]
    path.write_text("\n".join(["t (s);y (m)", *rows, "", f"{word};0.2417"]) + "\n")
    assert read_table(path).position.shape[-1] == 20
