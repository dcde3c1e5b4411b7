"""The formulas that are tried: a nature, whom it acts on, and one or two factors; and their files.

A factor is a shape in time, in place or in speed with a few constants: a power, a decay, a wave, a
pulse, a step, a pull to a place. Time counts in seconds, place in metres, speed in metres a
second, so that every factor is a pure number and the strength carries the unit.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import Any

import numpy as np

from galileo_jax.diagnosis.diagnosis import Law as FoundLaw
from galileo_jax.model.effects.law import Law, Nature
from galileo_jax.model.parameters import LogNormal, Normal, Prior, Uniform

Variable = str  # "t", "q" or "v"

VARIETIES = {"far_q": "pulse_q", "slope_q": "pull_q"}
"""Shapes that differ in their tails only: near a place, and to or from a place."""


@dataclass(frozen=True)
class Constant:
    """One constant of a factor."""

    unit: str  # SI
    prior: Prior | None  # None: uniform over what is seen of the variable
    grid: Sequence[float] | int  # values tried, or how many of what is seen of the variable


@dataclass(frozen=True)
class Factor:
    """A shape."""

    name: str  # of the shape in its variable: "power", "wave"
    variable: Variable
    code: str  # Python, of t, q, v, xp and the constants
    text: str  # as a physicist writes it; constants in braces
    constants: Mapping[str, Constant]  # by name

    @property
    def label(self) -> str:
        """`power_v`."""
        return f"{self.name}_{self.variable}"

    @property
    def kind(self) -> str:
        """The label of the shape that this one is a variety of, its own as a rule."""
        return VARIETIES.get(self.label, self.label)

    def value(self, t: Any, q: Any, v: Any, xp: Any, constants: Sequence[Any]) -> Any:
        """The shape, with its constants by their order; `xp` is NumPy or JAX."""
        names = dict(zip(self.constants, constants, strict=False))
        code = self.code.format(**{name: name for name in names})
        return eval(code, {"__builtins__": {}}, {"t": t, "q": q, "v": v, "xp": xp, **names})


POWERS = (0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0)
TIMES_S = tuple(np.geomspace(0.05, 1.5, 12).tolist())
PERIODS_S = tuple(np.geomspace(0.08, 1.5, 40).tolist())
LENGTHS_M = tuple(np.geomspace(0.06, 1.0, 60).tolist())
PHASES = tuple((np.arange(9) * np.pi / 8).tolist())  # half a turn: a strength has either sign
WIDTHS = (0.02, 0.04, 0.08, 0.16)  # s and m
RATES = (-10.0, -5.0, -2.5, -1.0, 1.0, 2.5, 5.0, 10.0)


PHASE = Constant("1", Uniform(-4.0, 8.0), PHASES)
RATE = Constant("1/m", Normal(0.0, 6.0), RATES)
MOMENT, PLACE = (Constant(unit, None, 30) for unit in ("s", "m"))


def _power(top: float = 3.0) -> Constant:
    return Constant("1", Uniform(0.0, top), POWERS)


def _size(unit: str, median: float, grid: Sequence[float], sd: float = 0.7) -> Constant:
    return Constant(unit, LogNormal(median, sd), grid)


FACTORS = (
    Factor("power", "t", "(xp.abs(t) + 1e-9) ** {p}", "t^{p}", {"p": _power()}),
    Factor(
        "decay",
        "t",
        "xp.exp(-t / {tau})",
        "exp(-t/{tau})",
        {"tau": _size("s", 0.3, TIMES_S, sd=0.8)},
    ),
    Factor(
        "wave",
        "t",
        "xp.sin(6.283185307 * t / {period} + {phase})",
        "sin(2π t/{period} + {phase})",
        {"period": _size("s", 0.4, PERIODS_S), "phase": PHASE},
    ),
    Factor(
        "pulse",
        "t",
        "xp.exp(-(((t - {moment}) / {width}) ** 2))",
        "exp(-((t - {moment})/{width})²)",
        {"moment": MOMENT, "width": _size("s", 0.07, WIDTHS)},
    ),
    Factor(
        "step",
        "t",
        "0.5 * (1.0 + xp.tanh((t - {moment}) / {width}))",
        "step(t - {moment})",
        {"moment": MOMENT, "width": _size("s", 0.03, (0.02, 0.05))},
    ),
    Factor("growth", "q", "xp.exp({rate} * q)", "exp({rate} q)", {"rate": RATE}),
    Factor("linear", "q", "q", "q", {}),
    Factor(
        "wave",
        "q",
        "xp.sin(6.283185307 * q / {length} + {phase})",
        "sin(2π q/{length} + {phase})",
        {"length": _size("m", 0.25, LENGTHS_M), "phase": PHASE},
    ),
    Factor(
        "pulse",
        "q",
        "xp.exp(-(((q - {place}) / {width}) ** 2))",
        "exp(-((q - {place})/{width})²)",
        {"place": PLACE, "width": _size("m", 0.06, WIDTHS)},
    ),
    Factor(
        "pull",
        "q",
        "-(q - {place}) / {width} / (1.0 + ((q - {place}) / {width}) ** 2) ** 2",
        "u/(1 + u²)², u = ({place} - q)/{width}",
        {"place": PLACE, "width": _size("m", 0.05, WIDTHS)},
    ),
    Factor(
        "slope",
        "q",
        "-(q - {place}) / {width} * xp.exp(-(((q - {place}) / {width}) ** 2))",
        "u exp(-u²), u = ({place} - q)/{width}",
        {"place": PLACE, "width": _size("m", 0.05, WIDTHS)},
    ),
    Factor(
        "far",
        "q",
        "1.0 / (1.0 + ((q - {place}) / {width}) ** 2)",
        "1/(1 + ((q - {place})/{width})²)",
        {"place": PLACE, "width": _size("m", 0.1, (*WIDTHS, 0.3))},
    ),
    Factor("power", "v", "(v * v + 1e-4) ** ({n} / 2)", "|v|^{n}", {"n": _power(3.5)}),
    Factor(
        "decay",
        "v",
        "xp.exp(-xp.abs(v) / {speed})",
        "exp(-|v|/{speed})",
        {"speed": _size("m/s", 0.3, (0.1, 0.2, 0.4, 0.8), sd=0.8)},
    ),
    Factor("backward", "v", "xp.where(v < 0, 1.0, 0.0 * v)", "(v < 0)", {}),
)


@dataclass(frozen=True)
class Structure:
    """A formula without values for its constants."""

    nature: Nature  # see `model.effects.law`
    is_on_all: bool  # else on object 1
    factors: tuple[Factor, ...]  # one or two, of different variables

    @property
    def family(self) -> str:
        """What makes two formulas the same: `power_v`.

        Left out is what a passage in one direction does not tell: a push from a change of
        friction, and often on whom it acts; and the tails of a shape.
        """
        return "*".join(sorted(factor.kind for factor in self.factors))

    @property
    def own_names(self) -> list[dict[str, str]]:
        """By factor its constants' names in the formula, where a second of a name has a 2."""
        found: list[dict[str, str]] = []
        for factor in self.factors:
            used = [name for own in found for name in own]
            found.append({name: f"{name}2" if name in used else name for name in factor.constants})
        return found

    @property
    def constants(self) -> dict[str, tuple[Factor, Constant]]:
        """By name in the formula."""
        return {
            own: (factor, factor.constants[name])
            for factor, names in zip(self.factors, self.own_names, strict=True)
            for name, own in names.items()
        }

    @property
    def code(self) -> str:
        """F as Python, of t, q, v, xp and the constants."""
        own = zip(self.factors, self.own_names, strict=True)
        parts = [factor.code.format(**names) for factor, names in own]
        return parts[0] if len(parts) == 1 else " * ".join(f"({part})" for part in parts)

    def text(self, values: Mapping[str, float] | None = None) -> str:
        """As a physicist writes it, constants and the strength `c` by value or by name."""
        names = {name: name if values is None else f"{values[name]:.3g}" for name in self.constants}
        along, against, more = "c", "-c", "+ c"
        if values is not None:
            c = values["c"]
            along, against = f"{c:.3g}", f"{-c:.3g}"
            more = f"{'-' if c < 0 else '+'} {abs(c):.3g}"
        parts = [
            factor.text.format(**{name: names[own] for name, own in mine.items()})
            for factor, mine in zip(self.factors, self.own_names, strict=True)
        ]
        shape = " ".join(parts).replace("- -", "+ ")
        whom = "all objects" if self.is_on_all else "object 1"
        head = {
            "push": f"a = {along} {shape}",
            "drag": f"a = {against} {shape} sign(v)",
            "drag_force": f"F = {against} {shape} sign(v)",
            "friction": f"k (1 {more} {self._from_release(shape, values)})",
        }[self.nature]
        return f"{head}, {whom}"

    def _from_release(self, shape: str, values: Mapping[str, float] | None) -> str:
        """The shape less its value where the motion begins, if that is not 0."""
        if any(factor.variable == "q" for factor in self.factors):
            return f"[{shape} - at the release]"
        if values is None:
            return f"[{shape} - at t = 0, v = 0]"
        begin = float(self.value(0.0, 0.0, 0.0, values))
        return shape if abs(begin) < NEXT_TO_NOTHING else f"[{shape} - {begin:.3g}]"

    def value(self, t: Any, q: Any, v: Any, constants: Mapping[str, Any]) -> Any:
        """f, in NumPy."""
        names = {"t": t, "q": q, "v": v, "xp": np, **constants}
        return eval(self.code, {"__builtins__": {}}, names)


