"""The results of a prediction: lines for the terminal, its chart, its section of the report."""

import re
from collections.abc import Mapping
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.prediction.extrapolate import Motions, as_measured
from galileo_jax.report import html_page as html
from galileo_jax.report.chart import Band, Chart, Line, Panel, Points
from galileo_jax.report.fit_page import PAGE
from galileo_jax.report.phrases import sentence
from galileo_jax.report.style import object_colour
from galileo_jax.report.video_frames import data_uri
from galileo_jax.results.run import Run
from galileo_jax.runtime.atomic_write import write_text

LEAST_M = 5e-4  # of motion after the clip; less is not mentioned
OVER = "everything is at rest when the clip ends and stays at rest: these values describe the clip"
ALONE = "prediction.html"  # where there is no report to go into
STEP_S = 1 / 60  # between points of the curve


def prediction_lines(run: Run, found: Mapping[str, Any]) -> list[str]:
    """The answers of prediction.json as lines for the terminal."""
    until = found["predicted_until_s"]
    lines = [f"until {until:.2f} s, {found['seconds_beyond_clip_s']:g} s after the clip's end:"]
    if is_over(found):
        lines.append(OVER)
    for name, entry in found["objects"].items():
        for i, (question, answer) in enumerate(_answers(run, entry).items()):
            mark = "" if question.endswith("?") else ":"
            lines.append(f"{f'{name}: ' if i == 0 else '  '}{question}{mark} {answer}")
    if found["hit"] is not None:
        lines.append(_hit(found))
    return lines


def _answers(run: Run, entry: Mapping[str, Any]) -> dict[str, str]:
    """What the posterior predicts of one object, by question."""
    surroundings = run.problem.model.scene.surroundings
    is_free = not surroundings.has_surface or surroundings.is_level
    verb = "move" if any(surroundings.rolls) or is_free else "slide"
    slides, stops = entry["slides_probability"], entry["stops_probability"]
    answers = {f"will it {verb}?": _chance(slides)}
    if slides == 0:
        return answers
    answers["how far"] = _interval(entry["travelled_m"], "m")
    beyond = entry["travelled_beyond_clip_m"]
    if beyond["q975"] > LEAST_M:
        answers["of that after the clip"] = _interval(beyond, "m")
    answers["does it stop?"] = _chance(stops)
    if entry["rest_x_m"] and entry["rest_time_s"]:
        answers["where it stops"] = f"x = {_interval(entry['rest_x_m'], 'm')}"
        answers["when it stops"] = _interval(entry["rest_time_s"], "s")
    if stops < 1 or is_free:
        answers["where it is at the end"] = f"x = {_interval(entry['end_x_m'], 'm')}" + (
            f", y = {_interval(entry['end_y_m'], 'm')}" if is_free else ""
        )
    return answers


def _hit(found: Mapping[str, Any]) -> str:
    first, second = list(found["objects"])[:2]
    hit = found["hit"]
    when = f", after {_interval(hit['time_s'], 's')}" if hit["time_s"] else ""
    return f"does {first} hit {second}? {_chance(hit['probability'])}{when}"


def is_over(found: Mapping[str, Any]) -> bool:
    """Whether something moved in the clip and nothing does after it."""
    objects = found["objects"].values()
    moves_on = any(
        entry["stops_probability"] < 1 or entry["travelled_beyond_clip_m"]["q975"] > LEAST_M
        for entry in objects
    )
    return not moves_on and any(entry["slides_probability"] > 0 for entry in objects)


def _chance(probability: float) -> str:
    words = {0.0: "no", 1.0: "yes"}.get(probability, "perhaps")
    return f"{words} (probability {probability:.2f})"


def _interval(entry: Mapping[str, float], unit: str) -> str:
    mean, low, high = (f"{entry[key]:.3f}" for key in ("mean", "q025", "q975"))
    return f"{mean} {unit} ({low} to {high})"


