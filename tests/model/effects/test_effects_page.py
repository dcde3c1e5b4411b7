"""docs/reference/effects.md and docs/how-to/write_an_effect.md say what is there."""

import ast
import math
import re
from pathlib import Path

from galileo_jax.model.effects import make_effects
from galileo_jax.model.effects.registry import ENTRY_POINTS
from galileo_jax.model.parameters import LogNormal, Normal, Parameter, Uniform
from tests.model.effects.motion import LIBRARY, OFF_THE_RAMP, PAIR

ROOT = Path(__file__).resolve().parents[3]
PAGE = (ROOT / "docs" / "reference" / "effects.md").read_text()
GUIDE = (ROOT / "docs" / "how-to" / "write_an_effect.md").read_text()


def test_every_effect_has_its_row():
    rows = re.findall(r"^\| `(\w+)` \|.*\|$", PAGE, re.MULTILINE)
    assert sorted(rows) == sorted((*LIBRARY, *OFF_THE_RAMP))
    for effect in make_effects(LIBRARY):
        (row,) = [line for line in PAGE.splitlines() if line.startswith(f"| `{effect.name}` |")]
        for parameter in effect.parameters(PAIR):
            short = parameter.name.removeprefix(effect.name)
            assert f"`{parameter.name}`" in row or f"`{short}`" in row, parameter.name
            assert parameter.unit == "1" or f", {parameter.unit}" in row, parameter.name
            assert _in_words(parameter) in row, parameter.name


def test_the_example_on_the_page_is_the_file():
    (shown,) = re.findall(r"```python\n(.*?)```", GUIDE, re.DOTALL)
    file = (ROOT / "examples" / "my_effect.py").read_text()
    assert _without_docstrings(shown) == _without_docstrings(file)


def test_the_entry_point_group():
    assert f'[project.entry-points."{ENTRY_POINTS}"]' in GUIDE


def _in_words(parameter: Parameter) -> str:
    """The prior as the table has it."""
    match parameter.prior:
        case LogNormal(median, sd):
            return f" {median:g}, ×/÷ e" + (f"^{sd:g}" if sd != 1 else "")  # noqa: RUF001
        case Normal(mean, sd) if parameter.unit == "rad":
            return f"± {math.degrees(sd):g}°"
        case Normal(mean, sd):
            return f"{mean:g} ± {sd:g}" if mean else f"± {sd:g}"
        case Uniform(low, high):
            return f"{low:g} to {high:g}" if parameter.unit == "1" else "the path"
    raise AssertionError(f"{parameter.name}: no words for {parameter.prior}")


def _without_docstrings(source: str) -> str:
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(
            node
        ):
            node.body = node.body[1:]
    return ast.dump(tree)
