"""`galileo train`: trains the neural estimators, goes on where one stopped, and tests them."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import galileo_jax as gx
from galileo_jax.commands import command
from galileo_jax.commands.options import VerbParser, refuse
from galileo_jax.runtime.errors import InputError


def main(argv: Sequence[str]) -> None:
    """Trains into --out, or tests the network of --test."""
    asked = _parser().asked(argv)
    network = asked.pop("test", None)
    if (network is None) == ("out" not in asked):
        raise InputError("galileo train: one of --out DIR (train) and --test DIR expected")
    if network is not None:
        refuse(asked, tuple(asked), "--test trains nothing")
        _test(network)
        return
    with command.progress_display() as show:

        def on_progress(stage: str, share: float, partial: Any) -> None:
            if partial is not None:
                loss, rate = partial.losses[-1][1], partial.learning_rate
                stage = f"{stage}, loss {loss:.4f}, rate {rate:.0e}"
            show(stage, share, None)

        done = gx.train(**asked, on_progress=on_progress)
    print(
        f"{len(done.losses)} epochs, validation loss {done.best_validation_loss:.5f}; "
        f"{done.seconds:.0f} s, of which data {done.data_seconds:.0f} s"
    )
    out = asked["out"]
    command.console().print(
        f"{out}/network.npz, {out}/loss.svg; test it with galileo train --test {out}"
    )


def _test(network: Path) -> None:
    from galileo_jax.api.train import evaluate_network

    done = evaluate_network(network)
    print(f"{done.num_samples} new samples{'':<18}{'found':>10}{'reference':>12}")
    for name, value in done.found.items():
        known = f"{done.reference[name]:>12.4g}" if name in done.reference else ""
        print(f"{name:<34}{value:>10.4g}{known}")


def _parser() -> VerbParser:
    parser = VerbParser(
        "train",
        "Trains the neural estimators, goes on where one stopped, and tests them.",
        "galileo train --preset thesis --out networks/thesis",
        "galileo train --test networks/thesis",
    )
    parser.out("train into it, or go on there (no default)")
    parser.add_argument(
        "--test", type=Path, metavar="DIR", help="test its network, train nothing (no default)"
    )
    parser.add("preset", "engine", choices=None, metavar="NAME")
    parser.add("config", metavar="FILE")
    parser.add("data", metavar="DIR")
    parser.add("samples", "max_epochs", "frames")
    parser.add("seed", type=int)
    return parser
