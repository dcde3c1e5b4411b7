"""The page: one HTML file that needs nothing else."""

from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.report import statements
from galileo_jax.report.fitted import Fitted
from galileo_jax.report.statements import MEANINGS, number
from galileo_jax.run import Run

HEADLINES = ("k1", "k2", "mass_ratio")

_CSS = """
:root { color-scheme: light dark; --paper: #fcfbf9; --ink: #22242a; --soft: #6a6d76;
  --line: #dfdcd5; --card: #ffffff; --accent: #c2592f; }
@media (prefers-color-scheme: dark) { :root { --paper: #17181b; --ink: #e6e4df; --soft: #a0a2a8;
  --line: #33353b; --card: #1e2024; --accent: #e58a62; } }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 66rem; padding: 2.5rem 1.25rem 4rem; background: var(--paper);
  color: var(--ink); font: 1rem/1.55 system-ui, -apple-system, "Segoe UI", Roboto, sans-serif; }
h1 { font-size: 1.7rem; font-weight: 600; letter-spacing: -0.01em; margin: 0; line-height: 1.2;
  overflow-wrap: anywhere; }
h2 { font-size: 1.15rem; font-weight: 600; margin: 2.8rem 0 0.6rem; }
p, ul { max-width: 44rem; margin: 0.4rem 0; }
ul { padding-left: 1.2rem; }
.soft, figcaption { color: var(--soft); }
figcaption { font-size: 0.9rem; max-width: 44rem; margin-bottom: 0.6rem; }
.cards { display: grid; grid-template-columns: repeat(auto-fill, minmax(15rem, 1fr)); gap: 0.9rem;
  margin: 1.6rem 0 1.2rem; }
.card { background: var(--card); border: 1px solid var(--line); border-radius: 0.6rem;
  padding: 0.9rem 1.1rem; }
.card b { display: block; font-size: 1.9rem; font-weight: 600; line-height: 1.25;
  font-variant-numeric: tabular-nums; }
.card span { color: var(--soft); font-size: 0.9rem; }
.grid { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 22rem), 1fr));
  gap: 0.9rem; }
figure { margin: 0; }
figure svg { display: block; max-width: 36rem; width: 100%; height: auto; color: var(--ink); }
svg text { font-family: inherit !important; }
.narrow { max-width: 44rem; overflow-x: auto; }
.narrow svg { min-width: 30rem; max-width: none; }
.table { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: 0.4rem 0.9rem 0.4rem 0; border-bottom: 1px solid var(--line);
  vertical-align: baseline; }
th { font-weight: 500; color: var(--soft); font-size: 0.85rem; }
td.n { white-space: nowrap; }
.warn { color: var(--accent); }
code { font: 0.85rem/1.5 ui-monospace, "SF Mono", Menlo, monospace; overflow-wrap: anywhere; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: 0.25rem 1.2rem; margin: 0.4rem 0; }
dt { color: var(--soft); }
dd { margin: 0; overflow-wrap: anywhere; }
@media (max-width: 34rem) { body { padding-top: 1.5rem; } td.meaning, th.meaning { display: none; }
  dl { grid-template-columns: 1fr; } dd { margin-bottom: 0.4rem; } }
"""


def render(run: Run, fitted: Fitted, figures: Mapping[str, Mapping[str, str]]) -> str:
    """The whole page.

    Args:
      run: the fit.
      fitted: it in the clip's frames.
      figures: inline SVG by section ("velocity", "position", "residuals", "draws") and name.
    """
    title = ", ".join(Path(clip).name for clip in run.result["clips"])
    sections = [
        _header(title, run),
        _headlines(run),
        _untold(run, fitted),
        _figures("Velocity", _velocity_caption(), figures["velocity"]),
        _figures("Position", _position_caption(fitted), figures["position"]),
        _figures("Residuals", _residual_caption(), figures["residuals"]),
        _figures("Posterior", _draws_caption(run), figures["draws"], "narrow"),
        _table("Parameters", {**run.result["parameters"], **run.result.get("derived", {})}),
        _table("Nuisances", run.result.get("nuisances", {}), _NUISANCES),
        _provenance(run),
    ]
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}: fit</title>\n<style>{_CSS}</style>\n</head>\n<body>\n"
        + "\n".join(sections)
        + "\n</body>\n</html>\n"
    )


_NUISANCES = (
    "Always free, with tight priors, so that the intervals above contain them. "
    "Where the clip says nothing of one, it keeps its prior."
)


