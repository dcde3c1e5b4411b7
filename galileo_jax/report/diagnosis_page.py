"""The pages of a comparison and of a diagnosis: where the model fails, and what it lacks."""

from collections.abc import Mapping, Sequence
from html import escape
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.clip.schema import Clip
from galileo_jax.comparison.path_residuals import PathResiduals
from galileo_jax.diagnosis.reasons import p_text
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.report import diagnosis_text
from galileo_jax.report import html_page as html
from galileo_jax.report.animation import animation
from galileo_jax.report.chart import Chart
from galileo_jax.report.diagnosis_charts import (
    NUM_CANDIDATES,
    before_after_chart,
    failure_chart,
    friction_chart,
    known_objects,
    missing_force_chart,
    rounds_chart,
)
from galileo_jax.report.fit_text import error_text, pull_text
from galileo_jax.report.paragraph import unseen_text
from galileo_jax.report.provenance import provenance
from galileo_jax.results.shown import shown

NUM_CELLS = 12
FAILURES = (
    "Position and speed along the path, 0 at the foot: measured (dots) and fitted (line). Below, "
    "the residuals in units of the stated noise: filled along the path, hollow across it; 95 % of "
    "noise is inside the grey band. Grey: transitions between phases. Yellow, where the model "
    "fails: the worst interval."
)
CELLS = (
    "A cell is one object, axis and phase of the motion. z: the largest of its test statistics, in "
    "standard deviations over data simulated with the fitted model. Autocorrelation: of "
    "neighbouring residuals, about 0 for noise."
)
ONLY_WIDE = ("", "log evidence", "log prior", "chi2 per dof", "p")  # of the candidates
ADDED = (
    "Residuals in units of the noise before and after, on the same axes: filled along the path, "
    "hollow across it. Yellow: the interval in which the model fails worst."
)
FRICTION = (
    "The coefficient of friction on stretches of four frames, with its 95 % band, as the motion "
    "asks for it. The path is counted from the foot of the ramp; on a slope alone, from where the "
    "track counts."
)
ROUNDS = "The error of the velocity in each round, and what tracking noise alone would give."
LEFT_OUT = "Error of the velocity without and with the added effect."


def write_comparison_page(
    path: Path,
    title: str,
    record: Mapping[str, Any],
    paths: Sequence[PathResiduals],
    clips: Sequence[Clip],
    model: tuple[JointProblem, np.ndarray],
    *,
    is_adequate: bool,
    command: str,
) -> Path:
    """Writes the page and returns its path.

    `record`: compare.json. `paths`: the objects' along their paths. `model`: with its parameters,
    as for `_motion`. `command` makes the page again.
    """
    left = f"{error_text(record['error'])}."
    pulls = html.items(map(pull_text, record["pulls"]))
    effects = html.prose(f"The model: {diagnosis_text.effects_text(record['effects'])}.", "soft")
    sections = [
        _failures(is_adequate, paths),
        _motion(clips, {"fitted": model}),
        _cells(record["where"], several=len(clips) > 1),
        provenance(command, clips, _engine_and_seed(record)),
    ]
    said = unseen_text(record)
    unseen = html.prose(said, "soft") if said else ""
    more = f"{html.prose(left)}\n{pulls}\n{effects}\n{unseen}"
    lead = diagnosis_text.adequacy(record)
    return html.write_page(path, "comparison", title, lead, sections, more, is_adequate)


