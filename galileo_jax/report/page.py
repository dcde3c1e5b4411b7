"""The page of a fit."""

import re
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.report import statements
from galileo_jax.report.chart import object_colour
from galileo_jax.report.fitted import Fitted
from galileo_jax.report.provenance import provenance
from galileo_jax.report.residuals import worst_stretch_of
from galileo_jax.report.shell import details, document, figure_section, header, legend
from galileo_jax.report.statements import meaning, number
from galileo_jax.results.run import Run
from galileo_jax.results.shown_parameters import shown_parameters

HEADLINES = re.compile(r"gravity|k\d+|mass_ratio(_\d+_\d+)?")


def render(run: Run, fitted: Fitted, figures: Mapping[str, Mapping[str, str]]) -> str:
    """The whole page.

    Args:
      run: the fit.
      fitted: it in the clip's frames.
      figures: HTML by section ("motion", "velocity", "position", "residuals", "draws") and name.
    """
    title = ", ".join(Path(clip).name for clip in run.result["clips"])
    key = _key(run)
    sections = [
        _header(title, run) + _headlines(run),
        _untold(run, fitted),
        "<h2>Motion</h2>\n" + "\n".join(figures["motion"].values()),
        figure_section("Velocity", _velocity_caption(), figures["velocity"], legend=key),
        figure_section("Where it fails", _failure_caption(run, fitted), figures["residuals"]),
        _table("Parameters", shown_parameters(run.result)),
        details("Nuisances", _table("", run.result.get("nuisances", {}), _NUISANCES)),
        figure_section("Posterior", _draws_caption(run), figures["draws"], "narrow"),
        figure_section("Position", _position_caption(fitted), figures["position"], legend=key),
        _provenance(run),
    ]
    return document(f"{title}: fit", sections)


_NUISANCES = (
    "Always free, with tight priors, so that the intervals above contain them. "
    "Where the clip says nothing of one, it keeps its prior."
)


def _header(title: str, run: Run) -> str:
    result = run.result
    effects = ", ".join(result["effects"]) or "none beyond friction and impact"
    mark = "" if result["converged"] else ' class="warn"'
    caution = statements.caution(result)
    said = [*([caution] if caution else []), *result.get("warnings", [])]
    warning = "".join(f'<p class="warn">{escape(line)}</p>\n' for line in said)
    more = (
        f"<p{mark}>{escape(statements.convergence(run))}</p>\n{warning}"
        f'<p class="soft">Method {escape(result["method"])}; effects: {escape(effects)}.</p>\n'
    )
    return header("fit", title, statements.fit_quality(result), more, statements.fits(result))


def _key(run: Run) -> str:
    """What the marks of velocities and positions mean."""
    names = run.problem.observation.names
    return legend(
        [
            ("dot", "ink", "measured"),
            *(("line", object_colour(i), f"{name}, fitted") for i, name in enumerate(names)),
            ("fill", "soft", "dark: 95 % of the model, light: 95 % of measurements"),
        ]
    )


def _headlines(run: Run) -> str:
    cards = []
    for name, entry in shown_parameters(run.result).items():
        if not HEADLINES.fullmatch(name):
            continue
        label = escape(meaning(name) or name)
        if entry["identified"]:
            low, high = (number(entry[key], entry["sd"]) for key in ("q025", "q975"))
            value, note = number(entry["mean"], entry["sd"]), f"{low} to {high} (95 %)"
        else:
            value, note = "not told", "see below"
        cards.append(
            f'<div class="card"><span>{label}</span><b>{value}</b><span>{note}</span></div>'
        )
    return f'<div class="cards">{"".join(cards)}</div>'


