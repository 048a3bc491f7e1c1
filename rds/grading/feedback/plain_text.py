"""Text that others wrote, for pages and gradebooks: shown as it is, able to do nothing."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

LONGEST = 4000  # characters
_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "＝", "＋", "－", "＠")
_SEPARATORS = frozenset(',;|\t\r\n"')  # where a spreadsheet may cut a line, by the country that it is set to


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
    """Text for a table that a spreadsheet may open: nothing in it is taken for a formula, as after blanks by some."""
    text = plain(text)
    return f"'{text}" if text.lstrip("' ").startswith(_FORMULA) else text


def uncell(text: str) -> str:
    """What `cell` was given, of a text without anything that cannot be printed."""
    return text[1:] if text.startswith("'") and text.lstrip("' ").startswith(_FORMULA) else text


def csv_line(cells: Iterable[str]) -> str:
    """A line of CSV that each spreadsheet cuts at the same places, also one that takes `;` for the end of a cell."""
    quoted = (f'"{each.replace(chr(34), 2 * chr(34))}"' if _SEPARATORS & set(each) else each for each in cells)
    return ",".join(quoted) + "\r\n"
