"""The simplest formula of time, speed and place that explains a missing acceleration.

    target = response f(t, v, q) + unit noise,      f = sum of few terms of a dictionary

`target` are the whitened residuals after projecting out everything that friction, masses and
nuisance parameters can explain. `response` maps an acceleration at each time to these residuals.
The formula is therefore fitted to the data and not to the inferred curve, which is smoothed and has
correlated errors. Terms are chosen by orthogonal matching pursuit and their number by BIC, a
scanned wavelength, place or width counting as one more parameter.

Source: Pati, Rezaiifar and Krishnaprasad (1993), 10.1109/ACSSC.1993.342465 (matching pursuit);
Brunton, Proctor and Kutz (2016), 10.1073/pnas.1517384113 (laws by sparse regression); Schwarz
(1978), 10.1214/aos/1176344136 (BIC).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np

NOTHING, NOT_SIMPLE = "nothing", "no simple formula"
MAX_TERMS = 3
WORTH = 0.02  # of the misfit: a parameter that explains less makes no formula simpler
CLEARLY_BETTER = 10.0  # of BIC: very strong evidence (Kass and Raftery 1995)
AS_GOOD = 6.0  # a formula with a BIC so near to the best's is reported as well
EXPLAINED = 0.8  # a formula that leaves more than a fifth is none
CERTAIN = 3.0  # log Bayes factor from which on there is something to explain

LENGTHS_M = np.geomspace(0.08, 0.8, 160)  # over a metre of way no phase is missed
SPEEDS_M_S = (0.1, 0.2, 0.4)
PLACES, WIDTHS_M = 24, (0.02, 0.04, 0.08)
TIMES, WIDTHS_S = 24, (0.03, 0.06, 0.12)

Curve = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Sight:
    """What one clip says of the acceleration that one object lacks.

    Attributes:
      time_s, path_m, speed_m_s: `[time]`, of the object, while it is seen to move; empty where
        it never is.
      target: `[value]`, see above.
      response: `[value, time]`, d target / d acceleration; s^2/m.
      free_chi2: what the acceleration without a form leaves of `target`'s square.
      log_evidence: of the acceleration without a form against none.
    """

    time_s: np.ndarray
    path_m: np.ndarray
    speed_m_s: np.ndarray
    target: np.ndarray
    response: np.ndarray
    free_chi2: float
    log_evidence: float


class Term(NamedTuple):
    """One entry of the dictionary.

    Attributes:
      text: as written, SI units.
      curve: of time, path and speed.
      scanned: what was tried of it: equal for terms that share it, empty where nothing was.
    """

    text: str
    curve: Curve
    scanned: tuple[float, ...] = ()


@dataclass(frozen=True)
class Formula:
    """What was found.

    Attributes:
      text: the right-hand side, `NOTHING` or `NOT_SIMPLE`.
      share_explained: of the misfit that an acceleration of any form takes away.
      terms: the dictionary's; none where no formula was found.
      coefficients: theirs, m/s^2 per unit of the term.
    """

    text: str
    share_explained: float
    terms: tuple[Term, ...] = ()
    coefficients: tuple[float, ...] = ()

    def curve(self, time_s: np.ndarray, path_m: np.ndarray, speed_m_s: np.ndarray) -> np.ndarray:
        """The acceleration `[time]`, m/s^2."""
        total = np.zeros(len(time_s))
        for term, coefficient in zip(self.terms, self.coefficients, strict=True):
            total += coefficient * term.curve(time_s, path_m, speed_m_s)
        return total


def find_formula(sights: Sequence[Sight]) -> Formula:
    """The simplest formula for an object's missing acceleration, the same in all clips.

    Without a formula: `NOT_SIMPLE` where the data ask for an acceleration all the same, else
    `NOTHING`; so also for an object that no clip shows in motion (`path_m` empty in all).
    """
    target = np.concatenate([sight.target for sight in sights])
    nothing = float(target @ target)
    to_explain = nothing - sum(sight.free_chi2 for sight in sights)
    price = max(float(np.log(max(np.count_nonzero(target), 1))), WORTH * to_explain)
    log_evidence = sum(sight.log_evidence for sight in sights)
    without = NOT_SIMPLE if log_evidence > CERTAIN else NOTHING
    # An acceleration that is never at work, or never shows, has no formula.
    if not any(np.any(sight.response) for sight in sights):
        return Formula(without, 0.0)
    found = [fit for terms in _families(sights) for fit in _pursue(sights, target, terms)]
    found = sorted(found, key=lambda fit: fit.cost(price))
    best = found[0]
    share = float(np.clip((nothing - best.chi2) / max(to_explain, 1e-9), 0.0, 1.0))
    if nothing - best.cost(price) > CLEARLY_BETTER and share > EXPLAINED:
        limit = best.cost(price) + max(AS_GOOD, WORTH * to_explain)
        alike = [fit for fit in found if fit.cost(price) < limit and fit.is_plain]
        others = dict.fromkeys(fit.text for fit in alike[:4] if fit.text != best.text)
        text = "  or  ".join([best.text, *others])
        return Formula(text, share, best.terms, tuple(best.coefficients))
    return Formula(without, share if without == NOT_SIMPLE else 0.0)


class _Fit(NamedTuple):
    terms: tuple[Term, ...]
    coefficients: np.ndarray
    chi2: float

    def cost(self, price: float) -> float:
        scanned = {term.scanned for term in self.terms}
        count = len(self.terms) + sum(map(len, scanned))
        return self.chi2 + count * price

    @property
    def is_plain(self) -> bool:
        return not any(term.scanned for term in self.terms)

    @property
    def text(self) -> str:
        parts = []
        for term, coefficient in zip(self.terms, self.coefficients, strict=True):
            sign = "-" if coefficient < 0 else "+"
            size = f"{abs(coefficient):.2g}"
            parts += [sign, size if term.text == "1" else f"{size} {term.text}"]
        first = "" if parts[0] == "+" else "-"
        return " ".join([first + parts[1], *parts[2:]])


def _pursue(sights: Sequence[Sight], target: np.ndarray, terms: Sequence[Term]) -> list[_Fit]:
    """Matching pursuit's fits with one term, two, and so on; of plain terms all with one or two.

    The pursuit takes terms one by one: what only a pair explains (1 - v) it may miss.
    """
    columns = np.concatenate([_columns(sight, terms) for sight in sights])
    size = np.linalg.norm(columns, axis=0)
    is_seen = size > 1e-6 * size.max()
    kept = [term for term, seen in zip(terms, is_seen, strict=True) if seen]
    columns = columns[:, is_seen] / size[is_seen]
    plain = [i for i, term in enumerate(kept) if not term.scanned]
    chosen = [[i] for i in plain]
    chosen += [list(pair) for pair in combinations(plain, 2)]
    chosen += _matching_pursuit(columns, target)
    fits = []
    for index in chosen:
        found = np.linalg.lstsq(columns[:, index], target, rcond=None)[0]
        left = target - columns[:, index] @ found
        coefficients = found / size[is_seen][index]
        fits.append(_Fit(tuple(kept[i] for i in index), coefficients, float(left @ left)))
    return fits


def _matching_pursuit(columns: np.ndarray, target: np.ndarray) -> list[list[int]]:
    """The first column that orthogonal matching pursuit chooses, the first two, and so on.

    Columns have unit length. These few lines spare the import of scikit-learn, which takes longer
    than all formulas together.
    """
    found: list[list[int]] = []
    chosen, left = [], target
    while len(chosen) < min(MAX_TERMS, columns.shape[1]):
        best = int(np.argmax(np.abs(columns.T @ left)))
        if best in chosen:  # nothing but rounding is left
            break
        chosen = sorted([*chosen, best])
        found.append(chosen)
        own = columns[:, chosen]
        left = target - own @ np.linalg.lstsq(own, target, rcond=None)[0]
    return found


def _columns(sight: Sight, terms: Sequence[Term]) -> np.ndarray:
    """How each term shows in the data, `[value, term]`."""
    place = sight.time_s, sight.path_m, sight.speed_m_s
    return sight.response @ np.stack([term.curve(*place) for term in terms], axis=1)


def _families(sights: Sequence[Sight]) -> list[list[Term]]:
    """The dictionary: plain terms alone, and with each kind of scanned ones."""
    path = np.concatenate([sight.path_m for sight in sights])
    time = np.concatenate([sight.time_s for sight in sights])
    plain = _plain()
    return [
        plain,
        plain + _waves(),
        plain + _windows(np.linspace(path.min(), path.max(), PLACES)),
        plain + _pulses(np.linspace(time.min(), time.max(), TIMES)),
    ]


def _plain() -> list[Term]:
    decays = [
        Term(f"exp(-|v|/{u:g}) sign(v)", lambda t, q, v, u=u: np.exp(-abs(v) / u) * np.sign(v))
        for u in SPEEDS_M_S
    ]
    return [
        Term("1", lambda t, q, v: np.ones_like(t)),
        Term("v", lambda t, q, v: v),
        Term("v|v|", lambda t, q, v: v * abs(v)),
        Term("t", lambda t, q, v: t),
        Term("q", lambda t, q, v: q),
        *decays,
    ]


def _waves() -> list[Term]:
    found = []
    for w in LENGTHS_M:
        turn = 2 * np.pi / w
        scanned = (float(w),)
        found += [
            Term(f"sin(2π q/{w:.3g})", lambda t, q, v, k=turn: np.sin(k * q), scanned),
            Term(f"cos(2π q/{w:.3g})", lambda t, q, v, k=turn: np.cos(k * q), scanned),
        ]
    return found


def _windows(places: np.ndarray) -> list[Term]:
    """A bell at a place, and the slope of one: a pit or a bump in the way."""
    found = []
    for q0 in places:
        for width in WIDTHS_M:
            u = f"(q{-q0:+.2f})/{width:g}"
            scanned = (float(q0), width)

            def bell(t, q, v, q0=q0, width=width):
                return np.exp(-(((q - q0) / width) ** 2))

            def slope(t, q, v, q0=q0, width=width):
                return (q - q0) / width * np.exp(-(((q - q0) / width) ** 2))

            found += [
                Term(f"exp(-({u})²)", bell, scanned),
                Term(f"{u} exp(-({u})²)", slope, scanned),
            ]
    return found


def _pulses(times: np.ndarray) -> list[Term]:
    return [
        Term(
            f"exp(-((t{-t0:+.2f})/{width:g})²)",
            lambda t, q, v, t0=t0, width=width: np.exp(-(((t - t0) / width) ** 2)),
            (float(t0), width),
        )
        for t0 in times
        for width in WIDTHS_S
    ]
