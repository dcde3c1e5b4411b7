"""docs/reference/effects.md and docs/how-to/write_an_effect.md say what is there."""

import ast
import re
from pathlib import Path

from galileo_jax.model.effects import make_effects
from galileo_jax.model.effects.registry import ENTRY_POINTS
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


def test_the_example_on_the_page_is_the_file():
    (shown,) = re.findall(r"```python\n(.*?)```", GUIDE, re.DOTALL)
    file = (ROOT / "examples" / "my_effect.py").read_text()
    assert _without_docstrings(shown) == _without_docstrings(file)


def test_the_entry_point_group():
    assert f'[project.entry-points."{ENTRY_POINTS}"]' in GUIDE


def _without_docstrings(source: str) -> str:
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(
            node
        ):
            node.body = node.body[1:]
    return ast.dump(tree)
