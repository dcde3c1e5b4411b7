"""What a diagnosis leaves open: its hypotheses with their probabilities and posteriors.

They stand in the run's folder (hypotheses.npz), so that the next experiment can be chosen later.
"""

import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.special import softmax

from galileo_jax.diagnosis.diagnosis import Diagnosis
from galileo_jax.diagnosis.stakes import decisive_margin
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.runtime.atomic_write import replacing
from galileo_jax.runtime.errors import InputError

FILE = "hypotheses.npz"
# Of the hypotheses so many take part, unless they are so improbable that no experiment that anybody
# would make for their sake could save them (e^-7 = 0.001).
MOST, FARTHEST = 8, 7.0


@dataclass(frozen=True)
class Belief:
    """One hypothesis after the data."""

    effects: tuple[str, ...]  # that are there; none is the model without any
    log_odds: float  # over no effect, nats
    z: np.ndarray  # `[parameter]`, the mode, in the trials' order
    free: np.ndarray  # `[parameter]`, which it has
    covariance: np.ndarray  # `[parameter, parameter]`, in z

    @property
    def name(self) -> str:
        """The effects, joined by +."""
        return "+".join(self.effects) or "none"


@dataclass(frozen=True)
class Beliefs:
    """All hypotheses that are still possible."""

    of: tuple[Belief, ...]  # the most probable first
    margin: float  # difference in log odds, nats, at which a diagnosis rules one out

    @property
    def probability(self) -> np.ndarray:
        """`[hypothesis]`, among these."""
        return softmax([belief.log_odds for belief in self.of])

    @property
    def by_name(self) -> dict[str, float]:
        """The probabilities by the hypotheses' names."""
        shares = zip(self.of, self.probability, strict=True)
        return {one.name: float(share) for one, share in shares}


def beliefs_of(found: Diagnosis) -> Beliefs:
    """The hypotheses of a diagnosis that are still possible, at most `MOST`.

    Laws are left out: their parameters are not those of the library, so that no rollout of another
    setting would know them.
    """
    library = [(one.hypothesis, one.log_odds) for one in found.candidates if one.law is None]
    every = [
        Belief(one.effects, log_odds, one.fit.z, one.fit.free, one.fit.covariance)
        for one, log_odds in [(found.rounds[0].hypothesis, 0.0), *library]
    ]
    every.sort(key=lambda one: -one.log_odds)
    near = [one for one in every if every[0].log_odds - one.log_odds < FARTHEST][:MOST]
    return Beliefs(tuple(near), decisive_margin(found.base.is_adequate))


def write_beliefs(path: Path, trials: JointProblem, beliefs: Beliefs) -> None:
    """Writes hypotheses.npz."""
    arrays = {
        key: np.stack([getattr(one, key) for one in beliefs.of])
        for key in ("z", "free", "covariance", "log_odds")
    }
    names = np.array([one.name for one in beliefs.of])
    arrays |= {"effects": names, "parameters": np.array(trials.names)}
    arrays |= {"margin": np.array(beliefs.margin)}
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **arrays)  # pyright: ignore[reportArgumentType]


def read_beliefs(path: Path, parameters: Sequence[str]) -> Beliefs:
    """Reads what `write_beliefs` wrote.

    It must have these `parameters`, in their order.

    Raises:
      InputError: missing, damaged, or of another model.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file; `galileo diagnose` of this version writes it")
    try:
        with np.load(path) as held:
            content = {key: held[key] for key in held.files}
        columns = [content[key] for key in ("effects", "log_odds", "z", "free", "covariance")]
        rows = zip(*columns, strict=True)
        found = Beliefs(
            tuple(
                Belief(() if name == "none" else tuple(str(name).split("+")), float(odds), *arrays)
                for name, odds, *arrays in rows
            ),
            float(content["margin"]),
        )
        known = [str(name) for name in content["parameters"]]
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise InputError(f"{path}: not the hypotheses of a diagnosis ({error})") from error
    if known != list(parameters) or not found.of:
        raise InputError(f"{path}: of another model than this version's; diagnose the clip again")
    return found
