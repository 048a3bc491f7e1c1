"""What a page says to its kernel can be lost with a connection that breaks: it goes on, and claims nothing false."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rds.panels.jog import loop
from tests.panels.conftest import App, begin_with, turn_to

LOSES = """
window.lost = null; // the kind of words that are lost
window.tried = 0; // how many of them
const Real = window.WebSocket;
window.WebSocket = class extends Real {
  send(data) {
    const text = typeof data === "string" ? data : new TextDecoder().decode(data);
    if (window.lost !== null && text.includes(`"kind":"${window.lost}"`)) window.tried += 1;
    else super.send(data);
  }
};
"""
HELD = 7000  # ms of the page's clock after which it says that it gets no answer


@pytest.fixture(scope="module")
def losing_page(app: App, new_page_for_all: Callable[..., Any]) -> Any:
    """A page whose words can be lost."""
    page = new_page_for_all(1280, 800, clock=True)
    page.add_init_script(LOSES)
    page.goto(app.url)
    return page


@pytest.fixture
def page(losing_page: Any, spoiled: bool) -> Any:
    """The same, of which nothing is lost yet; loaded again after a test that failed."""
    if spoiled:
        losing_page.reload()
    losing_page.keyboard.up("Enter")
    losing_page.wait_for_selector(".rds-rescue-box", state="attached")
    losing_page.evaluate("window.lost = null; window.tried = 0")
    return losing_page


def test_a_page_whose_words_were_lost_is_answered_again(page: Any) -> None:
    page.evaluate("window.lost = 'beat'")
    page.clock.run_for(HELD)
    page.wait_for_selector('.rds-rescue p:has-text("gets no answer")')
    page.evaluate("window.lost = null")
    page.clock.run_for(HELD)
    page.wait_for_selector(".rds-rescue-box", state="hidden")


def test_a_button_whose_word_was_lost_can_be_pressed_again(page: Any) -> None:
    turn_to(page, "Main menu")
    page.click('.rds-head button:text-is("Dark")')  # a field, whose change the next click does not overtake
    page.evaluate("window.lost = 'settle'")
    page.click('.rds-nav button:text-is("Jog")')
    page.evaluate("window.lost = null")
    assert page.locator('.rds-title h1:text-is("Jog")').count() == 0
    page.click('.rds-nav button:text-is("Jog")')
    page.wait_for_selector('.rds-title h1:text-is("Jog")')


@pytest.mark.parametrize(
    "kind, label, most", [("hold", "X plus", 10), ("turn", "spindle forward", 5)], ids=["held", "turning"]
)
def test_a_hand_that_is_not_heard_lets_go(page: Any, kind: str, label: str, most: int) -> None:
    page.click('.rds-nav button:text-is("Jog")')
    page.click('button:text-is("while held")')  # another page of this folder may have chosen steps
    for panel in ("Drawing", "Jog"):  # behind whose titles the choice has come back
        page.click(f'.rds-nav button:text-is("{panel}")')
        page.wait_for_selector(f'.rds-title h1:text-is("{panel}")')
    press = page.locator(f'button[aria-label="{label}"]')
    press.wait_for()
    press.evaluate("(button) => { button.disabled = false; }")  # as if the machine were taken
    page.evaluate(f"window.lost = '{kind}'")
    press.focus()
    page.keyboard.down("Enter")
    page.wait_for_selector(".rds-hold-on")
    page.clock.run_for(5000)
    assert page.evaluate("window.tried") == most
    assert page.locator(".rds-hold-on").count() == 0


@pytest.mark.parametrize("script, label, event", [("hold.js", "X plus", "keydown"), ("turn.js", "X forward", "click")])
def test_a_hand_that_was_not_heard_is_given_time_to_be_heard_again(
    new_page: Callable[..., Any], script: str, label: str, event: str
) -> None:
    page = new_page(400, 300)
    page.set_content("<html></html>")
    text = (Path(loop.__file__).parent / "static" / script).read_text(encoding="utf-8")
    page.add_script_tag(content=text.replace("export default", "window.made ="))
    page.evaluate("setInterval = (beat) => { window.beat = beat; }")
    page.evaluate(
        "made.render({ el: document.body, model: {"
        " get: (name) => ({ axis: 'X', spindle: 'X', disabled: false, by_step: false })[name],"
        " on: () => {}, off: () => {}, send: () => {} } })"
    )
    press = page.locator(f'button[aria-label="{label}"]')
    for _ in range(2):
        press.dispatch_event(event, {"key": "Enter"})
        page.evaluate("beat(); beat()")
        assert page.locator(".rds-hold-on").count() == 1
        page.evaluate("for (let n = 0; n < 10 && document.querySelector('.rds-hold-on'); n += 1) beat()")
        assert page.locator(".rds-hold-on").count() == 0


MISSES = """
window.deaf = true;
window.missed = 0; // words that said what the strip draws
const Heard = window.WebSocket;
window.WebSocket = class extends Heard {
  set onmessage(hear) {
    super.onmessage = (event) => {
      const text = typeof event.data === "string" ? event.data : new TextDecoder().decode(event.data);
      if (window.deaf && text.includes('"traces"') && text.includes('"update"')) window.missed += 1;
      else hear(event);
    };
  }
};
"""


def test_a_strip_that_missed_what_it_draws_asks_again(
    second_app: App, folders: set[Path], new_page: Callable[..., Any]
) -> None:
    """It stayed empty until the end of the run, beside a progress bar that went on."""
    begin_with(second_app, duration=0.5)
    page = new_page(1280, 800)
    folders.add(second_app.folder)
    page.add_init_script(MISSES)
    page.goto(second_app.url)
    page.click('.rds-nav button:text-is("Equipment control")')
    page.click('button:visible:text-is("Run")')
    page.wait_for_selector(':text("RMS error"):visible')
    page.click('.lm-TabBar-tab:visible:has-text("Live")')
    page.wait_for_function("window.missed > 0 && document.querySelector('.rds-strip').clientWidth")
    assert page.locator(".rds-strip canvas").count() == 0
    page.evaluate("window.deaf = false")
    page.wait_for_selector(".rds-strip canvas:visible")
