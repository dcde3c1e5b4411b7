"""Fits that leave too much, gone on from as if the clip were noisier.

At the noise of a camera that sees hundredths of a millimetre a fit may be stuck in a narrow valley,
which at the noise of a search is none: from there the way leads on.
"""

from galileo_jax.search.table import BASE, Start, Table

NAME = "blur"


def propose(table: Table) -> list[Start]:
    """The hypotheses that may decide and do not explain the data, from their own fits."""
    keys = [key for key in (BASE, *table.deciding()) if key in table.entries]
    rows = [table.entries[key].hypothesis for key in keys]
    wanted = [(one, one.effects) for one in rows if not table.is_explained(one)]
    return [
        Start(one.effects, one.fit.z[: len(one.fit.steps)], one, NAME)
        for one, _ in table.not_asked(NAME, wanted)
    ]
