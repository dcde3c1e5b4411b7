"""A sweep's config: one YAML file, with overrides from the command line.

A config with all its keys:

simulate: [{count: 8}, {count: 4, effect: air_drag}]   # clips made for this sweep
clips: ["clips/*.yaml", [slow.yaml, fast.yaml]]        # each alone; those in a list together
common: {method: mh}             # options of every cell
grid: {seed: [0, 1], chains: [4, 8]}                   # all combinations
list: [{sampler: mixture}, {sampler: random_walk}]     # one by one, each with all of the grid
reports: true                    # each cell's own page; default: up to 60 cells

A folder of films and tables stands for `clips: [all of them]`, `common: {method: explain}`.
"""

import glob
import itertools
import os
from collections.abc import Mapping, Sequence
from copy import deepcopy
from pathlib import Path
from typing import Annotated, Any

import yaml
from pydantic import BaseModel, ConfigDict, Field

from galileo_jax.api.simulate import simulate
from galileo_jax.clip.yaml_file import read_mapping
from galileo_jax.files.package_data import config_path
from galileo_jax.runtime.errors import InputError, named
from galileo_jax.sweeping.settings import Settings, checked, make_settings

ClipName = Annotated[str, Field(strict=True, min_length=1)]


class Simulated(BaseModel):
    """Clips to be made with `galileo simulate`."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    # How many; the first has `seed`, the next one more
    count: Annotated[int, Field(strict=True, ge=1)]
    seed: Annotated[int, Field(strict=True, ge=0)] = 0
    effect: Annotated[str, Field(strict=True)] | None = None  # hidden in them
    # Of the effect, from 0 to 1; drawn where it is not given
    strength: Annotated[float, Field(gt=0, le=1)] | None = None
    # Rendered and to be tracked; else tracks in metres
    video: Annotated[bool, Field(strict=True)] = False

    def made(self, folder: Path) -> list[Path]:
        """Videos or tracks in a folder, made by `simulate` where they are not there already.

        Raises:
          InputError: there is no such effect, or it has no place in the scene.
        """
        strength = "" if self.strength is None else f"{self.strength:g}"
        suffix = ".mp4" if self.video else ".csv"
        effects = (self.effect,) if self.effect else ()
        paths = []
        for seed in range(self.seed, self.seed + self.count):
            path = folder / f"{self.effect or 'none'}{strength}_{seed}{suffix}"
            paths.append(path)
            if not all(path.with_suffix(end).is_file() for end in (suffix, ".yaml", ".truth.json")):
                options = {"track_only": not self.video, "strength": self.strength}
                simulate(path, seed=seed, effects=effects, **options)
        return paths


class SweepConfig(BaseModel):
    """What a sweep does; see the module for an example."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    simulate: tuple[Simulated, ...] = ()  # clips that are made for it
    # Files or patterns, relative to where the command is called; those of a list within the list
    # are trials of the same objects and fitted together
    clips: tuple[ClipName | tuple[ClipName, ...], ...] = ()
    common: dict[str, Any] = {}  # options of every cell; see `settings` for those of each method
    # Options with several values each, of which all combinations are taken
    grid: dict[str, Annotated[list[Any], Field(min_length=1)]] = {}
    # Whether each cell gets a page of its own, which takes about a second and 2 to 5 MB; None:
    # where a sweep has up to 60 cells
    reports: Annotated[bool, Field(strict=True)] | None = None
    # Options that go together, one entry after the other
    list: Annotated[tuple[dict[str, Any], ...], Field(min_length=1)] = ({},)

    def all_settings(self) -> tuple[Settings, ...]:
        """The settings of all cells, each once.

        Raises:
          InputError: an option is wrong; names it and where it stands.
        """
        found: dict[Settings, None] = {}
        for i, entry in enumerate(self.list):
            for values in itertools.product(*self.grid.values()):
                point = dict(zip(self.grid, values, strict=True))
                if twice := set(entry) & set(point):
                    raise InputError(f"list.{i}.{min(twice)}: stands in grid, too; keep one")
                try:
                    found[make_settings({**self.common, **entry, **point})] = None
                except InputError as error:
                    raise InputError(f"{_where(str(error), i, entry, point)}{error}") from None
        return tuple(found)

    def clip_groups(self) -> tuple[tuple[str, ...], ...]:
        """The clips by name, patterns expanded: those of a group are fitted together.

        Raises:
          InputError: nothing has such a name.
        """
        groups: list[tuple[str, ...]] = []
        for entry in self.clips:
            if isinstance(entry, str):
                groups += [(path,) for path in _matches(entry)]
            else:
                groups.append(tuple(path for name in entry for path in _matches(name)))
        return tuple(dict.fromkeys(groups))


