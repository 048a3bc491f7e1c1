"""What the kernel makes of a file that comes in parts, without a browser."""

from __future__ import annotations

from typing import Any

from rds.panels.kit.file_import import LARGEST, FileImport


class Page:
    """The button's kernel side, what it took, said and answered."""

    def __init__(self) -> None:
        self.taken: list[tuple[str, bytes]] = []
        self.said: list[str] = []
        self.answers: list[dict[str, Any]] = []
        self.button = FileImport("Import", "", lambda name, content: self.taken.append((name, content)), self)
        self.button.send = self.answers.append  # type: ignore[method-assign]

    def say(self, text: str, kind: str = "note") -> None:
        self.said.append(text)

    def hears(self, kind: str, content: bytes = b"", **words: Any) -> dict[str, Any]:
        self.button._said(None, {"kind": kind, **words}, [memoryview(content)])
        return self.answers[-1]


def test_a_file_is_taken_when_its_last_part_has_come() -> None:
    page = Page()
    assert page.hears("begin", file="a", name="log.csv", size=5) == {"kind": "more", "file": "a", "at": 0}
    assert page.hears("part", b"abc", file="a") == {"kind": "more", "file": "a", "at": 3}
    assert page.taken == []
    assert page.hears("part", b"de", file="a") == {"kind": "end", "file": "a"}
    assert page.hears("begin", file="b", name="empty.csv", size=0) == {"kind": "end", "file": "b"}
    assert page.taken == [("log.csv", b"abcde"), ("empty.csv", b"")]


def test_a_file_that_is_too_large_is_refused_before_it_is_sent() -> None:
    page = Page()
    assert page.hears("begin", file="a", name="log.csv", size=LARGEST + 1) == {"kind": "end", "file": "a"}
    assert "log.csv has 250 MB" in page.said[0] and "copy it into the folder yourself" in page.said[0]


def test_parts_of_two_files_are_not_mixed() -> None:
    page = Page()
    page.hears("begin", file="a", name="log.csv", size=5)
    page.hears("begin", file="b", name="other.csv", size=2)
    assert page.hears("part", b"abc", file="a") == {"kind": "end", "file": "a"}
    assert "import one after the other" in page.said[0]
    page.hears("part", b"xy", file="b")
    assert page.taken == [("other.csv", b"xy")]


def test_a_file_that_the_browser_cannot_read_is_told() -> None:
    page = Page()
    page.hears("begin", file="a", name="log.csv", size=5)
    assert page.hears("failed", name="log.csv", why="it is gone") == {"kind": "end", "file": "a"}
    assert page.said == ["log.csv was not imported: the browser cannot read it (it is gone)"] and page.taken == []
