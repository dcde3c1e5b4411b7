"""The page of what was found in films and tables that others made: its pictures and its rows."""

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from galileo_jax.report.style import matplotlib_style, object_colour, palette, save_svg

Row = Mapping[str, Any]  # of people.yaml, of the journal, or a part of one
BLOCK = re.compile(r"(?<=<!-- rows -->\n).*?(?=<!-- end -->)", re.DOTALL)
MOST_DOTS, MOST_CORNERS = 36, 150
SIZE_IN = (2.5, 1.65)
DISTRUST = "See where it fails"
NAMES = {"k1": "friction", "mass_ratio": "ratio of the masses", "gravity": "g",
         "thread_length": "length", "launch_speed": "launch speed", "pixels_per_metre": "scale",
         "deceleration1": "deceleration 1", "deceleration2": "deceleration 2"}  # fmt: skip
VERDICTS = {"wrong": "**wrong**", "wrong, not trusted": "**wrong**, and says so",
            "refused, rightly": "right: refused"}  # fmt: skip


def motions(track: Path, until_s: float) -> list[dict[str, Any]]:
    """What a picture draws of an exported track: each object along the axis that bends most."""
    if not track.is_file():
        return []
    table: Any = pd.read_csv(track)
    table = table[table.time_s <= table.time_s.min() + until_s]
    found = []
    for (_, name), one in table.groupby(["clip", "object"], sort=False):
        seen = one.dropna(subset=["x_m"])
        axis = max((a for a in "xyz" if f"fitted_{a}_m" in one), key=lambda a, s=seen: _bend(s, a))
        during = one[one.time_s.between(seen.time_s.min(), seen.time_s.max())]
        dots, line = _thinned(seen, MOST_DOTS), _thinned(during, MOST_CORNERS)
        found.append({
            "object": name, "axis": axis,
            "dots": [_digits(dots.time_s), _digits(dots[f"{axis}_m"])],
            "line": [_digits(line.time_s), _digits(line[f"fitted_{axis}_m"])],
        })  # fmt: skip
    return found


def write(docs: Path, cases: Sequence[Row], rows: Sequence[Row]) -> None:
    """The page's count and table between its marks, and a picture for each row with a fit."""
    folder, page = docs / "images" / "gallery", docs / "explanation" / "gallery.md"
    folder.mkdir(parents=True, exist_ok=True)
    lines = [counted(rows), "", "| | What, and who made it | Right | Found | Verdict | CPU s |",
             "|---|---|---|---|---|---|"]  # fmt: skip
    for case, row in zip(cases, rows, strict=True):
        name = Path(case["file"]).name.split(".")[0] + case.get("suffix", "")
        picture = f"![{case['tells']}](../images/gallery/{name}.svg)" if row["motions"] else ""
        if picture:
            (folder / f"{name}.svg").write_text(drawn(name, row["motions"], case.get("unit", "m")))
        verdict, seconds = VERDICTS.get(row["judged"], row["judged"]), f"{row['cpu_s']:.0f}"
        cells = [f"{case['tells']}. {case['by']}", case["known"], found(case, row), verdict]
        lines.append(" | ".join([f"| {picture}", *cells, f"{seconds} |"]))
    text = page.read_text(encoding="utf-8")
    page.write_text(BLOCK.sub(lambda _: "\n".join(lines) + "\n", text), encoding="utf-8")


def counted(rows: Sequence[Row]) -> str:
    """How many rows are right and wrong, in a sentence."""
    right = sum(row["judged"] in ("right", "refused, rightly") for row in rows)
    said = sum(row["judged"].endswith("not trusted") for row in rows)
    return (
        f"**{right} of {len(rows)} are right, {said} are wrong and the program says that its model "
        f"does not describe them, {len(rows) - right - said} are wrong without a word.**"
    )


def found(case: Row, row: Row) -> str:
    """What the program said of a row: values with 95 % intervals, or its sentence."""
    values = [f"{NAMES.get(name, name)} {_shown(one)}" for name, one in row["values"].items()]
    hits = [line for line in row["said"] if re.search(case.get("words", DISTRUST), line)]
    said = row["sentence"] or (re.sub(r"^warning: (\S+: )?", "", hits[-1]) if hits else "")
    said = said.partition(": galileo")[0].replace("|", "/")
    return "; ".join([*values, *([f"“{said}”"] if said and not values else [])])


def drawn(name: str, series: Sequence[Row], unit: str) -> str:
    """The picture: measured places as dots, the fit as a line, against time."""
    from matplotlib.figure import Figure

    with matplotlib_style(name):
        figure = Figure(figsize=SIZE_IN)
        axes = figure.add_axes((0.17, 0.24, 0.8, 0.62))
        for index, one in enumerate(series):
            colour = palette()[object_colour(index)]
            axes.plot(*one["line"], color=colour, linewidth=1.2, alpha=0.75)
            dots = [values[:: len(series)] for values in one["dots"]]
            axes.plot(*dots, "o", color=colour, markersize=2.8, markeredgewidth=0)
        names = dict.fromkeys(one["axis"] for one in series)
        axes.set_title(f"{' and '.join(names)}, {unit}", fontsize=8, pad=3)
        axes.set_xlabel("time, s", fontsize=8, labelpad=1)
        axes.locator_params(nbins=4)
        axes.tick_params(labelsize=8, length=2.5, pad=2)
    return re.sub(r"(\.\d\d)\d+", r"\1", save_svg(figure, name))


def _shown(value: Row) -> str:
    unit = {"m/s^2": "m/s²", "radii/s^2": "radii/s²", "1": ""}.get(value["unit"], value["unit"])
    if not value["identified"]:
        return "not determined"
    digits = max(0, math.ceil(-math.log10(value["sd"] / 3)))
    mean, low, high = (f"{value[name]:.{digits}f}" for name in ("mean", "q025", "q975"))
    return f"{mean} [{low}, {high}] {unit}".rstrip()


def _bend(seen: Any, axis: str) -> float:
    """How far the places along an axis are from a straight line against time, m."""
    time_s, place_m = seen.time_s, seen[f"{axis}_m"]
    return float(np.std(place_m - np.polyval(np.polyfit(time_s, place_m, 1), time_s)))


def _thinned(table: Any, most: int) -> Any:
    """Every so many rows."""
    return table.iloc[:: -(-len(table) // most) or 1]


def _digits(values: Any) -> list[float]:
    return [float(f"{one:.4g}") for one in values]