def write_prediction(folder: Path, run: Run, found: Mapping[str, Any], chart: Chart) -> Path:
    """Puts the prediction's section into the folder's report, in place of an earlier one.

    Without a report the section is a page of its own. first_and_last.png lies in the folder.
    """
    section = _section(run, found, chart, (folder / "first_and_last.png").read_bytes())
    page = folder / PAGE
    if page.is_file() and "</main>" in (text := page.read_text(encoding="utf-8")):
        write_text(page, _inserted(text, section))
        return page
    title = ", ".join(Path(clip).name for clip in run.result["clips"])
    until = f"Until {found['predicted_until_s']:.2f} s after the first frame."
    return html.write_page(folder / ALONE, "prediction", title, until, [section])


def _inserted(page: str, section: str) -> str:
    page = re.sub(r'<section id="prediction">.*?</section>\n', "", page, flags=re.DOTALL)
    if 'href="#prediction"' not in page:
        page = page.replace("</nav>", '<a href="#prediction">Prediction</a></nav>', 1)
    before, after = page.rsplit("</main>", 1)
    return html.with_plotly(f"{before}{section}</main>{after}")


def _section(run: Run, found: Mapping[str, Any], chart: Chart, picture: bytes) -> str:
    answers = {name: _answers(run, entry) for name, entry in found["objects"].items()}
    columns = dict.fromkeys(chain.from_iterable(answers.values()))
    rows = [
        [html.code(name), *(own.get(question, "") for question in columns)]
        for name, own in answers.items()
    ]
    hit = f"{html.prose(sentence(_hit(found)))}\n" if found["hit"] is not None else ""
    over = f"{html.prose(sentence(OVER))}\n" if is_over(found) else ""
    stills = f'<img src="{data_uri("png", picture)}" style="max-width:100%" alt="the stills">'
    motion = html.chart_section(
        "Prediction",
        f"{found['seconds_beyond_clip_s']:g} s beyond the clip's end, from {found['num_draws']} "
        "draws of the posterior: mean and 95 % interval.",
        [chart],
        "stack",
        html.legend(
            [
                ("dot", "ink", "measured"),
                *(("line", object_colour(i), f"{name}, median") for i, name in enumerate(answers)),
                ("dashed", "soft", "beyond the clip"),
                ("fill", "soft", "95 % of the posterior"),
            ]
        ),
    )
    caption = "First and last frame of the clip, filmed and simulated, and the predicted end."
    return (
        f'<section id="prediction">\n{motion}\n{over}{html.table(("", *columns), rows)}\n{hit}'
        f"<figure><figcaption>{caption}</figcaption>{stills}</figure>\n</section>\n"
    )


def prediction_chart(run: Run, motions: Motions) -> Chart:
    """Every object's x against time, with 95 % bands, during the clip and beyond.

    Without a surface it is the height: of most such motions x says little.
    """
    observation = run.problem.observation
    clip_end_s = float(observation.times_s[-1])
    stride = max(1, round(STEP_S / (motions.times_s[1] - motions.times_s[0])))
    times = motions.times_s[::stride]
    axis = 0 if run.problem.model.scene.surroundings.has_surface else 1
    shown = as_measured(run.problem.model, motions)[:, :, axis, ::stride]
    marks = []
    for i, name in enumerate(observation.names):
        low, median, high = np.quantile(shown[:, i], [0.025, 0.5, 0.975], axis=0)
        colour, during = object_colour(i), times <= clip_end_s
        marks += [
            Band(times, low, high, colour, "", 0.25),
            Line(times[during], median[during], colour, name),
            Line(times[~during], median[~during], colour, "", is_dashed=True),
            Points(observation.times_s, observation.position_m[i, axis], "ink", "measured",
                   size_px=3.3),
        ]  # fmt: skip
    panel = Panel(
        ylabel=("x, m", "y, m")[axis],
        marks=tuple(marks),
        title="Measured (dots), median and 95 % of the posterior",
        xlabel="time, s",
        divider=(clip_end_s, "end of the clip"),
    )
    label = f"measured and predicted {('x', 'y')[axis]} against time"
    return Chart("prediction", label, (panel,), run.problem.name, panel_px=290)