def write_diagnosis_page(
    path: Path,
    title: str,
    record: Mapping[str, Any],
    paths: Sequence[Sequence[PathResiduals]],
    clips: Sequence[Clip],
    models: Sequence[tuple[JointProblem, np.ndarray]],
    *,
    truth: str | None,
    command: str,
    next_command: str,
) -> Path:
    """Writes the page and returns its path; each figure in it can be saved as SVG.

    `record`: diagnosis.json. `paths`, `models`: of every round, as for a comparison. `truth`: the
    effect hidden in a synthetic clip; None where that is not known. `command` makes the page again.
    """
    verdict, names = record["verdict"], _titles(record)
    alone = diagnosis_text.each_clip(record.get("each_clip"))
    sections = [
        html.section("Why", html.items(why["sentence"] for why in record["reasons"])),
        _rounds(record["history"]),
        _candidates(record),
        _motion(clips, dict(zip(names, models, strict=True))),
        _failures(record["adequate"], paths[0], f": {names[0]}"),
        *(
            html.chart_section(f"Added: {name}", ADDED, charts)
            for name, charts in before_after_charts(record, paths).items()
        ),
        _missing(record),
        _friction(record.get("friction_along_way", [])),
        _cells(record["where"], several=len(clips) > 1),
        html.section("Each clip alone", html.items(alone)),
        _left_one_out(record.get("left_one_out", [])),
        provenance(command, clips, _engine_and_seed(record)),
    ]
    hidden = "" if truth is None else html.prose(f"Truth: {truth}.")
    go_on = html.prose(html.Html(f"Next: {html.code(next_command)}"), "soft")
    more = "\n".join([hidden, html.items(verdict["advice"]), go_on])
    is_good = verdict["status"] != "unknown"
    return html.write_page(path, "diagnosis", title, record["sentence"], sections, more, is_good)


def before_after_charts(
    record: Mapping[str, Any], paths: Sequence[Sequence[PathResiduals]]
) -> dict[str, list[Chart]]:
    """By the effects of each round after the first, a chart for each object: before and after."""
    return {
        name: [before_after_chart(*two, (before, name)) for two in zip(old, new, strict=True)]
        for (old, before), (new, name) in pairwise(zip(paths, _titles(record), strict=True))
    }


def _titles(record: Mapping[str, Any]) -> list[str]:
    """What the rounds' models are called."""
    return [diagnosis_text.effects_text(row["effects"]) for row in record["history"]]


def _rounds(history: Sequence[Mapping[str, Any]]) -> str:
    frictions = [name for name in ("k1", "k2") if name in history[0]]
    rows = [
        [
            diagnosis_text.round_text(row), f"{row['rmse']:.4f}", f"{row['chi2_per_dof']:.2f}",
            p_text(row["p_value"]), *(shown(row[k]) for k in frictions),
        ]
        for row in history
    ]  # fmt: skip
    head = ["model with", "rmse, m/s", "chi2 per dof", "p", *frictions]
    marks = [("fill", "accent", "velocity error"), ("dashed", "ink", "tracking noise alone")]
    key = html.legend(marks)
    charts = html.chart_section("Rounds", ROUNDS, [rounds_chart(history)], "stack", key)
    return f"{charts}\n{html.table(head, rows)}"


def _candidates(record: Mapping[str, Any]) -> str:
    candidates, none = record["candidates"], record["probability_none"]
    rows = [_candidate(entry) for entry in candidates[:NUM_CANDIDATES]]
    chi2, p = f"{record['error']['chi2_per_dof']:.2f}", p_text(record["p_value"])
    rows.append(["none", _bar(none), f"{none:.3f}", "", "+0.0", "+0.0", chi2, p, ""])
    head = ["effect", "", "probability", "strength", "log evidence", "log prior", "chi2 per dof",
            "p", "not distinguished from"]  # fmt: skip
    if not any(row[-1] for row in rows):
        head, rows = head[:-1], [row[:-1] for row in rows]
    rest = len(candidates) + 1 - len(rows)
    note = html.prose(f"{rest} more are less probable; diagnosis.json has them.", "soft")
    return html.section("Candidates", html.table(head, rows, ONLY_WIDE), note if rest > 0 else "")


