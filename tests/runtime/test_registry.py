"""Entries known by their files' names, so that --help tells them without importing JAX."""

import subprocess
import sys

from galileo_jax.inference.samplers import sampler_names
from galileo_jax.runtime.registry import entry_names
from galileo_jax.thesis.similarity import similarity_names


def test_entries_are_named_as_their_files():
    assert entry_names("galileo_jax.thesis.similarities") == similarity_names()
    told = entry_names("galileo_jax.inference.samplers.library")
    assert told == sampler_names() == ("mixture", "random_walk")


def test_fit_lists_them_without_jax():
    said = (
        "import sys; from galileo_jax.commands import fit; text = fit._parser().format_help(); "
        "assert 'random_walk' in text and 'earth_mover' in text; assert 'jax' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", said], check=True)
