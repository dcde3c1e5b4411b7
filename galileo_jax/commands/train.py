"""`galileo train`: trains the neural estimators, goes on where one stopped, and tests them."""

import argparse
import time
from collections.abc import Sequence
from pathlib import Path

from galileo_jax.commands import command
from galileo_jax.files.atomic_write import write_json, write_text
from galileo_jax.files.package_data import config_path
from galileo_jax.rollout.engine_names import ENGINES
from galileo_jax.runtime import compilation_cache
from galileo_jax.runtime.errors import InputError

PRESETS = ("thesis", "galileo")
NUM_TEST = 1000
TEST_SHARD = 2**30  # beyond any training set's


def main(argv: Sequence[str]) -> int | None:
    """Trains into --out, or tests the network of --test."""
    call = _parser().parse_args(argv)
    if (call.test is None) == (call.out is None):
        raise InputError("galileo train: one of --out DIR (train) and --test DIR expected")
    import jax

    jax.config.update("jax_enable_x64", True)
    compilation_cache.enable()
    return _test(call) if call.test else _train(call)


def _train(call: argparse.Namespace) -> None:
    from galileo_jax.neural.config import load_config
    from galileo_jax.neural.dataset import load_or_make
    from galileo_jax.neural.presets import make_task
    from galileo_jax.neural.training import train
    from galileo_jax.report.draw import to_svg
    from galileo_jax.report.training_chart import loss_chart

    path = call.config or config_path(f"train_{call.preset}.yaml")
    config = load_config(
        path,
        samples=call.samples,
        frames=call.frames,
        seed=call.seed,
        engine=call.engine,
        max_epochs=call.max_epochs,
    )
    out: Path = call.out
    if out.exists() and not out.is_dir():
        raise InputError(f"--out: {out} is a file; a folder expected")
    task = make_task(config)
    shown = command.console()
    began = time.perf_counter()
    with command.progress() as bar:
        made = bar.add_task("simulating", total=None)
        data = load_or_make(
            task,
            config,
            call.data or out / "data",
            lambda done, total: bar.update(made, completed=done, total=total),
        )
        data_s = time.perf_counter() - began
        trained = bar.add_task("training", total=config.max_epochs)

        def on_epoch(progress) -> None:
            text = f"training, loss {progress.losses[-1][1]:.4f}, rate {progress.learning_rate:.0e}"
            bar.update(trained, completed=progress.epoch, description=text)

        progress = train(task, config, data, out, on_epoch)
    write_text(out / "loss.svg", to_svg(loss_chart(progress.losses)))
    seconds = time.perf_counter() - began
    write_json(
        out / "training.json",
        {
            "config": config.model_dump(),
            "epochs": progress.epoch,
            "best_validation_loss": progress.best,
            "seconds": {"data": round(data_s, 1), "all": round(seconds, 1)},
        },
    )
    print(
        f"{progress.epoch} epochs, validation loss {progress.best:.5f}; "
        f"{seconds:.0f} s, of which data {data_s:.0f} s"
    )
    shown.print(f"{out}/network.npz, {out}/loss.svg; test it with galileo train --test {out}")


def _test(call: argparse.Namespace) -> None:
    from galileo_jax.neural.checkpoint import NETWORK, load_network
    from galileo_jax.neural.dataset import make_samples
    from galileo_jax.neural.presets import make_task

    network, config = load_network(call.test / NETWORK if call.test.is_dir() else call.test)
    task = make_task(config)
    data = make_samples(task, config.seed, TEST_SHARD, NUM_TEST)
    found = task.test(network, data, config.seed)
    reference = task.reference()
    print(f"{NUM_TEST} new samples{'':<18}{'found':>10}{'reference':>12}")
    for name, value in found.items():
        known = f"{reference[name]:>12.4g}" if name in reference else ""
        print(f"{name:<34}{value:>10.4g}{known}")
    if call.test.is_dir():
        write_json(call.test / "test.json", {"found": found, "reference": reference})


def _parser() -> command.Parser:
    parser = command.Parser(prog="galileo train", description=__doc__)
    parser.add_argument("--preset", choices=PRESETS, default="galileo")
    parser.add_argument("--out", type=Path, metavar="DIR", help="train into it, or go on there")
    parser.add_argument("--test", type=Path, metavar="DIR", help="test its network, train nothing")
    parser.add_argument("--config", type=Path, help="a YAML file in place of the preset's own")
    parser.add_argument("--data", type=Path, help="folder of the samples (default DIR/data)")
    parser.add_argument("--samples", type=command.whole_number(100))
    parser.add_argument("--max-epochs", type=command.whole_number(1))
    parser.add_argument("--frames", type=command.whole_number(25), help="thesis: 60 or 110")
    parser.add_argument("--seed", type=command.whole_number(0))
    parser.add_argument("--engine", choices=ENGINES, help="thesis: that makes the data")
    return parser
