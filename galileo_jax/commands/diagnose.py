"""`galileo diagnose`: which effect is missing in the model of a clip?"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import galileo_jax as gx
from galileo_jax.commands import clip_options, command
from galileo_jax.commands.options import VerbParser
from galileo_jax.results.truth import hidden_effect

NUM_CANDIDATES = 5
NAME_WIDTH = 26  # at least, of the column of effects
FRICTIONS = ("k1", "k2")


def main(argv: Sequence[str]) -> None:
    """Diagnoses clips; writes diagnosis.json, a page, and a run of the model it ends with."""
    asked = _parser().asked(argv)
    clips = clip_options.load_clips(asked.pop("tracks"), asked.get("pixels_per_metre"))
    out = clip_options.out_folder(asked.pop("out", None), clips, "diagnosis")
    svg, hidden = asked.pop("svg", False), hidden_effect(clips[0].path)
    with command.progress_display() as display:
        rows: list[Mapping[str, Any]] = []

        def show(partial: Mapping[str, Any]) -> None:
            if "round" in partial:
                rows.append(partial["round"])
                if len(rows) == 1:
                    display.print(_round_head(rows[0]))
                display.print(_round_line(rows))

        found = gx.diagnose(clips, **asked, on_progress=display.showing(show))
        print("\n".join(_lines(found, hidden, out)))
        display("writing the page", 1.0)
        found.save(out, svg=svg)
    clip_options.warn_of_tracks(found.measurements)
    command.say(f"{out}/diagnosis.json, {out}/report.html, {out}/model")


def _round_head(first: Mapping[str, Any]) -> str:
    """Names of the columns of the table of rounds."""
    frictions = "".join(f"  {name:<28}" for name in FRICTIONS if name in first)
    return f"{'model with':<26}{'rmse m/s':>9}{'chi2/dof':>10}{'p':>9}{frictions}".rstrip()


def _round_line(rows: Sequence[Mapping[str, Any]]) -> str:
    """The last of the rounds, and how the friction coefficients changed since the one before."""
    from galileo_jax.report import diagnosis_text
    from galileo_jax.results.shown import value_text

    row = rows[-1]
    frictions = ""
    for name in FRICTIONS:
        if name not in row:
            continue
        value = value_text(row[name], "+-")
        if len(rows) > 1:
            value += f" ({row[name]['mean'] - rows[-2][name]['mean']:+.4f})"
        frictions += f"  {value:<28}"
    return (
        f"{diagnosis_text.round_text(row):<26}{row['rmse']:>9.4f}"
        f"{row['chi2_per_dof']:>10.2f}{diagnosis_text.p_text(row['p_value']):>9}{frictions}".rstrip()
    )


def _lines(found: "gx.Diagnosis", hidden: str | None, out: Path) -> list[str]:
    """Candidates, the verdict, and how to go on."""
    from galileo_jax.inference.fits.gradient import BEHIND, SETTLED
    from galileo_jax.report import diagnosis_text

    record = found.document
    shown = record["candidates"][:NUM_CANDIDATES]
    width = max([NAME_WIDTH, *(len(entry["effect"]) + 2 for entry in shown)])
    lines = ["", f"{'candidates':<{width}}{'probability':>12}{'evidence':>12}{'p':>9}  strength"]
    for entry, made in zip(shown, found.found.candidates, strict=False):
        strengths = diagnosis_text.strength_texts(entry).values()
        is_behind = shown[0]["log_evidence"] - entry["log_evidence"] > BEHIND
        is_settled = made.hypothesis.fit.code in SETTLED
        evidence = f"{entry['log_evidence']:+.1f}"
        evidence = "far behind" if is_behind and not is_settled else evidence
        lines.append(
            f"{entry['effect']:<{width}}{entry['probability']:>12.3f}{evidence:>12}"
            f"{diagnosis_text.p_text(entry['p_value']):>9}  "
            + (entry["law"] or ", ".join(strengths))
        )
    p_none = diagnosis_text.p_text(record["p_value"])
    lines.append(f"{'none':<{width}}{record['probability_none']:>12.3f}{'+0.0':>12}{p_none:>9}")
    lines = [*(lines if shown else []), "", found.sentence]
    if hidden is not None:
        lines.append(f"truth: {hidden}")
    lines += [f"why: {sentence}" for sentence in diagnosis_text.why(record["reasons"])]
    if record["verdict"]["status"] == "unknown":
        lines.append(diagnosis_text.formula_text(record))
    lines += diagnosis_text.each_clip(record.get("each_clip"))
    for row in record.get("left_one_out", []):
        lines.append(
            f"{row['clip']}, predicted from the other clips: off by {row['rmse_before']:.4f} m/s, "
            f"with what was added by {row['rmse_after']:.4f} m/s"
        )
    lines += [f"- {sentence}" for sentence in record["verdict"]["advice"]]
    return [*lines, f"next: {found.next_command(out)}"]


def _parser() -> VerbParser:
    parser = VerbParser(
        "diagnose",
        __doc__,
        "galileo diagnose clip.mp4                             what is missing is added",
        "galileo diagnose clip1.mp4 clip2.mp4 --add none       trials together; nothing is added",
    )
    parser.add("tracks")
    parser.add("add", metavar="auto|none|NAME")
    parser.add_argument(
        "--svg",
        action="store_true",
        help="also write the residuals before and after each effect as SVG (plots/)",
    )
    clip_options.add_clip_options(parser, out="folder (default runs/CLIP/diagnosis)")
    return parser
