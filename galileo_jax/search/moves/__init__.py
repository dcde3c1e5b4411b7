"""Moves: each looks at the table of hypotheses and proposes where to look next.

A move is a file of this folder with a pure function `propose(table)`: the starts that the table has
not been asked for yet. A file that is here is used.
"""

import importlib
import pkgutil
from collections.abc import Callable, Mapping

from galileo_jax.search.table import Start, Table

Move = Callable[[Table], list[Start]]

MOVES: Mapping[str, Move] = {
    module.name: importlib.import_module(f"{__name__}.{module.name}").propose
    for module in sorted(pkgutil.iter_modules(__path__), key=lambda module: module.name)
}
