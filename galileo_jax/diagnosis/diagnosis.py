"""The result of a diagnosis: what diagnosis.json holds, and what figures need.

The keys of the file are listed in docs/reference/result_files.md.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.special import softmax

from galileo_jax.comparison.compare import Comparison
from galileo_jax.diagnosis.each_clip import EachClip
from galileo_jax.diagnosis.friction_along_way import Stretch
from galileo_jax.diagnosis.thresholds import DECISIVE, NEARLY_ALL
from galileo_jax.model.effects.forms import FORM_BY_NAME, FORM_NAMES
from galileo_jax.search.hypothesis import Hypothesis

Status = Literal["none", "named", "ambiguous", "law", "unknown"]


@dataclass(frozen=True)
class Law:
    """A formula that the missing force suggested, as fitted."""

    text: str  # with its constants: `a = 0.83 t^0.48, object 1`
    family: str  # its shape; two of a family are one formula
    source: str  # its effect as Python
    constants: Mapping[str, str]  # their values as text, by name


@dataclass(frozen=True)
class Candidate:
    """One hypothesis in the race."""

    effects: tuple[str, ...]
    hypothesis: Hypothesis  # the fit
    error: dict[str, float]  # rmse, noise, chi2_per_dof, ... as in result.json
    score_z: float  # of the score test at zero strength, in standard deviations
    log_evidence: float  # over that of the model without effects: what the data say alone
    # log of its probability before the data over that of the model without effects
    log_prior: float
    # among all candidates and the model without any of them; 0 before it is ranked
    probability: float = 0.0
    p_value: float | None = None  # of its adequacy; None where it was not compared (too improbable)
    confounded_with: tuple[str, ...] = ()  # candidates that these data do not tell from it
    # the formula, where it is a law that the missing force suggested; else None
    law: Law | None = None
    num_constants: int = 1  # parameters of its effects
    # how many of its effects the clip leads to expect, as the drag of the air
    num_expected: int = 0
    # names of imperfections beside it, and of its own parameters, that are larger than such things
    # usually are
    unusual: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """The effects, joined by +."""
        return "+".join(self.effects)

    @property
    def title(self) -> str:
        """What a sentence calls it: a law by its formula."""
        return self.name if self.law is None else self.law.text

    @property
    def log_odds(self) -> float:
        """How much more probable it is than no effect, in nats: with the data and the prior."""
        return self.log_evidence + self.log_prior

    @property
    def is_form(self) -> bool:
        """Whether it is a form without a name."""
        return any(name in FORM_NAMES for name in self.effects)

    @property
    def family(self) -> str | None:
        """The shape of a law's or a form's formula; None of all else."""
        if self.law is not None:
            return self.law.family
        is_one_form = self.is_form and len(self.effects) == 1
        return FORM_BY_NAME[self.effects[-1]].family if is_one_form else None


@dataclass(frozen=True)
class Reason:
    """A rule of the verdict that fired."""

    rule: str  # its name
    sentence: str  # what it says here
    # what it was decided by, and names of the hypotheses that it is about
    numbers: Mapping[str, float | str | None]


@dataclass(frozen=True)
class Verdict:
    """What is missing."""

    status: Status
    # one effect (or set) where it is named, all that explain the data equally well where it is
    # ambiguous; a form without a name stands last; the proposed effect of a law
    effects: tuple[str, ...]
    # where it is unknown: the form without a name that explains the data; None if not even that is
    # known
    form: str | None = None
    advice: tuple[str, ...] = ()  # what would tell more, one sentence each
    reasons: tuple[Reason, ...] = ()  # the rules that fired, in their order
    # the formula, where the verdict is a law, or ambiguous because one does as well
    law: Law | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """The hypotheses that it is about; several effects of one are joined by +."""
        return ("+".join(self.effects),) if self.status == "named" else self.effects


@dataclass(frozen=True)
class Round:
    """One round of the loop: a model, how it was fitted, how it compares with the data."""

    hypothesis: Hypothesis  # the fit
    comparison: Comparison  # of it with the data
    # names of imperfections that count as effects, being larger than usual
    called: tuple[str, ...] = ()

    @property
    def effects(self) -> tuple[str, ...]:
        """What the model has, beside what it always has."""
        return (*self.hypothesis.effects, *self.called)


@dataclass(frozen=True)
class MissingForce:
    """The acceleration that no effect explains, inferred without a form."""

    time_s: np.ndarray  # `[time]`, since the release
    # `[object, time]`, along the path
    acceleration_m_s2: np.ndarray
    sd_m_s2: np.ndarray
    # `[object, time]`, where and how fast the objects are then
    path_m: np.ndarray
    speed_m_s: np.ndarray


@dataclass(frozen=True)
class Diagnosis:
    """The whole of a diagnosis."""

    # of the loop; the first is the model without effects (or with those given)
    rounds: tuple[Round, ...]
    # all hypotheses but the model without effects, the most probable first
    candidates: tuple[Candidate, ...]
    verdict: Verdict  # what is missing
    missing: MissingForce | None = None  # where the verdict is unknown or a law
    # per clip of a series, the rmse (m/s) predicted from the others, before and after; empty for
    # one clip
    left_one_out: tuple[tuple[str, float, float], ...] = ()
    # of a series that no model without effects fits, each clip against the model of all and by
    # itself; else empty
    each_clip: tuple[EachClip, ...] = ()
    # of each clip along the way, where it is uneven; else empty
    friction: tuple[tuple[Stretch, ...], ...] = ()

    @property
    def base(self) -> Comparison:
        """The model without the missing effect against the data."""
        return self.rounds[0].comparison

    @property
    def probability_none(self) -> float:
        """That no effect is missing; with those of the candidates it sums to 1."""
        return float(softmax([0.0, *(c.log_odds for c in self.candidates)])[0])

    def share_explained(self, candidate: Candidate | None) -> float:
        """What of the base's chi2 beyond that of noise a candidate takes away; None: nothing."""
        misfit = self.base.error["chi2_per_dof"] - 1.0
        if candidate is None or misfit <= 0.0:
            return 0.0
        left = max(candidate.error["chi2_per_dof"] - 1.0, 0.0)
        return max(0.0, 1.0 - left / misfit)

    @property
    def nearly(self) -> Candidate | None:
        """The most probable candidate, if it takes nearly all of the error away; no formula."""
        best = self.candidates[0] if self.candidates else None
        if best is None or best.law is not None or best.log_odds < DECISIVE:
            return None
        return best if self.share_explained(best) >= NEARLY_ALL else None
