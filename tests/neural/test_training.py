import json

import numpy as np
import pytest

from galileo_jax.neural.checkpoint import NETWORK, load_network
from galileo_jax.neural.config import load_config
from galileo_jax.neural.dataset import load_or_make
from galileo_jax.neural.training import cosine_rate, train
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.progress import scope
from galileo_jax.thesis.task import ThesisTask
from tests.thesis.test_network import config


class Toy(ThesisTask):
    """The thesis's network on a line: no simulation, the same loop."""

    shard_size = 50
    made = 0

    def make(self, key, count):
        import jax

        self.made += 1
        profile = np.asarray(jax.random.normal(key, (count, 4, 60)), np.float32)
        return {"profile": profile, "target": profile[:, :, :20].mean(-1)}


def run(folder, settings, stop_after=None):
    toy = Toy(settings)
    data = load_or_make(toy, settings, folder / "data")

    def on_progress(stage, share, progress):
        assert stage == "training" and share == progress.epoch / settings.max_epochs
        if progress.epoch == stop_after:
            raise KeyboardInterrupt

    with scope(on_progress):
        return train(toy, settings, data, folder)


def test_it_learns_and_leaves_a_network(tmp_path):
    progress = run(tmp_path, config())
    assert progress.epoch == 4
    assert progress.losses[-1][0] < progress.losses[0][0]
    network, kept = load_network(tmp_path / NETWORK)
    assert kept == config()
    data = load_or_make(Toy(config()), config(), tmp_path / "data")
    error = np.abs(np.asarray(network(data["profile"][180:])) - data["target"][180:])
    assert np.isclose(np.log(error.mean(axis=0)).mean(), progress.best, rtol=1e-4)


def test_after_a_stop_it_goes_on_as_if_nothing_had_been(tmp_path):
    whole = run(tmp_path / "whole", config())
    with pytest.raises(KeyboardInterrupt):
        run(tmp_path / "parts", config(), stop_after=2)
    assert not (tmp_path / "parts" / NETWORK).exists()
    parts = run(tmp_path / "parts", config())
    assert np.allclose(whole.losses, parts.losses, rtol=1e-6)
    first, second = (np.load(tmp_path / name / NETWORK) for name in ("whole", "parts"))
    assert all(np.array_equal(first[name], second[name]) for name in first.files)


def test_a_finished_training_is_not_trained_again(tmp_path):
    first = run(tmp_path, config())
    assert run(tmp_path, config(), stop_after=5) == first


def test_another_config_is_refused(tmp_path):
    run(tmp_path, config())
    with pytest.raises(InputError, match="trained with another learning_rate"):
        run(tmp_path, config(learning_rate=1e-2))
    with pytest.raises(InputError, match="samples of other settings"):
        run(tmp_path, config(seed=1))


def test_samples_are_made_once_and_missing_ones_again(tmp_path):
    toy = Toy(config())
    data = load_or_make(toy, config(), tmp_path)
    assert toy.made == 4 and len(data["target"]) == 200
    (tmp_path / "shard_00002.npz").unlink()
    again = load_or_make(toy, config(), tmp_path)
    assert toy.made == 5
    assert np.array_equal(data["profile"], again["profile"])


def test_the_rate_is_cut_at_plateaus_and_the_last_one_ends(tmp_path):
    progress = run(tmp_path, config(learning_rate=30.0, patience=1, max_epochs=50))
    assert progress.cuts == 2 and progress.epoch < 50
    assert np.isclose(progress.learning_rate, 0.3)


def test_configs_errors_name_file_key_and_value(tmp_path):
    path = tmp_path / "c.yaml"
    path.write_text(json.dumps(config().model_dump() | {"batch": 0}))
    with pytest.raises(InputError, match=r"c\.yaml: batch: .* got 0"):
        load_config(path)
    path.write_text("preset: thesis\nsampels: 3\n")
    with pytest.raises(InputError, match=r"c\.yaml"):
        load_config(path)
    with pytest.raises(InputError, match="cannot be read"):
        load_config(tmp_path / "none.yaml")


def test_a_file_that_is_no_network_is_refused(tmp_path):
    (tmp_path / NETWORK).write_text("no")
    with pytest.raises(InputError, match="not a trained network"):
        load_network(tmp_path / NETWORK)


def test_the_cosine_schedule_holds_and_then_falls_to_zero(tmp_path):
    settings = config(schedule="cosine", max_epochs=6)
    rates = [cosine_rate(epoch, settings) for epoch in range(7)]
    assert rates[:3] == [1e-3] * 3
    assert rates == sorted(rates, reverse=True) and rates[-1] == pytest.approx(0)
    progress = run(tmp_path, settings)
    assert progress.epoch == 6 and progress.learning_rate == pytest.approx(0)
