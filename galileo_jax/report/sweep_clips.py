"""The first part of a sweep's page: one row for each clip, with a picture and a link to its page.

It needs no truth and adds nothing up: it is for whoever filmed the clips, such as a class.
"""

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from itertools import islice
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from galileo_jax.clip.schema import Clip
from galileo_jax.observation.observation import Observation
from galileo_jax.report import html_page as html
from galileo_jax.report.fit_text import fits, meaning, nearness
from galileo_jax.report.style import object_colour
from galileo_jax.report.video_frames import data_uri, jpeg
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
DRAWING_PX, MARGIN_PX = (100, 62), 6.0
MOST_POINTS = 60  # of a drawn path
APART = '<span class="apart" title="stands apart">◆</span>&nbsp;'
SHORT = {"mass_ratio": "m1/m2"}  # headings of columns, where they are not the parameter's name
IN_WORDS = {"mass_ratio": "mass of object 1 over mass of object 2"}
Document = Mapping[str, Any]


@dataclass(frozen=True)
class ClipRow:
    """A clip and what a sweep found of it."""

    name: str  # that the clip is shown by
    together_with: tuple[str, ...] = ()  # names of the trials that it was fitted together with
    picture: bytes | None = None  # JPEG; None of a clip without a video
    observation: Observation | None = None  # its track; None where it could not be tracked
    fit: Document | None = None  # result.json of its fit; None without one
    diagnosis: Document | None = None  # diagnosis.json; None where it was not diagnosed
    # Label and path of its own pages, relative to the sweep's page.
    pages: tuple[tuple[str, Path], ...] = ()
    failures: tuple[str, ...] = ()  # why it has no result, a sentence each
    other_fits: int = 0  # how many fits it has beside the one that is shown
    check: Document | None = None  # compare.json of a fit that was explained
    remark: str = ""  # why it stands apart from the others; empty where it does not
    outside: tuple[str, ...] = ()  # the quantities that the others find otherwise


def thumbnail(clip: Clip, observation: Observation) -> bytes | None:
    """A small JPEG from the middle of a clip's motion; None where it has no video.

    `observation`: its track, frame by frame as in the video.
    """
    if clip.video is None:
        return None
    wanted = middle_frame(observation)
    try:
        first = islice(decode.frames(clip.video), wanted + 1)
        return jpeg(deque(first, maxlen=1)[0], PICTURE_PX, QUALITY)
    except (InputError, IndexError):  # a picture is no reason to fail
        return None


def middle_frame(observation: Observation) -> int:
    """The frame in which the objects are half as far from where they began as they come.

    Distances are summed over the objects. Without any motion: the middle of the track.
    """
    frames = np.arange(observation.position_m.shape[-1])
    away = np.zeros(len(frames))
    for position, is_seen in zip(observation.position_m[:, :2], observation.mask, strict=True):
        if is_seen.any():
            seen = position[:, is_seen]
            away += np.interp(frames, frames[is_seen], np.hypot(*(seen - seen[:, :1])))
    if not away.any():
        return len(away) // 2
    return int(np.argmax(away >= 0.5 * away.max()))


def clips_section(rows: Sequence[ClipRow]) -> str:
    """The table as HTML, with its heading; empty without any."""
    if not rows:
        return ""
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
        _row(row, own, columns, has_remarks) for row, own in zip(rows, values, strict=True)
    )
    known = {name: IN_WORDS.get(name) or meaning(name) for name in columns}
    meanings = [f"{SHORT.get(name, name)}: {what}" for name, what in known.items() if what]
    caption = "Each value with its 95 % interval. Off: root mean square of the fit's distance."
    if meanings:
        caption = f"{'; '.join(meanings)}. {caption}"
    if any(row.other_fits for row in rows):
        caption += " Values are those of the first fit of each clip, in the order of the config."
    lines = f"<thead><tr>{top}</tr></thead><tbody>{body}</tbody>"
    clips = f'<div class="table"><table class="clips">{lines}</table></div>'
    return html.section("Clip by clip", html.prose(caption), clips)


def _values(row: ClipRow) -> dict[str, Mapping[str, Any]]:
    """By name: frictions and mass ratios; of a motion that has none what it does determine."""
    if row.fit is not None:
        entries = {**row.fit["parameters"], **row.fit["derived"]}
        for name, best in point_estimate(row.fit).items():
            if name in entries:
                entries[name] = {**entries[name], "mean": best, "sd": None, "identified": True}
        return headlines(entries)
    last = row.diagnosis["history"][-1] if row.diagnosis is not None else {}
    return headlines({name: entry for name, entry in last.items() if isinstance(entry, Mapping)})