def _untold(run: Run, fitted: Fitted) -> str:
    reasons = statements.undetermined(run, fitted)
    if not reasons:
        return "<h2>What the clip does not tell</h2>\n<p>It tells every main parameter.</p>"
    by_reason: dict[str, list[str]] = {}
    for name, reason in reasons.items():
        by_reason.setdefault(reason, []).append(name)
    items = "".join(
        f"<li><strong>{escape(', '.join(meaning(n) or n for n in names))}</strong>: "
        f"{escape(reason)}.</li>"
        for reason, names in by_reason.items()
    )
    return f"<h2>What the clip does not tell</h2>\n<ul>{items}</ul>"


def _velocity_caption() -> str:
    return (
        "Measured velocities against the fit. Dark band: the model with the posterior's "
        "uncertainty. Light band: where 95 of 100 measurements are expected. The line that the "
        "slider moves is the clip's time."
    )


def _failure_caption(run: Run, fitted: Fitted) -> str:
    told = (
        "Measured minus fitted, in units of the noise: without a pattern and, but for 5 in 100, "
        "inside the grey band if the model is right. "
    )
    worst = worst_stretch_of(fitted)
    if worst is None:
        return told + "It fails nowhere: no stretch is stronger than noise makes it."
    return (
        f"{told}Yellow: the worst stretch, {worst.name} along {worst.axis} from "
        f"{worst.start_s:.2f} to {worst.end_s:.2f} s ({worst.z:.0f} times the noise of its mean). "
        "`galileo compare` tests it; `galileo diagnose` looks for what is missing."
    )


def _position_caption(fitted: Fitted) -> str:
    millimetres = np.round(1e3 * fitted.offset_m, 1) + 0.0  # no -0.0
    names = fitted.observation.names
    moved = "; ".join(
        f"{name} ({x:.1f}, {y:.1f}) mm" for name, (x, y) in zip(names, millimetres, strict=True)
    )
    return (
        "The point followed is not quite the centre; this constant offset is in the fitted "
        f"curves: {moved}."
    )


def _draws_caption(run: Run) -> str:
    size = run.posterior.flat().shape[0]
    told = f"{size} draws of the main parameters."
    if "m2" in run.posterior.names:
        told += (
            " Straight bands of one mass against another are the ridge: only masses' ratios show."
        )
    return told


def _table(heading: str, entries: Mapping[str, Mapping[str, Any]], note: str = "") -> str:
    if heading and not entries:
        return f"<h2>{escape(heading)}</h2>\n<p>The model of this motion has none to determine.</p>"
    rows = []
    for name, entry in entries.items():
        sd = entry["sd"]
        low, high = number(entry["q025"], sd), number(entry["q975"], sd)
        unit = "" if entry["unit"] == "1" else entry["unit"]
        told = "yes" if entry["identified"] else "no"
        rows.append(
            f"<tr><td><code>{escape(name)}</code></td>"
            f'<td class="meaning">{escape(meaning(name) or "")}</td>'
            f'<td class="n">{number(entry["mean"], sd)} {escape(unit)}</td>'
            f'<td class="n">{number(sd, sd)}</td><td class="n">{low} to {high}</td>'
            f"<td>{told}</td></tr>"
        )
    head = (
        '<tr><th scope="col">name</th><th scope="col" class="meaning">meaning</th>'
        '<th scope="col">mean</th><th scope="col">sd</th><th scope="col">95 % interval</th>'
        '<th scope="col">identified</th></tr>'
    )
    text = f"<p>{escape(note)}</p>" if note else ""
    top = f"<h2>{escape(heading)}</h2>\n" if heading else ""
    return f'{top}{text}<div class="table"><table>{head}{"".join(rows)}</table></div>'


def _provenance(run: Run) -> str:
    result = run.result
    timings = ", ".join(f"{stage} {spent:.1f} s" for stage, spent in result["timings_s"].items())
    error = result["error"]
    facts = {
        "engine": str(result.get("engine", run.problem.engine.name)),
        "seed": str(result["seed"]),
        "velocity error": (
            f"rmse {number(error['rmse'], None)} m/s; tracking noise alone would give "
            f"{number(error['noise'], None)} m/s"
        ),
        "timings": timings,
    }
    return provenance(statements.command_again(run), (run.clip,), facts)
