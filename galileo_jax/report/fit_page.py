"""The page of a fit, DIR/report.html."""

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.measurement.segments.segments import Cut
from galileo_jax.prediction.posterior_predictive import (
    PosteriorPredictive,
    posterior_predictive,
)
from galileo_jax.report import fit_text
from galileo_jax.report.animation import animation
from galileo_jax.report.chart import Chart
from galileo_jax.report.fit_charts import (
    axes_of,
    failing_interval_of,
    profile_chart,
    residual_chart,
)
from galileo_jax.report.fit_text import meaning
from galileo_jax.report.html_page import chart_section, details, document, header, legend, table
from galileo_jax.report.posterior_charts import pair_chart, trace_chart
from galileo_jax.report.provenance import provenance
from galileo_jax.report.style import object_colour
from galileo_jax.results.run import Run
from galileo_jax.results.shown import (
    HEADLINES,
    interval_text,
    number,
    shown,
    shown_parameters,
    unit_text,
)
from galileo_jax.runtime.atomic_write import write_text

PAGE = "report.html"


def write_report(
    run: Run, page: Path | None = None, lead: str = "", beside: Mapping[str, str] | None = None
) -> Path:
    """Writes a finished fit's page; returns its path.

    Args:
      run: the fit.
      page: where to; default: report.html in the run's folder.
      lead: the result in words, for the top of the page.
      beside: titles of other pages to their places, for links.
    """
    page = page or run.folder / PAGE
    fitted = posterior_predictive(run, seed=int(run.result["seed"]))
    write_text(page, _render(run, fitted, fit_charts(run, fitted), lead, beside or {}))
    return page


def charts_of_run(run: Run) -> list[Chart]:
    """All figures of a fit's page."""
    fitted = posterior_predictive(run, seed=int(run.result["seed"]))
    return [chart for some in fit_charts(run, fitted).values() for chart in some]


def fit_charts(run: Run, fitted: PosteriorPredictive) -> dict[str, list[Chart]]:
    """The figures of a fit, by section of the page."""
    objects, clip = range(len(fitted.observation.names)), run.problem.name
    main = [p.name for p in run.problem.parameters if p.role != "nuisance"]
    shown = shown_parameters(run.result)
    names = [name for name in main if name in shown] or main
    draws = [pair_chart(run.posterior, names)]
    if run.result["method"] == "mh":
        draws.append(trace_chart(run.posterior, names))
    both = [(i, axis) for i in objects for axis in axes_of(fitted)]
    return {
        "velocity": [profile_chart(fitted, "velocity", *one, clip) for one in both],
        "residuals": [residual_chart(fitted, i, clip) for i in objects],
        "draws": draws,
        "position": [profile_chart(fitted, "position", *one, clip) for one in both],
    }


def _render(
    run: Run,
    fitted: PosteriorPredictive,
    charts: Mapping[str, Sequence[Chart]],
    lead: str,
    beside: Mapping[str, str],
) -> str:
    title = ", ".join(Path(clip).name for clip in run.result["clips"])
    key = _key(run)
    sections = [
        _header(title, run, lead, beside) + _headlines(run),
        _undetermined(run, fitted),
        _motion(run, fitted),
        chart_section("Velocity", VELOCITY, charts["velocity"], legend=key),
        chart_section(
            "Residuals" if failing_interval_of(fitted) is None else "Where the model fails",
            _failure(fitted),
            charts["residuals"],
        ),
        _table("Parameters", shown_parameters(run.result)),
        details("Nuisance parameters", _table("", run.result.get("nuisances", {}), NUISANCES)),
        chart_section("Posterior", _draws_caption(run), charts["draws"], "stack"),
        chart_section("Position", _position_caption(fitted), charts["position"], legend=key),
        _provenance(run),
    ]
    return document(f"{title}: fit", sections)


def _motion(run: Run, fitted: PosteriorPredictive) -> str:
    model = ", ".join(run.result["effects"]) or "fitted"
    centres = np.median(fitted.position_m, axis=0) - fitted.offset_m[..., None]
    return "<h2>Motion</h2>\n" + animation(run.clip, run.problem, {model: centres})


NUISANCES = (
    "Always free, with narrow priors, so that the intervals above include their uncertainty. "
    "A nuisance parameter that the clip does not determine has its prior."
)
VELOCITY = (
    "Measured and fitted velocities. Dark band: 95 % of the model, from the uncertainty of the "
    "posterior. Light band: 95 % of measurements are expected in it. The vertical line is at the "
    "time of the slider."
)


def _header(title: str, run: Run, lead: str, beside: Mapping[str, str]) -> str:
    result = run.result
    effects = ", ".join(result["effects"]) or "none besides friction and impact"
    mark = "" if result["converged"] else ' class="warn"'
    caution = fit_text.caution(result)
    cautions = [*([caution] if caution else []), *result.get("warnings", [])]
    warning = "".join(f'<p class="warn">{escape(line)}</p>\n' for line in cautions)
    more = (
        f"<p{mark}>{escape(fit_text.convergence(run))}</p>\n{warning}"
        f'<p class="soft">Method {escape(result["method"])}; effects: {escape(effects)}.</p>\n'
        + "".join(
            f'<p class="soft">{escape(line)}.</p>\n'
            for line in (*_cuts(result), *result.get("taken_as_exact", []))
        )
    )
    said = [*fit_text.fit_quality(result), f"({fit_text.chi2_text(result['error'])})"]
    quality, is_good = " ".join(said), fit_text.fits(result)
    if not lead:
        return header("fit", title, quality, more, is_good)
    links = "".join(
        f'<p><a href="{escape(place, quote=True)}">{escape(text)}</a></p>\n'
        for text, place in beside.items()
    )
    return header("explanation", title, lead, f"{links}<p>{escape(quality)}</p>\n{more}", is_good)


