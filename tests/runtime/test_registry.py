"""Registries load their packages on first use; names are known from files, without JAX."""

import subprocess
import sys

import pytest

from galileo_jax.inference.samplers.sampler import SAMPLERS
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.registry import Registry, entry_names


def test_entries_are_named_as_their_files():
    told = entry_names("galileo_jax.inference.samplers.library")
    assert told == SAMPLERS.names() == ("mixture", "random_walk")


def test_fit_lists_them_without_jax():
    said = (
        "import sys; from galileo_jax.commands import fit; text = fit._parser().format_help(); "
        "assert 'random_walk' in text and 'earth_mover' in text; assert 'jax' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", said], check=True)


ENTRY = """
from dataclasses import dataclass
from {package} import THINGS

@dataclass(frozen=True)
class Thing:
    name: str

THINGS.register(Thing("{name}"))
"""


@pytest.fixture
def things(tmp_path, monkeypatch, request):
    """A registry of a package with two entries, each a file; none is imported yet."""
    package = f"registry_of_{request.node.name}"
    folder = tmp_path / package
    folder.mkdir()
    (folder / "__init__.py").write_text(
        "from galileo_jax.runtime.registry import Registry\n"
        f"THINGS = Registry('thing', 'things', '{package}')\n"
    )
    for name in ("apple", "pear"):
        (folder / f"{name}.py").write_text(ENTRY.format(package=package, name=name))
    monkeypatch.syspath_prepend(tmp_path)
    return __import__(package).THINGS


def test_a_package_is_loaded_on_first_use(things):
    package = things._packages[0]
    assert f"{package}.apple" not in sys.modules
    assert things["apple"].name == "apple"
    assert f"{package}.pear" in sys.modules
    assert things.names() == tuple(things) == ("apple", "pear") and "pear" in things


def test_an_unknown_name_lists_the_known_and_the_nearest(things):
    with pytest.raises(InputError, match=r"^unknown thing 'aple'; known: apple, pear; did you me"):
        things["aple"]
    with pytest.raises(InputError, match=r"known: apple, pear$"):
        things["zzz"]


def test_a_package_beside_it_adds_entries(things, tmp_path):
    assert len(things) == 2
    text = ENTRY.format(package=things._packages[0], name="plum")
    (tmp_path / "plums_beside.py").write_text(text)
    things.extend("plums_beside")
    assert things.names() == ("apple", "pear", "plum")


def test_a_name_is_taken_once():
    registry: Registry[type] = Registry("thing", "things")
    thing = type("Thing", (), {"name": "apple"})
    assert registry.register(thing) is thing
    with pytest.raises(InputError, match="two things are named 'apple'"):
        registry.register(thing)
