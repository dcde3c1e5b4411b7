"""The page of a diagnosis: what is missing, how the error fell, and what it looks like."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise
from pathlib import Path
from typing import Any

from galileo_jax.clip.schema import Clip
from galileo_jax.diagnosis.diagnosis import Diagnosis, Round
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.report import findings
from galileo_jax.report.along import Along, along_paths
from galileo_jax.report.chart import Chart
from galileo_jax.report.comparison_page import cells, failures, motion
from galileo_jax.report.failure import before_after_chart
from galileo_jax.report.missing_force import is_told, missing_force_chart
from galileo_jax.report.plotly_chart import chart_element, figure_element
from galileo_jax.report.provenance import provenance
from galileo_jax.report.rounds import HEIGHT_PX, rounds_figure
from galileo_jax.report.shell import document, figure_section, header, items, legend, table
from galileo_jax.report.statements import number
from galileo_jax.report.svg_chart import chart_svg
from galileo_jax.report.write import PLOTS
from galileo_jax.runtime.atomic_write import write_text

NUM_CANDIDATES = 8
ONLY_WIDE = ("", "log evidence", "chi2 per dof", "p")  # of the candidates
BAR = '<div class="bar"><div style="width:{:.1f}%"></div></div>'


@dataclass(frozen=True)
class Told:
    """A diagnosis and what is said of it.

    Attributes:
      diagnosis: what was found.
      record: diagnosis.json.
      go_on: the command that comes next.
      hidden: what was hidden in a synthetic clip, None where that is not known.
      clips: what was diagnosed.
      command: that makes the page again.
      seed: of the draws in pictures.
    """

    diagnosis: Diagnosis
    record: Mapping[str, Any]
    go_on: str
    hidden: str | None
    clips: tuple[Clip, ...]
    command: str
    seed: int


def write_diagnosis_page(path: Path, title: str, trials: JointProblem, told: Told) -> None:
    """Writes the page, and what was left before and after an effect as SVG into plots/."""
    diagnosis = told.diagnosis
    shown = [
        along_paths(trials, one.hypothesis.fit, one.comparison, told.seed)
        for one in diagnosis.rounds
    ]
    rounds = list(pairwise(zip(shown, map(_title, diagnosis.rounds), strict=True)))
    added = [(after[1], _before_after(before, after)) for before, after in rounds]
    for chart in (chart for _, charts in added for chart in charts):
        write_text(path.parent / PLOTS / f"{chart.name}.svg", chart_svg(chart))
    sections = [
        _verdict(title, told),
        _rounds(told.record["history"]),
        _candidates(diagnosis, told.record["candidates"]),
        motion(told.clips, trials, _fitted(trials, diagnosis)),
        failures(f"Where it fails: {_title(diagnosis.rounds[0])}", shown[0]),
        *(_added(name, charts) for name, charts in added),
        _missing(told, trials.problems[0].observation.names),
        cells(diagnosis.base, several=len(trials.problems) > 1),
        _each_clip(told.record.get("each_clip")),
        _left_one_out(told.record.get("left_one_out", [])),
        provenance(
            told.command,
            told.clips,
            {"engine": trials.problems[0].engine.name, "seed": str(told.seed)},
        ),
    ]
    write_text(path, document(f"{title}: diagnosis", [part for part in sections if part]))


def _fitted(trials: JointProblem, diagnosis: Diagnosis) -> dict[str, Any]:
    """The parameters of every round, `[parameter]`, by its effects."""
    return {
        _title(one): trials.theta(one.hypothesis.fit.z, one.hypothesis.fit.free)
        for one in diagnosis.rounds
    }


def _title(one: Round) -> str:
    return findings.effects_text(one.hypothesis.effects)


def _verdict(title: str, told: Told) -> str:
    diagnosis = told.diagnosis
    hidden = "" if told.hidden is None else f"<p>Truth: {escape(told.hidden)}.</p>\n"
    more = (
        f"{hidden}{items(diagnosis.verdict.advice)}\n"
        f'<p class="soft">Next: <code>{escape(told.go_on)}</code></p>'
    )
    is_known = diagnosis.verdict.status != "unknown"
    return header("diagnosis", title, findings.verdict(diagnosis), more, is_known)


def _rounds(history: Sequence[Mapping[str, Any]]) -> str:
    frictions = [name for name in ("k1", "k2") if name in history[0]]
    rows = []
    for row in history:
        rows.append(
            [
                escape(findings.effects_text(row["effects"])),
                f"{row['rmse']:.4f}",
                f"{row['chi2_per_dof']:.2f}",
                escape(findings.p_text(row["p_value"])),
                *(number(row[k]["mean"], row[k]["sd"]) for k in frictions),
            ]
        )
    head = ["model with", "rmse, m/s", "chi2 per dof", "p", *frictions]
    errors = [float(row["rmse"]) for row in history]
    label = "velocity error round by round: " + ", ".join(f"{error:.4f} m/s" for error in errors)
    chart = figure_element(rounds_figure(history), label, HEIGHT_PX)
    key = legend([("fill", "accent", "velocity error"), ("dashed", "ink", "tracking noise alone")])
    return (
        "<h2>Rounds</h2>\n<figure><figcaption>The error of the velocity, round by round, and what "
        "tracking noise alone would leave of it.</figcaption>"
        f'{key}<div class="stack">{chart}</div></figure>\n{table(head, rows)}'
    )


def _before_after(
    before: tuple[Sequence[Along], str], after: tuple[Sequence[Along], str]
) -> list[Chart]:
    """One chart for each object, of two rounds: what is left, and the model's effects."""
    return [
        before_after_chart(one, two, (before[1], after[1]))
        for one, two in zip(before[0], after[0], strict=True)
    ]


