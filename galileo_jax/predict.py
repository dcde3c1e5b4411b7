"""`galileo predict`: continue a fitted scene beyond its clip."""

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from galileo_jax import command
from galileo_jax.errors import InputError
from galileo_jax.files import write_json, write_text

NUM_DRAWS = 200
LONGEST_S = 60.0


def main(argv: Sequence[str]) -> int | None:
    """Writes prediction.json and its pictures into --out (default: the run's folder)."""
    call = _parser().parse_args(argv)
    out: Path = call.out or call.run
    if out.exists() and not out.is_dir():
        what = "RUN" if call.out is None else "--out"
        raise InputError(f"{what}: {out} is a file; a folder expected")

    import jax

    jax.config.update("jax_enable_x64", True)
    from galileo_jax.prediction import answers, extrapolate
    from galileo_jax.report.continuation import continuation_figure
    from galileo_jax.report.figure import to_svg
    from galileo_jax.report.first_and_last import write_first_and_last
    from galileo_jax.run import load_run

    with command.console().status("rolling out") as status:
        run = load_run(call.run)
        motions = extrapolate(run, call.seconds, call.draws, call.seed)
        found = answers(run, motions, call.seconds, call.seed)
        status.update("drawing")
        svg = to_svg(continuation_figure(run, motions), "prediction")
        try:
            found["picture"] = write_first_and_last(run, motions, out / "first_and_last.png")
            write_text(out / "prediction.svg", svg)
            write_json(out / "prediction.json", found)
        except OSError as error:
            raise InputError(f"--out: {out}: {error.strerror or error}") from error
    print("\n".join(_told(found)))
    print(f"{out}/prediction.json, prediction.svg, first_and_last.png")
    return None


def _told(found: dict[str, Any]) -> list[str]:
    """The answers as lines for the reader."""
    until = found["predicted_until_s"]
    lines = [f"until {until:.2f} s, {found['seconds_beyond_clip_s']:g} s after the clip's end:"]
    for name, entry in found["objects"].items():
        slides, stops = entry["slides_probability"], entry["stops_probability"]
        lines.append(f"{name}: will it slide? {_chance(slides)}")
        if slides == 0:
            continue
        lines.append(f"  how far: {_interval(entry['travelled_m'], 'm')}")
        beyond = entry["travelled_beyond_clip_m"]
        if beyond["q975"] > 5e-4:
            lines.append(f"  of that after the clip: {_interval(beyond, 'm')}")
        lines.append(f"  does it stop? {_chance(stops)}")
        if entry["rest_x_m"] and entry["rest_time_s"]:
            lines.append(
                f"  at x = {_interval(entry['rest_x_m'], 'm')}, "
                f"after {_interval(entry['rest_time_s'], 's')}"
            )
        if stops < 1:
            lines.append(f"  at the end at x = {_interval(entry['end_x_m'], 'm')}")
    if found["hit"] is not None:
        first, second = list(found["objects"])[:2]
        told = f"does {first} hit {second}? {_chance(found['hit']['probability'])}"
        if found["hit"]["time_s"]:
            told += f", after {_interval(found['hit']['time_s'], 's')}"
        lines.append(told)
    return lines


def _chance(probability: float) -> str:
    words = {0.0: "no", 1.0: "yes"}.get(probability, "perhaps")
    return f"{words} (probability {probability:.2f})"


def _interval(entry: dict[str, float], unit: str) -> str:
    mean, low, high = (f"{entry[key]:.3f}" for key in ("mean", "q025", "q975"))
    return f"{mean} {unit} ({low} to {high})"


def _parser() -> command.Parser:
    parser = command.Parser(
        prog="galileo predict",
        description="Continue a fitted scene beyond its clip, with 95 % intervals from the "
        "posterior: will it slide, how far, where does it stop, does it hit.",
    )
    add = parser.add_argument
    add("run", type=Path, metavar="RUN", help="the folder that fit wrote")
    add("--seconds", type=_seconds, required=True, metavar="S", help="how long beyond the clip")
    add("--out", type=Path, metavar="DIR", help="default: RUN")
    add("--seed", type=_whole(0), default=0)
    add("--draws", type=_whole(2), default=NUM_DRAWS, help=f"rollouts (default {NUM_DRAWS})")
    return parser


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 < value <= LONGEST_S:
        raise argparse.ArgumentTypeError(f"{text!r} is no time; seconds in (0, {LONGEST_S:g}]")
    return value


def _whole(low: int) -> Any:
    def parse(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            value = low - 1
        if value < low or (value > 10_000 and low > 0):
            raise argparse.ArgumentTypeError(f"{text!r} is no whole number from {low} on")
        return value

    return parse


if __name__ == "__main__":
    raise SystemExit(command.run(main))
