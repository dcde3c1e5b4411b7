"""The first part of a sweep's page: one row for each clip, with a picture and a link to its page.

It needs no truth and adds nothing up: it is for whoever filmed the clips, such as a class.
"""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from galileo_jax.clip.schema import Clip
from galileo_jax.observation.observation import Observation
from galileo_jax.report.fit_text import fits, meaning, nearness
from galileo_jax.report.style import object_colour
from galileo_jax.report.video_frames import jpeg
from galileo_jax.results.shown import (
    HEADLINES,
    headlines,
    interval_text,
    number,
    point_estimate,
    shown,
    unit_text,
)
from galileo_jax.runtime.errors import InputError
from galileo_jax.video import decode

PICTURE_PX, QUALITY = 200, 70  # the longer side of a thumbnail, twice as large as it is shown
DRAWING_PX = (100, 62)
MOST_POINTS = 60  # of a drawn path
APART = '<span class="apart" title="stands apart">◆</span>&nbsp;'
SHORT = {"mass_ratio": "m1/m2"}  # headings of columns, where they are not the parameter's name
Document = Mapping[str, Any]


@dataclass(frozen=True)
class ClipRow:
    """A clip and what a sweep found of it.

    Attributes:
      name: that the clip is shown by.
      together_with: names of the trials that it was fitted together with.
      picture: JPEG; None of a clip without a video.
      observation: its track; None where it could not be tracked.
      fit: result.json of its fit; None without one.
      diagnosis: diagnosis.json; None where it was not diagnosed.
      pages: label and path of its own pages, relative to the sweep's page.
      failures: why it has no result, a sentence each.
      other_fits: how many fits it has beside the one that is shown.
      check: compare.json of a fit that was explained.
      remark: why it stands apart from the others; empty where it does not.
      outside: the quantities that the others find otherwise.
    """

    name: str
    together_with: tuple[str, ...] = ()
    picture: bytes | None = None
    observation: Observation | None = None
    fit: Document | None = None
    diagnosis: Document | None = None
    pages: tuple[tuple[str, Path], ...] = ()
    failures: tuple[str, ...] = ()
    other_fits: int = 0
    check: Document | None = None
    remark: str = ""
    outside: tuple[str, ...] = ()


def thumbnail(clip: Clip, observation: Observation) -> bytes | None:
    """A small JPEG from the middle of a clip's motion; None where it has no video.

    `observation`: its track, frame by frame as in the video.
    """
    if clip.video is None:
        return None
    wanted, picture = middle_frame(observation), None
    try:
        for index, frame in enumerate(decode.frames(clip.video)):
            picture = frame
            if index >= wanted:
                break
    except InputError:  # a picture is no reason to fail
        return None
    return None if picture is None else jpeg(picture, PICTURE_PX, QUALITY)


def middle_frame(observation: Observation) -> int:
    """The frame in which the objects are half as far from where they began as they come.

    Distances are summed over the objects. Without any motion: the middle of the track.
    """
    position = np.where(observation.mask[:, None, :], observation.position_m, np.nan)
    away = np.zeros(position.shape[-1])
    for i, is_seen in enumerate(observation.mask):
        if is_seen.any():
            first = position[i][:, int(np.argmax(is_seen))]
            distance = np.hypot(*(position[i] - first[:, None]))
            distance[~is_seen] = np.interp(
                np.flatnonzero(~is_seen), np.flatnonzero(is_seen), distance[is_seen]
            )
            away += distance
    if not away.any():
        return len(away) // 2
    return int(np.argmax(away >= 0.5 * away.max()))