def _cuts(result: Mapping[str, Any]) -> list[str]:
    """What of each clip is left out, and why: one line each."""
    return [
        f"{clip}: {Cut(**entry)}" for clip, cuts in result.get("cuts", {}).items() for entry in cuts
    ]


def _key(run: Run) -> str:
    """What the marks of velocities and positions mean."""
    names = run.problem.observation.names
    return legend(
        [
            ("dot", "ink", "measured"),
            *(("line", object_colour(i), f"{name}, fitted") for i, name in enumerate(names)),
            ("fill", "soft", "dark: 95 % of the model; light: 95 % of measurements"),
        ]
    )


def _headlines(run: Run) -> str:
    cards = []
    for name, entry in shown_parameters(run.result).items():
        if not HEADLINES.fullmatch(name):
            continue
        label = escape(meaning(name) or name)
        if entry["identified"]:
            value, note = shown(entry), f"{interval_text(entry)} (95 %)"
        else:
            value, note = "not determined", "see below"
        cards.append(
            f'<div class="card"><span>{label}</span><b>{value}</b><span>{note}</span></div>'
        )
    return f'<div class="cards">{"".join(cards)}</div>'


def _undetermined(run: Run, fitted: PosteriorPredictive) -> str:
    reasons = fit_text.undetermined(run, fitted)
    heading = "What the clip does not determine"
    if not reasons:
        return f"<h2>{heading}</h2>\n<p>It determines all main parameters.</p>"
    by_reason: dict[str, list[str]] = {}
    for name, reason in reasons.items():
        by_reason.setdefault(reason, []).append(name)
    items = "".join(
        f"<li><strong>{escape(', '.join(meaning(n) or n for n in names))}</strong>: "
        f"{escape(reason)}.</li>"
        for reason, names in by_reason.items()
    )
    return f"<h2>{heading}</h2>\n<ul>{items}</ul>"


def _failure(fitted: PosteriorPredictive) -> str:
    text = (
        "Residuals: measured minus fitted, in units of the stated noise. If model and noise are "
        "right, they show no pattern, and 95 % of them are inside the grey band. "
    )
    found = failing_interval_of(fitted)
    if found is None:
        return text + "No interval deviates more than noise would."
    name, axis, worst = found
    return (
        f"{text}Yellow: the interval that deviates most, {name} along {axis} from "
        f"{worst.start_s:.2f} to {worst.end_s:.2f} s (its mean is {worst.z:.0f} standard errors "
        "from 0). Run galileo compare to test the model, and galileo diagnose to find the effect "
        "that it lacks."
    )


def _position_caption(fitted: PosteriorPredictive) -> str:
    millimetres = np.round(1e3 * fitted.offset_m, 1) + 0.0  # no -0.0
    names = fitted.observation.names
    moved = "; ".join(
        f"{name} ({', '.join(f'{value:.1f}' for value in moved)}) mm"
        for name, moved in zip(names, millimetres, strict=True)
    )
    return (
        "The tracked point is not exactly the centre. The fitted curves include this constant "
        f"offset: {moved}."
    )


def _draws_caption(run: Run) -> str:
    size = run.posterior.flat().shape[0]
    text = f"{size} draws of the main parameters."
    if "m2" in run.posterior.names:
        text += " One mass against another lies on a straight line: only their ratio is determined."
    return text


def _table(heading: str, entries: Mapping[str, Mapping[str, Any]], note: str = "") -> str:
    if heading and not entries:
        return f"<h2>{escape(heading)}</h2>\n<p>The model of this motion has none to determine.</p>"
    rows = []
    for name, entry in entries.items():
        rows.append(
            [
                f"<code>{escape(name)}</code>",
                escape(meaning(name) or ""),
                f"{shown(entry)}{escape(unit_text(entry))}",
                shown(entry, "sd"),
                interval_text(entry),
                "yes" if entry["identified"] else "no",
            ]
        )
    head = ("name", "meaning", "mean", "sd", "95 % interval", "determined")
    text = f"<p>{escape(note)}</p>" if note else ""
    top = f"<h2>{escape(heading)}</h2>\n" if heading else ""
    return f"{top}{text}{table(head, rows, only_wide=('meaning',))}"


def _provenance(run: Run) -> str:
    result = run.result
    timings = ", ".join(f"{stage} {spent:.1f} s" for stage, spent in result["timings_s"].items())
    error = result["error"]
    facts = {
        "engine": str(result.get("engine", run.problem.engine.name)),
        "seed": str(result["seed"]),
        "velocity error": (
            f"rmse {number(error['rmse'], None)} m/s; tracking noise alone gives "
            f"{number(error['noise'], None)} m/s"
        ),
        "timings": timings,
    }
    return provenance(fit_text.fit_command(run), (run.clip,), facts)
