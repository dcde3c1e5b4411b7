"""What a sweep's page shows of each clip, gathered from its cells."""

import os
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from galileo_jax.report.sweep_clips import ClipRow
from galileo_jax.report.sweep_page import labels
from galileo_jax.sweeping.cell import Cell, ClipFiles
from galileo_jax.sweeping.settings import Diagnose, Explain
from galileo_jax.sweeping.store import Store
from galileo_jax.sweeping.summary import Row
from galileo_jax.sweeping.work import CHECK, MISSING

MOST_PICTURES = 200  # a page with more clips has none: each is some 7 KB


def make_clip_rows(cells: Sequence[Cell], store: Store, rows: Sequence[Row]) -> list[ClipRow]:
    """One row for each clip of a sweep, sorted by name (clip2 before clip10)."""
    clips: dict[str, ClipFiles] = {}
    of_clip: dict[str, list[tuple[Cell, Row]]] = {}
    for cell, row in zip(cells, rows, strict=True):
        for clip in cell.clips:
            clips[clip.key] = clip
            of_clip.setdefault(clip.key, []).append((cell, row))
    names = names_of(cells)
    label = labels([row for row in rows if row["status"] == "done"])
    made = [_row(clip, of_clip[key], store, names, label) for key, clip in clips.items()]
    if len(made) > MOST_PICTURES:
        made = [replace(row, picture=None, observation=None) for row in made]
    return sorted(made, key=lambda row: natural(row.name))


def _row(
    clip: ClipFiles,
    own: Sequence[tuple[Cell, Row]],
    store: Store,
    names: dict[str, str],
    label: Callable[[Row], str],
) -> ClipRow:
    done = [(cell, row) for cell, row in own if row["status"] == "done"]
    fits = [cell for cell, _ in done if not isinstance(cell.settings, Diagnose)]
    diagnoses = [cell for cell, _ in done if isinstance(cell.settings, Diagnose)]
    explained = next((cell for cell in fits[:1] if isinstance(cell.settings, Explain)), None)
    missing = store.result(explained.name, MISSING) if explained else None
    if diagnoses:
        missing = store.result(diagnoses[0].name)
    shown = next(iter([*fits, *diagnoses]), None)
    together = [names[other.key] for other in shown.clips if other is not clip] if shown else []
    alike = Counter(label(row) for _, row in done)
    pages = []
    for cell, row in done:
        if (page := store.page(cell.name, clip.name)) is not None:
            text = "report" if len(done) == 1 else label(row)
            text += f" seed {row['seed']}" if alike[label(row)] > 1 else ""
            pages.append((text, Path(os.path.relpath(page, store.folder))))
    measured = store.clip(clip.key) if store.has_clip(clip.key) else None
    return ClipRow(
        names[clip.key],
        tuple(together),
        measured.thumbnail if measured else None,
        measured.measurement.observation if measured else None,
        store.result(fits[0].name) if fits else None,
        missing or None,
        tuple(pages),
        tuple(row["failure"] for _, row in own if row["status"] == "failed"),
        max(len(fits) - 1, 0),
        store.result(explained.name, CHECK) if explained else None,
        next((row["remark"] for _, row in own if row["remark"]), ""),
        tuple(str(next((row["outside"] for _, row in own if row["outside"]), "")).split()),
    )


def names_of(cells: Sequence[Cell]) -> dict[str, str]:
    """By key what each clip is called: its file's name, with as much of its path as it takes."""
    clips = {clip.key: clip for cell in cells for clip in cell.clips}
    names = {key: clip.name for key, clip in clips.items()}
    for longer in (lambda clip: f"{clip.path.parent.name}/{clip.name}", lambda clip: clip.source):
        count = Counter(names.values())
        names = {k: longer(clips[k]) if count[name] > 1 else name for k, name in names.items()}
    return names


def natural(name: str) -> list[tuple[int, int | str]]:
    """A key that sorts numbers in names by their value."""
    parts = re.split(r"(\d+)", name.lower())
    return [(0, int(part)) if part.isdecimal() else (1, part) for part in parts]
