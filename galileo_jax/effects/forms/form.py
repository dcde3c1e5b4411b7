"""What a form has besides what every effect has: words for it, as it has no name."""

from typing import ClassVar

from galileo_jax.effects.effect import Effect


class Form(Effect):
    """An effect without a name; `meaning` says what it does, `name` only labels it."""

    meaning: ClassVar[str]
