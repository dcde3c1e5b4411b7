"""The page of a sweep: what a class found, each clip, errors, verdicts, what failed."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.report.chart import Boxes, Chart, Panel
from galileo_jax.report.class_chart import Agreement, class_section
from galileo_jax.report.html_page import chart_section, document, header, legend, table
from galileo_jax.report.provenance import versions
from galileo_jax.report.sweep_clips import ClipRow, clips_section
from galileo_jax.runtime.atomic_write import write_text

COLOURS = ("object2", "object1", "good", "fails", "ink", "soft")
QUANTITIES = {"k1": "k1", "k2": "k2", "mass_ratio": "m1/m2"}
BOXES_PX = 190
MAX_FAILURES = 50  # listed; the table on disk has all
Row = Mapping[str, Any]


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
    lead = f"{len(done)} of {len(rows)} cells done"
    lead += f", {len(failed)} failed: see below." if failed else "."
    if apart := sum(bool(row.remark) for row in clips):
        lead += f" {apart} of {len(clips)} clips stand apart (◆)."
    sections = [header("sweep", title, lead, is_good=not failed)]
    if found:
        sections.append(class_section(found))
    if clips:
        sections.append(clips_section(clips))
    is_truth_known = any(row["hidden"] for row in done)
    if is_truth_known:
        sections += _errors("Error by effect", _EFFECT, done, lambda row: row["hidden"], label)
    caption = _METHOD if is_truth_known else _NO_TRUTH
    is_comparison = is_truth_known or len({label(row) for row in done}) > 1
    if is_comparison:
        sections += _errors("Error by method", caption, done, label, label)
    sections += _confusion(done)
    if is_comparison:
        sections.append(_methods(done, label))
    if failed:
        sections.append(_failures(failed))
    sections.append(_provenance(command))
    write_text(path, document(f"{title}: sweep", sections))


_EFFECT = (
    "Error of each estimate, by the effect that was hidden in the clip. Where no truth is known: "
    "the velocity error divided by the tracking noise; 1 is noise alone."
)
_METHOD = "The same by method and by those of its options that differ between cells."
_NO_TRUTH = (
    "The velocity error divided by the tracking noise, by method and by those of its options "
    "that differ; 1 is noise alone."
)


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
) -> list[str]:
    """Box plots of each quantity's errors; of chi2 per degree of freedom where none is known."""
    charts = []
    for name, symbol in QUANTITIES.items():
        known = [row for row in rows if _has_error(row, name)]
        if known:
            values = [abs(row[f"{name}_error"]) for row in known]
            title = f"error of {symbol}"
            charts.append(_boxes(title, known, values, category, label))
    if not charts:
        known = [row for row in rows if row["chi2_per_dof"] is not None]
        if not known:
            return []
        values = [row["chi2_per_dof"] for row in known]
        charts.append(_boxes("chi2 per degree of freedom", known, values, category, label))
    names = sorted({label(row) for row in rows})
    key = legend(("dot", COLOURS[i % len(COLOURS)], name) for i, name in enumerate(names))
    # Plotly's charts are as wide as the screen: on paper they would be cut off.
    return [f'<div class="screen">{chart_section(heading, caption, charts, legend=key)}</div>']


def _has_error(row: Row, quantity: str) -> bool:
    """Whether the truth is known and the clip determines the quantity, as far as is known."""
    return row[f"{quantity}_error"] is not None and row[f"{quantity}_identified"] is not False


def _boxes(
    title: str,
    rows: Sequence[Row],
    values: Sequence[float],
    category: Callable[[Row], str | None],
    label: Callable[[Row], str],
) -> Chart:
    names = sorted({label(row) for row in rows})
    is_beside = category is not label and len(names) > 1
    marks = []
    for i, name in enumerate(names):
        own = [j for j, row in enumerate(rows) if label(row) == name]
        places = [category(rows[j]) or "unknown" for j in own]
        colour = COLOURS[i % len(COLOURS)]
        marks.append(Boxes(places, [values[j] for j in own], colour, name, is_beside))
    panel = Panel(title, tuple(marks), ylim=(0.0, 1.05 * max(values) or 1.0))
    return Chart(title, f"{title}, box plots", (panel,), panel_px=BOXES_PX)


def _confusion(rows: Sequence[Row]) -> list[str]:
    """The hidden effect against the verdict."""
    known = [(row["hidden"], row["verdict"]) for row in rows if row["verdict"] and row["hidden"]]
    if not known:
        return []
    hidden = sorted({h for h, _ in known})
    verdicts = sorted({v for _, v in known}, key=lambda v: (v not in hidden, v))
    count = Counter(known)
    most = max(count.values())
    lines = [[escape(h), *(_shaded(count[h, v], most) for v in verdicts)] for h in hidden]
    right = sum(n for (h, v), n in count.items() if h == v)
    return [
        f"<h2>Hidden and named</h2>\n<p>Rows: the effect hidden in the clip. Columns: the "
        f"verdict of the diagnosis. {right} of {len(known)} are correct; none means that no "
        f"effect is missing.</p>\n{table(['', *verdicts], lines)}"
    ]


def _shaded(number: int, most: int) -> str:
    """The number on a ground that is the darker the larger it is; nothing for 0."""
    share = round(80 * number / most)
    return f'<span class="share" style="--share:{share}%">{number}</span>' if number else ""


def _methods(rows: Sequence[Row], label: Callable[[Row], str]) -> str:
    """Each method in a line: how many cells, typical errors, and whether intervals hold."""
    head = ["", "cells", "converged"]
    for symbol in QUANTITIES.values():
        head += [f"{symbol}: median error", "in 95 %"]
    lines = []
    for name in sorted({label(row) for row in rows}):
        own = [row for row in rows if label(row) == name]
        line = [escape(name), str(len(own)), _share(row["converged"] for row in own)]
        for quantity in QUANTITIES:
            errors = [abs(row[f"{quantity}_error"]) for row in own if _has_error(row, quantity)]
            line.append(f"{np.median(errors):.3g}" if errors else "")
            line.append(_share(row[f"{quantity}_covered"] for row in own))
        lines.append(line)
    return "<h2>Methods</h2>\n" + table(head, lines)


def _share(values: Iterable[bool | None]) -> str:
    """How many are true, of those that say anything."""
    known = [value for value in values if value is not None]
    return f"{sum(known)} of {len(known)}" if known else ""


def _failures(rows: Sequence[Row]) -> str:
    lines = [[f"<code>{escape(row['cell'])}</code>", escape(row["failure"])] for row in rows]
    more = len(lines) - MAX_FAILURES
    note = f"<p>{more} more are in summary.csv.</p>" if more > 0 else ""
    return "<h2>Failed</h2>\n" + table(["cell", "why"], lines[:MAX_FAILURES]) + note


def _provenance(command: str) -> str:
    listed = ", ".join(f"{name} {found}" for name, found in versions().items())
    return (
        "<h2>Provenance</h2>\n<p>The name of a cell is made from its options, the content of its "
        "clips and the version: the same name means the same numbers.</p>\n"
        f"<dl><dt>command</dt><dd><code>{escape(command)}</code></dd>"
        f"<dt>versions</dt><dd>{escape(listed)}</dd></dl>"
    )
