"""A sweep's config: what it means, and one clear line for what is wrong with it."""

from pathlib import Path

import pytest

from galileo_jax.files.package_data import config_path
from galileo_jax.runtime.errors import InputError
from galileo_jax.sweeping.config import make_configs, read_config
from galileo_jax.sweeping.settings import Grad, Mh

READY = ("thesis_ablation", "samplers", "hidden_effects", "physics101")


def write(folder: Path, text: str) -> Path:
    path = folder / "sweep.yaml"
    path.write_text(text)
    return path


def load_config(path: Path, changes=(), runs=()):
    called, _, content = read_config(path)
    return make_configs(called, content, changes, runs)


def load_one(folder: Path, text: str, changes=()):
    (config,) = load_config(write(folder, text), changes)
    return config


def test_grid_is_all_combinations_and_list_one_by_one(tmp_path):
    text = "clips: [a.csv]\ncommon: {noise: tracker}\ngrid: {seed: [0, 1]}\n"
    text += "list: [{method: grad}, {method: mh, chains: 4}]"
    assert load_one(tmp_path, text).all_settings() == (
        Grad(seed=0, noise="tracker"),
        Grad(seed=1, noise="tracker"),
        Mh(method="mh", seed=0, chains=4, noise="tracker"),
        Mh(method="mh", seed=1, chains=4, noise="tracker"),
    )


def test_the_same_settings_count_once(tmp_path):
    text = "clips: [a.csv]\nlist: [{}, {method: grad}, {effects: []}, {effects: [air_drag]}]"
    assert len(load_one(tmp_path, text).all_settings()) == 2


def test_overrides(tmp_path):
    text = "clips: [a.csv]\ncommon: {seed: 1}\nlist: [{method: grad}, {method: mh}]"
    changes = ["common.seed=7", "list.1.chains=4", "grid.noise=[tracker]"]
    config = load_one(tmp_path, text, changes)
    assert [each.seed for each in config.all_settings()] == [7, 7]
    assert config.all_settings()[1] == Mh(method="mh", seed=7, chains=4, noise="tracker")


def test_multirun_is_a_config_for_every_combination(tmp_path):
    path = write(tmp_path, "clips: [a.csv]")
    found = load_config(path, (), ["common.seed=1,2", "common.effects=[],[air_drag]"])
    settings = [each for config in found for each in config.all_settings()]
    assert settings == [
        Grad(seed=seed, effects=effects) for seed in (1, 2) for effects in ((), ("air_drag",))
    ]


WRONG = {
    "clip: [a.csv]": "clip: unknown; known: simulate, clips, common, grid, reports, list",
    "clips: [3]": "clips.0: Input should be a valid string; got 3",
    "common: {}": "clips: missing; files, patterns",
    "clips: [a]\ncommon: {method: grid}": "common.method: unknown value 'grid'; known: grad, mh",
    "clips: [a]\ncommon: {chains: 3}": (
        "common.chains: method grad has no such option; an option of mh, thesis"
    ),
    "clips: [a]\ngrid: {seed: [0, x]}": "grid.seed: Input should be a valid integer",
    "clips: [a]\ngrid: {seed: 3}": "grid.seed: Input should be a valid list; got 3",
    "clips: [a]\nlist: [{seed: 1}]\ngrid: {seed: [2]}": "list.0.seed: stands in grid, too",
    "clips: [a]\nlist: [{}, {method: mh, max_steps: 30}]": "list.1.max_steps: ",
    "clips: [a]\ncommon: {method: mh, sampler: nuts}": (
        "common.sampler: unknown value; known: mixture, random_walk; got 'nuts'"
    ),
    "simulate: [{count: 0}]": "simulate.0.count: ",
    "- a": "a list, not a mapping",
}


@pytest.mark.parametrize("text", WRONG)
def test_what_is_wrong_is_one_line(text, tmp_path):
    with pytest.raises(InputError) as error:
        load_config(write(tmp_path, text))
    assert WRONG[text] in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("changes", "runs", "line"),
    [
        (["common.seed"], [], "--set: 'common.seed': KEY=VALUE expected"),
        (["common.seed=["], [], "--set common.seed=[: not YAML"),
        (["list.7.seed=1"], [], "--set list.7.seed=1: 7: one of 0 to 0 expected"),
        (["clips.0.x=1"], [], "clips.0 has no keys below it"),
        ([], ["=1,2"], "--multirun: '=1,2'"),
    ],
)
def test_wrong_overrides(changes, runs, line, tmp_path):
    path = write(tmp_path, "clips: [a.csv]\nlist: [{}]")
    with pytest.raises(InputError, match=None) as error:
        load_config(path, changes, runs)
    assert line in str(error.value)


def test_clips_by_pattern_and_together(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in "abc":
        (tmp_path / f"{name}.csv").touch()
    config = load_one(tmp_path, "clips: ['[ab].csv', a.csv, [b.csv, c.csv]]")
    named = [[Path(name).name for name in group] for group in config.clip_groups()]
    assert named == [["a.csv"], ["b.csv"], ["b.csv", "c.csv"]]
    for text, line in (("['x*']", "no file matches 'x*'"), ("[x.csv]", "x.csv: no such file")):
        with pytest.raises(InputError) as error:
            load_one(tmp_path, f"clips: {text}").clip_groups()
        assert line in str(error.value)


@pytest.mark.parametrize("name", READY)
def test_ready_configs_are_right(name):
    (config,) = load_config(config_path(f"{name}.yaml"))
    assert config.all_settings()
