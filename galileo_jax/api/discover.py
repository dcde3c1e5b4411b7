"""`discover`: measure, diagnose, choose the next setting, until the verdict is settled."""

import tempfile
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from galileo_jax.api.diagnose import Diagnosis, diagnose
from galileo_jax.experiment.choose import LITTLE, best_first, expect
from galileo_jax.experiment.hypothesis_probabilities import beliefs_of
from galileo_jax.experiment.journal import Journal, law_row, open_journal
from galileo_jax.experiment.lab import Described, Lab, LabError, program_of, write_clip
from galileo_jax.experiment.plan import candidates, farthest, middle, parted, stands
from galileo_jax.experiment.settings import Can
from galileo_jax.report.experiment_page import write_discovery_page
from galileo_jax.runtime import progress
from galileo_jax.runtime.atomic_write import writing_into
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.lazy import pd
from galileo_jax.runtime.precision import in_float64

DIAGNOSIS = "diagnosis"  # folder of the last one
MEASURED, DIAGNOSED = 0.1, 0.8  # of the work of one experiment, for progress
MOST_SHARE = 0.98  # before the pages are written


@dataclass(frozen=True, eq=False)
class Discovery:
    """What a lab was found to do.

    Attributes:
      document: discover.json: every experiment with the reason for it, every verdict.
      found: the last diagnosis; None where no experiment gave a track, or nothing was left to do.
      folder: with clips, verdicts and pages; None where none was given.
    """

    document: Mapping[str, Any]
    found: Diagnosis | None
    folder: Path | None

    @property
    def status(self) -> str | None:
        """Of the last verdict: none, named, ambiguous, law, unknown; None without any."""
        return self._last.get("status")

    @property
    def effects(self) -> tuple[str, ...]:
        """Of the last verdict."""
        return tuple(self._last.get("effects", ()))

    @property
    def sentence(self) -> str:
        """The result in one sentence."""
        made = len(self.document["experiments"])
        said = self._last.get("sentence", "No experiment delivered a track.")
        return f"After {made} experiment{'' if made == 1 else 's'}: {said}"

    @property
    def _last(self) -> Mapping[str, Any]:
        rounds = self.document["rounds"]
        return rounds[-1] if rounds else {}

    @property
    def experiments(self) -> "pd.DataFrame":
        """One row per experiment: `number, settings, reason, outcome, line, clip`."""
        return pd.DataFrame(self.document["experiments"])

    @property
    def rounds(self) -> "pd.DataFrame":
        """One row per verdict: `clips, status, effects, form, law, sentence, hypotheses`."""
        return pd.DataFrame(self.document["rounds"])

    def report(self, path: str | Path) -> Path:
        """Writes the page: one HTML file, no network needed."""
        return write_discovery_page(Path(path), self.document, self.sentence)

    def __repr__(self) -> str:
        return f"<Discovery: {self.sentence}>"


@in_float64
def discover(
    lab: str | Path | Lab,
    *,
    budget: int = 16,
    out: str | Path | None = None,
    timeout: float = 60.0,
    effects_from: Sequence[str | Path] = (),
    seed: int = 0,
    on_progress: progress.OnProgress | None = None,
    cancel: progress.CancelFlag | None = None,
) -> Discovery:
    """Finds out what a lab's objects do: measures, diagnoses, chooses the next setting.

    Ends when the verdict stands (docs/how-to/discover.md) or the budget is spent. An experiment
    that comes to nothing (the lab dies, hangs, answers rubbish or repeats itself) costs one of the
    budget. Interrupted and called again with the same folder, it goes on where it was.

    Args:
      lab: a program (docs/how-to/discover.md has the protocol), or an object with its two methods
        `describe` and `measure`.
      budget: the largest number of experiments, 1 to 999.
      out: folder for clips, verdicts and pages. None: nothing is left on disk.
      timeout: how long to wait for an answer of the lab, s.
      effects_from: Python files that register more candidates.
      seed: of all random numbers; the same seed gives the same result.
      on_progress: called with the stage, the share done (0 to 1) and what there is of the result:
        `{"experiment": row}` when one is made, `{"round": row}` for each verdict.
      cancel: a flag with `is_set`, such as `threading.Event`.

    Raises:
      InputError: there is no such lab, it does not describe itself, or `out` is another lab's.
      Cancelled: `cancel` was set; what was measured stays in `out`.

    Examples:
      >>> import galileo_jax as gx
      >>> found = gx.discover("./lab.py", budget=8, out="runs/lab")  # doctest: +SKIP
      >>> found.status, found.effects  # doctest: +SKIP
      ('named', ('air_drag',))
    """
    if not 1 <= budget <= 999:
        raise InputError(f"--budget: {budget} is not a number of experiments; 1 to 999 expected")
    if not 0 < timeout < float("inf"):
        raise InputError(f"--timeout: {timeout:g} is not a time; seconds above 0 expected")
    if isinstance(lab, str | Path):
        lab = program_of(lab, timeout)
    with ExitStack() as stack:
        stack.enter_context(progress.scope(on_progress, cancel))
        if out is None:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="galileo.")))
        else:
            folder = Path(out)
        with writing_into(folder):
            folder.mkdir(parents=True, exist_ok=True)
        try:
            described = lab.describe()
        except LabError as error:
            raise InputError(f"LAB: {error}") from error
        can, held = parted(described.can)
        journal = open_journal(folder, described.document, seed)
        journal.held = held
        loop = _Loop(lab, described, can, journal, budget, tuple(map(str, effects_from)))
        found = loop.run()
        if found is None and journal.rounds and not (folder / DIAGNOSIS).is_dir():
            with progress.part(MOST_SHARE, 0.99):  # broken off before it was saved
                found = loop.diagnosed()
        made = Discovery(journal.document, found, None if out is None else folder)
        if out is not None:
            progress.report("writing the pages", 0.99)
            made.report(folder / "report.html")
            if found is not None:
                found.save(folder / DIAGNOSIS)
        progress.report("discovered", 1.0)
        return made


