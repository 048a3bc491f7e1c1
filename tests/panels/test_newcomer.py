"""A newcomer with nothing but the browser and an empty folder: from the first controller to a part and a mail."""

from __future__ import annotations

import email
import socket
from collections.abc import Callable
from email.policy import default
from typing import Any

import pytest

from tests.panels.conftest import App

MOST = {  # presses (of the mouse, of Enter) of each step; what is typed and chosen from a list counts as one each
    "write": 3,
    "break and mend": 4,
    "run in three modes": 6,  # one of them sets how long
    "change a gain live": 5,  # as here
    "compare": 4,
    "design by poles": 4,
    "cut a part": 4,
    "send the result": 3,
}
INSIDE = """() => {
    const says = document.querySelector(".rds-code-says").getBoundingClientRect();
    const seen = document.querySelector(".rds-code .cm-scroller").getBoundingClientRect();
    return says.width > 150 && says.left >= seen.left && says.right <= Math.min(seen.right, innerWidth);
}"""


class Hand:
    """Whoever uses the page; counts what is pressed, by step."""

    def __init__(self, page: Any):
        self.page = page
        self.presses: dict[str, int] = {}
        self._step = ""
        self._saved: list[str] = []  # where runs were saved

    def begin(self, step: str) -> None:
        self._step = step
        self.presses[step] = 0

    def count(self) -> None:
        self.presses[self._step] += 1

    def click(self, selector: str) -> None:
        self.count()
        self.page.click(selector)

    def press(self, text: str) -> None:
        self.click(f'button:visible:text-is("{text}")')

    def choose(self, label: str, option: str) -> None:
        self.count()
        self.page.locator(f'.rds-field:visible:has(label:text-is("{label}")) select').first.select_option(label=option)

    def type(self, label: str, value: str) -> None:
        self.count()
        box = self.page.locator(".rds-field:visible", has_text=label).first.locator("input[type=text]")
        box.fill(value)
        box.press("Tab")

    def sees(self, text: str) -> None:
        self.page.wait_for_selector(f':text("{text}"):visible')

    def keys(self, keys: str) -> None:
        self.count()
        self.page.keyboard.press(keys)

    def tab(self, title: str) -> None:
        self.click(f'.lm-TabBar-tab:visible:has-text("{title}")')

    def saved_anew(self) -> None:
        """Wait for the files of a run that is none of those before."""
        self.page.wait_for_function(
            """(before) => [...document.querySelectorAll('code')].some((each) => each.offsetParent
                && each.parentElement.innerText.startsWith('Saved with') && !before.includes(each.innerText))""",
            arg=self._saved,
        )
        self._saved.append(self.page.inner_text(':text("Saved with its report in"):visible code'))


class Box:
    """A mail server's."""

    def __init__(self) -> None:
        self.mails: list[Any] = []

    async def handle_DATA(self, server: Any, session: Any, envelope: Any) -> str:
        self.mails.append(envelope.content)
        return "250 taken"


