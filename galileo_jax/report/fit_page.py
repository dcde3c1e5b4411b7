"""The page of a fit, DIR/report.html."""

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.measurement.segments.segments import Cut
from galileo_jax.prediction.posterior_predictive import PosteriorPredictive, posterior_predictive
from galileo_jax.report import fit_text
from galileo_jax.report import html_page as html
from galileo_jax.report.animation import animation
from galileo_jax.report.chart import Chart
from galileo_jax.report.fit_charts import (
    failing_interval_of,
    pair_chart,
    profile_chart,
    residual_chart,
    trace_chart,
)
from galileo_jax.report.fit_text import meaning
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

PAGE = "report.html"
NUISANCES = (
    "Always free, with narrow priors, so that the intervals above include their uncertainty. "
    "A nuisance parameter that the clip does not determine has its prior."
)
VELOCITY = (
    "Measured and fitted velocities. Dark band: 95 % of the model, from the uncertainty of the "
    "posterior. Light band: 95 % of measurements are expected in it. The vertical line is at the "
    "time of the slider."
)
RESIDUALS = (
    "Residuals: measured minus fitted, in units of the stated noise. If model and noise are "
    "right, they show no pattern, and 95 % of them are inside the grey band. "
)
NONE_TO_DETERMINE = "The model of this motion has none to determine."


def write_report(
    run: Run, page: Path | None = None, lead: str = "", beside: Mapping[str, str] | None = None
) -> Path:
    """Writes a finished fit's page, report.html in its folder if no other; returns its path.

    `lead`: the result in words, for the top; `beside`: titles of other pages to their places.
    """
    fitted = posterior_predictive(run, seed=int(run.result["seed"]))
    charts, parameters = fit_charts(run, fitted), shown_parameters(run.result)
    key, is_good = _key(run), fit_text.fits(run.result)
    quality = " ".join(
        [*fit_text.fit_quality(run.result), f"({fit_text.chi2_text(run.result['error'])})"]
    )
    more = _top(run) + _headlines(parameters)
    if lead:
        links = (html.prose(html.link(*one)) for one in (beside or {}).items())
        more = "\n".join([*links, html.prose(quality), more])
    sections = [
        _undetermined(run, fitted),
        _motion(run, fitted),
        html.chart_section("Velocity", VELOCITY, charts["velocity"], key=key),
        _residuals(fitted, charts["residuals"]),
        html.section(
            "Parameters", _table(parameters) if parameters else html.prose(NONE_TO_DETERMINE)
        ),
        html.details(
            "Nuisance parameters", html.prose(NUISANCES) + _table(run.result.get("nuisances", {}))
        ),
        html.chart_section("Posterior", _draws_caption(run), charts["draws"], "stack"),
        html.chart_section("Position", _position_caption(fitted), charts["position"], key=key),
        _provenance(run),
    ]
    title = ", ".join(Path(clip).name for clip in run.result["clips"])
    kind = "explanation" if lead else "fit"
    page = page or run.folder / PAGE
    return html.write_page(page, kind, title, lead or quality, sections, more, is_good)


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
    both = [(i, axis) for i in objects for axis in range(len(fitted.observation.axes))]
    return {
        "velocity": [profile_chart(fitted, "velocity", *one, clip) for one in both],
        "residuals": [residual_chart(fitted, i, clip) for i in objects],
        "draws": draws,
        "position": [profile_chart(fitted, "position", *one, clip) for one in both],
    }


def _top(run: Run) -> str:
    """What stands below the first sentence: convergence, warnings, method, what was left out."""
    result = run.result
    effects = ", ".join(result["effects"]) or "none besides friction and impact"
    cuts = [
        f"{clip}: {Cut(**entry)}" for clip, cuts in result.get("cuts", {}).items() for entry in cuts
    ]
    lines = [
        html.prose(fit_text.convergence(run), "" if result["converged"] else "warn"),
        *(html.prose(line, "warn") for line in fit_text.cautions(result)),
        html.prose(f"Method {result['method']}; effects: {effects}.", "soft"),
        *(html.prose(f"{line}.", "soft") for line in (*cuts, *result.get("taken_as_exact", []))),
    ]
    return "".join(f"{line}\n" for line in lines)


