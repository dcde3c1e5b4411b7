"""What a form has besides what every effect has: words for it, as it has no name."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import ClassVar

from galileo_jax.model.effects.effect import Effect, Surroundings, Theta

# Against an effect of the library. Who looks for what is missing has no reason to believe that the
# library holds it: each form is as probable as an effect, all seven a third of the library.
UNNAMED_ODDS = 1.0


class Form(Effect):
    """An effect without a name; `meaning` says what it does, `name` only labels it."""

    meaning: ClassVar[str]
    family: ClassVar[str]
    """The shape of its formula, as `diagnosis.laws` calls it; a law of that shape is the same."""
    nature: ClassVar[str] = "friction"
    """What has that shape: friction, a drag or a push, as in `model.effects.law`."""
    is_on_all: ClassVar[bool] = True
    """Else on object 1 alone."""
    how_likely: ClassVar[float] = UNNAMED_ODDS
    """Before the data, against an effect with a name."""

    constant: ClassVar[str] = ""
    """Which of its constants is known of effects that have a name; empty: there are none."""
    constant_words: ClassVar[str] = ""
    named_values: ClassVar[Mapping[str, float]] = MappingProxyType({})
    """The constant's value of each of these effects."""

    def odds(self, theta: Theta, scene: Surroundings) -> float:
        """The same for whatever strength and scene."""
        return self.how_likely