def _added(title_after: str, charts: Sequence[Chart]) -> str:
    pictures = {chart.name: chart_element(chart) for chart in charts}
    return figure_section(
        f"Added: {title_after}",
        "What is left, in units of the noise, on the same axes: filled along the path, hollow "
        "across it. Yellow: where the model fails worst.",
        pictures,
    )


def _candidates(diagnosis: Diagnosis, candidates: Sequence[Mapping[str, Any]]) -> str:
    rows = []
    for made, told in zip(diagnosis.candidates, candidates[:NUM_CANDIDATES], strict=False):
        texts = findings.strength_texts(made.effects, told)
        named = [text if len(texts) == 1 else f"{name} = {text}" for name, text in texts.items()]
        strengths = ", ".join(named)
        rows.append(
            [
                escape(told["effect"]).replace("_", "_<wbr>").replace("+", "+<wbr>"),
                BAR.format(100 * told["probability"]),
                f"{told['probability']:.3f}",
                escape(strengths),
                f"{told['score']:+.1f}",
                f"{told['chi2_per_dof']:.2f}",
                escape(findings.p_text(told["p_value"])),
                escape(", ".join(told["confounded_with"])).replace("_", "_<wbr>"),
            ]
        )
    head = ["effect", "", "probability", "strength", "log evidence", "chi2 per dof", "p",
            "not told from"]  # fmt: skip
    if not any(row[-1] for row in rows):
        head, rows = head[:-1], [row[:-1] for row in rows]
    rest = len(candidates) - len(rows)
    note = f"<p class='soft'>{rest} more are less probable; diagnosis.json has them.</p>"
    return f"<h2>Candidates</h2>\n{table(head, rows, ONLY_WIDE)}\n{note if rest > 0 else ''}"


def _missing(told: Told, names: Sequence[str]) -> str:
    missing = told.diagnosis.missing
    if missing is None:
        return ""
    pictures, said = {}, []
    for i, name in enumerate(names):
        if not is_told(missing, i):
            continue
        pictures[name] = chart_element(missing_force_chart(missing, i, name))
        share = missing.share_explained[i]
        explains = f" (explains {100 * share:.0f} % of what is missing)" if share > 0 else ""
        said.append(f"{name}: {missing.formula[i]}{explains}")
    return figure_section(
        "The missing force",
        "The acceleration along the path that the model would need, inferred without a form, with "
        "its 95 % band, in m/s², of q (m past the foot), v (m/s) and t (s since the release). The "
        f"simplest formula that fits: {'; '.join(said)}.",
        pictures,
    )


def _each_clip(record: Mapping[str, Any] | None) -> str:
    if record is None:
        return ""
    return f"<h2>Each clip by itself</h2>\n{items(findings.each_clip(record))}"


def _left_one_out(rows: Sequence[Mapping[str, Any]]) -> str:
    if not rows:
        return ""
    cells_of = [
        [escape(row["clip"]), f"{row['rmse_before']:.4f}", f"{row['rmse_after']:.4f}"]
        for row in rows
    ]
    return (
        "<h2>Each clip predicted from the others</h2>\n<p>Error of the velocity, before and after "
        "the effect was added.</p>\n" + table(["clip", "before, m/s", "after, m/s"], cells_of)
    )
