"""Track files as the tools write them, of a box that slides down an incline of 20 degrees.

Layouts from: Tracker 5 and 6 (.trk of its examples, data export), Logger Pro 3 (csv),
DeepLabCut 2 and 3 (csv; h5 by pandas with PyTables 3).
"""

import io
import math
import pickle
import zipfile
from pathlib import Path

import h5py
import numpy as np

ANGLE_DEG = 20.0
FRICTION = 0.2
FPS = 60.0
SCALE_PX_PER_M = 800.0
ORIGIN_PX = (640.0, 560.0)
NUM_FRAMES = 48
START_M = -0.7
FIRST_FRAME = 12  # of the video; nobody marks what stands still

COORDS = "org.opensourcephysics.media.core.ImageCoordSystem"
SCORER = "DLC_resnet50_slideAug20shuffle1_50000"


def times() -> np.ndarray:
    """`[row]`, s, from the first mark on."""
    return np.arange(NUM_FRAMES) / FPS


def path_m(seed: int = 3, noise_m: float = 4e-4) -> np.ndarray:
    """`[2, row]`, m: x along the travel, y up, origin at the foot; with errors of measurement."""
    angle = math.radians(ANGLE_DEG)
    acceleration = 9.81 * (math.sin(angle) - FRICTION * math.cos(angle))
    along = START_M + 0.5 * acceleration * times() ** 2
    place = np.stack([along * math.cos(angle), -along * math.sin(angle)])
    return place + np.random.default_rng(seed).normal(0, noise_m, place.shape)


def path_px(shift_m: float = 0.0) -> np.ndarray:
    """`[2, row]`, px: x right, y down."""
    x, y = path_m()
    return np.stack(
        [ORIGIN_PX[0] + (x + shift_m) * SCALE_PX_PER_M, ORIGIN_PX[1] - y * SCALE_PX_PER_M]
    )


def _point_mass(name: str, place_px: np.ndarray) -> str:
    kind = "org.opensourcephysics.cabrillo.tracker.PointMass"
    marks = "".join(
        f"""
                <property name="[{FIRST_FRAME + n}]" type="object">
                <object class="{kind}$FrameData">
                    <property name="x" type="double">{x!r}</property>
                    <property name="y" type="double">{y!r}</property>
                </object>
                </property>"""
        for n, (x, y) in enumerate(place_px.T.tolist())
    )
    return f"""
        <property name="item" type="object">
        <object class="{kind}">
            <property name="mass" type="double">1.0</property>
            <property name="name" type="string">{name}</property>
            <property name="framedata" type="array" class="[L{kind}$FrameData;">{marks}
            </property>
            <property name="keyFrames" type="array" class="[I"/>
        </object>
        </property>"""


def _axes(frame: int, x_px: float, angle_deg: float, scale: float) -> str:
    return f"""
            <property name="[{frame}]" type="object">
            <object class="{COORDS}$FrameData">
                <property name="xorigin" type="double">{x_px!r}</property>
                <property name="yorigin" type="double">{ORIGIN_PX[1]!r}</property>
                <property name="angle" type="double">{angle_deg!r}</property>
                <property name="xscale" type="double">{scale!r}</property>
                <property name="yscale" type="double">{scale!r}</property>
            </object>
            </property>"""


def trk(
    names: tuple[str, ...] = ("mass A",),
    angle_deg: float = 0.0,
    scale: float = SCALE_PX_PER_M,
    unit: str | None = "m",
    step_ms: float = 1000 / FPS,
    drift_px: float = 0.0,
) -> str:
    """A Tracker tab; `angle_deg` turns its axes, `unit=None` is a version that writes no unit.

    With `drift_px` the origin is somewhere else in the second frame.
    """
    axes = "".join(
        _axes(n, ORIGIN_PX[0] + n * drift_px, angle_deg, scale) for n in range(1 + bool(drift_px))
    )
    masses = "".join(_point_mass(name, path_px(0.1 * n)) for n, name in enumerate(names))
    length = f'\n    <property name="length_unit" type="string">{unit}</property>' if unit else ""
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<object class="org.opensourcephysics.cabrillo.tracker.TrackerPanel">
    <property name="semantic_version" type="string">6.1.3</property>
    <property name="width" type="double">1280.0</property>
    <property name="height" type="double">720.0</property>
    <property name="videoclip" type="object">
    <object class="org.opensourcephysics.media.core.VideoClip">
        <property name="video" type="object">
        <object class="org.opensourcephysics.media.core.ImageVideo">
            <property name="path" type="string">slide.mp4</property>
            <property name="delta_t" type="double">{step_ms!r}</property>
        </object>
        </property>
        <property name="startframe" type="int">{FIRST_FRAME}</property>
        <property name="stepsize" type="int">1</property>
    </object>
    </property>
    <property name="clipcontrol" type="object">
    <object class="org.opensourcephysics.media.core.StepperClipControl">
        <property name="rate" type="double">1.0</property>
        <property name="delta_t" type="double">{step_ms!r}</property>
        <property name="frame" type="int">0</property>
    </object>
    </property>
    <property name="coords" type="object">
    <object class="{COORDS}">
        <property name="fixedorigin" type="boolean">true</property>
        <property name="fixedangle" type="boolean">true</property>
        <property name="fixedscale" type="boolean">true</property>
        <property name="framedata" type="array" class="[L{COORDS}$FrameData;">{axes}
        </property>
    </object>
    </property>{length}
    <property name="tracks" type="collection" class="java.util.ArrayList">
        <property name="item" type="object">
        <object class="org.opensourcephysics.cabrillo.tracker.CoordAxes">
            <property name="name" type="string">axes</property>
        </object>
        </property>{masses}
    </property>
