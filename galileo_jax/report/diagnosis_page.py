"""The page of a diagnosis: verdict, rounds, candidates, and where the model fails."""

from collections.abc import Mapping, Sequence
from html import escape
from itertools import pairwise
from pathlib import Path
from typing import Any

from galileo_jax.clip.schema import Clip
from galileo_jax.comparison.path_residuals import PathResiduals, path_residuals
from galileo_jax.diagnosis.diagnosis import Diagnosis, Reason, Round
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.report import diagnosis_text
from galileo_jax.report.chart import Chart
from galileo_jax.report.comparison_charts import before_after_chart
from galileo_jax.report.comparison_page import cells, engine_and_seed, failures, motion
from galileo_jax.report.diagnosis_charts import (
    friction_chart,
    known_objects,
    missing_force_chart,
    rounds_chart,
)
from galileo_jax.report.html_page import chart_section, document, header, items, legend, table
from galileo_jax.report.provenance import provenance
from galileo_jax.results.shown import shown
from galileo_jax.runtime.atomic_write import write_text

NUM_CANDIDATES = 8
ONLY_WIDE = ("", "log evidence", "log prior", "chi2 per dof", "p")  # of the candidates
WRAPPED = '<div class="wrapped">{}</div>'
BAR = '<div class="bar"><div style="width:{:.1f}%"></div></div>'


def write_diagnosis_page(
    path: Path,
    title: str,
    trials: JointProblem,
    diagnosis: Diagnosis,
    record: Mapping[str, Any],
    clips: Sequence[Clip],
    *,
    truth: str | None,
    command: str,
    next_command: str,
    seed: int,
) -> None:
    """Writes the page; each figure in it can be saved as SVG.

    `record`: diagnosis.json. `truth`: the effect hidden in a synthetic clip, None where that is not
    known. `command` makes the page again, `next_command` is to be run next.
    """
    shown = _residuals(trials, diagnosis, seed)
    is_good = diagnosis.verdict.status != "unknown"
    hidden = "" if truth is None else f"<p>Truth: {escape(truth)}.</p>\n"
    more = (
        f"{hidden}{items(diagnosis.verdict.advice)}\n"
        f'<p class="soft">Next: <code>{escape(next_command)}</code></p>'
    )
    sections = [
        header("diagnosis", title, diagnosis_text.verdict(diagnosis), more, is_good),
        _reasons(diagnosis.verdict.reasons),
        _rounds(diagnosis.rounds, record["history"]),
        _candidates(diagnosis, record["candidates"]),
        motion(
            clips,
            trials,
            _fitted(trials, diagnosis),
            {_title(one): one.hypothesis.of(trials) for one in diagnosis.rounds},
        ),
        failures(
            f"{'Residuals' if diagnosis.base.is_adequate else 'Where the model fails'}: "
            f"{_title(diagnosis.rounds[0])}",
            shown[0],
        ),
        *(_added(name, charts) for name, charts in _before_after(diagnosis, shown)),
        _missing(diagnosis, record, trials.problems[0].observation.names),
        _friction(record.get("friction_along_way", [])),
        cells(diagnosis.base, several=len(trials.problems) > 1),
        _each_clip(record.get("each_clip")),
        _left_one_out(record.get("left_one_out", [])),
        provenance(command, clips, engine_and_seed(trials, seed)),
    ]
    write_text(path, document(f"{title}: diagnosis", [part for part in sections if part]))


def before_after_charts(trials: JointProblem, diagnosis: Diagnosis, seed: int) -> list[Chart]:
    """The residuals before and after each effect that was added, one chart for each object."""
    shown = _residuals(trials, diagnosis, seed)
    return [chart for _, charts in _before_after(diagnosis, shown) for chart in charts]


def _fitted(trials: JointProblem, diagnosis: Diagnosis) -> dict[str, Any]:
    """The parameters of every round, `[parameter]`, by its effects."""
    return {
        _title(one): one.hypothesis.of(trials).theta(one.hypothesis.fit.z, one.hypothesis.fit.free)
        for one in diagnosis.rounds
    }


def _title(one: Round) -> str:
    return diagnosis_text.effects_text(one.effects)


def _reasons(reasons: Sequence[Reason]) -> str:
    return f"<h2>Why</h2>\n{items([why.sentence for why in reasons])}" if reasons else ""


def _rounds(rounds: Sequence[Round], history: Sequence[Mapping[str, Any]]) -> str:
    frictions = [name for name in ("k1", "k2") if name in history[0]]
    rows = []
    for row in history:
        rows.append(
            [
                escape(diagnosis_text.round_text(row)),
                f"{row['rmse']:.4f}",
                f"{row['chi2_per_dof']:.2f}",
                escape(diagnosis_text.p_text(row["p_value"])),
                *(shown(row[k]) for k in frictions),
            ]
        )
    head = ["model with", "rmse, m/s", "chi2 per dof", "p", *frictions]
    key = legend([("fill", "accent", "velocity error"), ("dashed", "ink", "tracking noise alone")])
    caption = "The error of the velocity in each round, and what tracking noise alone would give."
    charts = chart_section("Rounds", caption, [rounds_chart(rounds)], "stack", key)
    return f"{charts}\n{table(head, rows)}"


