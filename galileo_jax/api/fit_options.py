"""What `fit` can be asked for, importable without JAX, and which options go together."""

from dataclasses import dataclass
from typing import Literal

BLOCK_STEPS = 25  # of every chain, between two looks at convergence
MAX_STEPS = 4000
OF_GALILEO = ("sampler", "max_steps", "init")  # options of chains, by preset
OF_THESIS = ("similarity", "acceptance", "selection")

Discrepancy = Literal["auto", "none", "rough"]


@dataclass(frozen=True)
class FitOptions:
    """What `fit` was asked for; the arguments of the same names."""

    method: Literal["grad", "mh", "cnn"] = "grad"
    effects: tuple[str, ...] = ()
    effects_from: tuple[str, ...] = ()
    free: tuple[str, ...] = ()
    discrepancy: Discrepancy = "auto"
    motion: str = "planar"
    engine: str = "auto"
    noise: Literal["camera", "bodies", "tracker"] | None = None
    seed: int = 0
    sampler: str = "mixture"
    max_steps: int = MAX_STEPS
    chains: int | None = None
    init: Literal["grad", "cnn"] = "grad"
    preset: Literal["galileo", "thesis"] = "galileo"
    similarity: str = "thesis_gaussian"
    acceptance: str = "coin"
    selection: str = "best"


def ignored_options(method: str, preset: str) -> tuple[tuple[str, ...], str]:
    """The options that this method and preset take no notice of, and where they belong."""
    if method != "mh":
        return ("preset", "chains", *OF_GALILEO, *OF_THESIS), f"of --method mh, not of {method}"
    if preset == "thesis":
        return OF_GALILEO, "not of --preset thesis"
    return OF_THESIS, "of --preset thesis only"
