"""Suggested formulas as effects, fitted to the track in the model with all else free."""

import itertools
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np

from galileo_jax.diagnosis.laws.formula_interpreter import ActingFormulas
from galileo_jax.diagnosis.laws.grammar import (
    Structure,
    class_source,
    law_class,
    name_of,
    without_one_factor,
)
from galileo_jax.diagnosis.laws.linearised_clip import LinearisedClip
from galileo_jax.diagnosis.laws.rank_formulas import (
    NUM_LAWS,
    Shape,
    Suggestion,
    chosen,
    ranges_of,
    suggestions,
)
from galileo_jax.diagnosis.missing_force import View
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.rollout.engine_jax import EngineJax
from galileo_jax.rollout.engines import make_engine
from galileo_jax.search.fit import refit
from galileo_jax.search.hypothesis import Hypothesis

NUM_REFITTED = 3
MOST_Z = 2.5
SAME_MOTION_NATS = 0.5  # by which no clip tells two motions apart
SAME_EVIDENCE_NATS = 0.25  # by which neither of two laws is the more evident
LEAST_FRICTION = 0.05  # a friction's strength is a share of its coefficient


@dataclass(frozen=True)
class FittedLaw:
    """A law in the model."""

    structure: Structure  # the formula
    source: str  # its class, as written in proposed_effect.py
    hypothesis: Hypothesis  # the fit, with the trials it is of
    score: float  # nats, of the screening

    @property
    def trials(self) -> JointProblem:
        """Whose parameters were fitted."""
        assert self.hypothesis.trials is not None
        return self.hypothesis.trials

    @property
    def theta(self) -> np.ndarray:
        """All of them, noise scales last."""
        return self.trials.theta(self.hypothesis.fit.z, self.hypothesis.fit.free)

    def constants(self) -> dict[str, float]:
        """Values at the fit, the strength first, as `c`."""
        theta = dict(zip(self.trials.names, self.theta, strict=True))
        name = name_of(self.structure)
        values = {"c": float(theta[name])}
        return values | {key: float(theta[f"{name}_{key}"]) for key in self.structure.constants}

    @property
    def text(self) -> str:
        """The formula with its constants: `a = -0.62 |v|^1.5 sign(v), all objects`."""
        return self.structure.text(self.constants())


def fitted_laws(
    trials: JointProblem,
    near: Hypothesis,
    views: Sequence[View],
    wanted: Collection[Shape] = (),
    on_stage: Callable[[str], None] = lambda _: None,
) -> list[FittedLaw]:
    """The best few formulas, fitted; the most evident first.

    If the best has two factors, it is tried without either, too: one may do nothing. And whether a
    formula pushes or changes friction, one object or all, only a fit can tell: the best is tried
    in every way.

    `near` has no effects, all else from where fits start; `wanted` is tried whatever the screening
    says of it.
    """
    clips = [LinearisedClip.of(view) for view in views]
    found = chosen(suggestions(clips), wanted)
    on_stage(f"looking for a law: fitting the {len(found)} most promising formulas")
    made = _fitted(trials, near, found, clips)
    known = {name_of(law.structure) for law in made}
    if made:
        others = [*_simpler(made[0]), *suggestions(clips, made[0].structure.family)]
        new = [one for one in others if name_of(one.structure) not in known]
        on_stage(f"looking for a law: fitting the best formula in {len(new[:NUM_LAWS])} other ways")
        made += _fitted(trials, near, new[:NUM_LAWS], clips)
    return without_twins(sorted(made, key=lambda law: -law.hypothesis.fit.log_evidence))


def without_twins(laws: Sequence[FittedLaw]) -> list[FittedLaw]:
    """Laws, of those that say the same of object 1 and of all objects one only.

    Where the clip shows nothing of the formula on the others, the two are one hypothesis, and would
    count twice in a table of probabilities. The more evident is left, or else the shorter claim:
    motions that are alike may need stranger constants for it (on object 1 a power of 1.8 where one
    of 1.2 does on all).
    """
    motions = [_motion(law, laws[0]) for law in laws]

    def is_twin(i: int, j: int) -> bool:
        a, b = laws[i].structure, laws[j].structure
        is_same = replace(a, is_on_all=b.is_on_all) == b and a.is_on_all != b.is_on_all
        return is_same and 0.5 * float(np.sum((motions[i] - motions[j]) ** 2)) < SAME_MOTION_NATS

    left_out: set[int] = set()
    for i, j in itertools.combinations(range(len(laws)), 2):
        if is_twin(i, j):
            ahead = laws[i].hypothesis.fit.log_evidence - laws[j].hypothesis.fit.log_evidence
            is_short = not laws[i].structure.is_on_all
            left_out.add(j if is_short or ahead > SAME_EVIDENCE_NATS else i)
    return [law for i, law in enumerate(laws) if i not in left_out]


