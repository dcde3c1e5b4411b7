"""Which formulas an inferred missing force suggests.

    target = sum over objects  response_i (c f(t, q_i, v_i))  +  unit noise

with everything that friction, masses and nuisances can do made part of the noise, as in `formula`.
The response was computed by rollouts round a fit with a free acceleration, so that the data are
explained, not the smooth curve. What is asked of a formula is

    gain in chi2 / 2  -  log(n) / 2 for each number  -  log(10) for a second factor.

Constants are tried on grids, and from the best point of a grid on by Nelder and Mead's simplex
(1965, 10.1093/comjnl/7.4.308): where a thousand nats are to be explained, a place that is half a
grid step off costs dozens.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from math import log

import numpy as np

from galileo_jax.diagnosis.laws.grammar import Structure, structures
from galileo_jax.diagnosis.laws.linearised_clip import LinearisedClip
from galileo_jax.diagnosis.thresholds import LENGTH_ODDS

NUM_LAWS, NUM_OF_FAMILY, NUM_STARTS = 8, 2, 3
BEHIND = 40.0  # nats: what is further behind the best formula is not fitted, and
BEHIND_SHARE = 0.1  # of its score: so wrong is a linear model of large changes
NUM_SINGLE = 4  # of NUM_LAWS, at least, have one factor: two fit anything in a linear model
SAME = 0.5  # nats: formulas of a family and nature that differ less do not differ here
APART = 0.2  # of a grid: starts that are nearer come to the same end
MOST_TRIES = 150  # of the simplex
SHOWS = 1e-6  # of the largest column: what is less does not show


Shape = tuple[str, str, bool]
"""Family, nature, and whether it acts on all objects."""


@dataclass(frozen=True)
class Suggestion:
    """A formula that is worth a fit."""

    structure: Structure
    # constants by name, the best first, none near another; `c` is the strength on the first object,
    # of a friction times its coefficient
    starts: tuple[Mapping[str, float], ...]
    score: float  # nats, see above


def suggestions(clips: Sequence[LinearisedClip], family: str | None = None) -> list[Suggestion]:
    """All formulas that show, or those of one family, by whatever and on whom; best first."""
    scene = clips[0].view.model.scene.surroundings
    ranges = ranges_of(clips)
    found = [
        one
        for structure in structures(scene.has_surface, len(scene.names))
        if family in (None, structure.family)
        and (one := suggestion_of(clips, structure, ranges)) is not None
    ]
    return sorted(found, key=lambda one: -one.score)


def chosen(found: Sequence[Suggestion], wanted: Collection[Shape] = ()) -> list[Suggestion]:
    """Of all formulas those that are to be fitted, best first.

    The best of what is wanted come first, then the best single factors; of each family the second
    must differ from the best.
    """
    found = sorted(found, key=lambda one: -one.score)
    # By nature and by whom it acts on, too: where friction is much changed, a push of the same
    # family may be the better one in a linear model, and far behind in a fit.
    first = [one for shape in wanted for one in _best_of(found, shape)]
    best_score = found[0].score if found else 0.0
    least = max(best_score - max(BEHIND, BEHIND_SHARE * best_score), 0.0)
    families: dict[str, list[Suggestion]] = {}
    for one in found:
        alike = families.setdefault(one.structure.family, [])
        is_new = all(
            one.structure.nature != other.structure.nature or other.score - one.score > SAME
            for other in alike
        )
        if one.score > least and is_new and len(alike) < NUM_OF_FAMILY:
            alike.append(one)
    best = [alike[0] for alike in families.values() if alike]
    single = [one for one in best if len(one.structure.factors) == 1 and one not in first]
    single = [*first, *single][:NUM_SINGLE]
    second = [one for alike in families.values() for one in alike[1:]]
    others = sorted(
        (one for one in [*best, *second] if one not in single), key=lambda one: -one.score
    )
    return sorted([*single, *others][:NUM_LAWS], key=lambda one: -one.score)


def _best_of(found: Sequence[Suggestion], shape: Shape) -> list[Suggestion]:
    """The best formula of a shape, of ranked ones; a drag is one of force or of acceleration."""
    family, nature, is_on_all = shape
    alike = [
        one
        for one in found
        if one.structure.family == family and one.structure.nature.startswith(nature)
    ]
    return sorted(alike, key=lambda one: one.structure.is_on_all != is_on_all)[:1]


def ranges_of(clips: Sequence[LinearisedClip]) -> dict[str, tuple[float, float]]:
    """What of time and place is seen in motion."""
    views = [clip.view for clip in clips]
    times = np.concatenate([view.time_s[view.moves.any(axis=0)] for view in views])
    places = np.concatenate([view.path_m[view.moves] for view in views])
    if not places.size:
        return {"t": (0.0, 1.0), "q": (0.0, 1.0)}
    reach = float(np.ptp(places))
    return {
        "t": (float(times.min()), float(times.max())),
        # What acts from afar may stand beyond the way.
        "q": (float(places.min()) - 0.3 * reach, float(places.max()) + 0.3 * reach),
    }


def _grid(structure: Structure, ranges: Mapping[str, tuple[float, float]]) -> dict[str, np.ndarray]:
    values = []
    for factor, constant in structure.constants.values():
        if isinstance(constant.grid, int):
            values.append(np.linspace(*ranges[factor.variable], constant.grid))
        else:
            values.append(np.asarray(constant.grid))
    points = np.meshgrid(*values, indexing="ij") if values else []
    return {name: point.ravel() for name, point in zip(structure.constants, points, strict=True)}


def suggestion_of(
    clips: Sequence[LinearisedClip], structure: Structure, ranges: Mapping[str, tuple[float, float]]
) -> Suggestion | None:
    """The best constants of a formula; None where it does not show."""
    grid = _grid(structure, ranges)
    gain, strength = _gains(clips, structure, grid)
    if not gain.size:
        return None
    columns = grid | {"c": strength}
    best = _apart(gain, grid)
    starts = [{name: float(values[i]) for name, values in columns.items()} for i in best]
    highest = float(gain[best[0]])
    if grid:
        better = _refined(clips, structure, grid, starts[0])
        gain, strength = _gains(clips, structure, {k: np.array([v]) for k, v in better.items()})
        if gain.size and gain[0] > highest:
            starts[0], highest = better | {"c": float(strength[0])}, float(gain[0])
    numbers = 1 + len(structure.constants)
    if structure.nature == "friction":  # the strength times each object's own coefficient
        numbers += (len(clips[0].responses) - 1) * structure.is_on_all
    price = 0.5 * numbers * log(sum(np.count_nonzero(clip.target) for clip in clips))
    price -= log(LENGTH_ODDS) * (len(structure.factors) - 1)
    return Suggestion(structure, tuple(starts), highest - price)


def _apart(gain: np.ndarray, grid: Mapping[str, np.ndarray]) -> list[int]:
    """The best points of a grid, the best first, none beside another.

    They are the tops of hills along the first constant, whatever the others are there: the lengths
    of a wave between which nothing fits may differ by little. Where the hills are few, points far
    from them are taken, too.
    """
    if not grid:
        return [0]
    found = _hilltops(gain, next(iter(grid.values())))[:NUM_STARTS]
    unit = np.stack([(values - values.min()) / np.ptp(values) for values in grid.values()], axis=1)
    for i in np.argsort(-gain):
        if len(found) == NUM_STARTS:
            break
        if all(np.abs(unit[i] - unit[j]).max() > APART for j in found):
            found.append(int(i))
    return found


def _hilltops(gain: np.ndarray, along: np.ndarray) -> list[int]:
    """The points of a grid that are the best at their value of one constant and beat both beside.

    The best first. Both are `[point of the grid]`, `along` values of the constant.
    """
    values = np.unique(along)
    best = [max(np.flatnonzero(along == value), key=lambda i: gain[i]) for value in values]
    profile = np.concatenate([[-np.inf], gain[best], [-np.inf]])
    is_top = (profile[1:-1] > profile[:-2]) & (profile[1:-1] >= profile[2:])
    return sorted((int(best[i]) for i in np.flatnonzero(is_top)), key=lambda i: -gain[i])


def _gains(
    clips: Sequence[LinearisedClip], structure: Structure, grid: Mapping[str, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Half of what chi2 falls by, and the first object's strength, `[point of the grid]`.

    Both are empty where the formula shows nowhere.
    """
    columns = np.concatenate([clip.columns(structure, grid) for clip in clips], axis=1)
    if structure.nature != "friction":
        columns = columns.sum(axis=0, keepdims=True)
    target = np.concatenate([clip.target for clip in clips])
    power = np.einsum("ovg,pvg->gop", columns, columns)
    along = np.einsum("ovg,v->go", columns, target)
    size = np.trace(power, axis1=1, axis2=2)
    if not size.max() > SHOWS:
        return np.empty(0), np.empty(0)
    # Strengths of unit size are what the priors expect.
    power = power + 0.1 * np.eye(power.shape[-1])
    strength = np.linalg.solve(power, along[..., None])[..., 0]
    gain = 0.5 * np.einsum("go,go->g", along, strength)
    if structure.nature == "friction":
        for clip in clips:
            gain = np.where(clip.is_possible(structure, grid, strength), gain, 0.0)
    if structure.nature.startswith("drag"):
        gain = np.where(strength[:, 0] > 0.0, gain, 0.0)  # what drives is no drag
    return gain, strength[:, 0]