@dataclass
class _Loop:
    """One discovery. What is done stands in the journal before the next thing is begun."""

    lab: Lab
    described: Described
    can: Can
    journal: Journal
    budget: int
    effects_from: tuple[str, ...]

    def run(self) -> Diagnosis | None:
        """Goes on until the verdict is settled or the budget is spent."""
        journal, found = self.journal, None
        while True:
            tracks, last = journal.tracks, journal.last
            if journal.experiments and not journal.experiments[-1]["outcome"]:
                self._measure(journal.experiments[-1])
            elif tracks and (last is None or last["clips"] != [one["clip"] for one in tracks]):
                found = self._diagnose(tracks[-1]) or found
            elif why := self._end():
                journal.ended = why
                journal.write()
                return found
            else:
                settings, reason = self._choose(found)
                journal.add({**settings, **journal.held}, reason)

    def _share(self, part: float) -> float:
        """Of all the work, where so much of the last experiment's is done."""
        before = max(len(self.journal.experiments) - 1, 0)
        return min((before + part) / self.budget, MOST_SHARE)

    def _measure(self, row: dict[str, Any]) -> None:
        journal = self.journal
        progress.report(f"experiment {row['number']}", self._share(0.0))
        path = journal.folder / "clips" / f"e{row['number']:03}.csv"
        try:
            text = self.lab.measure(row["settings"])
            others = {one["number"]: journal.folder / one["clip"] for one in journal.tracks}
            write_clip(path, text, self.described.clip, row["settings"], others)
        except progress.Cancelled:
            raise
        except Exception as error:  # whatever a lab does must cost one experiment
            journal.close(row, line=_line(error))
        else:
            journal.close(row, clip=str(path.relative_to(journal.folder)))
        progress.report("measured", self._share(MEASURED), {"experiment": row})

    def _diagnose(self, new: dict[str, Any]) -> Diagnosis | None:
        journal, share = self.journal, self._share(DIAGNOSED)
        try:
            with progress.part(self._share(MEASURED), share):
                found = self.diagnosed()
        except progress.Cancelled:
            raise
        except Exception as error:  # whatever a lab's numbers bring about must cost one experiment
            journal.close(new, line=f"cannot be diagnosed: {_line(error)}")
            progress.report("measured", share, {"experiment": new})
            return None
        verdict = found.verdict
        row = {
            "clips": [one["clip"] for one in journal.tracks],
            "status": verdict.status,
            "effects": list(verdict.effects),
            "form": verdict.form,
            "law": None if verdict.law is None else law_row(verdict.law),
            "sentence": found.sentence,
            "p_value": found.document["p_value"],
        }
        journal.rounds.append(row)
        journal.write()
        progress.report("diagnosed", share, {"round": row})
        return found

    def diagnosed(self) -> Diagnosis:
        """The diagnosis of all tracks."""
        clips = [self.journal.folder / one["clip"] for one in self.journal.tracks]
        return diagnose(clips, effects_from=self.effects_from, seed=self.journal.seed)

    def _end(self) -> str | None:
        """Why it ends; None where it goes on."""
        rounds = self.journal.rounds
        if stands(rounds):
            return f"the verdict ({rounds[-1]['status']}) is the same in successive rounds"
        if len(self.journal.experiments) >= self.budget:
            return f"the budget of {self.budget} experiments is spent"
        return None

    def _choose(self, found: Diagnosis | None) -> tuple[Mapping[str, Any], str]:
        """The next setting, and why."""
        journal = self.journal
        tried = [{name: one["settings"][name] for name in self.can} for one in journal.experiments]
        outcomes = [one["outcome"] for one in journal.experiments]
        lost = [row for row, one in zip(tried, outcomes, strict=True) if one == "lost"]
        if not self.can:
            return {}, "the lab has no setting that is known here: the same experiment again"
        if not tried:
            return middle(self.can), "nothing is known yet: the middle of what the lab allows"
        settings = candidates(self.can, lost, journal.seed)
        if not journal.tracks:
            return farthest(self.can, settings, tried), (
                "no track yet: as different as possible from what failed"
            )
        if found is None:  # begun again after the budget was spent
            found = self.diagnosed()
        clip, beliefs = found.measurements[0].clip, beliefs_of(found.found)
        try:
            with progress.part(self._share(DIAGNOSED), self._share(1.0)):
                ahead = expect(clip, found.problem, beliefs, settings, None, journal.seed)
        except InputError as error:  # of scenes that nobody can set up here
            said = f"not simulated ({_line(error)}): as different as possible from those so far"
            return farthest(self.can, settings, tried), said
        best = best_first(ahead)[0]
        journal.rounds[-1]["hypotheses"] = beliefs.by_name
        if best.gain_nats < LITTLE:
            return farthest(self.can, settings, tried), (
                f"no setting is expected to gain more than {best.gain_nats:.2f} nats: as different "
                "as possible from those so far, to see whether the verdict holds"
            )
        odds = ", ".join(f"{name} {p:.2f}" for name, p in list(beliefs.by_name.items())[:3])
        return dict(best.setting), (
            f"largest expected gain: {best.gain_nats:.2f} nats; the true hypothesis is then named "
            f"with probability {best.named:.2f}; so far: {odds}"
        )


def _line(error: Exception) -> str:
    return " ".join(str(error).split())[:200] or type(error).__name__