NEXT_TO_NOTHING = 0.01  # of a shape, whose size is about 1
ALONE: Mapping[Nature, str] = {"push": "tq", "drag": "v", "drag_force": "v", "friction": "tqv"}
"""The variables of a single factor, by nature; what else there is is in the library or a push."""
TOGETHER = ("power_t", "decay_t", "linear_q", "growth_q", "pulse_q", "power_v", "backward_v")
"""Factors that are tried in pairs."""
SEVERAL = tuple(factor for factor in FACTORS if factor.label in TOGETHER)


def structures(has_surface: bool, num_objects: int) -> Iterator[Structure]:
    """All formulas with one or two factors."""
    natures: list[Nature] = ["push", "drag"]
    if num_objects > 1:
        natures.append("drag_force")
    if has_surface:
        natures.append("friction")
    pairs = [pair for pair in combinations(SEVERAL, 2) if pair[0].variable != pair[1].variable]
    for nature, is_on_all in product(natures, (False, True) if num_objects > 1 else (False,)):
        if nature == "drag_force" and not is_on_all:
            continue
        for factor in FACTORS:
            if factor.variable in ALONE[nature]:
                yield Structure(nature, is_on_all, (factor,))
        for pair in pairs:
            has_speed = any(factor.variable == "v" for factor in pair)
            if has_speed == nature.startswith("drag"):
                yield Structure(nature, is_on_all, pair)


