"""Changing values in a yaml text without touching its comments and layout."""

from collections.abc import Mapping
from typing import Any

import yaml

Key = tuple[str | int, ...]
"""Where a value stands: `("fps",)` or `("objects", 1, "point_px")`."""


def dump(content: Mapping[str, Any]) -> str:
    """A new yaml text; short lists on one line."""
    return yaml.safe_dump(dict(content), sort_keys=False, default_flow_style=None, width=100)


def edited(text: str, changes: Mapping[Key, Any], content: Mapping[str, Any]) -> tuple[str, bool]:
    """`text` with `changes`, which must amount to `content`.

    Returns:
      the new text, and whether comments and layout were kept. Where they cannot be (blocks
      written in an unusual way), the text is written afresh from `content`.
    """
    new = text
    try:
        for key, value in changes.items():
            new = _with_value(new, key, value)
        if yaml.safe_load(new) == content:
            return new, True
    except (yaml.YAMLError, LookupError):
        pass
    return dump(content), False


def _with_value(text: str, key: Key, value: Any) -> str:
    parent: Any = yaml.compose(text, Loader=yaml.SafeLoader)
    for part in key[:-1]:
        parent = _child(parent, part)
    if parent is None:
        raise LookupError(key)
    old = _child(parent, key[-1])
    if old is not None:
        return text[: old.start_mark.index] + _inline(value) + text[old.end_mark.index :]
    if isinstance(parent, yaml.SequenceNode):
        return _with_item(text, parent, value)
    title, last = [pair for pair in parent.value if _is_on_one_line(pair[1])][-1]
    return _with_line(text, last, f"{' ' * title.start_mark.column}{key[-1]}: {_inline(value)}")


def _with_item(text: str, sequence: yaml.SequenceNode, item: Mapping[str, Any]) -> str:
    _, last = sequence.value[-1].value[-1]
    indent = " " * sequence.start_mark.column
    lines = [f"{key}: {_inline(value)}" for key, value in item.items()]
    return _with_line(text, last, f"{indent}- " + f"\n{indent}  ".join(lines))


def _with_line(text: str, after: yaml.Node, line: str) -> str:
    """Adds `line` below the line on which the node `after` ends."""
    end = text.find("\n", after.end_mark.index)
    if end < 0:
        return f"{text}\n{line}\n"
    return f"{text[:end]}\n{line}{text[end:]}"


def _child(node: Any, part: str | int) -> yaml.Node | None:
    if isinstance(part, int):
        return node.value[part] if part < len(node.value) else None
    return next((value for title, value in node.value if title.value == part), None)


def _is_on_one_line(node: yaml.Node) -> bool:
    return node.start_mark.line == node.end_mark.line


def _inline(value: Any) -> str:
    return yaml.safe_dump(value, default_flow_style=True, width=10_000).split("\n...")[0].strip()
