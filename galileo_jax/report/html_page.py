"""The parts of HTML pages: each page is one file that needs nothing else, not even a network."""

import base64
import contextlib
import gzip
import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from html import escape
from importlib import resources
from importlib.metadata import version
from pathlib import Path

from galileo_jax.report.chart import Chart
from galileo_jax.report.plotly_figure import figure, to_json
from galileo_jax.runtime.atomic_write import replacing, write_text
from galileo_jax.runtime.jax_setup import cache_folder

NO_SCRIPT = (
    '<noscript><p class="warn">Charts and clip need JavaScript; text and tables do not.</p>'
    "</noscript>"
)


class Html(str):
    """Text that is HTML already; whatever takes text escapes what is not."""

    __slots__ = ()


def _html(text: str) -> str:
    return text if isinstance(text, Html) else escape(text)


def write_page(
    path: Path,
    kind: str,
    title: str,
    lead: str,
    sections: Iterable[str],
    more: str = "",
    is_good: bool = True,
) -> Path:
    """Writes a page and returns its path.

    Every `<h2>` is an entry of its contents. Plotly is inlined, compressed (2 MB), where there is
    a chart.

    `kind`: what it is, such as "comparison"; `title`: of which clips; `lead`: the result in one
    sentence, good news or not; `more`: HTML below it; `sections`: HTML, empty ones are left out.
    """
    contents, body = _with_anchors("\n".join(filter(None, sections)))
    page = (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(f'{title}: {kind}')}</title>\n<style>{_asset('page.css')}</style>\n"
        f'</head>\n<body>\n<header>\n<p class="eyebrow">galileo · {escape(kind)}</p>\n'
        f"<h1>{escape(title)}</h1>\n"
        f'<p class="lead{"" if is_good else " warn"}">{escape(lead)}</p>\n{more}\n'
        f"{contents}\n{NO_SCRIPT}</header>\n<main>\n{body}\n</main>\n"
        f"<script>{_asset('page.js')}</script>\n</body>\n</html>\n"
    )
    write_text(path, with_plotly(page))
    return path


def with_plotly(page: str) -> str:
    """The page with Plotly inlined after its last section, if it has charts and needs it."""
    if 'class="chart"' not in page or 'id="plotly"' in page:
        return page
    before, after = page.rsplit("</main>\n", 1)
    script = f'<script type="text/plain" id="plotly">{_plotly()}</script>\n'
    return f"{before}</main>\n{script}{after}"


def section(heading: str, *parts: str) -> str:
    """A heading over parts that are HTML; empty where all of them are."""
    body = "\n".join(filter(None, parts))
    return f"<h2>{escape(heading)}</h2>\n{body}" if body else ""


def prose(text: str, look: str = "") -> str:
    """A paragraph of plain text or `Html`; `look`: "soft", "warn"."""
    return f'<p class="{look}">{_html(text)}</p>' if look else f"<p>{_html(text)}</p>"


def link(text: str, place: str) -> Html:
    """A link to another page."""
    return Html(f'<a href="{escape(place, quote=True)}">{escape(text)}</a>')


def code(text: str) -> Html:
    """Names and commands."""
    return Html(f"<code>{escape(text)}</code>")


def chart_element(chart: Chart) -> str:
    """The chart as HTML; page.js draws it in the colours of the page."""
    drawn = figure(chart, has_legend=False)
    encoded = to_json(drawn).replace("<", "\\u003c")
    clock = "" if chart.clip is None else f' data-clip="{escape(chart.clip, quote=True)}"'
    return (
        f'<div class="chart" role="img" aria-label="{escape(chart.label, quote=True)}" '
        f'style="height:{drawn["layout"]["height"]}px"{clock}>'
        f'<script type="application/json">{encoded}</script></div>'
    )


def chart_section(
    heading: str, caption: str, charts: Iterable[Chart], arrangement: str = "grid", key: str = ""
) -> str:
    """A heading, a caption, what the marks mean, and charts.

    `arrangement`: "grid", side by side where there is room, or "stack", one below the other.
    """
    drawn = "".join(map(chart_element, charts))
    figure = f"<figure><figcaption>{escape(caption)}</figcaption>{key}"
    return section(heading, f'{figure}<div class="{arrangement}">{drawn}</div></figure>')


def legend(entries: Iterable[tuple[str, str, str]]) -> str:
    """What the marks mean.

    `entries`: (line, dashed, dot, fill or cross; colour of the style sheet; meaning).
    """
    listed = "".join(
        f'<li><span class="key {kind}" style="color:var(--{colour})"></span>{escape(text)}</li>'
        for kind, colour, text in entries
    )
    return f'<ul class="legend">{listed}</ul>'


def details(summary: str, inner: str) -> str:
    """A part that the reader opens."""
    return f"<details><summary>{escape(summary)}</summary>{inner}</details>"


def table(head: Sequence[str], rows: Iterable[Sequence[str]], only_wide: Sequence[str] = ()) -> str:
    """A table of plain text and `Html`; columns `only_wide` are left out on a phone."""
    kinds = ["n wide" if name in only_wide else "n" for name in head]
    lines = []
    for tag, row in (('th scope="col"', head), *(("td", row) for row in rows)):
        cells = zip(map(_html, row), kinds, strict=True)
        line = (f'<{tag} class="{kind}">{cell}</{tag[:2]}>' for cell, kind in cells)
        lines.append(f"<tr>{''.join(line)}</tr>")
    return f'<div class="table"><table>{"".join(lines)}</table></div>'


def listing(entries: Mapping[str, str]) -> str:
    """Names with what they stand for, plain text or `Html`."""
    listed = (f"<dt>{escape(name)}</dt><dd>{_html(text)}</dd>" for name, text in entries.items())
    return f"<dl>{''.join(listed)}</dl>"


def items(entries: Iterable[str]) -> str:
    """A list of sentences, plain text or `Html`; empty without any."""
    listed = "".join(f"<li>{_html(entry)}</li>" for entry in entries)
    return f"<ul>{listed}</ul>" if listed else ""


def _with_anchors(body: str) -> tuple[str, str]:
    """The contents, and the body whose headings they lead to."""
    links: list[str] = []

    def anchored(found: re.Match[str]) -> str:
        slug = f"s{len(links) + 1}"
        links.append(f'<a href="#{slug}">{found[1]}</a>')
        return f'<h2 id="{slug}">{found[1]}</h2>'

    body = re.sub(r"<h2>(.*?)</h2>", anchored, body)
    return f'<nav aria-label="contents">{"".join(links)}</nav>' if links else "", body


@cache
def _asset(name: str) -> str:
    return resources.files("galileo_jax.report").joinpath(name).read_text(encoding="utf-8")


@cache
def _plotly() -> str:
    """Plotly's script as the Python package has it: gzip, base64; 4.8 MB become 2.0.

    Packed once per machine: it takes as long as the rest of a page.
    """
    folder = cache_folder()
    path = None if folder is None else folder / f"plotly-{version('plotly')}.base64"
    if path is not None:
        with contextlib.suppress(OSError):
            return path.read_text("ascii")
    script = resources.files("plotly").joinpath("package_data", "plotly.min.js").read_bytes()
    packed = base64.b64encode(gzip.compress(script, 6, mtime=0)).decode("ascii")
    if path is not None:  # a cache that cannot be written is no reason to stop
        with contextlib.suppress(OSError), replacing(path) as temporary:
            temporary.write_text(packed, "ascii")
    return packed
