"""A yaml mapping: read strictly (no repeated keys, no tracebacks), and written afresh."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from galileo_jax.runtime.errors import InputError

MAX_BYTES = 1_000_000
"""A clip yaml has under 2 kB; a file this large is something else, often the video."""


class _StrictLoader(yaml.SafeLoader):
    """Safe loading that refuses a key given twice (PyYAML would keep the last)."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: dict[str, int] = {}
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode) and key.value != "<<":
                line = key.start_mark.line + 1
                if key.value in seen:
                    raise InputError(
                        f"{key.value}: given twice, in lines {seen[key.value]} and {line}; keep one"
                    )
                seen[key.value] = line
        return super().construct_mapping(node, deep)


def read_mapping(path: Path) -> dict[str, Any]:
    """The mapping in a yaml file. Raises `InputError`, one line, for anything else."""
    try:
        if path.stat().st_size > MAX_BYTES:
            raise InputError(f"{path}: larger than {MAX_BYTES} bytes; a clip yaml expected")
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a text file in UTF-8; a clip yaml expected") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    try:
        value = yaml.load(text, Loader=_StrictLoader)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"line {mark.line + 1}: " if mark else ""
        raise InputError(f"{path}: not yaml: {where}{error.problem or error.context}") from None
    except RecursionError:
        raise InputError(f"{path}: not a clip yaml: nested too deeply") from None
    except (yaml.YAMLError, ValueError, TypeError, AttributeError) as error:
        # PyYAML's constructors let other errors through, for instance for the date 2020-99-99.
        raise InputError(f"{path}: not yaml: {' '.join(str(error).split())[:100]}") from None
    if value is None:
        raise InputError(f"{path}: empty; the keys video, scenario, fps, objects, ... expected")
    if not isinstance(value, dict):
        found = "a list" if isinstance(value, list) else "a single value"
        raise InputError(f"{path}: {found}, not a mapping; 'key: value' expected")
    return value


def yaml_text(content: Mapping[str, Any]) -> str:
    """A new yaml text; short lists on one line."""
    return yaml.safe_dump(dict(content), sort_keys=False, default_flow_style=None, width=100)
