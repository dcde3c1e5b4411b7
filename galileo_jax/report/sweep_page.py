"""The page of a sweep: what a class found, each clip, errors, verdicts, what failed."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.report import html_page as html
from galileo_jax.report.chart import Boxes, Chart, Panel
from galileo_jax.report.class_chart import Agreement, class_section
from galileo_jax.report.provenance import versions_text
from galileo_jax.report.sweep_clips import ClipRow, clips_section

COLOURS = ("object2", "object1", "good", "fails", "ink", "soft")
QUANTITIES = {"k1": "k1", "k2": "k2", "mass_ratio": "m1/m2"}
BOXES_PX = 190
MAX_FAILURES = 50  # listed; the table on disk has all
Row = Mapping[str, Any]
EFFECT = (
    "Error of each estimate, by the effect that was hidden in the clip. Where no truth is known: "
    "the velocity error divided by the tracking noise; 1 is noise alone."
)
METHOD = "The same by method and by those of its options that differ between cells."
NO_TRUTH = (
    "The velocity error divided by the tracking noise, by method and by those of its options "
    "that differ; 1 is noise alone."
)
CELLS = (
    "The name of a cell is made from its options, the content of its clips and the version: the "
    "same name means the same numbers."
)


def write_sweep_page(
    path: Path,
    title: str,
    rows: Sequence[Row],
    command: str,
    clips: Sequence[ClipRow] = (),
    found: Sequence[Agreement] = (),
) -> None:
    """Writes the page.

    `rows`: as `sweeping.summary.make_rows` gives them; `clips` in the order in which they are
    shown.
    """
    done = [row for row in rows if row["status"] == "done"]
    failed = [row for row in rows if row["status"] == "failed"]
    label = labels(done)
    is_truth_known = any(row["hidden"] for row in done)
    to_compare = done if is_truth_known or len(set(map(label, done))) > 1 else []
    with_truth = done if is_truth_known else []
    caption = METHOD if is_truth_known else NO_TRUTH
    cells = {"command": html.code(command), "versions": versions_text()}
    sections = [
        class_section(found),
        clips_section(clips),
        _errors("Error by effect", EFFECT, with_truth, lambda row: row["hidden"], label),
        _errors("Error by method", caption, to_compare, label, label),
        _confusion(done),
        _methods(to_compare, label) if to_compare else "",
        _failures(failed),
        html.section("Provenance", html.prose(CELLS), html.listing(cells)),
    ]
    lead = f"{len(done)} of {len(rows)} cells done"
    lead += f", {len(failed)} failed: see below." if failed else "."
    if apart := sum(bool(row.remark) for row in clips):
        lead += f" {apart} of {len(clips)} clips stand apart (◆)."
    html.write_page(path, "sweep", title, lead, sections, is_good=not failed)


def labels(rows: Iterable[Row]) -> Callable[[Row], str]:
    """A cell's method with those options that differ between cells of this method."""
    seen: dict[str, dict[str, set[str]]] = {}
    for row in rows:
        own = seen.setdefault(row["method"], {})
        for key, value in _options(row).items():
            own.setdefault(key, set()).add(value)

    def label(row: Row) -> str:
        own = seen[row["method"]]
        shown = [value for key, value in _options(row).items() if len(own[key]) > 1]
        return " ".join([row["method"], *shown])

    return label


def _options(row: Row) -> dict[str, str]:
    found = dict(part.split("=", 1) for part in row["options"].split())
    if row["method"] not in ("diagnose", "explain"):  # of these it is no option
        found["effects"] = f"with {row['effects']}" if row["effects"] != "none" else "no effect"
    return found


