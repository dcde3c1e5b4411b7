"""The video as an element of the page; see viewer.js."""

import math
from typing import Any

from nicegui.element import Element

from galileo_jax.studio.clip_state import Sheet
from galileo_jax.studio.marks import CORNERS, handles
from galileo_jax.studio.session import Session

WORDS = {"upper": "ramp", "foot": "foot", "stick1": "stick", "stick2": "stick"}
WORDS |= {name: name[-1] for name in CORNERS}


class Viewer(Element, component="viewer.js"):
    """The frames of the active clip, with marks, track and model drawn over them."""

    def show(self, session: Session, stage: str, placing: bool) -> None:
        """Draws the session's state as one of the stages needs it."""
        given: dict[str, Any] = {"count": 0, "name": "", "width": 16, "height": 9, "fps": 30.0}
        if session.sheet is not None:
            given = _shown(session, session.sheet, stage) | {"placing": placing}
        changed = {key: v for key, v in given.items() if self._props.get(key) != v}
        if changed:
            self._props.update(changed)
            self.update()


def _shown(session: Session, sheet: Sheet, stage: str) -> dict[str, Any]:
    """The properties of viewer.js."""
    marks, info, found = sheet.marks, sheet.info, session.results
    motion, track = session.motion, found.tracks.get(sheet.name)
    is_measured = stage not in ("video", "marks")
    is_asked = stage == "explain" and found.fit is None
    end = info.frame_count - 1
    return {
        "name": sheet.name,
        "count": info.frame_count,
        "fps": marks.fps,
        "width": info.size_px[0],
        "height": info.size_px[1],
        "marks": {key: list(place) for key, place in handles(marks).items()},
        "words": {**WORDS, **({} if marks.has_table else {"foot": "ramp"})},
        "boxes": _boxes(sheet),
        "stick": _length(marks.stick_m),
        "sides": [_length(side) for side in marks.rectangle_m],
        "things": (session.seen or {}).get("things", []) if is_asked else [],
        "editable": stage == "marks",
        "table": marks.has_table,
        "first": marks.first_frame,
        "last": end if marks.last_frame is None else marks.last_frame,
        "told": [[i, *c] for i, one in enumerate(marks.objects) for c in one.corrections],
        "follow": len(track["times"]) - 1 if track and track.get("is_running") else None,
        "track": track or motion if is_measured else None,
        "model": motion if is_measured and stage != "track" else None,
        "stretches": session.stretches if stage in ("compare", "diagnose") else [],
    }


def _length(metres: float | None) -> str:
    return f"{metres:g} m" if metres else "? m"


def _boxes(sheet: Sheet) -> dict[str, list[float]]:
    """How large the marked objects are in the picture, px, where size and scale are known."""
    marks = sheet.marks
    if marks.rectangle is not None or marks.stick is None or not marks.stick_m:
        return {}
    scale = math.dist(*marks.stick) / marks.stick_m
    return {
        one.name: [one.size_m[0] * scale, one.size_m[2] * scale]
        for one in marks.objects
        if one.size_m and one.shape == "box"
    }
