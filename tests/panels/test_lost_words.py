"""What a page says to its kernel can be lost with a connection that breaks: it does not claim then to get no answer."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tests.panels.conftest import App

LOSES = """
window.losing = false;
const Real = window.WebSocket;
window.WebSocket = class extends Real {
  send(data) {
    const text = typeof data === "string" ? data : new TextDecoder().decode(data);
    if (!window.losing || !text.includes('"beat"')) super.send(data);
  }
};
"""
HELD = 7000  # ms of the page's clock after which it says that it gets no answer


def test_a_page_whose_words_were_lost_is_answered_again(app: App, new_page: Callable[[int, int], Any]) -> None:
    page = new_page(1280, 800)
    page.add_init_script(LOSES)
    page.clock.install()
    page.goto(app.url)
    page.wait_for_selector(".rds-rescue-box", state="attached")
    page.evaluate("window.losing = true")
    page.clock.run_for(HELD)
    page.wait_for_selector('.rds-rescue p:has-text("gets no answer")')
    page.evaluate("window.losing = false")
    page.clock.run_for(HELD)
    page.wait_for_selector(".rds-rescue-box", state="hidden")