def test_a_newcomer_gets_from_an_empty_folder_to_a_part_and_a_mail(
    second_app: App, open_page: Callable[..., Any], capsys: pytest.CaptureFixture[str]
) -> None:
    aiosmtpd_controller = pytest.importorskip("aiosmtpd.controller", reason="aiosmtpd is not installed")
    for left in ("*.py", "*.ngc", "*.toml", "session.json"):
        for each in second_app.folder.glob(left):
            each.unlink()
    page = open_page(on=second_app)
    page.wait_for_selector(".rds-first svg")  # an axis moves before anything is pressed
    hand = Hand(page)

    hand.begin("write")
    hand.click('.rds-nav button:text-is("Equipment control")')
    page.wait_for_selector('.rds-title h1:text-is("Equipment control")')
    hand.choose("Controller", "User-defined")
    page.wait_for_selector('.cm-line:has-text("def control(t, r, y, state, params):")')
    hand.click('.cm-line:has-text("error = r.position")')
    page.keyboard.press("End")
    page.keyboard.type("\nslower = 0.5 * error")
    hand.sees("the controller keeps its interface")

    hand.begin("break and mend")
    hand.click('.cm-line:has-text("slower = 0.5")')
    page.keyboard.press("End")
    page.keyboard.type(" + r.positoin")
    page.wait_for_selector('.rds-code-says:has-text("Did you mean r.position?")')
    assert "r.positoin" in page.locator(".rds-code-bad").inner_text()
    page.set_viewport_size({"width": 390, "height": 800})  # a telephone's: the fault is broken into lines, not cut off
    page.wait_for_function(INSIDE)
    page.set_viewport_size({"width": 1280, "height": 800})
    for _ in " + r.positoin":
        page.keyboard.press("Backspace")
    page.wait_for_selector(".rds-code-says", state="hidden")

    hand.begin("run in three modes")
    hand.type("Final time", "0.5")
    for mode in ("", "Emulation", "Implementation"):
        if mode:
            hand.choose("Mode", mode)
        hand.keys("Control+Enter")
        hand.saved_anew()

    hand.begin("change a gain live")
    hand.choose("Mode", "Emulation")
    hand.type("Final time", "600")
    hand.keys("Control+Enter")
    gain = page.locator(".rds-live-values .rds-field:visible", has_text="Kp").locator("input[type=text]")
    page.wait_for_function("+(document.querySelector('[data-samples]')?.dataset.samples || 0) > 20")
    hand.count()
    gain.fill("30")
    gain.press("Enter")
    page.wait_for_selector('[data-marks$="X.Kp 30"]')
    hand.press("Stop")
    hand.sees("ended early: stopped")
    hand.saved_anew()

    hand.begin("compare")
    hand.tab("Earlier runs")
    rows = page.locator(".rds-runs tbody tr")
    for k in (0, 1):
        hand.count()
        rows.nth(k).locator("input[type=checkbox]").check()
    hand.press("What differs")
    page.wait_for_selector('.rds-main td:text-is("changed while it ran"):visible')

    hand.begin("design by poles")
    hand.click('.rds-nav button:text-is("Design")')
    page.wait_for_selector('.rds-title h1:text-is("Design")')
    page.wait_for_selector('button:text-is("Write the file"):enabled')
    hand.count()
    page.locator("[role=slider][aria-valuetext]").first.press("ArrowLeft")
    hand.press("Write the file")
    page.wait_for_selector('.rds-notice-good:has-text("Try it opens it beside Run")')
    hand.press("Try it")
    page.wait_for_selector('.rds-title h1:text-is("Equipment control")')

    hand.begin("cut a part")
    hand.click('.rds-nav button:text-is("Program")')
    page.wait_for_selector('.rds-verdict .rds-notice-good:has-text("the machine can run it")')
    hand.keys("Control+Enter")
    page.wait_for_selector('.rds-main :text("against the part as programmed"):visible')
    assert page.locator('.rds-main :text("as measured, by tool"):visible').count()

    hand.begin("send the result")
    hand.sees("Saved with its report in")
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        port = found.getsockname()[1]
    words = f'host = "127.0.0.1"\nport = {port}\nsecurity = "none"\nsender = "lab@example.edu"\n'
    (second_app.folder / "email.toml").write_text(words)  # the laboratory's
    box = Box()
    server = aiosmtpd_controller.Controller(box, hostname="127.0.0.1", port=port)
    server.start()
    try:
        hand.type("E-mail to", "me@example.edu")
        hand.press("Send")
        hand.sees("sent to me@example.edu: program.html, result.csv")
    finally:
        server.stop()
    parts = email.message_from_bytes(box.mails[0], policy=default).iter_attachments()
    assert [part.get_filename() for part in parts] == ["program.html", "result.csv"]

    warned = [said for said in page.warned if "onnection" not in said]  # which a busy computer may lose for a moment
    assert not warned, warned
    with capsys.disabled():
        print("\npresses of a newcomer:", ", ".join(f"{step} {count}" for step, count in hand.presses.items()))
    assert {step: count for step, count in hand.presses.items() if count > MOST[step]} == {}