def without_one_factor(
    structure: Structure, values: Mapping[str, float]
) -> list[tuple[Structure, dict[str, float]]]:
    """What a formula of two factors is without either of them: one may do nothing.

    `values` are those of its constants, and its strength as `c`; each that is found has its own.
    """
    found = []
    if len(structure.factors) == 1:
        return []
    for factor, names in zip(structure.factors, structure.own_names, strict=True):
        nature = structure.nature if factor.variable in ALONE[structure.nature] else "push"
        if factor.variable not in ALONE[nature]:
            continue
        constants = {name: values[own] for name, own in names.items()}
        # A drag is against the motion, which is forward.
        constants["c"] = values["c"] * (1.0 if nature == structure.nature else -1.0)
        found.append((Structure(nature, structure.is_on_all, (factor,)), constants))
    return found


IMPORTS = """from galileo_jax.model.effects.law import Law
from galileo_jax.model.effects.registry import register
from galileo_jax.model.parameters import LogNormal, Normal, Uniform
"""
CLASS = '''@register
class ProposedLaw(Law):
    """{text}."""

    name = "{name}"
    nature, is_on_all = "{nature}", {is_on_all}
    constants = {{{constants}}}

    def formula(self, t, q, v, xp{arguments}):
        return {code}
'''


def name_of(structure: Structure) -> str:
    """`law_drag_power_v_all`."""
    shape = "_".join(factor.label for factor in structure.factors)
    return f"law_{structure.nature}_{shape}" + ("_all" if structure.is_on_all else "")


def class_source(structure: Structure, ranges: Mapping[Variable, tuple[float, float]]) -> str:
    """The class that registers itself; `ranges` are those of constants without a prior."""
    constants = []
    for name, (factor, constant) in structure.constants.items():
        prior = constant.prior
        if prior is None:
            prior = Uniform(*(round(end, 3) for end in ranges[factor.variable]))
        constants.append(f'"{name}": ("{constant.unit}", {prior!r})')
    return CLASS.format(
        text=structure.text(),
        name=name_of(structure),
        nature=structure.nature,
        is_on_all=structure.is_on_all,
        constants=", ".join(constants),
        arguments="".join(f", {name}" for name in structure.constants),
        code=structure.code,
    )


def proposed_file(law: FoundLaw, clips: Sequence[str]) -> str:
    """`proposed_effect.py`."""
    values = ", ".join(f"{name} = {value}" for name, value in law.constants.items())
    head = f'"""{law.text}\n\nProposed by galileo diagnose {" ".join(clips)}\nwith {values}.\n"""\n'
    return f"{head}\n{IMPORTS}\n\n{law.source}"


def law_class(source: str) -> type[Law]:
    """The class of `class_source`, not registered: the library is what it was."""
    names = {
        "Law": Law,
        "LogNormal": LogNormal,
        "Normal": Normal,
        "Uniform": Uniform,
        "register": lambda law: law,
        "__name__": __name__,
    }
    exec(compile(source, "<proposed law>", "exec"), names)
    return names["ProposedLaw"]  # pyright: ignore
