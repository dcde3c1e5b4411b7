"""What a prediction says: lines for the terminal, and its section of the report."""

import base64
import re
from collections.abc import Callable, Mapping
from html import escape
from pathlib import Path
from typing import Any

from galileo_jax.report.figure import to_inline
from galileo_jax.report.shell import document, figure_section, header, table
from galileo_jax.report.write import PAGE
from galileo_jax.results.run import Run
from galileo_jax.runtime.atomic_write import write_text

LEAST_M = 5e-4  # after the clip, that is worth telling
OVER = "all is at rest when the clip ends, and stays so; what follows happened in the clip"
ALONE = "prediction.html"  # where there is no report to go into


def told(run: Run, found: Mapping[str, Any]) -> list[str]:
    """The answers, prediction.json, as lines for the reader."""
    verb, is_free = _verb(run), _is_free(run)
    until = found["predicted_until_s"]
    lines = [f"until {until:.2f} s, {found['seconds_beyond_clip_s']:g} s after the clip's end:"]
    if is_over(found):
        lines.append(OVER)
    for name, entry in found["objects"].items():
        slides, stops = entry["slides_probability"], entry["stops_probability"]
        lines.append(f"{name}: will it {verb}? {_chance(slides)}")
        if slides == 0:
            continue
        lines.append(f"  how far: {_interval(entry['travelled_m'], 'm')}")
        beyond = entry["travelled_beyond_clip_m"]
        if beyond["q975"] > LEAST_M:
            lines.append(f"  of that after the clip: {_interval(beyond, 'm')}")
        lines.append(f"  does it stop? {_chance(stops)}")
        if entry["rest_x_m"] and entry["rest_time_s"]:
            lines.append(
                f"  at x = {_interval(entry['rest_x_m'], 'm')}, "
                f"after {_interval(entry['rest_time_s'], 's')}"
            )
        if stops < 1 or is_free:
            line = f"  at the end at x = {_interval(entry['end_x_m'], 'm')}"
            if is_free:
                line += f", y = {_interval(entry['end_y_m'], 'm')}"
            lines.append(line)
    if found["hit"] is not None:
        first, second = list(found["objects"])[:2]
        line = f"does {first} hit {second}? {_chance(found['hit']['probability'])}"
        if found["hit"]["time_s"]:
            line += f", after {_interval(found['hit']['time_s'], 's')}"
        lines.append(line)
    return lines


def is_over(found: Mapping[str, Any]) -> bool:
    """Whether something moved in the clip and nothing does after it."""
    objects = found["objects"].values()
    moves_on = any(
        entry["stops_probability"] < 1 or entry["travelled_beyond_clip_m"]["q975"] > LEAST_M
        for entry in objects
    )
    return not moves_on and any(entry["slides_probability"] > 0 for entry in objects)


def _is_free(run: Run) -> bool:
    """Whether the height says something of its own: no surface leads the objects."""
    return not run.problem.model.scene.surroundings.has_surface


def _verb(run: Run) -> str:
    """What the objects do; what may turn does not slide."""
    turns = any(run.problem.model.scene.surroundings.rolls)
    return "move" if turns or _is_free(run) else "slide"


def _chance(probability: float) -> str:
    words = {0.0: "no", 1.0: "yes"}.get(probability, "perhaps")
    return f"{words} (probability {probability:.2f})"


def _interval(entry: Mapping[str, float], unit: str) -> str:
    mean, low, high = (f"{entry[key]:.3f}" for key in ("mean", "q025", "q975"))
    return f"{mean} {unit} ({low} to {high})"


def write_prediction(folder: Path, run: Run, found: Mapping[str, Any], svg: str) -> Path:
    """Puts the prediction's section into the folder's report, in place of an earlier one.

    Args:
      folder: with first_and_last.png in it; without a report the section is a page of its own.
      run: what was continued.
      found: prediction.json.
      svg: the motion continued.

    Returns:
      the page that has it.
    """
    section = _section(run, found, svg, (folder / "first_and_last.png").read_bytes())
    page = folder / PAGE
    if page.is_file() and "</main>" in (text := page.read_text(encoding="utf-8")):
        write_text(page, _inserted(text, section))
        return page
    page = folder / ALONE
    title = ", ".join(Path(clip).name for clip in run.result["clips"])
    until = f"Until {found['predicted_until_s']:.2f} s after the first frame."
    write_text(
        page, document(f"{title}: prediction", [header("prediction", title, until), section])
    )
    return page


def _inserted(page: str, section: str) -> str:
    page = re.sub(r'<section id="prediction">.*?</section>\n', "", page, flags=re.DOTALL)
    if 'href="#prediction"' not in page:
        page = page.replace("</nav>", '<a href="#prediction">Prediction</a></nav>', 1)
    before, after = page.rsplit("</main>", 1)
    return f"{before}{section}</main>{after}"


def _section(run: Run, found: Mapping[str, Any], svg: str, picture: bytes) -> str:
    columns = _columns(run)
    rows = [
        [f"<code>{escape(name)}</code>", *(cell(entry) for cell in columns.values())]
        for name, entry in found["objects"].items()
    ]
    hit = ""
    if found["hit"] is not None:
        first, second = list(found["objects"])[:2]
        when = _cell(found["hit"]["time_s"], "s")
        chance = _chance(found["hit"]["probability"])
        hit = f"<p>Does {escape(first)} hit {escape(second)}? {chance}, {when}.</p>\n"
    over = f"<p>{OVER[0].upper()}{OVER[1:]}.</p>\n" if is_over(found) else ""
    encoded = base64.b64encode(picture).decode("ascii")
    stills = f'<img src="data:image/png;base64,{encoded}" style="max-width:100%" alt="the stills">'
    motion = figure_section(
        "Prediction",
        f"{found['seconds_beyond_clip_s']:g} s beyond the clip's end, from {found['num_draws']} "
        "draws of the posterior: mean and 95 % interval.",
        {"motion": to_inline(svg, "measured and predicted motion")},
        "narrow",
    )
    caption = "First and last frame of the clip, as filmed and as simulated, and the end."
    return (
        f'<section id="prediction">\n{motion}\n{over}{table(("", *columns), rows)}\n{hit}'
        f"<figure><figcaption>{caption}</figcaption>{stills}</figure>\n</section>\n"
    )


def _columns(run: Run) -> dict[str, Callable[[Mapping[str, Any]], str]]:
    """Each column's title, and its cell of an object's entry."""
    columns: dict[str, Callable[[Mapping[str, Any]], str]] = {
        f"will it {_verb(run)}?": lambda entry: _chance(entry["slides_probability"]),
        "how far": lambda entry: _cell(entry["travelled_m"], "m"),
        "after the clip": lambda entry: _cell(entry["travelled_beyond_clip_m"], "m"),
        "does it stop?": lambda entry: _chance(entry["stops_probability"]),
        "where": lambda entry: _cell(entry["rest_x_m"], "m"),
        "when": lambda entry: _cell(entry["rest_time_s"], "s"),
    }
    if _is_free(run):
        del columns["where"]  # of x alone, which says little here
        columns["x at the end"] = lambda entry: _cell(entry["end_x_m"], "m")
        columns["y at the end"] = lambda entry: _cell(entry["end_y_m"], "m")
    return columns


def _cell(entry: Mapping[str, float] | None, unit: str) -> str:
    return _interval(entry, unit) if entry else "never"
