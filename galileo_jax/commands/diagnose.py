"""`galileo diagnose`: which effect is missing in the model of a clip?"""

import argparse
import json
import shlex
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from galileo_jax import __version__
from galileo_jax.api.precompile import work_ahead
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.commands import command
from galileo_jax.commands.clip_options import add_clip_options, load_clips
from galileo_jax.commands.fit import out_folder, write_fit
from galileo_jax.files.atomic_write import write_json
from galileo_jax.measurement.measure import Measurement, inferred, measure
from galileo_jax.results.stale_outputs import TRACKS, digest
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.jax_setup import set_up

if TYPE_CHECKING:
    from galileo_jax.diagnosis.diagnosis import Diagnosis, Round
    from galileo_jax.inference.fits.gradient import GradientFitter
    from galileo_jax.inference.joint_problem import JointProblem
    from galileo_jax.observation.observation import Observation

NUM_CANDIDATES = 5
FRICTIONS = ("k1", "k2")


def main(argv: Sequence[str]) -> int | None:
    """Diagnoses clips; writes diagnosis.json, a page, and a run of the model it ends with."""
    call = _parser().parse_args(argv)
    clips = load_clips(call.clips, call.pixels_per_metre)
    out = out_folder(call, clips)
    out = out if call.out else out / "diagnosis"
    hidden = read_hidden(clips[0])
    _check_effects(call)
    ahead = work_ahead(clips, lambda some, seen: _fitter(_trials(some, seen, call)))
    timings, began = {}, time.perf_counter()
    measured = [measure(clip) for clip in clips]
    ahead.join()
    clips = [one.clip for one in measured]
    timings["track"] = time.perf_counter() - began
    began = time.perf_counter()
    diagnosis, trials, record = _diagnose(measured, call)
    timings["diagnose"] = time.perf_counter() - began
    document = {
        "clips": call.clips,
        TRACKS: [digest(one.observation) for one in measured],
        **record,
        **inferred(measured),
        "left_out": _absent(trials),
        "engine": trials.problems[0].engine.name,
        "timings_s": {key: round(value, 3) for key, value in timings.items()},
        "version": __version__,
        "seed": call.seed,
    }
    write_json(out / "diagnosis.json", document)
    from galileo_jax.report import diagnosis_text
    from galileo_jax.report.diagnosis_page import DiagnosisReport, write_diagnosis_page

    go_on = diagnosis_text.next_command(diagnosis, call.clips, call.effects_from)
    print("\n".join(_told(diagnosis, record, go_on, hidden)))
    with command.console().status("drawing"):
        again = shlex.join(["galileo", "diagnose", *argv])
        told = DiagnosisReport(diagnosis, document, go_on, hidden, tuple(clips), again, call.seed)
        title = ", ".join(one.name for one in measured)
        write_diagnosis_page(out / "report.html", title, trials, told)
        _write_model(diagnosis, trials, measured, call, out / "model", timings)
    command.console().print(f"{out}/diagnosis.json, {out}/report.html, {out}/model", soft_wrap=True)
    return None


def read_hidden(clip: Clip) -> str | None:
    """What NAME.truth.json beside a synthetic clip says was hidden in it; None without.

    It is shown beside the verdict, and nothing else is done with it.

    Raises:
      InputError: the file is there and names no effect.
    """
    path = clip.path.with_suffix(".truth.json")
    if not path.is_file():
        return None
    try:
        return str(json.loads(path.read_text(encoding="utf-8"))["effect"])
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: not a truth with an effect ({error})") from error


def _check_effects(call: argparse.Namespace) -> None:
    """Loads the library and the user's files before anything is computed."""
    from galileo_jax.model.effects.registry import effect_names, load_file

    for path in call.effects_from:
        load_file(path)
    known = effect_names()
    if call.add not in ("auto", "none", *known):
        raise InputError(f"--add: unknown {call.add!r}; known: auto, none, {', '.join(known)}")


def _diagnose(
    measured: Sequence[Measurement], call: argparse.Namespace
) -> tuple["Diagnosis", "JointProblem", dict[str, Any]]:
    """The diagnosis, its trials, and diagnosis.json; prints each round when it is done."""
    set_up()
    from galileo_jax.diagnosis.diagnose import diagnose
    from galileo_jax.diagnosis.document import diagnosis_document, history_row
    from galileo_jax.inference.fits.gradient import Code

    clips, observations = [m.clip for m in measured], [m.observation for m in measured]
    trials = _trials(clips, observations, call)
    if call.add not in ("auto", "none", *trials.all_effects):
        raise InputError(f"--add: {call.add} has no place in {clips[0].path}")
    rows: list[dict[str, Any]] = []
    with command.console().status("starting") as status:

        def on_round(one: "Round") -> None:
            if one.hypothesis.fit.code is Code.FAILED:
                raise InputError(f"{clips[0].path}: {one.hypothesis.fit.code}")
            rows.append(history_row(trials, one, call.seed))
            status.stop()  # the table is for stdout, which a spinner would swallow
            if len(rows) == 1:
                print(_round_head(rows[0]))
            print(_round_line(rows), flush=True)
            status.start()

        diagnosis = diagnose(
            trials,
            seed=call.seed,
            add=call.add,
            on_stage=status.update,
            on_round=on_round,
        )
        record = diagnosis_document(trials, diagnosis, call.seed)
    return diagnosis, trials, record


def _fitter(trials: "JointProblem") -> "GradientFitter":
    """What `diagnose` fits them with."""
    from galileo_jax.diagnosis.diagnose import fitter_of

    return fitter_of(trials)


