"""The page of a diagnosis: what is missing, how the error fell, and what it looks like."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.diagnosis.diagnosis import Diagnosis, Round
from galileo_jax.files import write_text
from galileo_jax.inference.trials import Trials
from galileo_jax.report import findings
from galileo_jax.report.along import Along, along_paths
from galileo_jax.report.animation import SCRIPT, animation
from galileo_jax.report.comparison_page import cells, failures
from galileo_jax.report.failure import before_after_figure
from galileo_jax.report.figure import to_inline, to_svg
from galileo_jax.report.missing_force import is_told, missing_force_figure
from galileo_jax.report.shell import document, figure_section, items, table
from galileo_jax.report.statements import number

NUM_CANDIDATES = 8
BAR = (
    '<div style="background:var(--line);width:9rem;border-radius:.2rem">'
    '<div style="background:var(--accent);height:.7rem;border-radius:.2rem;width:{:.1f}%"></div>'
    "</div>"
)


@dataclass(frozen=True)
class Told:
    """A diagnosis and what is said of it.

    Attributes:
      diagnosis: what was found.
      record: diagnosis.json.
      go_on: the command that comes next.
      hidden: what was hidden in a synthetic clip, None where that is not known.
      shapes: of each clip, its objects' shapes.
      seed: of the draws in pictures.
    """

    diagnosis: Diagnosis
    record: Mapping[str, Any]
    go_on: str
    hidden: str | None
    shapes: tuple[tuple[str, ...], ...]
    seed: int


def write_diagnosis_page(path: Path, title: str, trials: Trials, told: Told) -> None:
    """Writes the page."""
    diagnosis = told.diagnosis
    shown = [
        along_paths(trials, one.hypothesis.fit, one.comparison, told.seed)
        for one in diagnosis.rounds
    ]
    sections = [
        f"<h1>{escape(title)}</h1>",
        _verdict(told),
        _rounds(told.record["history"]),
        *(
            _before_after(before, after, _title(one), _title(two))
            for (before, after), (one, two) in zip(
                pairwise(shown), pairwise(diagnosis.rounds), strict=True
            )
        ),
        _motion(trials, told),
        _candidates(diagnosis, told.record["candidates"]),
        _missing(told, trials.problems[0].observation.names),
        failures(f"Where the model fails: {_title(diagnosis.rounds[0])}", shown[0]),
        cells(diagnosis.base, several=len(trials.problems) > 1),
        _left_one_out(told.record.get("left_one_out", [])),
    ]
    page = document(f"{title}: diagnosis", [part for part in sections if part], SCRIPT)
    write_text(path, page)


def _title(one: Round) -> str:
    return findings.effects_text(one.hypothesis.effects)


def _verdict(told: Told) -> str:
    diagnosis = told.diagnosis
    warn = ' class="warn"' if diagnosis.verdict.status == "unknown" else ""
    hidden = "" if told.hidden is None else f"<p>Truth: {escape(told.hidden)}.</p>\n"
    return (
        f"<p{warn}><strong>{escape(findings.verdict(diagnosis))}</strong></p>\n{hidden}"
        f"{items(diagnosis.verdict.advice)}\n"
        f'<p class="soft">Next: <code>{escape(told.go_on)}</code></p>'
    )


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
    return f"<h2>Rounds</h2>\n{table(head, rows)}"


def _before_after(
    before: Sequence[Along], after: Sequence[Along], title_before: str, title_after: str
) -> str:
    pictures = {}
    for one, two in zip(before, after, strict=True):
        name = f"{two.clip}_{two.name}"
        figure = before_after_figure(one, two, (title_before, title_after))
        label = f"{name}, before and after"
        pictures[name] = to_inline(to_svg(figure, f"{name}_{title_after}"), escape(label, True))
    return figure_section(
        f"Added: {title_after}",
        "What is left, in units of the noise, on the same axes: filled along the path, hollow "
        "across it. Yellow: where the model fails worst.",
        pictures,
    )


def _motion(trials: Trials, told: Told) -> str:
    found = []
    for clip, problem in enumerate(trials.problems):
        predicted: dict[str, np.ndarray] = {}
        for one in told.diagnosis.rounds:
            fit = one.hypothesis.fit
            theta = trials.of_clip(trials.theta(fit.z, fit.free), clip)
            predicted[_title(one)] = problem.simulate(theta)
        found.append(animation(problem, told.shapes[clip], predicted))
    return "<h2>Motion</h2>\n" + "\n".join(found)


def _candidates(diagnosis: Diagnosis, candidates: Sequence[Mapping[str, Any]]) -> str:
    rows = []
    for made, told in zip(diagnosis.candidates, candidates[:NUM_CANDIDATES], strict=False):
        strengths = ", ".join(
            f"{name} = {findings.value_text(entry)}"
            for name, entry in findings.strengths(made.effects, told["parameters"]).items()
        )
        rows.append(
            [
                escape(told["effect"]),
                BAR.format(100 * told["probability"]),
                f"{told['probability']:.3f}",
                escape(strengths),
                f"{told['score']:+.1f}",
                f"{told['chi2_per_dof']:.2f}",
                escape(findings.p_text(told["p_value"])),
                escape(", ".join(told["confounded_with"])),
            ]
        )
    head = ["effect", "", "probability", "strength", "log evidence", "chi2 per dof", "p",
            "not told from"]  # fmt: skip
    rest = len(candidates) - len(rows)
    note = f"<p class='soft'>{rest} more are less probable; diagnosis.json has them.</p>"
    return f"<h2>Candidates</h2>\n{table(head, rows)}\n{note if rest > 0 else ''}"


def _missing(told: Told, names: Sequence[str]) -> str:
    missing = told.diagnosis.missing
    if missing is None:
        return ""
    pictures, said = {}, []
    for i, name in enumerate(names):
        if not is_told(missing, i):
            continue
        svg = to_svg(missing_force_figure(missing, i, name), f"missing_{name}")
        pictures[name] = to_inline(svg, escape(name, quote=True))
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
