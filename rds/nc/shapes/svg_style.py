"""What style sheets and attributes say of the elements of an SVG drawing, as far as it matters to what is cut."""

from __future__ import annotations

import re
from collections.abc import Mapping
from xml.etree import ElementTree

PAINT = ("fill", "stroke")
SIMPLE = re.compile(r"[.#]?[\w-]+")  # selectors that are followed: of an element's name, class or id
_MARKERS = "markers, such as arrowheads (Path > Stroke to Path in Inkscape makes curves of them)"
_CLIP = "a clip or mask: its object is drawn whole (Object > Clip > Release, Path > Intersection)"
NOT_DONE = {  # what is not done to an object, and told
    **dict.fromkeys(("clip-path", "mask"), _CLIP),
    **dict.fromkeys(("marker", "marker-start", "marker-mid", "marker-end"), _MARKERS),
    "stroke-dasharray": "the dashes of a stroke, which is cut as one line",
}
_RULED = ("display", "visibility", "transform", "overflow", *PAINT, *NOT_DONE)  # what is looked for in style sheets


def tag_of(element: ElementTree.Element) -> str:
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else "comment"


def declared(style: str) -> dict[str, str]:
    pairs = (part.split(":", 1) for part in style.split(";") if ":" in part)
    return {key.strip(): value.replace("!important", "").strip() for key, value in pairs}


def not_done(said: Mapping[str, str], is_stroked: bool) -> list[str]:
    """What is said of an object and not done to it, in the words of `NOT_DONE`, each once."""
    asked = {key for key in NOT_DONE if (said[key] or "none") not in ("none", "inherit")}
    if not is_stroked or not re.search("[1-9]", said["stroke-dasharray"]):  # dashes of no length are none
        asked.discard("stroke-dasharray")
    return list(dict.fromkeys(what for key, what in NOT_DONE.items() if key in asked))


def rules_of(root: ElementTree.Element) -> dict[str, dict[str, str]]:
    """What style sheets in the file say of what matters, by selector."""
    found: dict[str, dict[str, str]] = {}
    for element in root.iter():
        if tag_of(element) == "style":
            # by splitting: expressions that look for ends take the square of the length where there is none
            first, *commented = (element.text or "").split("/*")
            for rule in (first + "".join(text.partition("*/")[2] for text in commented)).split("}"):
                selectors, _, body = rule.rpartition("{")
                said = {key: value for key, value in declared(body).items() if key in _RULED}
                for selector in selectors.rpartition("{")[2].split(",") if said else ():
                    found.setdefault(selector.strip(), {}).update(said)
    return found