def clips_section(rows: Sequence[ClipRow]) -> str:
    """The table as HTML, with its heading."""
    values = [_values(row) for row in rows]
    columns = list(dict.fromkeys(name for each in values for name in each))
    columns.sort(key=lambda name: (not HEADLINES.fullmatch(name), "mass" in name))
    has_remarks = any(row.remark for row in rows)
    more = ["effect", "off", *(["remark"] if has_remarks else []), "report"]
    head = ["", "clip", *(SHORT.get(name, name) for name in columns), *more]
    kinds = {"": "picture", "report": "pages"}
    top = "".join(
        f'<th scope="col" class="{kinds.get(name, "")}">{escape(name)}</th>' for name in head
    )
    body = "".join(
        _row(row, own, columns, len(more)) for row, own in zip(rows, values, strict=True)
    )
    meanings = [
        f"{SHORT.get(name, name)}: {_meaning(name)}" for name in columns if _meaning(name) != name
    ]
    caption = "Each value with its 95 % interval. Off: root mean square of the fit's distance."
    if meanings:
        caption = f"{'; '.join(meanings)}. {caption}"
    if any(row.other_fits for row in rows):
        caption += " Values are those of the first fit of each clip, in the order of the config."
    return (
        f"<h2>Clip by clip</h2>\n<p>{escape(caption)}</p>\n"
        f'<div class="table"><table class="clips"><thead><tr>{top}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def _meaning(name: str) -> str:
    if name == "mass_ratio":
        return "mass of object 1 over mass of object 2"
    return meaning(name) or name


def _values(row: ClipRow) -> dict[str, Mapping[str, Any]]:
    """By name: frictions and mass ratios; of a motion that has none what it does determine."""
    if row.fit is not None:
        entries = {**row.fit["parameters"], **row.fit["derived"]}
        best = point_estimate(row.fit)
        for name in set(best) & set(entries):
            entries[name] = {**entries[name], "mean": best[name], "sd": None, "identified": True}
    elif row.diagnosis is not None:
        last = row.diagnosis["history"][-1]
        entries = {name: entry for name, entry in last.items() if isinstance(entry, Mapping)}
    else:
        return {}
    return headlines(entries)


def _row(row: ClipRow, values: Mapping[str, Any], columns: Sequence[str], more: int) -> str:
    """A row; it has `more` cells after its values."""
    together = ""
    if row.together_with:
        others = escape(", ".join(row.together_with))
        together = f'<span class="soft">fitted together with {others}</span>'
    cells = [
        f'<td class="picture">{_picture(row)}</td>',
        f'<th scope="row">{APART if row.remark else ""}{escape(row.name)}{together}</th>',
    ]
    if row.fit is None and row.diagnosis is None:
        said = "; ".join(dict.fromkeys([*row.failures, *filter(None, [row.remark])]))
        span = f'colspan="{len(columns) + more}"'
        cells.append(f'<td class="warn why" {span}>{escape(said or "Not computed yet.")}</td>')
    else:
        for name in columns:
            label = escape(SHORT.get(name, name), quote=True)
            shown = _value(values[name]) if name in values else ""
            kind = "value outside" if name in row.outside else "value"
            cells.append(f'<td class="{kind}" data-label="{label}">{shown}</td>')
        cells.append(f'<td class="model">{_model(row)}</td>')
        cells.append(f'<td class="value off" data-label="off">{_off(row)}</td>')
        if more == 4:
            cells.append(f'<td class="remark">{escape(row.remark)}</td>')
        cells.append(f'<td class="pages">{_links(row)}</td>')
    return f"<tr>{''.join(cells)}</tr>\n"


def _value(entry: Mapping[str, Any]) -> str:
    if not entry["identified"]:
        return '<span class="soft">not determined</span>'
    value = escape(f"{shown(entry)}{unit_text(entry)}")
    if not entry["sd"]:
        return value
    return f'{value} <span class="soft">{escape(interval_text(entry))}</span>'


def _off(row: ClipRow) -> str:
    """How near the fit comes; empty where that is not known."""
    first, *rest = (nearness(row.fit["error"]) if row.fit is not None else []) or [""]
    return "".join([first, *(f' <span class="soft">{size}</span>' for size in rest)])


def _model(row: ClipRow) -> str:
    """Whether the model describes the clip, or what is missing in it."""
    if row.diagnosis is not None:
        verdict = row.diagnosis["verdict"]
        said, is_good = verdict_words(verdict), verdict["status"] in ("none", "named", "law")
        error = row.diagnosis["history"][-1]
    elif row.check is not None and row.fit is not None:
        error, is_good = row.fit["error"], bool(row.check["adequate"])
        said = "none" if is_good else "no verdict"
    else:
        assert row.fit is not None
        error, is_good = row.fit["error"], fits(dict(row.fit))
        said = "fits" if is_good else "does not fit"
    mark = "" if is_good else ' class="warn"'
    failed = ""
    if row.failures:
        failed = f'<span class="warn">{escape(row.failures[0])}</span>'
    chi2 = number(error["chi2_per_dof"], 0.1)
    return f'<b{mark}>{escape(said)}</b> <span class="soft">chi2 {chi2}</span>{failed}'


def verdict_words(verdict: Mapping[str, Any]) -> str:
    """The effect that a diagnosis names, or what else it says, in a few words."""
    status, effects = verdict["status"], verdict["effects"]
    if status == "named":
        return " and ".join(effects)
    if status == "law":
        return str(verdict["law"])
    if status == "ambiguous":
        return f"ambiguous: {', '.join(effects)}"
    return "something unknown" if status == "unknown" else str(status)


def _links(row: ClipRow) -> str:
    return ", ".join(
        f'<a href="{quote(path.as_posix())}">{escape(label)}</a>' for label, path in row.pages
    )


def _picture(row: ClipRow) -> str:
    if row.picture is not None:
        encoded = base64.b64encode(row.picture).decode("ascii")
        name = escape(row.name, quote=True)
        return f'<img alt="a frame of {name}" src="data:image/jpeg;base64,{encoded}">'
    return "" if row.observation is None else _drawing(row.observation, row.name)


def _drawing(observation: Observation, name: str) -> str:
    """The objects' paths, and where they end, to scale."""
    width, height = DRAWING_PX
    places = np.moveaxis(np.where(observation.mask[:, None], observation.position_m, np.nan), 1, -1)
    seen = places[observation.mask]
    if not len(seen):
        return ""
    low, high = seen.min(axis=0), seen.max(axis=0)
    margin = 6.0
    scale = min(
        (size - 2 * margin) / max(extent, 1e-6)
        for size, extent in zip(DRAWING_PX, high - low, strict=True)
    )
    centre = (low + high) / 2
    shapes = []
    for i, (path, is_seen) in enumerate(zip(places, observation.mask, strict=True)):
        own = path[is_seen]
        if not len(own):
            continue
        chosen = own[np.unique(np.linspace(0, len(own) - 1, MOST_POINTS).round().astype(int))]
        x = width / 2 + scale * (chosen[:, 0] - centre[0])
        y = height / 2 - scale * (chosen[:, 1] - centre[1])
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
        colour = f"var(--{object_colour(i)})"
        shapes.append(
            f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.5"/>'
            f'<circle cx="{x[-1]:.1f}" cy="{y[-1]:.1f}" r="3" fill="{colour}"/>'
        )
    label = escape(f"paths of the objects in {name}", quote=True)
    return (
        f'<svg viewBox="0 0 {width} {height}" role="img" aria-label="{label}">'
        f"{''.join(shapes)}</svg>"
    )
