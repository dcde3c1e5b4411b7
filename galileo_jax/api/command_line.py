"""The shell command that repeats a call of the API.

Reports and messages show it as provenance and as the next step.
"""

import shlex
from collections.abc import Sequence
from pathlib import Path


def command_line(
    verb: str,
    words: Sequence[str | Path],
    *,
    effects: Sequence[str] = (),
    effects_from: Sequence[str | Path] = (),
    **options: object,
) -> str:
    """`galileo VERB WORDS --option value ...`, quoted for a shell.

    Args:
      verb: fit, compare, ...
      words: clips or runs.
      effects: names.
      effects_from: files.
      **options: by their names in Python; those that are None, "auto" or "" are left out.
    """
    parts = ["galileo", verb, *map(str, words)]
    if effects:
        parts += ["--effects", ",".join(effects)]
    for path in effects_from:
        parts += ["--effects-from", str(path)]
    for name, value in options.items():
        if value not in (None, "auto", ""):
            parts += [f"--{name.replace('_', '-')}", str(value)]
    return shlex.join(parts)
