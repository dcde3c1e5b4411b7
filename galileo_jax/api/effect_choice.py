"""Effects as a caller names them: names, classes, or a file that registers more."""

from collections.abc import Sequence
from pathlib import Path

from galileo_jax.model.effects.effect import Effect
from galileo_jax.model.effects.registry import effect_names, load_file, make_effects, register
from galileo_jax.runtime.known_names import check_known

EffectsLike = str | Sequence[str | type[Effect]]


def names_of(effects: EffectsLike) -> tuple[str, ...]:
    """The effects' names; "a,b" is two of them, and a class that nobody registered is."""
    if isinstance(effects, str):
        return tuple(name.strip() for name in effects.split(",") if name.strip())
    return tuple(one if isinstance(one, str) else _registered(one) for one in effects)


def chosen_effects(names: Sequence[str], files: Sequence[str | Path]) -> tuple[Effect, ...]:
    """The effects of these names, those that files register included.

    Raises:
      InputError: a file or a name is wrong; the message lists the known names.
    """
    for path in files:
        load_file(path)
    return make_effects(list(names))


def resolved(files: Sequence[str | Path]) -> list[str]:
    """The files by their whole paths, as results name them."""
    return [str(Path(path).resolve()) for path in files]


def check_addition(add: str, files: Sequence[str | Path]) -> None:
    """Raises `InputError` where `add` is neither auto, none nor an effect."""
    for path in files:
        load_file(path)
    known = effect_names()
    check_known("--add", "effect", add, ("auto", "none", *known))


def _registered(effect: type[Effect]) -> str:
    if effect.name not in effect_names():
        register(effect)
    return effect.name
