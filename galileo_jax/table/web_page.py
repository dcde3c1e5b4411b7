"""A table of a web page, as many programs save one under the name of a spreadsheet."""

from html.parser import HTMLParser

from galileo_jax.runtime.errors import InputError
from galileo_jax.table.numbers import Rows


def web_table(text: str) -> Rows:
    """The rows of the longest table of a page.

    Raises:
      InputError: there is none.
    """
    page = _Page()
    page.feed(text)
    rows = max(page.tables, key=len, default=[])
    rows = [(line, cells) for line, cells in rows if any(cells)]
    if not rows:
        raise InputError("a web page without a table; csv or a spreadsheet expected")
    return rows


class _Page(HTMLParser):
    """Collects the cells of all tables, each row with the line in which it begins."""

    def __init__(self) -> None:
        super().__init__()
        self.tables: list[Rows] = []
        self._is_cell = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "table":
            self.tables.append([])
        elif tag == "tr" and self.tables:
            self.tables[-1].append((self.getpos()[0], []))
        elif tag in ("td", "th") and self.tables and self.tables[-1]:
            self.tables[-1][-1][1].append("")
            self._is_cell = True

    def handle_endtag(self, tag: str) -> None:
        self._is_cell &= tag not in ("td", "th", "tr", "table")

    def handle_data(self, data: str) -> None:
        if self._is_cell:
            row = self.tables[-1][-1][1]
            row[-1] = f"{row[-1]}{data}".strip()
