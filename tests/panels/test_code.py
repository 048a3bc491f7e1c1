"""Code written in the page: from the template to a run, a fault at its line, mended, and back to an earlier version."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tests.panels.conftest import App

DROP = """async (text) => {
    const files = new DataTransfer();
    files.items.add(new File([text], "dropped.py", { type: "text/x-python" }));
    document.querySelector(".rds-code").dispatchEvent(new DragEvent("drop", { dataTransfer: files, cancelable: true }));
}"""


def test_a_controller_is_written_broken_mended_and_run(second_app: App, open_page: Callable[..., Any]) -> None:
    for old in second_app.folder.glob("*.py"):
        old.unlink()
    (second_app.folder / "session.json").unlink(missing_ok=True)
    page = open_page("Equipment control", on=second_app, width=640)
    page.locator('.rds-field:visible:has-text("Controller") select').first.select_option(label="User-defined")
    page.wait_for_selector('.cm-line:has-text("def control(t, r, y, state, params):")')  # nobody need look for it
    page.locator('.rds-field:visible:has-text("Final time") input').fill("0.2")

    page.click('.cm-line:has-text("error = r.position")')
    page.keyboard.press("End")
    page.keyboard.type("\nlast = r.accel")
    page.wait_for_selector('.cm-tooltip-autocomplete li:has-text("acceleration")')
    assert page.inner_text(".cm-completionDetail") == "mm/s²"
    page.keyboard.type("eration - r.positoin")
    fault = page.wait_for_selector('.rds-code-says:has-text("Did you mean r.position?")')
    line = page.locator(".rds-code-bad")
    assert "r.positoin" in line.inner_text()
    assert 0 <= fault.bounding_box()["y"] - line.bounding_box()["y"] - line.bounding_box()["height"] < 3
    page.wait_for_selector('.rds-main .rds-notice:has-text("my_controller.py: 1 fault: line 20")')
    page.keyboard.press("Control+Enter")  # what does not keep its interface is not run, and stays in sight
    page.wait_for_selector('.rds-notice [role=alert]:has-text("positoin")')
    page.wait_for_selector('.rds-code[data-at="20"]')  # at the end of that line
    for _ in "r.positoin":
        page.keyboard.press("Backspace")
    page.keyboard.type("last")
    page.wait_for_selector(':text("cannot access local variable"):visible, :text("referenced before"):visible')
    for _ in "last":
        page.keyboard.press("Backspace")
    page.keyboard.type("y")
    page.wait_for_selector('.rds-notice:has-text("the controller keeps its interface"):visible')
    assert page.locator(".rds-code-says").count() == 0
    page.click('button:visible:text-is("Run this file")')
    page.wait_for_selector(':text("done: 200 samples"):visible')
    assert "last = r.acceleration - y" in (second_app.folder / "my_controller.py").read_text()

    page.click('.lm-TabBar-tab:visible:has-text("Code")')
    page.click('.jupyter-widget-Collapse-header:visible:has-text("Versions (2)")')
    versions = page.locator('.widget-dropdown:visible:has-text("Version") select')
    versions.select_option(index=1)
    page.wait_for_selector('.rds-code-changes b.gone:has-text("r.positoin")')
    versions.select_option(index=2)
    page.click('button:text-is("Back to this version")')
    page.wait_for_selector('.rds-code-bad:has-text("- r.positoin")')

    page.evaluate(DROP, "def control(t, r, y, state, params):\n    return 2.0 * (r.position - y), state\n")
    page.wait_for_selector('.rds-notice:has-text("dropped.py is in your folder now")')
    page.wait_for_selector('.cm-line:has-text("return 2.0 * (r.position - y), state")')
    assert page.evaluate("document.documentElement.scrollWidth") <= 640
