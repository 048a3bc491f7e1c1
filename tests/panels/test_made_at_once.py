"""What a panel tells the page as it is made: each widget once, as it is in the end, and nothing before it is known."""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import comm
import ipywidgets as widgets
import pytest
from comm.base_comm import BaseComm
from ipywidgets.widgets.widget import _instances

from rds.panels.kit import made_at_once as made
from rds.panels.kit.made_at_once import made_at_once
from rds.panels.page.shell import Shell
from rds.panels.registry import PANELS
from rds.panels.session import Session


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[tuple[str, str, Any]]]:
    """What the page is sent: the kind of message, whom it is for, and what it says."""
    sent: list[tuple[str, str, Any]] = []

    class Channel(BaseComm):
        def publish_msg(self, msg_type: str, data: Any = None, **_: Any) -> None:
            sent.append((msg_type, self.comm_id, data or {}))

    monkeypatch.setattr(comm, "create_comm", lambda **options: Channel(**options))
    monkeypatch.setattr(made, "_ORIGINALS", {})
    yield sent


def page_of(said: list[tuple[str, str, Any]]) -> dict[str, dict[str, Any]]:
    """What the page makes of it; no message names a widget that it has not heard of."""
    known: dict[str, dict[str, Any]] = {}
    for kind, whose, data in said:
        if kind == "comm_close":
            continue
        for named in re.findall(r"IPY_MODEL_(\w+)", str(data)):
            assert named in known, f"{data} names an unknown widget"
        if kind == "comm_open":
            known[whose] = dict(data["state"])
        elif data["method"] == "update":
            known[whose].update(data["state"])
    return known


def test_a_panel_is_told_in_a_message_for_each_of_its_widgets_and_is_what_the_kernel_has(
    said: list[tuple[str, str, Any]], tmp_path: Path
) -> None:
    shell = Shell(Session(tmp_path))
    for name in PANELS.names():
        if name in ("menu", "help"):
            continue
        said.clear()
        before = set(_instances)
        shell.open(name)
        opened = [whose for kind, whose, _ in said if kind == "comm_open"]
        assert set(opened) == set(_instances) - before and len(opened) == len(set(opened)), name
        assert len(said) < 1.15 * len(opened) + 10, name  # the page itself changes a little
        plain = [data["state"]["_model_name"] for kind, _, data in said if kind == "comm_open"]
        assert plain.count("HTMLStyleModel") <= 1 and plain.count("LayoutModel") < len(plain) / 5, name


def test_what_was_made_at_once_follows_each_change_and_no_other_widget_does(said: list[tuple[str, str, Any]]) -> None:
    with made_at_once():
        texts = [widgets.HTML(f"{k}") for k in range(3)]
        box = widgets.VBox()  # made before what it shows
        late = widgets.Button(description="late")
        box.children = [*texts, late]
        late.send({"kind": "hello"})
        late.add_class("rds-late")
        assert said == []
    page = page_of(said)
    assert len(page) == 5 + 3  # one layout, two styles: of HTML, and of buttons
    assert [each["method"] for kind, _, each in said if kind == "comm_msg"] == ["custom"]
    assert list(page[late.model_id]["_dom_classes"]) == ["rds-late"]
    assert page[box.model_id]["children"] == [f"IPY_MODEL_{each.model_id}" for each in box.children]
    assert len({page[each.model_id]["layout"] for each in (*texts, box, late)}) == 1

    texts[1].layout.display = "none"
    texts[1].layout.display = ""
    texts[1].layout.width = "3px"
    texts[2].style.description_width = "7px"
    page = page_of(said)

    def look(widget: Any, name: str) -> Any:
        return page[page[widget.model_id][name].removeprefix("IPY_MODEL_")]

    assert [look(each, "layout")["width"] for each in (*texts, box, late)] == [None, "3px", None, None, None]
    assert [look(each, "style")["description_width"] for each in texts] == ["", "", "7px"]
    for whose in page:  # a page that is loaded again asks for all states
        state = _instances[whose].get_state()
        assert {name: state[name] for name in page[whose]} == page[whose]


def test_what_ends_takes_no_shared_layout_along(said: list[tuple[str, str, Any]]) -> None:
    with made_at_once():
        first, second = widgets.HTML("1"), widgets.HTML("2")
        forgotten = widgets.HTML("3")
        forgotten.close()
    shared = first.layout.model_id
    assert shared == second.layout.model_id
    for part in (first.layout, first.style, first):  # as a figure's are
        part.close()
    assert _instances[shared].comm is not None and second.layout.model_id == shared
    assert [whose for kind, whose, _ in said if kind == "comm_close"] == [said[-1][1]]
    with made_at_once():
        third = widgets.HTML("4")
    assert third.layout.model_id == shared
    page_of(said)


def test_a_layout_that_the_user_gives_to_another_widget_too_changes_both(said: list[tuple[str, str, Any]]) -> None:
    with made_at_once():
        owner = widgets.HTML("1")
    also = widgets.HTML("2", layout=owner.layout)
    owner.layout.width = "3px"
    page = page_of(said)
    looks = {page[each.model_id]["layout"].removeprefix("IPY_MODEL_") for each in (owner, also)}
    assert [page[look]["width"] for look in looks] == ["3px"]


def test_what_another_thread_makes_meanwhile_is_told_as_always(said: list[tuple[str, str, Any]]) -> None:
    with made_at_once():
        widgets.HTML("waits")
        other = threading.Thread(target=widgets.HTML, args=("does not",))
        other.start()
        other.join()
        assert [data["state"].get("value") for _, _, data in said][-1] == "does not"
    assert [data["state"].get("value") for _, _, data in said][-1] == "waits"
