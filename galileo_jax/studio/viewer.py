"""The video as an element of the page; see viewer.js."""

from collections.abc import Mapping, Sequence
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
        sheet = session.sheet
        if sheet is None:
            self._put({"count": 0, "name": "", "width": 16, "height": 9, "fps": 30.0})
            return
        marks, found = sheet.marks, session.results
        motion, track = self.motion(session), found.tracks.get(sheet.name)
        is_measured = stage not in ("video", "marks")
        is_asked = stage == "explain" and found.fit is None and session.seen is not None
        things = session.seen.get("things", []) if is_asked and session.seen else []
        stretches: Sequence[Any] = ()
        is_shown = stage in ("compare", "diagnose") and session.states["compare"] == "done"
        if is_shown and found.compare is not None:
            stretches = [s for s in found.compare["stretches"] if s["clip"] == sheet.name]
        self._put(
            {
                "name": sheet.name,
                "count": sheet.info.frame_count,
                "fps": marks.fps,
                "width": sheet.info.size_px[0],
                "height": sheet.info.size_px[1],
                "marks": {key: list(place) for key, place in handles(marks).items()},
                "words": {**WORDS, **({} if marks.has_table else {"foot": "ramp"})},
                "boxes": _boxes(sheet),
                "stick": _length(marks.stick_m),
                "sides": [_length(side) for side in marks.rectangle_m],
                "things": things,
                "editable": stage == "marks",
                "table": marks.has_table,
                "placing": placing,
                "first": marks.first_frame,
                "last": sheet.info.frame_count - 1
                if marks.last_frame is None
                else marks.last_frame,
                "told": [[i, *c] for i, one in enumerate(marks.objects) for c in one.corrections],
                "follow": len(track["times"]) - 1 if track and track.get("is_running") else None,
                "track": track or motion if is_measured else None,
                "model": motion if is_measured and stage != "track" else None,
                "stretches": list(stretches),
            }
        )

    @staticmethod
    def motion(session: Session) -> Mapping[str, Any] | None:
        """The active clip's motion, at the sliders where they were moved."""
        found = session.results
        if found.fit is None:
            return None
        for i, motion in enumerate(found.fit["motions"]):
            if motion["clip"] == session.active:
                live = found.live["motions"][i] if found.live is not None else {}
                return {**motion, **live}
        return None

    def _put(self, given: Mapping[str, Any]) -> None:
        changed = {key: v for key, v in given.items() if self._props.get(key) != v}
        if changed:
            self._props.update(changed)
            self.update()


def _length(metres: float | None) -> str:
    return f"{metres:g} m" if metres else "? m"


def _boxes(sheet: Sheet) -> dict[str, list[float]]:
    """How large the marked objects are in the picture, px, where size and scale are known."""
    marks = sheet.marks
    if marks.rectangle is not None or marks.stick is None or not marks.stick_m:
        return {}
    (x1, y1), (x2, y2) = marks.stick
    scale = ((x2 - x1) ** 2 + (y2 - y1) ** 2) ** 0.5 / marks.stick_m
    found = {}
    for one in marks.objects:
        if one.size_m and one.shape == "box":
            found[one.name] = [one.size_m[0] * scale, one.size_m[2] * scale]
    return found
