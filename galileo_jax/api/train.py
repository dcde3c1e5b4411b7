"""`train`: the neural estimators, and their errors on new samples."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from galileo_jax.files.package_data import config_path
from galileo_jax.neural import evaluation
from galileo_jax.neural.config import TrainConfig, load_config
from galileo_jax.neural.dataset import load_or_make
from galileo_jax.neural.task import make_task
from galileo_jax.neural.training import train as train_network
from galileo_jax.report.chart import Chart, Line, Panel
from galileo_jax.report.draw import to_svg
from galileo_jax.rollout.engine_names import ENGINES
from galileo_jax.runtime import progress
from galileo_jax.runtime.atomic_write import check_folder, write_json, write_text
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.known_names import check_known, option_of
from galileo_jax.runtime.precision import in_float64

PRESETS = ("thesis", "galileo")
LEAST = {"samples": 100, "max_epochs": 1, "frames": 25, "seed": 0}
SHARE_DATA = 0.5  # of the time, about, that goes into the samples


@dataclass(frozen=True)
class Trained:
    """A finished training of `seconds`, `data_seconds` of them for the samples.

    In `folder` are network.npz, loss.svg, training.json, and a checkpoint to go on from; `losses`
    are (training, validation) of every epoch.
    """

    folder: Path
    losses: tuple[tuple[float, float], ...]
    best_validation_loss: float
    seconds: float
    data_seconds: float

    def __repr__(self) -> str:
        epochs, loss = len(self.losses), self.best_validation_loss
        return f"<Trained {self.folder}: {epochs} epochs, validation loss {loss:.5f}>"


@in_float64
def train(
    out: str | Path,
    *,
    preset: Literal["thesis", "galileo"] = "galileo",
    config: str | Path | None = None,
    data: str | Path | None = None,
    samples: int | None = None,
    max_epochs: int | None = None,
    frames: int | None = None,
    seed: int | None = None,
    engine: Literal["auto", "rigid", "c", "mjx"] | None = None,
    on_progress: progress.OnProgress | None = None,
    cancel: progress.CancelFlag | None = None,
) -> Trained:
    """Trains a network on simulated samples, or goes on where an earlier call stopped.

    Args:
      out: folder for the network, its samples and its checkpoint.
      preset: which network, data and loss: "thesis" or "galileo".
      config: a YAML file; None: the preset's own.
      data: folder of the samples; None: OUT/data.
      samples: how many, 100 or more; None: the config's.
      max_epochs: the end at the latest; None: the config's.
      frames: of preset "thesis": displacements in a profile, 60 or 110; None: the config's.
      seed: of samples and weights; None: the config's.
      engine: of preset "thesis": what makes the samples, "auto", "rigid", "c" or "mjx"; None: the
        config's.
      on_progress: called with the stage, the share done (0 to 1), and in training with epoch,
        learning rate and losses so far.
      cancel: a flag with `is_set`, such as `threading.Event`.

    Raises:
      InputError: the config is wrong, or the folder holds samples or a checkpoint of another.
      Cancelled: `cancel` was set; the last whole epoch is saved.
    """
    check_known("--preset", "preset", preset, PRESETS)
    if engine is not None:
        check_known("--engine", "engine", engine, ENGINES)
    numbers = {"samples": samples, "max_epochs": max_epochs, "frames": frames, "seed": seed}
    for name, least in LEAST.items():
        value = numbers[name]
        if value is not None and not (isinstance(value, int) and value >= least):
            raise InputError(f"{option_of(name)}: '{value}' is not a whole number, {least} or more")
    out = Path(out)
    check_folder(out)
    path = Path(config) if config else config_path(f"train_{preset}.yaml")
    with progress.scope(on_progress, cancel):
        return _train(out, load_config(path, **numbers, engine=engine), Path(data or out / "data"))


def _train(out: Path, config: TrainConfig, data_folder: Path) -> Trained:
    task = make_task(config)
    began = time.perf_counter()
    with progress.part(0.0, SHARE_DATA):
        samples = load_or_make(task, config, data_folder)
    data_s = time.perf_counter() - began
    with progress.part(SHARE_DATA, 1.0):
        done = train_network(task, config, samples, out)
    write_text(out / "loss.svg", to_svg(_loss_chart(done.losses)))
    seconds = time.perf_counter() - began
    record = {
        "config": config.model_dump(),
        "epochs": done.epoch,
        "best_validation_loss": done.best,
        "seconds": {"data": round(data_s, 1), "all": round(seconds, 1)},
    }
    write_json(out / "training.json", record)
    return Trained(out, done.losses, done.best, seconds, data_s)


def _loss_chart(losses: Sequence[tuple[float, float]]) -> Chart:
    """`losses`: `(training, validation)` of every epoch."""
    values = np.asarray(losses)
    epochs = np.arange(1, len(values) + 1)
    lines = tuple(
        Line(epochs, values[:, i], colour, name, width_px=1.4)
        for i, (name, colour) in enumerate((("training", "object1"), ("validation", "object2")))
    )
    panel = Panel("loss", lines, xlabel="epoch", is_log_y=bool((values > 0).all()))
    return Chart("loss", "training and validation loss against the epoch", (panel,))


@in_float64
def evaluate_network(network: str | Path) -> evaluation.Evaluation:
    """Tests a trained network on 1,000 new samples (the command's --test).

    `network`: the folder of a training, where test.json is written, or a network's file. Of the
    result, `found` is measure to its value, `reference` what others reach in the same test.
    """
    return evaluation.evaluate_network(Path(network))
