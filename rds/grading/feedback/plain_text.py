"""Text that others wrote, for pages and gradebooks: shown as it is, able to do nothing."""

from __future__ import annotations

from html import escape

LONGEST = 4000  # characters
_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")


def plain(text: str, most: int = LONGEST) -> str:
    """`text` with what is not printable written as Python writes it (line ends and tabs stay), at most `most` long."""
    text = text.replace("\r\n", "\n")
    cut = text if len(text) <= most else f"{text[:most]}… ({len(text) - most} more characters)"
    return "".join(
        each if each.isprintable() or each in "\n\t" else each.encode("unicode_escape", "surrogatepass").decode("ascii")
        for each in cut
    )


def one_line(text: str, most: int = 200) -> str:
    """`plain` without line ends."""
    return plain(text, most).replace("\n", "\\n").replace("\t", "\\t")


def isolated(text: str, most: int = 200) -> str:
    """HTML of a name, in one line: whatever direction it is written in, what stands beside it keeps its place."""
    return f"<bdi>{escape(one_line(text, most))}</bdi>"


def cell(text: str) -> str:
    """Text for a table that a spreadsheet may open: nothing in it is taken for a formula."""
    text = plain(text)
    return f"'{text}" if text.startswith(_FORMULA) else text