def _refined(
    clips: Sequence[LinearisedClip],
    structure: Structure,
    grid: Mapping[str, np.ndarray],
    start: Mapping[str, float],
) -> dict[str, float]:
    """The constants that explain most, from the best point of the grid on, within the grid."""
    from scipy.optimize import minimize  # a quarter of a second; few diagnoses come here

    low, high = (np.array([f(values) for values in grid.values()]) for f in (np.min, np.max))

    def without(unit: np.ndarray) -> float:
        values = low + unit * (high - low)
        point = {name: values[i : i + 1] for i, name in enumerate(grid)}
        gain, _ = _gains(clips, structure, point)
        return -float(gain[0]) if gain.size else 0.0

    at = (np.array([start[name] for name in grid]) - low) / (high - low)
    steps = [0.5 / max(len(np.unique(values)) - 1, 1) for values in grid.values()]
    simplex = np.vstack([at, at + np.diag(np.where(at < 0.5, steps, np.negative(steps)))])
    options = {"initial_simplex": simplex, "maxfev": MOST_TRIES, "xatol": 1e-3, "fatol": 0.1}
    bounds = [(0.0, 1.0)] * len(at)
    found = minimize(without, at, method="Nelder-Mead", bounds=bounds, options=options)
    return dict(zip(grid, (low + found.x * (high - low)).tolist(), strict=True))
