"""The pages of `next` and `discover`: what to measure next, and what was measured and why."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from galileo_jax.diagnosis.reasons import p_text
from galileo_jax.experiment.settings import KNOWN, NUMBERS, known_as
from galileo_jax.report import html_page as html
from galileo_jax.report.chart import Chart, Panel, Points

NUM_ROWS = 20


def write_next_page(path: Path, record: Mapping[str, Any]) -> Path:
    """Writes the page of next.json and returns its path."""
    names = _names(record)
    about = record["about"] or "which hypothesis holds"
    odds = [f"{name}: {share:.3f}" for name, share in record["hypotheses"].items()]
    rows = [
        [*(_value(row[name]) for name in names), *(_number(row[key]) for key in NUMBERS)]
        for row in record["settings"][:NUM_ROWS]
    ]
    head = [*map(_title, names), f"gain, nats, about {about}", "named", "lead, nats", "hit"]
    note = (
        "named: probability that the true hypothesis is then far enough ahead of all others; lead: "
        "how far it is ahead on average; hit: probability that object 1 hits another object. "
        f"next.json has all {len(record['settings'])}."
    )
    caption = (
        f"The expected gain in nats about {about}, against each of the settings; one point for "
        "every combination that was tried, the best in colour."
    )
    expected, gains = "What each setting is expected to show", [gains_chart(record)]
    sections = [
        html.section(
            "What is open", html.prose("Probabilities of the hypotheses so far."), html.items(odds)
        ),
        html.chart_section(expected, caption, gains, "stack"),
        html.section("Settings", html.table(head, rows), html.prose(note, "soft")),
    ]
    title = ", ".join(Path(clip).stem for clip in record["clips"])
    return html.write_page(path, "next experiment", title, str(record["sentence"]), sections)


def gains_chart(record: Mapping[str, Any]) -> Chart:
    """The gain against each setting, one panel each; the best in colour."""
    rows = record["settings"]
    panels = []
    names = _names(record)
    varied = [name for name in names if len({row[name] for row in rows}) > 1]
    for name in varied or names[:1]:
        values = [row[name] for row in rows]
        gains = [row["gain_nats"] for row in rows]
        is_number = all(isinstance(v, int | float) for v in values)
        x = [float(v) for v in values] if is_number else [str(v) for v in values]
        marks = (
            Points(x[1:], gains[1:], "soft", "settings"),
            Points(x[:1], gains[:1], "accent", "the best", size_px=8),
        )
        panels.append(Panel("gain, nats", marks, xlabel=_title(name), level=0.0))
    label = f"expected gain against {', '.join(map(_title, names))}; {record['sentence']}"
    return Chart("gains", label, tuple(panels))


def write_discovery_page(path: Path, record: Mapping[str, Any], sentence: str) -> Path:
    """Writes the page of discover.json and returns its path."""
    names = list(record["lab"]["settings"])
    experiments = [
        [
            str(one["number"]),
            *(_value(one["settings"].get(name)) for name in names),
            one["outcome"] or "not made",
        ]
        for one in record["experiments"]
    ]
    verdicts = [
        [str(len(one["clips"])), one["status"], _what(one), p_text(one["p_value"])]
        for one in record["rounds"]
    ]
    reasons = [
        f"{one['number']}: {one['reason']}" + (f"; lost: {one['line']}" if one["line"] else "")
        for one in record["experiments"]
    ]
    words = [f"{len(one['clips'])}: {one['sentence']}" for one in record["rounds"]]
    made = html.table(["no.", *map(_title, names), "what came of it"], experiments)
    found = html.table(["clips", "verdict", "effects", "p without"], verdicts)
    held = [f"{name} = {value}" for name, value in record["held"].items()]
    sections = [
        html.section("Experiments", made, "<h3>Why</h3>", html.items(reasons)),
        html.section("Verdicts", found, "<h3>In words</h3>", html.items(words)),
        html.section("Settings that stay the same", html.items(held)),
    ]
    ended = html.prose(f"{record['ended']}.") if record["ended"] else ""
    is_good = bool(record["rounds"]) and record["rounds"][-1]["status"] in ("named", "none", "law")
    title = path.parent.name or "lab"
    return html.write_page(path, "discovery", title, sentence, sections, ended, is_good)


def _what(one: Mapping[str, Any]) -> str:
    """What a verdict is about: a formula reads better than the name of its effect."""
    law = one.get("law")
    if law is not None and one["status"] == "law":
        return str(law["text"])
    return ", ".join(one["effects"]) or one["form"] or ""


def _names(record: Mapping[str, Any]) -> Sequence[str]:
    return [name for name in record["settings"][0] if name not in NUMBERS]


def _title(name: str) -> str:
    known = known_as(name)
    unit = KNOWN[known].unit if known in KNOWN else ""
    return f"{known}, {unit}" if unit else known


def _value(value: Any) -> str:
    return f"{value:g}" if isinstance(value, int | float) else str(value)


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"
