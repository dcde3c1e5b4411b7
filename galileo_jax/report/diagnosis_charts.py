"""Charts of a comparison and a diagnosis: where the model fails, and what is missing in it."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from galileo_jax.comparison.local_tests import WHOLE
from galileo_jax.comparison.path_residuals import PathResiduals
from galileo_jax.report.chart import Band, Bars, Chart, Line, Mark, Panel, Points, side_by_side
from galileo_jax.report.diagnosis_text import effects_text
from galileo_jax.report.fit_charts import residual_panel
from galileo_jax.report.style import object_colour

NUM_POINTS = 70  # of a scatter plot
NUM_CANDIDATES = 8  # that are shown


def failure_chart(one: PathResiduals) -> Chart:
    """Measured (dots) and fitted (line, 95 % band) position and speed, and the residuals.

    Residuals: filled along the path, hollow across it. The interval that fails worst is shaded.
    """
    colour = object_colour(one.index)
    step = np.diff(one.times_s)
    middle = one.times_s[:-1] + step / 2
    position = Panel(
        ylabel="along the path, m",
        title=_title(one),
        marks=(
            Band(one.times_s, one.low_m, one.high_m, colour, "95 % of the model"),
            Line(one.times_s, one.predicted_m, colour, "fitted"),
            Points(one.times_s, one.measured_m, "ink", "measured"),
        ),
        highlights=(one.failing_s,),
    )
    speed = Panel(
        ylabel="speed, m/s",
        marks=(
            Line(middle, np.diff(one.predicted_m) / step, colour, "fitted"),
            Points(middle, np.diff(one.measured_m) / step, "ink", "measured"),
        ),
        highlights=(one.failing_s,),
    )
    label = f"{one.title}: position, speed and residuals of the fit, against time"
    panels = (position, speed, _residuals(one, one.largest))
    return Chart(f"failure_{one.clip}_{one.name}", label, panels, one.clip)


def comparison_chart(paths: Sequence[PathResiduals]) -> Chart:
    """A column for each object: position, speed, residuals; where the model fails is shaded."""
    columns = [failure_chart(one) for one in paths]
    return side_by_side("comparison", "position, speed and residuals", columns)


def before_after_chart(
    before: PathResiduals, after: PathResiduals, titles: tuple[str, str]
) -> Chart:
    """The residuals of one object before and after an effect was added, on the same axes."""
    largest = max(before.largest, after.largest)
    panels = tuple(
        _residuals(one, largest, f"{one.title}: {title}")
        for one, title in zip((before, after), titles, strict=True)
    )
    label = f"{after.title}: residuals before and after {titles[1]} was added"
    added = titles[1].replace(", ", "+").replace(" ", "_")
    return Chart(f"before_after_{after.clip}_{after.name}_{added}", label, panels, after.clip)


def _title(one: PathResiduals) -> str:
    if one.worst is None:
        return one.title
    where = "" if one.worst.phase == WHOLE else f", {one.worst.phase}"
    return f"{one.title}: worst in {one.worst.axis}{where} (z = {one.worst.z:.0f})"


def _residuals(one: PathResiduals, largest: float, title: str = "") -> Panel:
    return residual_panel(
        one.times_s,
        {"along the path": one.along, "across the path": one.across},
        one.index,
        title=title,
        phases=one.phases,
        highlight=one.failing_s,
        largest=largest,
    )


def diagnosis_chart(record: Mapping[str, Any]) -> Chart:
    """The velocity error of each round, and the probabilities of the first candidates."""
    rounds, shown = rounds_chart(record["history"]), record["candidates"][:NUM_CANDIDATES]
    if not shown:
        return rounds
    names, values = [one["effect"] for one in shown], [one["probability"] for one in shown]
    texts = tuple(f"{value:.3f}" for value in values)
    bars = Bars(names, values, "accent", "probability", 0.5, texts, is_horizontal=True)
    candidates = Panel("", (bars,), xlabel="probability", xlim=(0.0, 1.12))
    panels = (*rounds.panels, candidates)
    return Chart("diagnosis", "velocity error and candidates", panels, panel_px=200)


def rounds_chart(rounds: Sequence[Mapping[str, Any]]) -> Chart:
    """The velocity error of each round beside what tracking noise alone would give.

    `rounds`: `history` of diagnosis.json.
    """
    rmse, noise = ([float(one[key]) for one in rounds] for key in ("rmse", "noise"))
    names = [f"{i}. {effects_text(one['effects'])}" for i, one in enumerate(rounds, 1)]
    texts = tuple(f"{value:.4f}" for value in rmse)
    marks = (
        Bars(names[:-1], rmse[:-1], "soft", "velocity error", 0.3, texts[:-1], opacity=0.55),
        Bars(names[-1:], rmse[-1:], "accent", "velocity error of the last", 0.3, texts[-1:]),
        Line(names, noise, "ink", "tracking noise alone", is_dashed=True, width_px=1),
        Points(names, noise, "ink", "tracking noise alone"),
    )
    panel = Panel(
        "velocity error, m/s",
        marks[len(rounds) == 1 :],
        xlabel="round",
        xlim=(-0.7, len(rounds) - 0.3),
        ylim=(0.0, 1.18 * max(rmse)),
    )
    label = "velocity error round by round: " + ", ".join(f"{text} m/s" for text in texts)
    return Chart("rounds", label, (panel,))


def known_objects(missing: Mapping[str, Any]) -> list[str]:
    """The objects that were tracked while they moved: of others nothing is known.

    `missing`: `missing_force` of diagnosis.json.
    """
    values = {name: _array(one, "acceleration_m_s2") for name, one in missing["objects"].items()}
    return [name for name, value in values.items() if np.isfinite(value).any()]


def missing_force_chart(missing: Mapping[str, Any], names: Sequence[str]) -> Chart:
    """The acceleration that the model lacks, with its 95 % band, against time, speed and place.

    `missing`: `missing_force` of diagnosis.json; `names`: of the objects that are drawn.
    """
    time, objects = _array(missing, "time_s"), missing["objects"]
    value = np.stack([_array(objects[name], "acceleration_m_s2") for name in names])
    sd = np.stack([_array(objects[name], "sd_m_s2") for name in names])
    spread = 3 * float(np.nanmedian(np.where(np.isfinite(value), sd, np.nan)))
    ylim = (min(0.0, np.nanmin(value)) - spread, max(0.0, np.nanmax(value)) + spread)
    of_time: list[Mark] = []
    across: dict[str, list[Mark]] = {"speed_m_s": [], "path_m": []}
    for name, own, own_sd in zip(names, value, sd, strict=True):
        colour = object_colour(list(objects).index(name))
        known = np.flatnonzero(np.isfinite(own))
        chosen = known[:: max(1, len(known) // NUM_POINTS)]
        label = "missing" if len(names) == 1 else name
        of_time += _with_band(time, own, own_sd, colour, label)
        for key, marks in across.items():
            at = _array(objects[name], key)[chosen]
            marks.append(Points(at, own[chosen], colour, label, sd=own_sd[chosen]))
    listed = ", ".join(names)
    panels = tuple(
        Panel("missing, m/s²", tuple(marks), title=title, xlabel=xlabel, ylim=ylim, level=0.0)
        for marks, xlabel, title in (
            (of_time, "time since the release, s", listed),
            (across["speed_m_s"], "speed, m/s", ""),
            (across["path_m"], "along the path, m", ""),
        )
    )
    label = f"acceleration that the model of {listed} lacks, against time, speed and position"
    return Chart(f"missing_{'_'.join(names)}", label, panels)


def friction_chart(rows: Sequence[Mapping[str, Any]], clip: str) -> Chart:
    """The coefficient of friction along the way with its 95 % band, of the bodies of one clip.

    `rows`: `friction_along_way` of diagnosis.json.
    """
    marks: list[Mark] = []
    for index, row in enumerate(one for one in rows if one["clip"] == clip):
        path, mean, sd = (_array(row, key) for key in ("path_m", "mean", "sd"))
        marks += _with_band(path, mean, sd, object_colour(index), row["object"])
    panel = Panel(
        "friction coefficient", tuple(marks), title=clip, xlabel="along the path, m", level=0.0
    )
    return Chart(f"friction_{clip}", f"friction coefficient along the way in {clip}", (panel,))


def _with_band(
    x: np.ndarray, mean: np.ndarray, sd: np.ndarray, colour: str, name: str
) -> tuple[Band, Line]:
    """A curve and its 95 % band."""
    band = Band(x, mean - 1.96 * sd, mean + 1.96 * sd, colour, "95 %", 0.25)
    return band, Line(x, mean, colour, name)


def _array(record: Mapping[str, Any], key: str) -> np.ndarray:
    """A list of numbers; NaN where a file has null."""
    return np.array(record[key], float)
