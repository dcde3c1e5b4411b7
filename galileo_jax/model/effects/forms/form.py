"""What a form has besides what every effect has: words for it, as it has no name."""

from typing import ClassVar

from galileo_jax.model.effects.effect import Effect, Surroundings, Theta

# Against an effect that is met again and again: all forms together are as probable as two of those.
UNNAMED_ODDS = 0.25


class Form(Effect):
    """An effect without a name; `meaning` says what it does, `name` only labels it."""

    meaning: ClassVar[str]
    family: ClassVar[str]
    """The shape of its formula, as `diagnosis.laws` calls it; a law of that shape is the same."""

    def odds(self, theta: Theta, scene: Surroundings) -> float:
        """One in four."""
        return UNNAMED_ODDS
