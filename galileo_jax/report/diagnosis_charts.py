"""Charts of a diagnosis: how the error falls, the candidates, and the missing force."""

from collections.abc import Sequence

import numpy as np

from galileo_jax.diagnosis.diagnosis import Candidate, MissingForce, Round
from galileo_jax.report.chart import Band, Bars, Chart, Line, Mark, Panel, Points
from galileo_jax.report.diagnosis_text import effects_text
from galileo_jax.report.style import object_colour

NUM_POINTS = 70  # of a scatter plot


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


def is_known(missing: MissingForce, index: int) -> bool:
    """Whether anything is known of what this object lacks: it was tracked while it moved."""
    return bool(np.isfinite(missing.acceleration_m_s2[index]).any())


def missing_force_chart(missing: MissingForce, index: int, name: str) -> Chart:
    """The acceleration of one object that the model lacks, with its 95 % band."""
    value, sd = missing.acceleration_m_s2[index], missing.sd_m_s2[index]
    known = np.flatnonzero(np.isfinite(value))
    chosen = known[:: max(1, len(known) // NUM_POINTS)]
    colour = object_colour(index)
    spread = 3 * float(np.median(sd[known]))
    ylim = (min(0.0, value[known].min()) - spread, max(0.0, value[known].max()) + spread)

    def against(values: np.ndarray, xlabel: str, *marks: Mark, title: str = "") -> Panel:
        points = Points(values[chosen], value[chosen], colour, "missing", sd=sd[chosen])
        return Panel(
            "missing, m/s²", marks or (points,), title=title, xlabel=xlabel, ylim=ylim, level=0.0
        )

    time = missing.time_s
    panels = (
        against(
            time,
            "time since the release, s",
            Band(time, value - 1.96 * sd, value + 1.96 * sd, colour, "95 %", 0.25),
            Line(time, value, colour, "missing"),
            title=name,
        ),
        against(missing.speed_m_s[index], "speed, m/s"),
        against(missing.path_m[index], "along the path, m"),
    )
    label = f"acceleration that the model of {name} lacks, against time, speed and position"
    return Chart(f"missing_{name}", label, panels)
