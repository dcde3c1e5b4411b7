"""A proposed law as the Python file that a user would have written for it."""

from collections.abc import Sequence

from galileo_jax.diagnosis.diagnosis import Law as FoundLaw
from galileo_jax.diagnosis.laws.grammar import Structure
from galileo_jax.diagnosis.laws.rank_formulas import constant_range
from galileo_jax.diagnosis.missing_force import View
from galileo_jax.model.effects.law import Law
from galileo_jax.model.parameters import LogNormal, Normal, Uniform

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


def class_source(structure: Structure, views: Sequence[View]) -> str:
    """The class that registers itself."""
    constants = []
    for name, (_, constant) in structure.constants.items():
        prior = constant.prior
        if prior is None:
            low, high = constant_range(structure, views, name)
            prior = Uniform(round(low, 3), round(high, 3))
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
