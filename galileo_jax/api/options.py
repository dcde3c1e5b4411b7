"""What a function of the API was asked for, as one value; importable without JAX."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Literal, TypeVar, get_args, get_origin

from galileo_jax.runtime.known_names import check_known, option_of

OF_GALILEO = ("sampler", "max_steps", "init")  # options of chains, by preset
OF_THESIS = ("similarity", "acceptance", "selection")

Options = TypeVar("Options")


def options_of(kind: type[Options], arguments: Mapping[str, Any], **checked: Any) -> Options:
    """The options of a call, `kind` being a dataclass with fields of the arguments' names.

    `arguments`: of the call by name, its `locals()`; None: as the field's default. `checked`:
    what is not taken as it was given.
    """
    names = [one.name for one in fields(kind)]  # pyright: ignore[reportArgumentType]
    given = {name: arguments[name] for name in names if arguments[name] is not None}
    return kind(**given | checked)


def check_choices(options: Any) -> None:
    """Raises `InputError` where an option, whose type lists what there is, has another value."""
    for one in fields(options):
        if get_origin(one.type) is Literal:
            value = getattr(options, one.name)
            check_known(option_of(one.name), one.name, value, get_args(one.type))


@dataclass(frozen=True)
class FitOptions:
    """What `fit` was asked for; the arguments of the same names."""

    method: Literal["grad", "mh", "cnn"] = "grad"
    effects: tuple[str, ...] = ()
    effects_from: tuple[str, ...] = ()
    free: tuple[str, ...] = ()
    discrepancy: Literal["auto", "none", "rough"] = "auto"
    motion: Literal["planar", "free"] = "planar"
    engine: str = "auto"
    noise: Literal["camera", "bodies", "tracker"] | None = None
    seed: int = 0
    sampler: str = "mixture"
    max_steps: int = 4000
    chains: int | None = None
    init: Literal["grad", "cnn"] = "grad"
    preset: Literal["galileo", "thesis"] = "galileo"
    similarity: Literal["earth_mover", "root_mean", "thesis_gaussian"] = "thesis_gaussian"
    acceptance: Literal["coin", "metropolis"] = "coin"
    selection: Literal["best", "least_variance"] = "best"


def ignored_options(method: str, preset: str) -> tuple[tuple[str, ...], str]:
    """The options that this method and preset take no notice of, and where they belong."""
    if method != "mh":
        return ("preset", "chains", *OF_GALILEO, *OF_THESIS), f"of --method mh, not of {method}"
    if preset == "thesis":
        return OF_GALILEO, "not of --preset thesis"
    return OF_THESIS, "of --preset thesis only"
