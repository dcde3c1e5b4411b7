"""Tracker (physlets.org/tracker): the files that it saves, .trk (XML) and .trz (zip with a .trk).

<object class="org.opensourcephysics.cabrillo.tracker.TrackerPanel">
  videoclip   startframe, video.delta_t (ms)
  clipcontrol delta_t (ms), also where there is no video
  coords      ImageCoordSystem: framedata [n] xorigin, yorigin, angle (degrees,
              counterclockwise), xscale, yscale (pixels per unit); 1 = never calibrated
  length_unit "m", "cm", ...; older versions do not write it
  tracks      PointMass: name, framedata [frame] x, y, in pixels of the picture, y down
</object>
"""

import io
import math
import re
import zipfile
from xml.etree import ElementTree

import numpy as np

from galileo_jax.runtime.errors import InputError
from galileo_jax.table.titles import LENGTHS
from galileo_jax.table.track_table import Calibration, TrackTable

OSP = "org.opensourcephysics"
PANEL = f"{OSP}.cabrillo.tracker.TrackerPanel"
POINT_MASS = f"{OSP}.cabrillo.tracker.PointMass"
MAX_BYTES = 50_000_000
MAX_ROLL_DEG = 5.0
"""A camera is held level within this; axes turned further were laid along a slope."""

HEAD_BYTES = 1000  # in which a web page says that it is one


def is_trk(content: bytes) -> bool:
    """Whether a file is XML, but no web page, or an archive with a tab of Tracker."""
    start = content[:HEAD_BYTES].removeprefix(b"\xef\xbb\xbf").lstrip()
    is_page = b"<html" in start.lower()
    return start.startswith((b"<?xml", b"<object", b"<!DOCTYPE", b"PK\x03\x04")) and not is_page


def read_trk(content: bytes) -> TrackTable:
    """The marks of all point masses, in pixels, with the calibration."""
    panel = _panel(content)
    masses = panel.findall(f"property[@name='tracks']/property/object[@class='{POINT_MASS}']")
    marks = {_text(mass, "name") or f"mass {n + 1}": _marks(mass)
             for n, mass in enumerate(masses)}  # fmt: skip
    marks = {name: by_frame for name, by_frame in marks.items() if by_frame}
    if not marks:
        raise InputError("no point mass with marks; track an object in Tracker first")
    frames = np.array(sorted(set().union(*marks.values())))
    position = np.full((len(marks), 2, len(frames)), np.nan)
    for index, by_frame in enumerate(marks.values()):
        at = np.searchsorted(frames, list(by_frame))
        position[index][:, at] = np.array(list(by_frame.values())).T
    calibration, warnings = _calibration(panel)
    return TrackTable(
        names=tuple(marks),
        position=position,
        clock=frames,
        frame_s=_frame_s(panel),
        unit="px",
        y_axis="down",
        calibration=calibration,
        warnings=warnings,
    )


def _panel(content: bytes) -> ElementTree.Element:
    """The root of the XML, of one tab of Tracker."""
    content = _unpacked(content)
    if len(content) > MAX_BYTES:
        raise InputError(f"larger than {MAX_BYTES} bytes; a Tracker file expected")
    if b"<!ENTITY" in content:
        raise InputError("XML with entities; a file saved by Tracker has none")
    try:
        root = ElementTree.fromstring(content)
    except ElementTree.ParseError as error:
        raise InputError(f"not whole XML ({error}); save it again in Tracker") from None
    kind = root.get("class") or root.tag
    if kind != PANEL:
        wanted = "a tab (TrackerPanel) saved with File | Save Tab expected"
        raise InputError(f"holds {kind.rsplit('.', 1)[-1][:40]}; {wanted}")
    return root


def _unpacked(content: bytes) -> bytes:
    if not content.startswith(b"PK"):
        return content
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            tabs = [info for info in archive.infolist() if info.filename.endswith(".trk")]
            if len(tabs) != 1:
                raise InputError(f"{len(tabs)} .trk files in the archive; one expected")
            with archive.open(tabs[0]) as file:
                return file.read(MAX_BYTES + 1)
    except (zipfile.BadZipFile, RuntimeError, NotImplementedError) as error:
        raise InputError(f"not a whole Tracker project ({error})") from None


def _marks(mass: ElementTree.Element) -> dict[int, tuple[float, float]]:
    """Frame number to (x, y), pixels."""
    marks = {}
    for entry in mass.findall("property[@name='framedata']/property"):
        index = re.fullmatch(r"\[(\d+)\]", entry.get("name") or "")
        point = entry.find("object")
        if index is None or point is None:
            continue
        where = f"{_text(mass, 'name')}, frame {index[1]}"
        marks[int(index[1])] = (_number(point, "x", where), _number(point, "y", where))
    return marks


def _calibration(panel: ElementTree.Element) -> tuple[Calibration | None, tuple[str, ...]]:
    coords = panel.find("property[@name='coords']/object")
    entries = [] if coords is None else coords.findall("property[@name='framedata']//object")
    if not entries:
        return None, ()
    keys = ("xorigin", "yorigin", "angle", "xscale", "yscale")
    values = [[_number(entry, key, "coords") for key in keys] for entry in entries]
    if np.ptp(np.array(values), axis=0).max() > 1e-6:
        raise InputError(
            "its coordinate system moves with the frames; "
            "export the track as text (File | Export | Data) and give that"
        )
    x, y, angle_deg, *scales = values[0]
    if min(scales) <= 0:
        raise InputError(f"coords: a scale of {min(scales):g} pixels; above 0 expected")
    unit = LENGTHS.get((_text(panel, "length_unit") or "").strip().lower())
    turned_deg = (angle_deg + 45) % 90 - 45
    is_level = abs(turned_deg) <= MAX_ROLL_DEG
    taken = "laid along a slope: the picture's own vertical is used"
    if is_level:
        taken = f"a camera that leans by {turned_deg:.2f} degrees"
    said = f"its axes are turned by {angle_deg:.2f} degrees; interpreted as {taken}"
    if scales == [1.0, 1.0]:  # never calibrated
        scales, unit = [math.nan, math.nan], None
    roll_rad = math.radians(turned_deg) if is_level else 0.0
    found = Calibration((scales[0], scales[1]), unit, (x, y), roll_rad)
    return found, (said,) if abs(angle_deg) > 0.01 else ()


def _frame_s(panel: ElementTree.Element) -> float | None:
    """Between two frames; Tracker writes it in ms, the clip control's being what it uses."""
    for place in (
        "property[@name='clipcontrol']/object",
        "property[@name='videoclip']/object/property[@name='video']/object",
    ):
        owner = panel.find(place)
        if owner is not None and _text(owner, "delta_t") is not None:
            step_ms = _number(owner, "delta_t", "clipcontrol")
            if not 0.001 <= step_ms <= 1e5:
                raise InputError(f"delta_t: {step_ms:g} ms between frames cannot be")
            return step_ms / 1000
    return None


def _text(owner: ElementTree.Element, name: str) -> str | None:
    found = owner.find(f"property[@name='{name}']")
    return None if found is None else found.text


def _number(owner: ElementTree.Element, name: str, where: str) -> float:
    text = _text(owner, name)
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        problem = "missing" if text is None else f"{text[:40]!r} is not a number"
        raise InputError(f"{where}: {name}: {problem}")
    return value
