"""The design panel in a browser: poles moved by mouse and by keyboard, what follows them, and the file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from rds.panels.design.picture import design_picture
from rds.panels.design.state import Design
from rds.panels.session import Session
from tests.panels.conftest import App

WHOLE = """() => {
    const [plane, band, last] = ["svg", ".rds-splane-unstable", "[data-pole=pair]"].map(
        (each) => document.querySelector(`.rds-splane ${each}`)?.getBoundingClientRect());
    const place = document.querySelector(".rds-splane-row").getBoundingClientRect();
    return band && plane.width > 250 && plane.right <= place.right + 1 && band.right <= plane.right
        && band.width > 5 && last.left > plane.left && last.right < band.left;
}"""


def _numbers(page: Any) -> str:
    return str(page.inner_text(".rds-splane-row .scroll"))


def _shows(page: Any, label: str, value: str) -> None:
    field = page.locator(f'.rds-field:has(.rds-label:has-text("{label}")) input').element_handle()
    page.wait_for_function("([field, value]) => field.value === value", arg=[field, value])


def _type(page: Any, label: str, text: str) -> None:
    field = page.locator(f'.rds-field:has(.rds-label:has-text("{label}")) input')
    field.fill(text)
    field.press("Enter")


def _ready(page: Any) -> Any:
    """The first pole of the panel, at the place where it begins."""
    _type(page, "Real part", "-32")
    _type(page, "Imaginary part", "24")
    page.wait_for_selector('.rds-splane-row .scroll:has-text("1600")')
    pole = page.locator('.rds-splane-pole[tabindex="0"]').first
    pole.wait_for()
    page.wait_for_function("document.querySelectorAll('.rds-curves svg').length == 6")
    return pole


def test_a_pole_is_moved_with_the_mouse_and_the_keys_and_the_design_follows(same_page: Callable[[str], Any]) -> None:
    page = same_page("Design")
    pole = _ready(page)
    assert "1600" in _numbers(page)
    while (box := pole.bounding_box()) is None:  # while it is drawn anew
        page.wait_for_timeout(50)
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x - 60, y - 20, steps=6)
    page.wait_for_function("!document.querySelector('.rds-splane-row .scroll').innerText.includes('1600')")
    page.mouse.up()
    page.wait_for_function("""() => {
        const labels = [...document.querySelectorAll('.rds-label')];
        const value = (name) => parseFloat(labels.find((each) => each.innerText.includes(name))
            .closest('.rds-field').querySelector('input').value);
        const real = value('Real part'), imaginary = value('Imaginary part');
        const gain = /g₁\\s+(\\S+)/.exec(document.querySelector('.rds-splane-row .scroll').innerText);
        return real < -35 && imaginary > 24 && Math.abs(parseFloat(gain[1]) / (real ** 2 + imaginary ** 2) - 1) < 1e-3;
    }""")
    page.wait_for_selector('.rds-main:has-text("axes drawn from the ranges")')

    _type(page, "Real part", "-32")
    _type(page, "Imaginary part", "24")
    page.wait_for_selector('.rds-splane-row .scroll:has-text("1600")')
    pole = page.locator('.rds-splane-pole[tabindex="0"]').first
    assert pole.get_attribute("role") == "slider" and pole.get_attribute("aria-label") == "pair of poles"
    pole.focus()
    page.keyboard.press("ArrowLeft")
    page.wait_for_selector('[aria-valuetext="-33.00 ± 24.00 i, 1/s"]')
    page.keyboard.press("Shift+ArrowUp")  # the pole has kept the focus
    page.wait_for_selector('[aria-valuetext="-33.00 ± 34.00 i, 1/s"]')
    page.wait_for_selector(f'.rds-splane-row .scroll:has-text("{33**2 + 34**2}")')
    _shows(page, "Real part", "-33")
    _shows(page, "Imaginary part", "34")


def test_a_place_that_is_not_stable_is_refused_with_the_reason_in_the_dark_too(same_page: Callable[[str], Any]) -> None:
    page = same_page("Design")
    page.click('button:text-is("Dark")')
    pole = _ready(page)
    page.wait_for_selector('.rds-main:has-text("axes drawn from the ranges")')
    for width in (1280, 640, 390):  # made narrower, the plane shows what it showed, to its right edge
        page.set_viewport_size({"width": width, "height": 800})
        page.wait_for_function(WHOLE)
    page.set_viewport_size({"width": 1280, "height": 800})
    assert page.evaluate("document.documentElement.scrollWidth") <= 1280
    _type(page, "Real part", "-5")
    page.wait_for_selector('[aria-valuetext^="-5.000 ±"]')
    pole = page.locator('.rds-splane-pole[tabindex="0"]').first
    pole.focus()
    page.keyboard.press("Shift+ArrowRight")
    page.wait_for_selector('.rds-notice-error:has-text("its real part must be less than 0")')
    page.wait_for_selector('[aria-valuetext^="-5.000 ±"]')
    _shows(page, "Real part", "-5")
    _type(page, "Real part", "7")
    page.wait_for_selector('.rds-refusal:has-text("from -100000 to -0.1 1/s")')
    _type(page, "Real part", "-5")
    _type(page, "Imaginary part", "3000")
    page.wait_for_selector('.rds-notice-error:has-text("make the sampled loop unstable")')
    page.wait_for_selector('button:text-is("Write the file"):disabled')
    _type(page, "Imaginary part", "24")
    page.wait_for_selector(".rds-splane-row .scroll")


def test_the_file_is_written_checked_asked_about_and_tried(same_page: Callable[[str], Any], app: App) -> None:
    page = same_page("Design")
    _ready(page)
    _type(page, "File", "dragged.py")
    page.click('button:text-is("Write the file")')
    page.wait_for_selector('.rds-notice-good:has-text("dragged.py: the controller keeps its interface")')
    first = (app.folder / "dragged.py").read_text()
    _type(page, "Real part", "-45")
    page.wait_for_selector('[aria-valuetext^="-45.00"]')
    page.click('button:text-is("Write the file")')
    page.wait_for_selector('.rds-notice-error:has-text("is there already")')
    assert (app.folder / "dragged.py").read_text() == first
    page.click('button:text-is("Replace it")')
    page.wait_for_selector('.rds-notice-good:has-text("wrote dragged.py")')
    assert (app.folder / "dragged.py").read_text() != first
    page.click('button:text-is("Try it")')
    page.wait_for_selector('.rds-title h1:text-is("Equipment control")')
    page.wait_for_function("[...document.querySelectorAll('input')].some((each) => each.value == 'dragged.py')")


def test_a_design_is_kept_as_a_picture_that_replaces_none(tmp_path: Path) -> None:
    design = Design(Session(tmp_path))
    picture = design_picture(design.now(), 1.0, None)
    drawn = [axes for axes in picture.axes if axes.axison]
    assert len(drawn) == 7 and all("[" in axes.get_xlabel() or "part" in axes.get_xlabel() for axes in drawn)
    assert "-32 ± 24 i" in picture.get_suptitle()
    names = [design.keep_picture(b"a picture").name for _ in range(2)]
    assert names == ["my_tracking-1.png", "my_tracking-2.png"]