</object>
"""


def trz(tab: str) -> bytes:
    """A Tracker project: a zip archive with a tab and other files."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        archive.writestr("slide.trk", tab)
        archive.writestr("videos/slide.mp4", b"")
    return content.getvalue()


def _java(value: float) -> str:
    """As Java writes it: 1.2345E-2."""
    mantissa, exponent = f"{value:.9e}".split("e")
    return f"{mantissa}E{int(exponent)}"


def tracker_text(separator: str = "\t", decimal: str = ".") -> str:
    """Tracker's export of one track, in cm."""
    rows = [(t, 100 * x, 100 * y) for t, x, y in zip(times(), *path_m(), strict=True)]
    lines = ["mass_A", separator.join("txy")]
    lines += [separator.join(_java(v).replace(".", decimal) for v in row) for row in rows]
    return "\n".join(lines) + "\n"


def tracker_multi() -> str:
    """Tracker 6's export of two tracks, with a radius that nobody asked for; the second is late."""
    lines = ["#multi:", ",mass A,,,mass B,,,", "t,x,y,r,x,y,r,"]
    for n, (t, x, y) in enumerate(zip(times(), *path_m(), strict=True)):
        second = f"{x + 0.1:.6f},{y:.6f},1.0" if n >= 5 else ",,"
        lines.append(f"{t:.6f},{x:.6f},{y:.6f},{math.hypot(x, y):.6f},{second},")
    return "\n".join(lines) + "\n"


def logger_pro(separator: str = ",", decimal: str = ".") -> str:
    """Logger Pro's csv of a video analysis of two points; each has velocities."""
    titles = ["Time (s)", "X (m)", "Y (m)", "X Velocity (m/s)", "X 2 (m)", "Y 2 (m)"]
    lines = [separator.join(f"VideoAnalysis: {title}" for title in titles)]
    for t, x, y in zip(times(), *path_m(), strict=True):
        row = (t + 0.2, x, y, 0.0, x + 0.1, y)
        lines.append(separator.join(f"{v:.6f}".replace(".", decimal) for v in row))
    return "\n".join(lines) + "\n"


def plain_table(with_units: bool = False) -> str:
    """What a script of PhysTrack or a spreadsheet leaves: t, x, y; here in mm, y down."""
    header = "t (s),x (mm),y (mm)" if with_units else "t,x,y"
    rows = zip(times(), *path_m(), strict=True)
    return header + "\n" + "".join(f"{t:.6f},{1000 * x:.4f},{-1000 * y:.4f}\n" for t, x, y in rows)


def _dlc_columns() -> list[tuple[str, str, str]]:
    return [
        (SCORER, part, coordinate)
        for part in ("block", "corner")
        for coordinate in ("x", "y", "likelihood")
    ]


def _dlc_values() -> np.ndarray:
    """`[row, column]`; in row 20 the block is hidden and placed anywhere."""
    block, corner = path_px(), path_px(0.05)
    sure = np.full(NUM_FRAMES, 0.999)
    values = np.stack([*block, sure, *corner, sure], axis=1)
    values[20, :3] = 3.0, 4.0, 0.02
    return values


def dlc_csv() -> str:
    """DeepLabCut's csv of two body parts."""
    columns = _dlc_columns()
    header = [
        ",".join([title, *(column[n] for column in columns)])
        for n, title in enumerate(("scorer", "bodyparts", "coords"))
    ]
    rows = [",".join([str(n), *map(repr, row)]) for n, row in enumerate(_dlc_values().tolist())]
    return "\n".join(header + rows) + "\n"


def dlc_h5(path: Path) -> Path:
    """DeepLabCut's h5: pandas' format "table"."""
    values = _dlc_values()
    kind = np.dtype([("index", "<i8"), ("values_block_0", "<f8", (values.shape[1],))])
    rows = np.zeros(len(values), kind)
    rows["index"], rows["values_block_0"] = np.arange(len(values)), values
    with h5py.File(path, "w") as file:
        table = file.create_dataset("df_with_missing/table", data=rows)
        table.attrs["values_block_0_kind"] = np.bytes_(pickle.dumps(_dlc_columns(), 0))
    return path


def dlc_h5_fixed(path: Path) -> Path:
    """The same in pandas' format "fixed"."""
    columns = np.array(_dlc_columns())
    with h5py.File(path, "w") as file:
        frame = file.create_group("df_with_missing")
        frame.attrs["block0_items_nlevels"] = columns.shape[1]
        for n, words in enumerate(columns.T):
            level, label = np.unique(words, return_inverse=True)
            frame[f"block0_items_level{n}"] = level.astype("S")
            frame[f"block0_items_label{n}"] = label.astype("i1")
        frame["axis1"] = np.arange(NUM_FRAMES)
        frame["block0_values"] = _dlc_values()
    return path