def _row(row: ClipRow, values: Mapping[str, Any], columns: Sequence[str], has_remarks: bool) -> str:
    name, together = escape(row.name), ""
    if row.together_with:
        together = _soft(f"fitted together with {', '.join(row.together_with)}")
    cells = [
        f'<td class="picture">{_picture(row)}</td>',
        f'<th scope="row">{APART if row.remark else ""}{name}{together}</th>',
    ]
    if row.fit is None and row.diagnosis is None:
        said = "; ".join(dict.fromkeys([*row.failures, *filter(None, [row.remark])]))
        span = f'colspan="{len(columns) + 3 + has_remarks}"'
        cells.append(f'<td class="warn why" {span}>{escape(said or "Not computed yet.")}</td>')
    else:
        for column in columns:
            label = escape(SHORT.get(column, column), quote=True)
            kind = "value outside" if column in row.outside else "value"
            shown = _value(values[column]) if column in values else ""
            cells.append(f'<td class="{kind}" data-label="{label}">{shown}</td>')
        first, *rest = (nearness(row.fit["error"]) if row.fit is not None else []) or [""]
        off = " ".join([first, *map(_soft, rest)])
        links = ", ".join(html.link(label, quote(path.as_posix())) for label, path in row.pages)
        cells.append(f'<td class="model">{_model(row)}</td>')
        cells.append(f'<td class="value off" data-label="off">{off}</td>')
        cells += [f'<td class="remark">{escape(row.remark)}</td>'] * has_remarks
        cells.append(f'<td class="pages">{links}</td>')
    return f"<tr>{''.join(cells)}</tr>\n"


def _soft(text: str) -> str:
    return f'<span class="soft">{escape(text)}</span>'


def _value(entry: Mapping[str, Any]) -> str:
    if not entry["identified"]:
        return _soft("not determined")
    value = escape(f"{shown(entry)}{unit_text(entry)}")
    return f"{value} {_soft(interval_text(entry))}" if entry["sd"] else value


def _model(row: ClipRow) -> str:
    """Whether the model describes the clip, or what is missing in it."""
    if row.diagnosis is not None:
        verdict = row.diagnosis["verdict"]
        said, is_good = verdict_words(verdict), verdict["status"] in ("none", "named", "law")
        error = row.diagnosis["history"][-1]
    else:
        assert row.fit is not None
        error = row.fit["error"]
        is_good = fits(row.fit) if row.check is None else bool(row.check["adequate"])
        good, bad = ("fits", "does not fit") if row.check is None else ("none", "no verdict")
        said = good if is_good else bad
    mark = "" if is_good else ' class="warn"'
    failed = f'<span class="warn">{escape(row.failures[0])}</span>' if row.failures else ""
    chi2 = number(error["chi2_per_dof"], 0.1)
    return f"<b{mark}>{escape(said)}</b> {_soft(f'chi2 {chi2}')}{failed}"


def verdict_words(verdict: Mapping[str, Any]) -> str:
    """The effect that a diagnosis names, or what else it says, in a few words."""
    status, effects = str(verdict["status"]), verdict["effects"]
    words = {
        "named": " and ".join(effects),
        "law": str(verdict.get("law")),
        "ambiguous": f"ambiguous: {', '.join(effects)}",
        "unknown": "something unknown",
    }
    return words.get(status, status)


def _picture(row: ClipRow) -> str:
    if row.picture is not None:
        name = escape(row.name, quote=True)
        return f'<img alt="a frame of {name}" src="{data_uri("jpeg", row.picture)}">'
    return "" if row.observation is None else _drawing(row.observation, row.name)


def _drawing(observation: Observation, name: str) -> str:
    """The objects' paths, and where they end, to scale."""
    size = np.array(DRAWING_PX)
    places = np.moveaxis(observation.position_m[:, :2], 1, -1)
    seen = places[observation.mask]
    if not len(seen):
        return ""
    low, high = seen.min(axis=0), seen.max(axis=0)
    scale = np.min((size - 2 * MARGIN_PX) / np.maximum(high - low, 1e-6))
    shapes = []
    for i, (path, is_seen) in enumerate(zip(places, observation.mask, strict=True)):
        own = path[is_seen]
        if not len(own):
            continue
        chosen = own[np.unique(np.linspace(0, len(own) - 1, MOST_POINTS).round().astype(int))]
        drawn = size / 2 + scale * (chosen - (low + high) / 2) * (1, -1)
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in drawn)
        colour, (x, y) = f"var(--{object_colour(i)})", drawn[-1]
        shapes.append(
            f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.5"/>'
            f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{colour}"/>'
        )
    label = escape(f"paths of the objects in {name}", quote=True)
    view = f"0 0 {DRAWING_PX[0]} {DRAWING_PX[1]}"
    return f'<svg viewBox="{view}" role="img" aria-label="{label}">{"".join(shapes)}</svg>'
