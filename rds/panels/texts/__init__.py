"""The texts of the panels in other languages: a file each (de.toml), whose left sides are all texts in English."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from itertools import chain, zip_longest
from pathlib import Path
from typing import Any

from rds.core.toml_file import read_own_toml

_FOLDER = Path(__file__).parent
_PLACE = re.compile(r"\{(t?)\}")
ENGLISH = "English"  # of the panels themselves


@cache
def languages() -> dict[str, str]:
    """The languages by the names of their files, as each calls itself."""
    return {path.stem: str(_read(path)["language"]) for path in sorted(_FOLDER.glob("*.toml"))}


@cache
def texts(language: str) -> dict[str, str]:
    """The texts of a language by the English ones, for static/texts.js; none for English ("")."""
    if not language:
        return {}
    found = _read(_FOLDER / f"{language}.toml")
    return {text: text for text in found["same"]} | dict(found["texts"])


@cache
def exchanger(language: str) -> Callable[[str], str | None]:
    """What a text is in a language, as static/texts.js finds it; None for what its file does not have."""
    table, patterns = texts(language), []
    for source, put in table.items():
        if kinds := _PLACE.findall(source):
            pattern = re.compile("(.+?)".join(map(re.escape, _PLACE.split(source)[::2])), re.DOTALL)
            patterns.append((len(_PLACE.sub("", source)), pattern, kinds, put))
    patterns.sort(key=lambda each: each[0], reverse=True)  # what says most comes first

    def find(text: str) -> str | None:
        if text in table:
            return table[text]
        for _, pattern, kinds, put in patterns:
            if found := pattern.fullmatch(text):
                parts = [find(part) if kind else part for part, kind in zip(found.groups(), kinds, strict=True)]
                if None not in parts:
                    between = _PLACE.split(put)[::2]
                    return "".join(chain.from_iterable(zip_longest(between, map(str, parts), fillvalue="")))
        return None

    return find


def translate_picture(figure: Any, language: str) -> None:
    """Exchange the texts of a matplotlib figure: titles, labels, legends. What the file does not have stays.

    A `Picture` makes its legends anew with each other width: then their texts are exchanged again.
    """
    if not language:
        return
    from matplotlib.text import Text

    from rds.core.figure import Picture

    find = exchanger(language)

    def exchange(width: float) -> None:
        for each in figure.findobj(Text):
            lines = [find(line) or line for line in each.get_text().split("\n")]
            each.set_text(find(each.get_text()) or "\n".join(lines))

    if isinstance(figure, Picture):
        figure.lay_out(exchange)
    else:
        exchange(figure.get_figwidth())


def _read(path: Path) -> dict[str, Any]:
    return read_own_toml(path)
