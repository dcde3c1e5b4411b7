"""The shell command that repeats a call of the API.

Reports and messages show it as provenance and as the next step.
"""

import shlex
from collections.abc import Sequence
from pathlib import Path

from galileo_jax.runtime.known_names import option_of


def command_line(verb: str, words: Sequence[str | Path], **options: object) -> str:
    """`galileo VERB WORDS --option value ...`, quoted for a shell.

    Args:
      verb: fit, compare, ...
      words: clips or runs.
      **options: by their names in Python; those that are None, "auto" or "" are left out, each
        value of a tuple or list is given by itself.
    """
    parts = ["galileo", verb, *map(str, words)]
    for name, value in options.items():
        for one in value if isinstance(value, tuple | list) else (value,):
            if one not in (None, "auto", ""):
                parts += [option_of(name), str(one)]
    return shlex.join(parts)