def read_config(config: str | Path | Mapping[str, Any]) -> tuple[str, str, dict[str, Any]]:
    """What a config is called in messages, what its sweep is called, and its keys.

    It is a YAML file, the name of a ready one, its keys, or a folder: each film and table in it is
    explained alone.

    Raises:
      InputError: unreadable, or a folder without a film and a table, or with a result.
    """
    if isinstance(config, Mapping):
        return "config", "sweep", _plain(config)
    path = Path(config)
    if path.is_dir():
        from galileo_jax.api.explain import sources_of

        files = [glob.escape(str(file)) for file in sources_of([path])]
        return str(config), path.resolve().name, {"clips": files, "common": {"method": "explain"}}
    if not path.is_file():
        path = config_path(path.name if path.suffix else f"{path.name}.yaml")
    return str(path), path.stem, read_mapping(path)


def _plain(value: Any) -> Any:
    """A config that can be written: paths are text, sequences are lists."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return os.fspath(value) if isinstance(value, os.PathLike) else value


def make_configs(
    name: str, content: Mapping[str, Any], changes: Sequence[str] = (), runs: Sequence[str] = ()
) -> tuple[SweepConfig, ...]:
    """The configs that a config, called `name` in messages, and the command line make together.

    `changes`: "key=value" each, the key with dots (`common.seed=3`), the value YAML. `runs`:
    "key=a,b" each: one config for every combination.

    Raises:
      InputError: a key is unknown or its value is wrong.
    """
    plain = deepcopy(dict(content))
    for change in changes:
        (key, value), option = _split("--set", change), f"--set {change}"
        _put(plain, option, key, _parsed(option, value))
    many = [_split("--multirun", run) for run in runs]
    options = [_parsed(f"--multirun {key}={text}", f"[{text}]") for key, text in many]
    configs = []
    for values in itertools.product(*options):
        one = deepcopy(plain)
        for (key, text), value in zip(many, values, strict=True):
            _put(one, f"--multirun {key}={text}", key, value)
        configs.append(_checked(name, one))
    return tuple(configs)


def _checked(name: str, content: dict[str, Any]) -> SweepConfig:
    with named(name):
        config = checked(SweepConfig, content, ", ".join(SweepConfig.model_fields))
        config.all_settings()
        if not config.clips and not config.simulate:
            raise InputError("clips: missing; files, patterns such as clips/*.yaml expected")
    return config


def _where(message: str, index: int, entry: dict[str, Any], point: dict[str, Any]) -> str:
    """The part of a config that an error's key stands in."""
    key = message.split(":")[0].split(".")[0]
    if key in point:
        return "grid."
    return f"list.{index}." if key in entry else "common."


def _matches(pattern: str) -> list[str]:
    if not glob.has_magic(pattern):
        if not Path(pattern).is_file():
            raise InputError(f"clips: {pattern}: no such file")
        return [pattern]
    found = sorted(glob.glob(pattern, recursive=True))
    if not found:
        raise InputError(f"clips: no file matches {pattern!r}; --set 'clips=[...]' gives others")
    return found


def _split(option: str, text: str) -> tuple[str, str]:
    key, equals, value = text.partition("=")
    if not equals or not key:
        raise InputError(f"{option}: {text!r}: KEY=VALUE expected, such as common.seed=3")
    return key, value


def _parsed(option: str, text: str) -> Any:
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise InputError(f"{option}: not YAML ({error})") from None


def _put(content: dict[str, Any], option: str, key: str, value: Any) -> None:
    """Sets the value at a key with dots; numbers are places in a list."""
    parts = key.split(".")
    place: Any = content
    for i, part in enumerate(parts):
        if not isinstance(place, dict | list):
            raise InputError(f"{option}: {'.'.join(parts[:i])} has no keys below it")
        at: Any = part
        if isinstance(place, list):
            if not part.isdecimal() or int(part) >= len(place):
                raise InputError(f"{option}: {part}: one of 0 to {len(place) - 1} expected")
            at = int(part)
        elif part not in place:
            place[part] = {}
        if i == len(parts) - 1:
            place[at] = value
        place = place[at]
