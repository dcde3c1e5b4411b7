"""`galileo label`: write what is known about a clip into the yaml beside it."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from galileo_jax.api.label import label
from galileo_jax.clip.declaration import LEVELS
from galileo_jax.clip.load import has_yaml
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.sources import source_of
from galileo_jax.commands import command
from galileo_jax.commands.clip_options import corrections

LINE = ("X1", "Y1", "X2", "Y2")


def main(argv: Sequence[str]) -> int | None:
    """Creates or updates the yaml beside a clip; writes nothing unless the result is valid."""
    asked = vars(_parser().parse_args(argv))
    path: Path = asked.pop("clip")
    if not source_of(path) or has_yaml(path):
        command.refuse_ignored(argv, ["--level"], f"{path} is not in folders of Physics 101")
    for name in ("point", "size"):
        asked[name] = {thing: values for thing, *values in asked[name]}
    asked["shape"] = dict(asked["shape"])
    for key in ("first_frame", "last_frame"):
        asked[key] = {name: _frame(text) for name, text in asked[key]}
    asked["correct"] = corrections(asked["correct"])
    done = label(path, **asked)
    for line in [f"note: {note}" for note in done.notes]:
        command.console().print(line, soft_wrap=True, markup=False)
    for warning in done.clip.warnings:
        command.console().print(f"warning: {warning}", soft_wrap=True, markup=False)
    print(done.path)
    return None


def _parser() -> command.Parser:
    parser = command.Parser(
        prog="galileo label",
        description="Write what is known about a clip into the yaml beside it; everything "
        "else in it\n"
        "stays as it is. Pixels: x to the right, y down, as in any image viewer.",
    )
    parser.examples(
        "galileo label clip.mp4 --scenario ramp --ramp 60 114 150 146 --origin 160 150 \\\n"
        "      --scale 0 100 150 100 0.5 --point object1 73 109 --size object1 0.06 0.05 0.06",
        "galileo label clip.mp4 --fps 240",
    )
    add = parser.add_argument
    add("clip", type=Path, metavar="CLIP", help="video, track file or yaml")
    add("--scenario", metavar="NAME", help=f"one of {', '.join(SCENARIOS)} (default: unchanged)")
    add(
        "--fps",
        type=float,
        metavar="HZ",
        help="true frames per second (default of a new yaml: the video's)",
    )
    add("--gravity", type=float, metavar="G", help="m/s^2 (default of a new yaml: 9.81)")
    add("--direction", metavar="SIDE", help="of the travel: right or left (default: unchanged)")
    add(
        "--level",
        default=LEVELS[-1],
        metavar="FOLDER",
        help=f"Physics 101: the folder that this is declared for, {', '.join(LEVELS)}; points "
        "are "
        "always of the trial, sizes of the object (default %(default)s)",
    )
    _add_object_options(
        parser.add_argument_group("objects (repeat for each; a new NAME adds an object)")
    )
    _add_scene_options(parser.add_argument_group("scale and ramp"))
    _add_track_options(parser.add_argument_group("of a track file"))
    return parser


def _add_object_options(objects: Any) -> None:
    def add(option: str, metavar: tuple[str, ...], count: int | str, meaning: str) -> None:
        objects.add_argument(
            option, nargs=count, action="append", default=[], metavar=metavar, help=meaning
        )

    add(
        "--point",
        ("NAME", "X", "Y"),
        3,
        "its centre in its first frame, in pixels (default: unchanged)",
    )
    add(
        "--size",
        ("NAME", "METRES"),
        "+",
        "box: length depth height; cylinder: radius length; torus: radii; sphere: radius "
        "(default: unchanged)",
    )
    add(
        "--shape",
        ("NAME", "SHAPE"),
        2,
        "box, cylinder, torus or sphere (default of a new object: box)",
    )
    add(
        "--first-frame",
        ("NAME", "FRAME"),
        2,
        "first frame in which it moves freely, counted from 0; null: to be found (default of a "
        "new object: 0)",
    )
    add(
        "--last-frame",
        ("NAME", "FRAME"),
        2,
        "last frame that is used; null: the clip's last (default: unchanged)",
    )
    add(
        "--correct",
        ("NAME", "FRAME"),
        "+",
        "NAME FRAME X Y: where it is (pixels) in a frame in which it was lost; tracking "
        "continues from there. NAME FRAME removes that correction (default: unchanged)",
    )


def _add_scene_options(scene: Any) -> None:
    add = scene.add_argument
    add("--pixels-per-metre", type=float, metavar="PX", help="of the picture (default: unchanged)")
    add(
        "--pixels-per-metre-sd",
        type=float,
        metavar="PX",
        help="its uncertainty, one standard deviation (default: with --scale, that of half a "
        "pixel at either end; else unchanged)",
    )
    add(
        "--scale",
        nargs=5,
        type=float,
        metavar=(*LINE, "METRES"),
        help="two pixels and the distance between them in metres, instead of --pixels-per-metre "
        "(default: unchanged)",
    )
    add(
        "--rectangle",
        nargs=10,
        type=float,
        metavar=("X1", "Y1", "X2", "Y2", "X3", "Y3", "X4", "Y4", "WIDTH", "HEIGHT"),
        help="corners of a rectangle in the plane of the motion (pixels, counter-clockwise from "
        "the bottom left) and its sides (metres), instead of --scale if the camera is not "
        "square to the plane (default: unchanged)",
    )
    add(
        "--lens",
        nargs="+",
        type=float,
        metavar=("K1", "SD"),
        help="its radial distortion: a point r half diagonals from the middle appears at r (1 + "
        "K1 r^2) (default: unchanged)",
    )
    add("--ramp-angle", type=float, metavar="DEG", help="of the ramp, degrees (default: unchanged)")
    add(
        "--ramp-angle-sd",
        type=float,
        metavar="DEG",
        help="its uncertainty, one standard deviation (default: with --ramp, that of half a "
        "pixel at either end; else unchanged)",
    )
    add(
        "--ramp",
        nargs=4,
        type=float,
        metavar=LINE,
        help="two pixels on the ramp, which give its angle and direction, instead of "
        "--ramp-angle (default: unchanged)",
    )
    add(
        "--origin",
        nargs=2,
        type=float,
        metavar=("X", "Y"),
        help="foot of the ramp, in pixels (default: unchanged)",
    )
    add(
        "--origin-sd",
        type=float,
        metavar="PX",
        help="uncertainty of either coordinate, one standard deviation (default: with --origin, "
        "half a pixel; else unchanged)",
    )


def _add_track_options(track: Any) -> None:
    add = track.add_argument
    add("--track-units", metavar="UNIT", help="m, cm, mm, in, ft or px (default: unchanged)")
    add("--track-y", metavar="WAY", help="whether y points up or down (default: unchanged)")
    add(
        "--track-origin",
        nargs=2,
        type=float,
        metavar=("X", "Y"),
        help="the foot of the ramp, in its unit and along its axes (default: unchanged)",
    )


def _frame(text: str) -> Any:
    """A frame number; what is none is left as text, to be refused."""
    return None if text == "null" else int(text) if text.isdecimal() else text