def _residuals(
    trials: JointProblem, diagnosis: Diagnosis, seed: int
) -> list[tuple[PathResiduals, ...]]:
    """Of every round, those of all objects."""
    return [
        path_residuals(one.hypothesis.of(trials), one.hypothesis.fit, one.comparison, seed)
        for one in diagnosis.rounds
    ]


def _before_after(
    diagnosis: Diagnosis, shown: Sequence[Sequence[PathResiduals]]
) -> list[tuple[str, list[Chart]]]:
    """For each round after the first the effects of its model, and a chart for each object."""
    rounds = pairwise(zip(shown, map(_title, diagnosis.rounds), strict=True))
    return [
        (
            after,
            [
                before_after_chart(one, two, (before, after))
                for one, two in zip(shown_before, shown_after, strict=True)
            ],
        )
        for (shown_before, before), (shown_after, after) in rounds
    ]


def _added(title_after: str, charts: Sequence[Chart]) -> str:
    return chart_section(
        f"Added: {title_after}",
        "Residuals in units of the noise before and after, on the same axes: filled along the "
        "path, hollow across it. Yellow: the interval in which the model fails worst.",
        charts,
    )


def _candidates(diagnosis: Diagnosis, candidates: Sequence[Mapping[str, Any]]) -> str:
    rows = []
    for one, entry in zip(diagnosis.candidates, candidates[:NUM_CANDIDATES], strict=False):
        texts = diagnosis_text.strength_texts(one.effects, entry)
        named = [text if len(texts) == 1 else f"{name} = {text}" for name, text in texts.items()]
        strengths = entry["law"] or ", ".join(named)
        rows.append(
            [
                WRAPPED.format(
                    escape(entry["effect"]).replace("_", "_<wbr>").replace("+", "+<wbr>")
                ),
                BAR.format(100 * entry["probability"]),
                f"{entry['probability']:.3f}",
                WRAPPED.format(escape(strengths)),
                f"{entry['log_evidence']:+.1f}",
                f"{entry['log_prior']:+.1f}",
                f"{entry['chi2_per_dof']:.2f}",
                escape(diagnosis_text.p_text(entry["p_value"])),
                escape(", ".join(entry["confounded_with"])).replace("_", "_<wbr>"),
            ]
        )
    none, base = diagnosis.probability_none, diagnosis.base
    rows.append(
        ["none", BAR.format(100 * none), f"{none:.3f}", "", "+0.0", "+0.0",
         f"{base.error['chi2_per_dof']:.2f}", escape(diagnosis_text.p_text(base.p_value)), ""]
    )  # fmt: skip
    head = ["effect", "", "probability", "strength", "log evidence", "log prior", "chi2 per dof",
            "p", "not distinguished from"]  # fmt: skip
    if not any(row[-1] for row in rows):
        head, rows = head[:-1], [row[:-1] for row in rows]
    rest = len(candidates) + 1 - len(rows)
    note = f"<p class='soft'>{rest} more are less probable; diagnosis.json has them.</p>"
    return f"<h2>Candidates</h2>\n{table(head, rows, ONLY_WIDE)}\n{note if rest > 0 else ''}"


def _missing(diagnosis: Diagnosis, record: Mapping[str, Any], names: Sequence[str]) -> str:
    missing = diagnosis.missing
    if missing is None:
        return ""
    known = known_objects(missing, names)
    charts = [missing_force_chart(missing, {i: name}) for i, name in known.items()]
    found = diagnosis_text.formula_text(record)
    return chart_section(
        "The missing force",
        "The acceleration along the path that the model lacks, in m/s², with its 95 % band, "
        f"inferred without assuming a formula. {found} In a formula q is the position in m past "
        "the foot, v the speed in m/s and t the time in s since the release.",
        charts,
    )


def _friction(rows: Sequence[Mapping[str, Any]]) -> str:
    if not rows:
        return ""
    charts = [friction_chart(rows, clip) for clip in dict.fromkeys(row["clip"] for row in rows)]
    return chart_section(
        "Friction along the way",
        "The coefficient of friction on stretches of four frames, with its 95 % band, as the "
        "motion asks for it. The path is counted from the foot of the ramp; on a slope alone, "
        "from where the track counts.",
        charts,
    )


def _each_clip(record: Mapping[str, Any] | None) -> str:
    if record is None:
        return ""
    return f"<h2>Each clip alone</h2>\n{items(diagnosis_text.each_clip(record))}"


def _left_one_out(rows: Sequence[Mapping[str, Any]]) -> str:
    if not rows:
        return ""
    cells_of = [
        [escape(row["clip"]), f"{row['rmse_before']:.4f}", f"{row['rmse_after']:.4f}"]
        for row in rows
    ]
    return (
        "<h2>Each clip predicted from the others</h2>\n<p>Error of the velocity without and with "
        "the added effect.</p>\n" + table(["clip", "without, m/s", "with, m/s"], cells_of)
    )