def _headlines(parameters: Mapping[str, Mapping[str, Any]]) -> str:
    cards = []
    for name, entry in parameters.items():
        if not HEADLINES.fullmatch(name):
            continue
        value, note = "not determined", "see below"
        if entry["identified"]:
            value, note = shown(entry), f"{interval_text(entry)} (95 %)"
        label = escape(meaning(name) or name)
        cards.append(
            f'<div class="card"><span>{label}</span><b>{value}</b><span>{note}</span></div>'
        )
    return f'<div class="cards">{"".join(cards)}</div>'


def _undetermined(run: Run, fitted: PosteriorPredictive) -> str:
    by_reason: dict[str, list[str]] = {}
    for name, reason in fit_text.undetermined(run, fitted).items():
        by_reason.setdefault(reason, []).append(meaning(name) or name)
    listed = html.items(
        html.Html(f"<strong>{escape(', '.join(names))}</strong>: {escape(reason)}.")
        for reason, names in by_reason.items()
    )
    body = listed or html.prose("It determines all main parameters.")
    return html.section("What the clip does not determine", body)


def _motion(run: Run, fitted: PosteriorPredictive) -> str:
    model = ", ".join(run.result["effects"]) or "fitted"
    centres = np.median(fitted.position_m, axis=0) - fitted.offset_m[..., None]
    return html.section("Motion", animation(run.clip, run.problem, {model: centres}))


def _key(run: Run) -> str:
    """What the marks of velocities and positions mean."""
    names = run.problem.observation.names
    return html.legend(
        [
            ("dot", "ink", "measured"),
            *(("line", object_colour(i), f"{name}, fitted") for i, name in enumerate(names)),
            ("fill", "soft", "dark: 95 % of the model; light: 95 % of measurements"),
        ]
    )


def _residuals(fitted: PosteriorPredictive, charts: Sequence[Chart]) -> str:
    found = failing_interval_of(fitted)
    if found is None:
        text = f"{RESIDUALS}No interval deviates more than noise would."
        return html.chart_section("Residuals", text, charts)
    name, axis, worst = found
    text = (
        f"{RESIDUALS}Yellow: the interval that deviates most, {name} along {axis} from "
        f"{worst.start_s:.2f} to {worst.end_s:.2f} s (its mean is {worst.z:.0f} standard errors "
        "from 0). Run galileo compare to test the model, and galileo diagnose to find the effect "
        "that it lacks."
    )
    return html.chart_section("Where the model fails", text, charts)


def _position_caption(fitted: PosteriorPredictive) -> str:
    millimetres = np.round(1e3 * fitted.offset_m, 1) + 0.0  # no -0.0
    moved = "; ".join(
        f"{name} ({', '.join(f'{value:.1f}' for value in moved)}) mm"
        for name, moved in zip(fitted.observation.names, millimetres, strict=True)
    )
    return (
        "The tracked point is not exactly the centre. The fitted curves include this constant "
        f"offset: {moved}."
    )


def _draws_caption(run: Run) -> str:
    text = f"{run.posterior.flat().shape[0]} draws of the main parameters."
    if "m2" in run.posterior.names:
        text += " One mass against another lies on a straight line: only their ratio is determined."
    return text


def _table(entries: Mapping[str, Mapping[str, Any]]) -> str:
    rows = [
        [
            html.code(name), meaning(name) or "", f"{shown(entry)}{unit_text(entry)}",
            shown(entry, "sd"), interval_text(entry), "yes" if entry["identified"] else "no",
        ]
        for name, entry in entries.items()
    ]  # fmt: skip
    head = ("name", "meaning", "mean", "sd", "95 % interval", "determined")
    return html.table(head, rows, only_wide=("meaning",))


def _provenance(run: Run) -> str:
    result, error = run.result, run.result["error"]
    rmse, noise = number(error["rmse"], None), number(error["noise"], None)
    spent = result["timings_s"].items()
    facts = {
        "engine": str(result.get("engine", run.problem.engine.name)),
        "seed": str(result["seed"]),
        "velocity error": f"rmse {rmse} m/s; tracking noise alone gives {noise} m/s",
        "timings": ", ".join(f"{stage} {seconds:.1f} s" for stage, seconds in spent),
    }
    return provenance(fit_text.fit_command(run), (run.clip,), facts)