def _motion(law: FittedLaw, first: FittedLaw) -> np.ndarray:
    """What a law's fit leaves of the tracks, `[value]`, in units of the noise of the first's."""
    scale = first.theta[-len(law.trials.problems) :]
    return np.concatenate(law.trials.whitened(law.theta[None], scale), axis=1)[0]


def _simpler(law: FittedLaw) -> list[Suggestion]:
    """A formula of two factors without one of them, from where it was fitted."""
    found = without_one_factor(law.structure, law.constants())
    return [Suggestion(one, (own,), law.score) for one, own in found]


def _fitted(
    trials: JointProblem,
    near: Hypothesis,
    found: Sequence[Suggestion],
    clips: Sequence[LinearisedClip],
) -> list[FittedLaw]:
    """Suggestions as laws in the model, fitted; the most evident first."""
    if not found:
        return []
    ranges = ranges_of(clips)
    sources = [class_source(one.structure, ranges) for one in found]
    extended = _with_laws(trials, [one.structure for one in found], sources)
    fitter, count = GradientFitter(extended), len(extended.model_parameters)
    at = trials.places(extended.names)
    z = np.where((at >= 0) & near.fit.free[at], near.fit.z[at], 0.0)
    starts = [_starts(extended, z, one, clips) for one in found]
    owner = np.repeat(np.arange(len(found)), [len(own) for own in starts])
    free = np.stack([extended.free([name_of(one.structure)])[:count] for one in found])
    fits = fitter.fit_from(np.concatenate(starts)[:, :count], free[owner], owner)
    best = np.argsort([-fit.log_evidence for fit in fits])[:NUM_REFITTED]
    for i in best:
        fits[i] = max(fits[i], refit(fitter, fits[i]), key=lambda fit: fit.log_evidence)
    made = [
        FittedLaw(
            one.structure, source, Hypothesis((name_of(one.structure),), fit, extended), one.score
        )
        for i, (one, source, fit) in enumerate(zip(found, sources, fits, strict=True))
    ]
    return sorted(made, key=lambda law: -law.hypothesis.fit.log_evidence)


def _with_laws(
    trials: JointProblem, structures: Sequence[Structure], sources: Sequence[str]
) -> JointProblem:
    """The trials with these laws in place of the library."""
    laws = tuple(law_class(source)() for source in sources)
    laws = tuple(sorted(laws, key=lambda law: law.name))
    named = {name_of(structure): structure for structure in structures}
    problems = []
    for problem in trials.problems:
        model = replace(problem.model, effects=laws)
        engine = make_engine(problem.engine.name, model)
        if isinstance(engine, EngineJax):
            engine = type(engine)(model, ActingFormulas(model, named))
        problems.append(replace(problem, model=model, engine=engine))
    return JointProblem(tuple(problems))


def _starts(
    extended: JointProblem, z: np.ndarray, one: Suggestion, clips: Sequence[LinearisedClip]
) -> list[np.ndarray]:
    """Starts in z: constants of the screening; all else as given, or as goes with it."""
    name, found = name_of(one.structure), []
    for constants in one.starts:
        for others in (z, _with_formula(extended, z, one.structure, constants, clips)):
            start, values = others.copy(), dict(constants)
            if one.structure.nature == "friction":
                theta = dict(zip(extended.names, extended.theta(start), strict=True))
                values["c"] /= max(float(theta["k1"]), LEAST_FRICTION)
            for key, value in values.items():
                at = extended.names.index(name if key == "c" else f"{name}_{key}")
                prior = extended.parameters[at].prior
                inverse = float(prior.inverse(jnp.asarray(value)))
                start[at] = np.clip(np.nan_to_num(inverse), -MOST_Z, MOST_Z)
            found.append(start)
    return found


def _with_formula(
    extended: JointProblem,
    z: np.ndarray,
    structure: Structure,
    constants: Mapping[str, float],
    clips: Sequence[LinearisedClip],
) -> np.ndarray:
    """All else where a linear model has it if the formula is there."""
    total, count = np.zeros(len(z)), np.zeros(len(z))
    for index, clip in enumerate(clips):
        view = clip.view
        others = view.others()
        grid = {key: np.array([constants[key]]) for key in structure.constants}
        curves = clip.accelerations(structure, grid)
        left = view.target()
        for i, (curve,) in enumerate(curves):
            left = left - view.shows(i)[:, view.moves[i]] @ (constants["c"] * curve[view.moves[i]])
        design = view.fit.jacobian[:, others]
        normal = design.T @ design + np.eye(len(others))
        solved = -np.linalg.solve(normal, design.T @ left)
        columns = extended.columns[index]
        names = extended.problems[index].model.names
        for at, value in zip(others, solved, strict=True):
            own = view.model.names[at]
            if own in names:
                where = columns[names.index(own)]
                total[where] += value
                count[where] += 1
    return np.where(count > 0, total / np.maximum(count, 1), z)