def _errors(
    heading: str,
    caption: str,
    rows: Sequence[Row],
    category: Callable[[Row], str | None],
    label: Callable[[Row], str],
) -> str:
    """Box plots of each quantity's errors; of chi2 per degree of freedom where none is known."""
    names = sorted({label(row) for row in rows})
    colours = {name: COLOURS[i % len(COLOURS)] for i, name in enumerate(names)}

    def boxes(title: str, known: Sequence[Row], value: Callable[[Row], float]) -> Chart:
        is_beside = category is not label and len({label(row) for row in known}) > 1
        marks = []
        for name in sorted({label(row) for row in known}):
            own = [row for row in known if label(row) == name]
            places = [category(row) or "unknown" for row in own]
            marks.append(Boxes(places, [*map(value, own)], colours[name], name, is_beside))
        panel = Panel(title, tuple(marks), ylim=(0.0, 1.05 * max(map(value, known)) or 1.0))
        return Chart(title, f"{title}, box plots", (panel,), panel_px=BOXES_PX)

    charts = [
        boxes(f"error of {symbol}", known, lambda row, name=name: abs(row[f"{name}_error"]))
        for name, symbol in QUANTITIES.items()
        if (known := [row for row in rows if _has_error(row, name)])
    ]
    if not charts and (known := [row for row in rows if row["chi2_per_dof"] is not None]):
        charts = [boxes("chi2 per degree of freedom", known, lambda row: row["chi2_per_dof"])]
    if not charts:
        return ""
    key = html.legend(("dot", colour, name) for name, colour in colours.items())
    # Plotly's charts are as wide as the screen: on paper they would be cut off.
    return f'<div class="screen">{html.chart_section(heading, caption, charts, key=key)}</div>'


def _has_error(row: Row, quantity: str) -> bool:
    """Whether the truth is known and the clip determines the quantity, as far as is known."""
    return row[f"{quantity}_error"] is not None and row[f"{quantity}_identified"] is not False


def _confusion(rows: Sequence[Row]) -> str:
    """The hidden effect against the verdict."""
    known = [(row["hidden"], row["verdict"]) for row in rows if row["verdict"] and row["hidden"]]
    if not known:
        return ""
    hidden = sorted({h for h, _ in known})
    verdicts = sorted({v for _, v in known}, key=lambda v: (v not in hidden, v))
    count = Counter(known)
    most = max(count.values())
    lines = [[h, *(_shaded(count[h, v], most) for v in verdicts)] for h in hidden]
    note = (
        "Rows: the effect hidden in the clip. Columns: the verdict of the diagnosis. "
        f"{sum(h == v for h, v in known)} of {len(known)} are correct; none means that no effect "
        "is missing."
    )
    return html.section("Hidden and named", html.prose(note), html.table(["", *verdicts], lines))


def _shaded(number: int, most: int) -> html.Html:
    """The number on a ground that is the darker the larger it is; nothing for 0."""
    look = f'class="share" style="--share:{round(80 * number / most)}%"'
    return html.Html(f"<span {look}>{number}</span>" if number else "")


def _methods(rows: Sequence[Row], label: Callable[[Row], str]) -> str:
    """Each method in a line: how many cells, typical errors, and whether intervals hold."""
    head = ["", "cells", "converged"]
    for symbol in QUANTITIES.values():
        head += [f"{symbol}: median error", "in 95 %"]
    lines = []
    for name in sorted({label(row) for row in rows}):
        own = [row for row in rows if label(row) == name]
        line = [name, str(len(own)), _share(row["converged"] for row in own)]
        for quantity in QUANTITIES:
            errors = [abs(row[f"{quantity}_error"]) for row in own if _has_error(row, quantity)]
            line.append(f"{np.median(errors):.3g}" if errors else "")
            line.append(_share(row[f"{quantity}_covered"] for row in own))
        lines.append(line)
    return html.section("Methods", html.table(head, lines))


def _share(values: Iterable[bool | None]) -> str:
    """How many are true, of those that say anything."""
    known = [value for value in values if value is not None]
    return f"{sum(known)} of {len(known)}" if known else ""


def _failures(rows: Sequence[Row]) -> str:
    if not rows:
        return ""
    lines = [[html.code(row["cell"]), row["failure"]] for row in rows]
    more = len(lines) - MAX_FAILURES
    note = html.prose(f"{more} more are in summary.csv.") if more > 0 else ""
    return html.section("Failed", html.table(["cell", "why"], lines[:MAX_FAILURES]), note)
