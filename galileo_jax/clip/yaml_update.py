"""New values in a yaml text whose comments and order stay (by ruamel.yaml's round trip)."""

import io
from collections.abc import Mapping, MutableMapping, Sequence
from typing import Any

import yaml
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import YAMLError
from ruamel.yaml.tokens import CommentToken

from galileo_jax.clip.yaml_file import yaml_text

WIDTH = 10_000  # no line is wrapped that was not


def updated_text(
    text: str, content: Mapping[str, Any], order: Sequence[str] = ()
) -> tuple[str, bool]:
    """A yaml text with the values of `content`.

    Args:
      text: of a mapping.
      content: its keys and values, some of them changed or added, none removed.
      order: of top-level keys: a new one is put before those that come after it.

    Returns:
      the new text, and whether comments and layout stayed. Where they cannot (an anchor would
      change two values at once), the text is written afresh.
    """
    handler = YAML()
    handler.preserve_quotes = True
    handler.width = WIDTH
    try:
        document = handler.load(text)
        _set_indents(handler, document, text)
        _update(document, content, order)
        written = io.StringIO()
        handler.dump(document, written)
        if yaml.safe_load(written.getvalue()) == content:
            return written.getvalue(), True
    except (YAMLError, yaml.YAMLError):
        pass
    return yaml_text(content), False


def _set_indents(handler: YAML, document: CommentedMap, text: str) -> None:
    """As in the text: of blocks below the top-level keys, and whether it begins with ---."""
    handler.explicit_start = any(line.rstrip() == "---" for line in text.splitlines())
    for value in document.values():
        if not isinstance(value, CommentedMap | CommentedSeq) or value.fa.flow_style():
            continue
        if isinstance(value, CommentedMap):
            handler.indent(mapping=value.lc.col)
        elif value and isinstance(value[0], CommentedMap):
            handler.indent(sequence=value[0].lc.col, offset=value.lc.col)


def _update(
    old: MutableMapping[str, Any], new: Mapping[str, Any], order: Sequence[str] = ()
) -> None:
    for key, value in new.items():
        now = old.get(key)
        if key not in old:
            _insert(old, key, _styled(value), order)
        elif now == value:
            continue
        elif isinstance(now, CommentedMap) and isinstance(value, Mapping):
            _update(now, value)
        elif isinstance(now, CommentedSeq) and isinstance(value, list):
            _update_list(now, value)
        else:
            old[key] = _styled(value)


def _update_list(old: CommentedSeq, new: Sequence[Any]) -> None:
    """In place: a comment after the list belongs to it."""
    del old[len(new) :]
    for i, value in enumerate(new):
        if i >= len(old):
            old.append(_styled(value, is_item=True))
        elif isinstance(old[i], CommentedMap) and isinstance(value, Mapping):
            _update(old[i], value)
        elif old[i] != value:
            old[i] = value


def _insert(old: Any, key: str, value: Any, order: Sequence[str]) -> None:
    """Adds a key; a comment above the next key stays above that."""
    later = order[order.index(key) + 1 :] if key in order else ()
    keys = list(old)
    place = next((i for i, name in enumerate(keys) if name in later), len(keys))
    old.insert(place, key, value)
    comments = old.ca.items.get(keys[place - 1]) if place else None
    if not comments or comments[2] is None:
        return
    on_line, _, below = comments[2].value.partition("\n")
    if below.strip():
        mark = comments[2].start_mark
        comments[2] = CommentToken(f"{on_line}\n", mark) if on_line else None
        old.ca.items[key] = [None, None, CommentToken(f"\n{below}", mark), None]


def _styled(value: Any, is_item: bool = False) -> Any:
    """Lists of numbers on one line, and mappings without lists, but for items of a list."""
    if isinstance(value, Mapping):
        styled = CommentedMap({key: _styled(each) for key, each in value.items()})
        is_short = not any(isinstance(each, Mapping | list) for each in value.values())
        if is_short and not is_item:
            styled.fa.set_flow_style()
        return styled
    if isinstance(value, list | tuple):
        has_mappings = any(isinstance(each, Mapping) for each in value)
        listed = CommentedSeq([_styled(each, is_item=True) for each in value])
        if not has_mappings:
            listed.fa.set_flow_style()
        return listed
    return value
