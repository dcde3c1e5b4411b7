"""What a page would fetch."""

import re
from html.parser import HTMLParser


class References(HTMLParser):
    """Collects whatever a browser would fetch, and the page's elements."""

    def __init__(self):
        super().__init__()
        self.found, self.tags = [], set()

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        self.found += [v for k, v in attrs if k in ("src", "href", "xlink:href", "srcset", "data")]


def check_needs_nothing_from_outside(page: str) -> None:
    references = References()
    references.feed(page)
    assert references.found
    assert all(text.startswith(("#", "data:image/")) for text in references.found)
    assert not references.tags & {"link", "iframe"}
    assert not re.search(r"url\((?!#)", page) and "@import" not in page
