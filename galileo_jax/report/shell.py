"""What all pages are made of: one HTML file that needs nothing else."""

from collections.abc import Iterable, Mapping, Sequence
from html import escape

CSS = """
:root { color-scheme: light dark; --paper: #fcfbf9; --ink: #22242a; --soft: #6a6d76;
  --line: #dfdcd5; --card: #ffffff; --accent: #c2592f; }
@media (prefers-color-scheme: dark) { :root { --paper: #17181b; --ink: #e6e4df; --soft: #a0a2a8;
  --line: #33353b; --card: #1e2024; --accent: #e58a62; } }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 66rem; padding: 2.5rem 1.25rem 4rem; background: var(--paper);
  color: var(--ink); font: 1rem/1.55 system-ui, -apple-system, "Segoe UI", Roboto, sans-serif; }
h1 { font-size: 1.7rem; font-weight: 600; letter-spacing: -0.01em; margin: 0; line-height: 1.2;
  overflow-wrap: anywhere; }
h2 { font-size: 1.15rem; font-weight: 600; margin: 2.8rem 0 0.6rem; }
p, ul { max-width: 44rem; margin: 0.4rem 0; }
ul { padding-left: 1.2rem; }
.soft, figcaption { color: var(--soft); }
figcaption { font-size: 0.9rem; max-width: 44rem; margin-bottom: 0.6rem; }
.cards { display: grid; grid-template-columns: repeat(auto-fill, minmax(15rem, 1fr)); gap: 0.9rem;
  margin: 1.6rem 0 1.2rem; }
.card { background: var(--card); border: 1px solid var(--line); border-radius: 0.6rem;
  padding: 0.9rem 1.1rem; }
.card b { display: block; font-size: 1.9rem; font-weight: 600; line-height: 1.25;
  font-variant-numeric: tabular-nums; }
.card span { color: var(--soft); font-size: 0.9rem; }
.grid { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 22rem), 1fr));
  gap: 0.9rem; }
figure { margin: 0; }
figure svg { display: block; max-width: 36rem; width: 100%; height: auto; color: var(--ink); }
svg text { font-family: inherit !important; }
.narrow { max-width: 44rem; overflow-x: auto; }
.narrow svg { min-width: 30rem; max-width: none; }
.table { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: 0.4rem 0.9rem 0.4rem 0; border-bottom: 1px solid var(--line);
  vertical-align: baseline; }
th { font-weight: 500; color: var(--soft); font-size: 0.85rem; }
td.n { white-space: nowrap; }
.warn { color: var(--accent); }
code { font: 0.85rem/1.5 ui-monospace, "SF Mono", Menlo, monospace; overflow-wrap: anywhere; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: 0.25rem 1.2rem; margin: 0.4rem 0; }
dt { color: var(--soft); }
dd { margin: 0; overflow-wrap: anywhere; }
@media (max-width: 34rem) { body { padding-top: 1.5rem; } td.meaning, th.meaning { display: none; }
  dl { grid-template-columns: 1fr; } dd { margin-bottom: 0.4rem; } }
"""


def document(title: str, sections: Iterable[str], script: str = "") -> str:
    """A whole page; `sections` are HTML, `script` is JavaScript that runs at its end."""
    running = f"<script>{script}</script>\n" if script else ""
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{CSS}</style>\n</head>\n<body>\n"
        + "\n".join(sections)
        + f"\n{running}</body>\n</html>\n"
    )


def figure_section(
    heading: str, caption: str, figures: Mapping[str, str], arrangement: str = "grid"
) -> str:
    """A heading, a caption and pictures: one below the other ("narrow") or side by side."""
    inner = "".join(f'<div class="{arrangement}">{svg}</div>' for svg in figures.values())
    if arrangement == "grid":
        inner = f'<div class="grid">{"".join(figures.values())}</div>'
    return (
        f"<h2>{escape(heading)}</h2>\n<figure><figcaption>{escape(caption)}</figcaption>"
        f"{inner}</figure>"
    )


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of cells that are HTML already."""
    top = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    body = "".join(
        "<tr>" + "".join(f'<td class="n">{cell}</td>' for cell in row) + "</tr>" for row in rows
    )
    return f'<div class="table"><table><tr>{top}</tr>{body}</table></div>'


def items(entries: Iterable[str]) -> str:
    """A list of plain sentences; empty without any."""
    listed = "".join(f"<li>{escape(entry)}</li>" for entry in entries)
    return f"<ul>{listed}</ul>" if listed else ""
