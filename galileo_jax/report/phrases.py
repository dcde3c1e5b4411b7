"""Parts of sentences in terminal, pages, studio and paragraph."""

from collections.abc import Sequence


def sentence(text: str) -> str:
    """With a capital and a full stop."""
    return f"{text[:1].upper()}{text[1:]}."


def listed(parts: Sequence[str], word: str = "and") -> str:
    """`a, b and c`."""
    return f" {word} ".join([", ".join(parts[:-1]), parts[-1]] if parts[1:] else parts)


def two_figures(value: float) -> str:
    """A number with two figures, large ones without an exponent."""
    return f"{float(f'{value:.2g}'):g}"
