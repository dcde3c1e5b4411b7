"""`galileo simulate`: make a clip with known truth (video or track, yaml, truth)."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from galileo_jax.api.simulate import simulate
from galileo_jax.commands import command
from galileo_jax.commands.progress_display import progress_display
from galileo_jax.rollout.engine_names import MOTIONS
from galileo_jax.runtime.errors import InputError
from galileo_jax.simulation.check_settings import option, options_without_part
from galileo_jax.simulation.motion import LONGEST_S, SOLVERS
from galileo_jax.simulation.settings import (
    CAMERA_FAULTS,
    DIRECTIONS,
    SCENARIO_NAMES,
    SHAPES,
    Settings,
)

DEFAULT = Settings()


def main(argv: Sequence[str]) -> int | None:
    """Writes NAME.mp4 (or NAME.csv), NAME.yaml and NAME.truth.json, for a series NAME_1 and on."""
    asked = vars(_parser().parse_args(argv))
    out = asked.pop("out")
    for name in ("effects", "values"):
        asked[name] = _as_mapping(option(name), asked[name])
    # Written out with its default value an option is ignored no less; only here it shows.
    for fields, why in options_without_part(Settings(**asked)):
        command.refuse_ignored(argv, [option(field) for field in fields], why)
    with progress_display() as on_progress:
        made = simulate(out, **asked, on_progress=on_progress)
    print("\n".join(map(str, made.paths)))
    return None


def _parser() -> command.Parser:
    parser = command.Parser(
        prog="galileo simulate",
        description="Make a clip with known truth: NAME.mp4, NAME.yaml and NAME.truth.json.\n"
        "What is not given is drawn at random; the same seed makes the same clip.",
    )
    parser.examples(
        "galileo simulate --seed 7 --out demo/clip.mp4",
        "galileo simulate --scenario flight --floor --effect air_drag --track-only --out ball.csv",
    )
    add = parser.add_argument
    add("--out", type=Path, required=True, metavar="DIR/NAME.mp4", help="NAME.csv for a track")
    add(
        "--scenario",
        default=DEFAULT.scenario,
        metavar="NAME",
        help=f"one of {', '.join(SCENARIO_NAMES)} (default %(default)s)",
    )
    add("--seed", type=int, default=DEFAULT.seed, help="of what is drawn (default %(default)s)")
    _add_number(parser, "seconds", "S", f"length, up to {LONGEST_S:g} (default: until all rests)")
    _add_number(parser, "fps", "HZ", "frames per second")
    add(
        "--set",
        type=_value,
        action="append",
        default=[],
        dest="values",
        metavar="NAME=VALUE",
        help="a parameter of the scenario, such as k3=0.2 or floor_restitution=0.7 (default: "
        "drawn; may be given several times)",
    )
    _add_switch(parser, "floor", "of a fall or a flight: the object bounces")
    _add_switch(parser, "track-only", "a csv track in place of the video")
    _add_number(parser, "track-noise", "M", "standard deviation of a track's coordinates, m")
    _add_ramp_options(parser.add_argument_group("on a ramp"))
    _add_hidden_options(
        parser.add_argument_group("what is hidden", "in the truth, and not in the yaml")
    )
    _add_filming_options(parser.add_argument_group("filming"))
    return parser


def _add_ramp_options(ramp: Any) -> None:
    usual = "; ".join(f"{name}: {len(shapes)}" for name, shapes in SHAPES.items())
    ramp.add_argument(
        "--shapes",
        type=lambda text: tuple(text.split(",")) if text else None,
        metavar="SHAPE,...",
        help="box, cylinder, torus or sphere, in the order of the travel; round ones roll "
        f"(default: boxes, {usual})",
    )
    _add_number(ramp, "angle", "DEG", "of the ramp, degrees")
    for index in (1, 2):
        _add_number(ramp, f"m{index}", "KG", f"mass of object {index} (default: drawn)")
        _add_number(ramp, f"k{index}", "FRICTION", f"friction of object {index} (default: drawn)")
    ramp.add_argument(
        "--motion",
        default=DEFAULT.motion,
        metavar="NAME",
        help=f"{' or '.join(MOTIONS)}: from the first hit on objects turn and tip (MuJoCo's C "
        "engine; tracks only) (default %(default)s)",
    )
    _add_number(
        ramp,
        "z2",
        "M",
        "how far object 2 stands off the plane, towards the camera (--motion free; default: 0)",
    )
    ramp.add_argument(
        "--solver",
        default=DEFAULT.solver,
        metavar="NAME",
        help=f"{' or '.join(SOLVERS)}, which is not the engine that fits (default %(default)s)",
    )
    ramp.add_argument(
        "--series",
        type=int,
        metavar="N",
        help="N trials: NAME_1, NAME_2, ... (default: a single clip)",
    )


def _add_hidden_options(hidden: Any) -> None:
    hidden.add_argument(
        "--effect",
        type=_effect,
        action="append",
        default=[],
        dest="effects",
        metavar="NAME[:PARAMETER=VALUE,...]",
        help="an effect, in SI units; what is left out is drawn (default: none; may be given "
        "several times)",
    )
    _add_number(hidden, "strength", "SHARE", "0: weak, 1: strong (default: drawn)")
    hidden.add_argument(
        "--effects-from",
        type=Path,
        action="append",
        default=[],
        metavar="FILE.py",
        help="registers further effects (default: none; may be given several times)",
    )
    _add_switch(
        hidden,
        "faults",
        "small faults of real clips: release between frames, foot and impact not ideal",
    )


def _add_filming_options(film: Any) -> None:
    width, height = DEFAULT.size
    film.add_argument(
        "--size",
        type=_size,
        default=DEFAULT.size,
        metavar="WIDTHxHEIGHT",
        help=f"of the picture, px, even numbers (default {width}x{height})",
    )
    film.add_argument(
        "--direction",
        default=DEFAULT.direction,
        metavar="SIDE",
        help=f"of the travel: {' or '.join(DIRECTIONS)} (default %(default)s)",
    )
    _add_switch(film, "no-points", "the yaml does not say where the objects are")
    _add_switch(film, "hand", "a hand lets object 1 go")
    film.add_argument(
        "--camera-fault",
        action="append",
        default=[],
        metavar="NAME",
        help=f"one of {', '.join(CAMERA_FAULTS)}: held askew or rolled, or points of the yaml "
        "off by a few px (default: none; may be given several times)",
    )
    _add_number(film, "noise", "GREYS", "of the sensor, grey levels of 255")
    _add_number(film, "exposure", "S", "of a frame, seconds")
    _add_number(film, "defocus", "PX", "standard deviation of the blur")
    film.add_argument(
        "--missed-frames",
        type=int,
        default=DEFAULT.missed_frames,
        metavar="N",
        help="so many frames show the one before once more (default %(default)s)",
    )


def _add_number(group: Any, name: str, metavar: str, meaning: str) -> None:
    default = getattr(DEFAULT, name.replace("-", "_"))
    shown = "" if default is None else " (default %(default)g)"
    group.add_argument(
        f"--{name}", type=float, default=default, metavar=metavar, help=meaning + shown
    )


def _add_switch(group: Any, name: str, meaning: str) -> None:
    group.add_argument(f"--{name}", action="store_true", help=f"{meaning} (default: off)")


def _as_mapping(name: str, pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    mapping = dict(pairs)
    if name == "--effect" and len(mapping) < len(pairs):
        raise InputError("--effect: an effect is named twice")
    return mapping


def _effect(text: str) -> tuple[str, dict[str, float | str]]:
    """`NAME[:PARAMETER=VALUE,...]`; what is no number is left as text, to be refused."""
    name, _, rest = text.partition(":")
    return name.strip(), dict(_value(part) for part in rest.split(",")) if rest else {}


def _value(text: str) -> tuple[str, float | str]:
    """`NAME=VALUE`."""
    name, is_given, value = text.partition("=")
    if not is_given:
        raise argparse.ArgumentTypeError(f"{text!r} is not NAME=NUMBER")
    try:
        return name.strip(), float(value)
    except ValueError:
        return name.strip(), value


def _size(text: str) -> tuple[int, int] | str:
    width, _, height = text.partition("x")
    is_size = width.isdecimal() and height.isdecimal()
    return (int(width), int(height)) if is_size else text