def _candidate(entry: Mapping[str, Any]) -> list[str]:
    texts = diagnosis_text.strength_texts(entry)
    named = [text if len(texts) == 1 else f"{name} = {text}" for name, text in texts.items()]
    return [
        _wrapped(_breakable(entry["effect"]).replace("+", "+<wbr>")),
        _bar(entry["probability"]),
        f"{entry['probability']:.3f}",
        _wrapped(escape(entry["law"] or ", ".join(named))),
        f"{entry['log_evidence']:+.1f}",
        f"{entry['log_prior']:+.1f}",
        f"{entry['chi2_per_dof']:.2f}",
        p_text(entry["p_value"]),
        _breakable(", ".join(entry["confounded_with"])),
    ]


def _breakable(name: str) -> html.Html:
    """A line may break after a _."""
    return html.Html(escape(name).replace("_", "_<wbr>"))


def _wrapped(inner: str) -> html.Html:
    return html.Html(f'<div class="wrapped">{inner}</div>')


def _bar(share: float) -> html.Html:
    return html.Html(f'<div class="bar"><div style="width:{100 * share:.1f}%"></div></div>')


def _missing(record: Mapping[str, Any]) -> str:
    if (missing := record.get("missing_force")) is None:
        return ""
    charts = [missing_force_chart(missing, [name]) for name in known_objects(missing)]
    caption = (
        "The acceleration along the path that the model lacks, in m/s², with its 95 % band, "
        f"inferred without assuming a formula. {diagnosis_text.formula_text(record)} In a formula "
        "q is the position in m past the foot, v the speed in m/s and t the time in s since the "
        "release."
    )
    return html.chart_section("The missing force", caption, charts)


def _friction(rows: Sequence[Mapping[str, Any]]) -> str:
    charts = [friction_chart(rows, clip) for clip in dict.fromkeys(row["clip"] for row in rows)]
    return html.chart_section("Friction along the way", FRICTION, charts) if rows else ""


def _left_one_out(rows: Sequence[Mapping[str, Any]]) -> str:
    if not rows:
        return ""
    lines = [[row["clip"], f"{row['rmse_before']:.4f}", f"{row['rmse_after']:.4f}"] for row in rows]
    cells_of = html.table(["clip", "without, m/s", "with, m/s"], lines)
    return html.section("Each clip predicted from the others", html.prose(LEFT_OUT), cells_of)


def _engine_and_seed(record: Mapping[str, Any]) -> dict[str, str]:
    """What a page's provenance says of how it was computed."""
    return {key: str(record[key]) for key in ("engine", "seed")}


def _motion(clips: Sequence[Clip], models: Mapping[str, tuple[JointProblem, np.ndarray]]) -> str:
    """Every clip with the motion of each model with its parameters `[parameter]`, by its name."""
    found = []
    for i, clip in enumerate(clips):
        predicted = {
            name: trials.problems[i].simulate(trials.of_clip(theta, i))
            for name, (trials, theta) in models.items()
        }
        problem = next(iter(models.values()))[0].problems[i]
        if len(clips) > 1:
            found.append(f"<h3>{escape(problem.name)}</h3>")
        found.append(animation(clip, problem, predicted))
    return html.section("Motion", *found)


def _failures(is_adequate: bool, paths: Sequence[PathResiduals], model: str = "") -> str:
    """The charts of all objects; `model`: with its colon before it, for the heading."""
    heading = "Residuals" if is_adequate else "Where the model fails"
    return html.chart_section(f"{heading}{model}", FAILURES, map(failure_chart, paths))


def _cells(where: Sequence[Mapping[str, Any]], several: bool) -> str:
    """The worst cells as a table; `several`: with the clip of each."""
    words = ["clip"] * several + ["object", "axis", "phase"]
    numbers = {"rmse": ".4f", "noise": ".4f", "z": ".1f", "whiteness": ".2f"}
    rows = [
        [*(place[key] for key in words), *(f"{place[key]:{how}}" for key, how in numbers.items())]
        for place in where[:NUM_CELLS]
    ]
    head = [*words, "rmse, m/s", "noise, m/s", "z", "autocorrelation"]
    return html.section("Worst cells", html.prose(CELLS), html.table(head, rows))
