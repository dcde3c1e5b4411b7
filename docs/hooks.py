"""MkDocs hooks: the help of all commands in reference/commands.md, and figures in notebooks.

The page of commands is made from the program, so that the two cannot differ.
"""

import importlib
import os
from typing import Any

MARK = "<!-- all options -->"


def on_startup(**_: Any) -> None:
    """Has notebooks draw their figures as HTML that needs no network."""
    os.environ.setdefault("PLOTLY_RENDERER", "notebook")


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Replaces the mark on a page by the help of all commands."""
    return markdown.replace(MARK, all_options()) if MARK in markdown else markdown


def all_options() -> str:
    """The help of every command, as Markdown."""
    from galileo_jax.__main__ import VERBS

    parts = []
    for verb, _ in VERBS:
        parser = importlib.import_module(f"galileo_jax.commands.{verb}")._parser()
        parts.append(f"### {verb}\n\n```text\n{parser.format_help().rstrip()}\n```")
    return "\n\n".join(parts)