def _header(title: str, run: Run) -> str:
    result = run.result
    effects = ", ".join(result["effects"]) or "none beyond friction and impact"
    converged = escape(statements.convergence(run))
    mark = "" if result["converged"] else ' class="warn"'
    caution = statements.caution(result)
    warning = f'\n<p class="warn">{escape(caution)}</p>' if caution else ""
    return (
        f"<h1>{escape(title)}</h1>\n"
        f'<p class="soft">method {escape(result["method"])}, effects: {escape(effects)}</p>\n'
        f"<p{mark}>{converged}</p>\n<p>{escape(statements.fit_quality(result))}</p>{warning}"
    )


def _headlines(run: Run) -> str:
    known = {**run.result["parameters"], **run.result.get("derived", {})}
    cards = []
    for name in HEADLINES:
        if name not in known:
            continue
        entry = known[name]
        label = escape(MEANINGS.get(name, name))
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
        f"<li><strong>{escape(', '.join(MEANINGS.get(n, n) for n in names))}</strong>: "
        f"{escape(reason)}.</li>"
        for reason, names in by_reason.items()
    )
    return f"<h2>What the clip does not tell</h2>\n<ul>{items}</ul>"


def _velocity_caption() -> str:
    return (
        "Measured velocities (dots) against the fit. Dark band: the model with the posterior's "
        "uncertainty. Light band: where 95 of 100 measurements are expected."
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


def _residual_caption() -> str:
    return (
        "Measured minus fitted, whitened with the noise's covariance: without a pattern and, but "
        "for 5 in 100, between the dashed lines if the model is right."
    )


def _draws_caption(run: Run) -> str:
    size = run.posterior.flat().shape[0]
    told = f"{size} draws of the main parameters."
    if "m2" in run.posterior.names:
        told += " The straight band of m1 against m2 is the ridge: only the masses' ratio shows."
    return told


def _figures(
    heading: str, caption: str, figures: Mapping[str, str], arrangement: str = "grid"
) -> str:
    inner = "".join(f'<div class="{arrangement}">{svg}</div>' for svg in figures.values())
    if arrangement == "grid":
        inner = f'<div class="grid">{"".join(figures.values())}</div>'
    return (
        f"<h2>{escape(heading)}</h2>\n<figure><figcaption>{escape(caption)}</figcaption>"
        f"{inner}</figure>"
    )


def _table(heading: str, entries: Mapping[str, Mapping[str, Any]], note: str = "") -> str:
    rows = []
    for name, entry in entries.items():
        sd = entry["sd"]
        low, high = number(entry["q025"], sd), number(entry["q975"], sd)
        unit = "" if entry["unit"] == "1" else entry["unit"]
        told = "yes" if entry["identified"] else "no"
        rows.append(
            f"<tr><td><code>{escape(name)}</code></td>"
            f'<td class="meaning">{escape(MEANINGS.get(name, ""))}</td>'
            f'<td class="n">{number(entry["mean"], sd)} {escape(unit)}</td>'
            f'<td class="n">{number(sd, sd)}</td><td class="n">{low} to {high}</td>'
            f"<td>{told}</td></tr>"
        )
    head = (
        '<tr><th></th><th class="meaning"></th><th>mean</th><th>sd</th><th>95 % interval</th>'
        "<th>identified</th></tr>"
    )
    text = f"<p>{escape(note)}</p>" if note else ""
    return (
        f"<h2>{escape(heading)}</h2>\n{text}"
        f'<div class="table"><table>{head}{"".join(rows)}</table></div>'
    )


def _provenance(run: Run) -> str:
    result = run.result
    timings = ", ".join(f"{stage} {spent:.1f} s" for stage, spent in result["timings_s"].items())
    error = result["error"]
    items = {
        "made again by": f"<code>{escape(statements.command_again(run))}</code>",
        "engine": escape(str(result.get("engine", run.problem.engine.name))),
        "seed": str(result["seed"]),
        "version": f"galileo_jax {escape(str(result['version']))}",
        "velocity error": (
            f"rmse {number(error['rmse'], None)} m/s; tracking noise alone would give "
            f"{number(error['noise'], None)} m/s"
        ),
        "timings": escape(timings),
    }
    listed = "".join(f"<dt>{key}</dt><dd>{value}</dd>" for key, value in items.items())
    return f"<h2>Provenance</h2>\n<dl>{listed}</dl>"
