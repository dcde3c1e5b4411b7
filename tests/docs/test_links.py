"""What the pages name exists: linked files and headings, paths, public names, keys."""

import importlib
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml

import galileo_jax
from benchmarks.__main__ import summaries
from galileo_jax.__main__ import VERBS
from galileo_jax.clip.schema import ClipFile, ClipObject
from tests.docs.pages import NOTEBOOKS, PAGES, ROOT

LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
# A path in backticks that begins with one of these must exist.
TOP = ("galileo_jax", "docs", "tests", "benchmarks", "examples", "configs", "scenes")
PATH = re.compile(rf"`(?:python )?((?:{'|'.join(TOP)})/[\w./-]+?)/?`")
IN_A_ROOM = re.compile(r"`((?:\w+/)+\w+\.py)`")
IDS = [str(path.relative_to(ROOT)) for path in PAGES]


def _without_code(text: str) -> str:
    return re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)


def _anchors(path: Path) -> set[str]:
    headings = re.findall(r"^#+ (.+)$", _without_code(path.read_text()), re.MULTILINE)
    plain = [re.sub(r"[^\w\s-]", "", heading).strip().lower() for heading in headings]
    return {re.sub(r"[-\s]+", "-", heading) for heading in plain}


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_every_link_leads_somewhere(page):
    for target in LINK.findall(_without_code(page.read_text())):
        if re.match(r"[a-z]+:", target):
            continue
        file, _, anchor = target.partition("#")
        path = (page.parent / file).resolve() if file else page
        assert path.exists(), f"{page}: {target}"
        if anchor and path.suffix == ".md" and not anchor.startswith("galileo_jax."):
            assert anchor in _anchors(path), f"{page}: {target}"


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_every_link_of_a_notebook_leads_somewhere(path):
    cells = json.loads(path.read_text())["cells"]
    text = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown")
    for target in LINK.findall(text):
        assert (path.parent / target.partition("#")[0]).resolve().exists(), target


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_every_path_exists(page):
    text = page.read_text()
    for path in PATH.findall(text):
        assert (ROOT / path).exists(), f"{page}: {path}"
    rooms = [ROOT / top for top in ("galileo_jax", "benchmarks", "docs", ".")]
    for path in IN_A_ROOM.findall(text):
        assert any((room / path).is_file() for room in rooms), f"{page}: {path}"


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_every_benchmark_that_is_called_exists(page):
    for script in re.findall(r"python ((?:benchmarks|examples)/[\w/]+\.py)", page.read_text()):
        assert (ROOT / script).is_file(), f"{page}: {script}"
    for module in re.findall(r"python -m (benchmarks|tests)\.([\w.]+)", page.read_text()):
        assert (ROOT / module[0] / f"{module[1].replace('.', '/')}.py").is_file(), f"{page}"


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_every_benchmark_is_listed_or_in_the_history(page):
    text = page.read_text()
    for name in re.findall(r"python -m benchmarks (\w+)", text):
        assert name in summaries(), f"{page}: {name}"
    history = (ROOT / "docs" / "history" / "benchmarks.md").read_text()
    for script in re.findall(r"861ea27:benchmarks/([\w/]+\.py|\w+/)", text):
        assert f"`{script.replace('NAME.py', '')}" in history, f"{page}: {script}"


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_every_public_name_exists(page):
    text = re.sub(r"https?://\S+", "", page.read_text())
    for name in re.findall(r"\bgx\.(\w+)", text):
        assert name in galileo_jax.__all__, f"{page}: gx.{name}"
    for name in re.findall(r"from galileo_jax import (.+)", text):
        assert {part.strip() for part in name.split(",")} <= set(galileo_jax.__all__)


def test_the_reference_has_every_public_name_and_no_other():
    page = (ROOT / "docs" / "reference" / "api.md").read_text()
    documented = [
        getattr(importlib.import_module(module), name)
        for module, name in re.findall(r"^::: ([\w.]+)\.(\w+)$", page, re.MULTILINE)
    ]
    aliases = {"Array", "Force", "Friction", "Theta", "__version__"}  # named where they are used
    public = {name: getattr(galileo_jax, name) for name in set(galileo_jax.__all__) - aliases}
    assert [name for name, value in public.items() if value not in documented] == []
    assert [value for value in documented if value not in public.values()] == []


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_every_verb_exists(page):
    verbs = {verb for verb, _ in VERBS}
    # A word with a suffix or a slash is a file: `galileo FILE`.
    for verb in re.findall(r"^(?:\$ |    )galileo (\w+)(?=\s|$)", page.read_text(), re.MULTILINE):
        assert verb in verbs | {"VERB"}, f"{page}: galileo {verb}"


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_every_option_exists(page):
    helps = _helps()
    calls = re.sub(r"\\\n", " ", page.read_text())
    for verb, rest in re.findall(r"^(?:\$ |    )galileo ([a-z]\w+)(.*)", calls, re.MULTILINE):
        for option in re.findall(r"(?<!\S)--[a-z][\w-]+", rest.partition(" # ")[0]):
            assert re.search(rf"{option}\b", helps[verb]), f"{page}: galileo {verb} {option}"


def _helps() -> dict[str, str]:
    if not _HELPS:
        code = (
            "import importlib, json; from galileo_jax.__main__ import VERBS; "
            "print(json.dumps({v: importlib.import_module(f'galileo_jax.commands.{v}')"
            "._parser().format_help() for v, _ in VERBS}))"
        )
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
        )
        _HELPS.update(json.loads(done.stdout))
    return _HELPS


_HELPS: dict[str, str] = {}


@pytest.mark.parametrize("keys", [ClipFile, ClipObject])
def test_every_key_of_the_yaml_is_in_the_reference(keys):
    page = (ROOT / "docs" / "reference" / "clip_yaml.md").read_text()
    rows = set(re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE))
    assert set(keys.model_fields) <= rows
    assert rows <= set(ClipFile.model_fields) | set(ClipObject.model_fields)


def test_the_rooms_stand_in_the_order_that_is_checked():
    page = (ROOT / "docs" / "explanation" / "architecture.md").read_text()
    table = page.partition("| Room |")[2].partition("\n\n")[0]
    rows = [re.findall(r"`(\w+)`", row.split("|")[1]) for row in table.splitlines()[2:]]
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]
    (layers,) = [one["layers"] for one in contracts["contracts"] if one["type"] == "layers"]
    rooms = [layer.split(" : ") for layer in reversed(layers) if layer != "__main__"]
    assert rows == rooms


def test_every_page_is_in_the_navigation():
    nav = (ROOT / "mkdocs.yml").read_text().partition("nav:")[2]
    docs = ROOT / "docs"
    pages = {str(path.relative_to(docs)) for path in PAGES if path.is_relative_to(docs)}
    listed = set(re.findall(r": ([\w/-]+\.(?:md|ipynb))$", nav, re.MULTILINE))
    assert listed == pages | {f"notebooks/{path.name}" for path in NOTEBOOKS}


def test_the_extras_that_are_named_exist():
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"][
        "optional-dependencies"
    ]
    for page in PAGES:
        for extra in re.findall(r"galileo-jax\[(\w+)\]", page.read_text()):
            assert extra in extras, f"{page}: {extra}"


def test_the_yaml_examples_are_clips():
    for name in ("README.md", "docs/how-to/calibrate_and_label.md"):
        text = (ROOT / name).read_text()
        block = re.search(r"((?:    .*\n)*?    video: NAME\.mp4\n(?:    .*\n)+)", text)
        assert block, name
        ClipFile.model_validate(yaml.safe_load(block[1]) or {})
