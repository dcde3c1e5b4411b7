"""`galileo train`: trains the neural estimators, goes on where one stopped, and tests them."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from galileo_jax.api.train import evaluate_network, train
from galileo_jax.commands import command
from galileo_jax.commands.options import adder
from galileo_jax.commands.progress_display import progress_display
from galileo_jax.runtime.errors import InputError

OF_TRAINING = ("--preset", "--config", "--data", "--samples", "--max-epochs", "--frames", "--seed")


def main(argv: Sequence[str]) -> int | None:
    """Trains into --out, or tests the network of --test."""
    asked = vars(_parser().parse_args(argv))
    out, network = asked.pop("out"), asked.pop("test")
    if (network is None) == (out is None):
        raise InputError("galileo train: one of --out DIR (train) and --test DIR expected")
    if network is not None:
        command.refuse_ignored(argv, [*OF_TRAINING, "--engine"], "--test trains nothing")
        return _test(network)
    with progress_display() as show:

        def on_progress(stage: str, share: float, partial: Any) -> None:
            if partial is not None:
                loss, rate = partial.losses[-1][1], partial.learning_rate
                stage = f"{stage}, loss {loss:.4f}, rate {rate:.0e}"
            show(stage, share, None)

        done = train(out, **asked, on_progress=on_progress)
    print(
        f"{len(done.losses)} epochs, validation loss {done.best_validation_loss:.5f}; "
        f"{done.seconds:.0f} s, of which data {done.data_seconds:.0f} s"
    )
    command.console().print(
        f"{out}/network.npz, {out}/loss.svg; test it with galileo train --test {out}"
    )
    return None


def _test(network: Path) -> None:
    done = evaluate_network(network)
    print(f"{done.num_samples} new samples{'':<18}{'found':>10}{'reference':>12}")
    for name, value in done.found.items():
        known = f"{done.reference[name]:>12.4g}" if name in done.reference else ""
        print(f"{name:<34}{value:>10.4g}{known}")


def _parser() -> command.Parser:
    parser = command.Parser(
        prog="galileo train",
        description="Trains the neural estimators, goes on where one stopped, and tests them.",
    )
    parser.examples(
        "galileo train --preset thesis --out networks/thesis",
        "galileo train --test networks/thesis",
    )
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="train into it, or go on there (no default)"
    )
    parser.add_argument(
        "--test", type=Path, metavar="DIR", help="test its network, train nothing (no default)"
    )
    add = adder(parser, "train")
    add("preset", "engine", choices=None, metavar="NAME")
    add("config", metavar="FILE")
    add("data", metavar="DIR")
    add("samples", "max_epochs", "frames", "seed")
    return parser
