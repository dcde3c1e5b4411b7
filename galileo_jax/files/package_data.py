"""Where the scenes and configs are: in a checkout and in an installed wheel alike."""

from pathlib import Path

from galileo_jax.runtime.errors import InputError


def scene_path(name: str) -> Path:
    """Returns the path of `scenes/NAME` (an MJCF file such as ``ramp.xml``).

    Raises:
      InputError: there is no such scene; the message lists those there are.
    """
    return _data_path("scenes", name)


def config_path(name: str) -> Path:
    """Returns the path of `configs/NAME` (an experiment's YAML file).

    Raises:
      InputError: there is no such config; the message lists those there are.
    """
    return _data_path("configs", name)


def _data_path(folder: str, name: str) -> Path:
    package = Path(__file__).parents[1]
    inside_wheel = package / "_data" / folder
    root = inside_wheel if inside_wheel.is_dir() else package.parent / folder
    path = root / name
    if not path.is_file():
        known = ", ".join(sorted(entry.name for entry in root.glob("*") if entry.is_file()))
        raise InputError(f"no file {name!r} in {folder}; known: {known or 'none'}")
    return path