def _trials(
    clips: Sequence[Clip], observations: "Sequence[Observation]", call: argparse.Namespace
) -> "JointProblem":
    """The joint problem with all effects and nameless forms that have a place in the scene."""
    from galileo_jax.inference.build_problem import make_joint_problem
    from galileo_jax.model.effects.forms import FORM_NAMES, FORMS
    from galileo_jax.model.effects.registry import effect_names, make_effects

    def trials_with(names: Sequence[str]) -> "JointProblem":
        forms = tuple(form for form in FORMS if form.name in names)
        effects = make_effects([name for name in names if name not in FORM_NAMES])
        return make_joint_problem(clips, observations, call.engine, (*effects, *forms))

    without = SCENARIOS[clips[0].scenario].without
    names = [name for name in (*effect_names(), *FORM_NAMES) if name not in without]
    trials = trials_with(names)
    absent = trials.without_place()
    return trials_with([name for name in names if name not in absent]) if absent else trials


def _absent(trials: "JointProblem") -> list[str]:
    """Effects of the library that were no candidates."""
    from galileo_jax.model.effects.registry import effect_names

    return [name for name in effect_names() if name not in trials.all_effects]


def _write_model(
    diagnosis: "Diagnosis",
    trials: "JointProblem",
    measured: Sequence[Measurement],
    call: argparse.Namespace,
    out: Path,
    timings: dict[str, float],
) -> None:
    """A run of the last round's model, as `fit --effects` would leave it but for its page."""
    from galileo_jax.diagnosis.last_model import by_itself
    from galileo_jax.inference.build_problem import make_joint_problem
    from galileo_jax.inference.laplace import laplace_posterior
    from galileo_jax.model.effects.registry import make_effects

    last = diagnosis.rounds[-1].hypothesis
    part = make_joint_problem(
        [one.clip for one in measured],
        [one.observation for one in measured],
        call.engine,
        make_effects(last.effects),
    )
    fit = by_itself(last.fit, trials, part)
    notes: dict[str, Any] = {"engine": part.problems[0].engine.name, "status": fit.code.value}
    if call.effects_from:
        notes["effects_from"] = [str(Path(path).resolve()) for path in call.effects_from]
    write_fit(
        measured,
        part,
        laplace_posterior(part, fit, call.seed),
        fit.z,
        out,
        files=call.clips,
        method="grad",
        seed=call.seed,
        timings=timings,
        notes=notes,
        with_pages=False,
    )


def _round_head(first: dict[str, Any]) -> str:
    """Names of the columns of the table of rounds."""
    frictions = "".join(f"  {name:<28}" for name in FRICTIONS if name in first)
    return f"{'model with':<26}{'rmse m/s':>9}{'chi2/dof':>10}{'p':>9}{frictions}".rstrip()


def _round_line(rows: Sequence[dict[str, Any]]) -> str:
    """The last of the rounds, and how the friction coefficients changed since the one before."""
    from galileo_jax.report import diagnosis_text

    row = rows[-1]
    frictions = ""
    for name in FRICTIONS:
        if name not in row:
            continue
        told = diagnosis_text.value_text(row[name])
        if len(rows) > 1:
            told += f" ({row[name]['mean'] - rows[-2][name]['mean']:+.4f})"
        frictions += f"  {told:<28}"
    return (
        f"{diagnosis_text.effects_text(row['effects']):<26}{row['rmse']:>9.4f}"
        f"{row['chi2_per_dof']:>10.2f}{diagnosis_text.p_text(row['p_value']):>9}{frictions}".rstrip()
    )


def _told(
    diagnosis: "Diagnosis", record: dict[str, Any], go_on: str, hidden: str | None
) -> list[str]:
    """Candidates, the verdict, and how to go on."""
    from galileo_jax.inference.fits.gradient import BEHIND, Code
    from galileo_jax.report import diagnosis_text

    lines = ["", f"{'candidates':<26}{'probability':>12}{'evidence':>12}{'p':>9}  strength"]
    for made, told in list(zip(diagnosis.candidates, record["candidates"], strict=True))[
        :NUM_CANDIDATES
    ]:
        strengths = diagnosis_text.strength_texts(made.effects, told).values()
        is_behind = diagnosis.candidates[0].log_evidence - told["score"] > BEHIND
        is_settled = made.hypothesis.fit.code is Code.CONVERGED
        evidence = "far behind" if is_behind and not is_settled else f"{told['score']:+.1f}"
        lines.append(
            f"{told['effect']:<26}{told['probability']:>12.3f}{evidence:>12}"
            f"{diagnosis_text.p_text(told['p_value']):>9}  " + ", ".join(strengths)
        )
    lines += ["", diagnosis_text.verdict(diagnosis)]
    if hidden is not None:
        lines.append(f"truth: {hidden}")
    if diagnosis.missing is not None:
        lines += [
            f"missing acceleration of {name}: {entry['formula']}"
            for name, entry in record["missing_force"]["objects"].items()
        ]
    if "each_clip" in record:
        lines += diagnosis_text.each_clip(record["each_clip"])
    for row in record.get("left_one_out", []):
        lines.append(
            f"{row['clip']} predicted from the others: {row['rmse_before']:.4f} m/s, with what was "
            f"added {row['rmse_after']:.4f}"
        )
    lines += [f"- {sentence}" for sentence in diagnosis.verdict.advice]
    return [*lines, f"next: {go_on}"]


def _parser() -> command.Parser:
    parser = command.Parser(prog="galileo diagnose", description=__doc__)
    parser.add_argument("clips", nargs="+", metavar="CLIP", help="video, its yaml, or a csv track")
    parser.add_argument(
        "--add", default="auto", metavar="auto|none|NAME", help="what to add to the model"
    )
    add_clip_options(parser, out="folder (default runs/CLIP/diagnosis)")
    return parser
