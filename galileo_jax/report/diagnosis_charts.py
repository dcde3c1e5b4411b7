"""Charts of a comparison and a diagnosis: where the model fails, and what is missing in it."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from galileo_jax.comparison.local_tests import WHOLE
from galileo_jax.comparison.path_residuals import PathResiduals
from galileo_jax.diagnosis.diagnosis import Candidate, Diagnosis, MissingForce, Round
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


def diagnosis_chart(diagnosis: Diagnosis) -> Chart:
    """The velocity error of each round, and the probabilities of the first candidates."""
    rounds = rounds_chart(diagnosis.rounds)
    if not diagnosis.candidates:
        return rounds
    candidates = candidates_chart(diagnosis.candidates[:NUM_CANDIDATES])
    panels = (*rounds.panels, *candidates.panels)
    return Chart("diagnosis", "velocity error and candidates", panels, panel_px=200)


def rounds_chart(rounds: Sequence[Round]) -> Chart:
    """The velocity error of each round beside what tracking noise alone would give."""
    errors = [one.comparison.error for one in rounds]
    rmse = [float(error["rmse"]) for error in errors]
    names = [f"{i}. {effects_text(one.effects)}" for i, one in enumerate(rounds, 1)]
    texts = tuple(f"{value:.4f}" for value in rmse)
    noise = [float(error["noise"]) for error in errors]
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


def candidates_chart(candidates: Sequence[Candidate]) -> Chart:
    """The probability of each candidate, the most probable on top."""
    names = [one.name for one in candidates]
    values = [one.probability for one in candidates]
    texts = tuple(f"{value:.3f}" for value in values)
    bars = Bars(names, values, "accent", "probability", 0.5, texts, is_horizontal=True)
    panel = Panel("", (bars,), xlabel="probability", xlim=(0.0, 1.12))
    label = "probabilities of the candidates: " + ", ".join(
        f"{name} {text}" for name, text in zip(names, texts, strict=True)
    )
    return Chart("candidates", label, (panel,))


def known_objects(missing: MissingForce, names: Sequence[str]) -> dict[int, str]:
    """By index the objects that were tracked while they moved: of others nothing is known."""
    known = [bool(np.isfinite(one).any()) for one in missing.acceleration_m_s2]
    return {
        i: name for i, (name, is_known) in enumerate(zip(names, known, strict=True)) if is_known
    }


def missing_force_chart(missing: MissingForce, names: Mapping[int, str]) -> Chart:
    """The acceleration that the model lacks, with its 95 % band, against time, speed and place.

    `names`: of the objects that are drawn, by their index.
    """
    objects = list(names)
    value, sd = missing.acceleration_m_s2[objects], missing.sd_m_s2[objects]
    spread = 3 * float(np.nanmedian(np.where(np.isfinite(value), sd, np.nan)))
    ylim = (min(0.0, np.nanmin(value)) - spread, max(0.0, np.nanmax(value)) + spread)
    of_time: list[Mark] = []
    of_speed: list[Mark] = []
    of_path: list[Mark] = []
    for index, name, own, own_sd in zip(objects, names.values(), value, sd, strict=True):
        colour, time = object_colour(index), missing.time_s
        known = np.flatnonzero(np.isfinite(own))
        chosen = known[:: max(1, len(known) // NUM_POINTS)]
        label = "missing" if len(names) == 1 else name
        of_time.append(Band(time, own - 1.96 * own_sd, own + 1.96 * own_sd, colour, "95 %", 0.25))
        of_time.append(Line(time, own, colour, label))
        for marks, across in ((of_speed, missing.speed_m_s), (of_path, missing.path_m)):
            at = across[index][chosen]
            marks.append(Points(at, own[chosen], colour, label, sd=own_sd[chosen]))
    panels = tuple(
        Panel("missing, m/s²", tuple(marks), title=title, xlabel=xlabel, ylim=ylim, level=0.0)
        for marks, xlabel, title in (
            (of_time, "time since the release, s", ", ".join(names.values())),
            (of_speed, "speed, m/s", ""),
            (of_path, "along the path, m", ""),
        )
    )
    listed = ", ".join(names.values())
    label = f"acceleration that the model of {listed} lacks, against time, speed and position"
    return Chart(f"missing_{'_'.join(names.values())}", label, panels)


def friction_chart(rows: Sequence[Mapping[str, Any]], clip: str) -> Chart:
    """The coefficient of friction along the way with its 95 % band, of the bodies of one clip.

    Args:
      rows: `friction_along_way` of diagnosis.json.
      clip: whose.
    """
    marks: list[Mark] = []
    for index, row in enumerate(one for one in rows if one["clip"] == clip):
        colour = object_colour(index)
        path, mean, sd = (np.array(row[key], float) for key in ("path_m", "mean", "sd"))
        marks.append(Band(path, mean - 1.96 * sd, mean + 1.96 * sd, colour, "95 %", 0.25))
        marks.append(Line(path, mean, colour, row["object"]))
    panel = Panel(
        "friction coefficient", tuple(marks), title=clip, xlabel="along the path, m", level=0.0
    )
    return Chart(f"friction_{clip}", f"friction coefficient along the way in {clip}", (panel,))
