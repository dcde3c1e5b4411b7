"""`look`: what is understood of a table or film, for a person to check."""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from galileo_jax.clip.file_kinds import is_track, is_yaml
from galileo_jax.clip.look import Seen, seen_in_table
from galileo_jax.runtime.errors import InputError
from galileo_jax.table.read import PLACES, read_table
from galileo_jax.table.track_table import TrackTable

if TYPE_CHECKING:
    from galileo_jax.api.understand import Understood


@dataclass(frozen=True)
class Look:
    """What was understood of a file.

    Attributes:
      path: the file.
      seen: of a table; None of a film.
      film: of a film, one line; "" of a table.
      warnings: doubts, one line each.
      table: of a table, all that was read.
      fps: of a film, frames per second as its file says.
    """

    path: Path
    seen: Seen | None
    film: str = ""
    warnings: tuple[str, ...] = ()
    table: TrackTable | None = None
    fps: float | None = None

    @cached_property
    def understood(self) -> "Understood":
        """What moves and how; a film is looked through for it, which takes some seconds."""
        from galileo_jax.api.understand import understand

        return replace(understand(self.path), look=self)

    @property
    def yaml(self) -> str:
        """The clip's yaml that would be written; "" of a film in which nothing is understood."""
        if self.seen is not None:
            return self.seen.yaml
        from galileo_jax.api.proposed_clip import yaml_of

        return yaml_of(self.understood) if self.understood.scenario else ""

    def summary(self) -> str:
        """Lines to read: columns, time, gaps, what moves, the likely scenario; a yaml."""
        lines = _of_table(self.seen) if self.seen is not None else _of_film(self)
        beside = self.path.with_suffix(".yaml")
        if beside.exists():
            return "\n".join([*lines, f"declared: {beside.name}, which is there already"])
        if text := self.yaml:
            lines += ["", f"{beside.name} would be:", ""]
        return "\n".join([*lines, *("  " + line for line in text.splitlines())])

    def plot(self, path: str | Path) -> Path:
        """Writes the places in time as a figure, by the path's suffix (png, svg, pdf).

        Of a film the first picture, in which what moves is numbered, with its way and its angle.

        Raises:
          InputError: the picture cannot be written.
        """
        if self.seen is None or self.table is None:
            from galileo_jax.api.understand import write_marks

            return write_marks(self.understood, path)
        from galileo_jax.report.draw import write_picture
        from galileo_jax.report.track_chart import look_chart

        return write_picture(Path(path), look_chart(self.seen, self.table))


def look(file: str | Path, *, fps: float | None = None) -> Look:
    """What is understood of a table or film; nothing is written.

    Args:
      file: a table of any program, or a film.
      fps: frames per second, where the table counts frames.

    Raises:
      InputError: one line that names file, line and cell, and what was expected.
    """
    path = Path(file)
    if not path.exists():
        raise InputError(f"{path}: no such file")
    if path.is_dir() or is_yaml(path):
        raise InputError(f"{path}: a table or a film expected")
    if is_track(path):
        table = read_table(path, fps)
        seen = seen_in_table(path, table, fps)
        return Look(path, seen, warnings=seen.warnings, table=table)
    from galileo_jax.video import decode  # and OpenCV, which a table does not need

    info = decode.probe(path, fps)
    width, height = info.size_px
    film = f"{info.frame_count} frames of {width} x {height} pixels, {info.fps:.4g} a second"
    return Look(path, None, film, info.warnings, fps=info.fps)


def _of_film(film: Look) -> list[str]:
    from galileo_jax.api.understand import listed_things, sentence_of

    known = film.understood
    lines = [f"{film.path.name}: {film.film}", sentence_of(known)]
    return [*lines, *(f"  {one}" for one in listed_things(known))]


def _of_table(seen: Seen) -> list[str]:
    rows = [("column", "role", "unit", "last digit")]
    for one in seen.columns:
        is_used = bool(one.role) and (one.role not in PLACES or one.role in seen.axes)
        role = f"{one.role} of {one.name}" if one.name else one.role
        digit = f"{one.resolution:.1g}" if math.isfinite(one.resolution) else ""
        rows.append((one.title[:40], str(role) if is_used else "not used", one.unit or "", digit))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [f"{seen.path.name}: {seen.num_rows} rows, {len(seen.names)} object(s)"]
    if seen.columns:
        padded = ([c.ljust(w) for c, w in zip(row, widths, strict=True)] for row in rows)
        lines += ["  ".join(row).rstrip() for row in padded]
    clock = "frames" if seen.is_in_frames else f"s ({1 / seen.step:.4g} a second)"
    gaps = ", ".join(f"after row {row} ({size:.3g} steps)" for row, size in seen.gaps[:5])
    more = f" and {len(seen.gaps) - 5} more" if len(seen.gaps) > 5 else ""
    lines.append(f"time step: {seen.step:.4g} {clock}; gaps: {gaps + more or 'none'}")
    moved = ", ".join(
        f"{size:.4g} {seen.unit or '(no unit)'} along {'the way' if axis == 'line' else axis}"
        for axis, size in zip(seen.axes, seen.moved, strict=True)
        if axis != "angle"
    )
    moved = moved or f"{math.degrees(seen.moved[0]):.3g} degrees"
    lines.append(f"moves: {seen.names[0]} by {moved}")
    return [*lines, f"likely scenario: {seen.scenario} ({seen.why})"]
