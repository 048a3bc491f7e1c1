"""The pictures of a feedback page: what a student may see there may be seen in a gradebook."""

from __future__ import annotations

from html.parser import HTMLParser
from pathlib import Path
from typing import NamedTuple


class Picture(NamedTuple):
    """A label, and the picture itself as a URL."""

    label: str
    url: str


def pictures_of(page: Path) -> list[Picture]:
    """The pictures of a page that `feedback_page` made; none where there is no page."""
    reader = _Reader()
    if page.is_file():
        reader.feed(page.read_text(encoding="utf-8"))
    return reader.found


class _Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.found: list[Picture] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        about = dict(attrs)
        if tag == "img" and (about.get("src") or "").startswith("data:image/"):
            self.found.append(Picture(str(about.get("alt") or "run"), str(about["src"])))
