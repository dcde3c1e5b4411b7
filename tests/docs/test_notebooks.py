"""The notebooks run, and are committed without outputs."""

import ast
import re

import nbformat
import pytest
from nbclient import NotebookClient

from tests.docs.pages import NOTEBOOKS, ROOT

QUICK = "first_fit"
LONGEST_S = 600


def _code(path) -> list[str]:
    notebook = nbformat.read(path, as_version=4)
    return [cell.source for cell in notebook.cells if cell.cell_type == "code"]


def test_three_notebooks():
    assert [path.stem for path in NOTEBOOKS] == ["first_fit", "hidden_drag", "own_effect"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_no_outputs_are_committed(path):
    for cell in nbformat.read(path, as_version=4).cells:
        assert not cell.get("outputs"), "jupyter nbconvert --clear-output --inplace"
        assert cell.get("execution_count") is None


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_only_the_public_package_is_imported(path):
    tree = ast.parse("\n".join(_code(path)))
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    assert [ast.unparse(node) for node in imports] == ["import galileo_jax as gx"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_in_the_docs(path):
    assert f"notebooks/{path.name}" in (ROOT / "mkdocs.yml").read_text()


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, id=path.stem, marks=[] if path.stem == QUICK else [pytest.mark.slow])
        for path in NOTEBOOKS
    ],
)
def test_a_notebook_runs(path, tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    notebook = nbformat.read(path, as_version=4)
    resources = {"metadata": {"path": str(tmp_path)}}
    NotebookClient(notebook, timeout=LONGEST_S, resources=resources).execute()
    figures = [
        output
        for cell in notebook.cells
        for output in cell.get("outputs", ())
        if any("plotly" in kind or "html" in kind for kind in output.get("data", ()))
    ]
    assert len(figures) >= len(re.findall(r"\.plot\(\)", "\n".join(_code(path))))
