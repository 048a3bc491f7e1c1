"""The panels in other languages: every text of theirs is in the file, and the page is in the chosen language."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import ipywidgets as widgets
import pytest

from rds.checks import check_controller, clauses
from rds.controllers import controller_names
from rds.machines import load_machine, machine_names
from rds.machines.library import library
from rds.modes.experiment.outcome import bus_note
from rds.panels.code.advice import told
from rds.panels.code.completions import words as completions
from rds.panels.equipment.build import Mark, _words
from rds.panels.equipment.fields import first_fields, parameter_fields, signal_fields
from rds.panels.interpolator.fields import Rows
from rds.panels.kit.field import FieldView
from rds.panels.page import language
from rds.panels.page.shell import Shell
from rds.panels.program.words import words
from rds.panels.registry import PANELS
from rds.panels.session import Session
from rds.panels.session.choices import Choices
from rds.panels.session.fields import Field
from rds.panels.texts import exchanger, languages, texts
from rds.references import signal_kinds
from rds.results.html import notes_list

SCRIPT = Path(language.__file__).parent / "static" / "texts.js"
APART = ("style", "code", "pre", "svg", "math")
# names of files, machines, modules and examples are the same in every language, and so are words of G-code
NAME = re.compile(
    r"[\w./-]+\.(?:py|csv|ngc|toml|tbl|var)|G\d.*|[A-Z]|[-\d.]+( to [-\d.]+)? ?\S{0,8}|\S+@\S+|g[₁₂]|– \S+|cm|in|um"
)


class Words(HTMLParser):
    """The texts of some HTML, and those of its titles."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []
        self._apart = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._apart += tag in APART
        self.found += [value for name, value in attrs if name in ("title", "aria-label") and value]

    def handle_endtag(self, tag: str) -> None:
        self._apart -= tag in APART

    def handle_data(self, data: str) -> None:
        if not self._apart:
            self.found.append(data)


def said_by(widget: Any) -> Iterator[str]:
    """What a widget and those in it say."""
    names = ("description", "tooltip", "placeholder", "tip", "label")
    found = [value for name in names if isinstance(value := getattr(widget, name, None), str)]
    for name in ("tooltips", "_options_labels", "titles"):
        found += map(str, getattr(widget, name, None) or ())
    if isinstance(widget, widgets.HTML):
        words = Words()
        words.feed(widget.value)
        found += words.found
    yield from found
    for child in getattr(widget, "children", ()) or ():
        yield from said_by(child)


def fields_of(session: Session) -> Iterator[Field]:
    """All fields of the panels, also those that come into sight when something else is chosen."""
    for choices in session._choices.values():
        yield from choices.fields.values()
    machine = load_machine(session.machine)
    for axis in machine.axes:
        for kind in ("model", "control"):
            yield from first_fields(kind, machine, axis)
        for name in controller_names():
            yield from parameter_fields(name, machine.axes[axis])
        for shape in signal_kinds():
            yield from signal_fields(shape, machine.axes[axis].unit)


@pytest.fixture
def exchange(new_page: Callable[..., Any]) -> Callable[[str, list[str]], list[str | None]]:
    """What the page makes of some texts in a language."""
    page = new_page(400, 300)
    page.set_content("<html></html>")
    script = SCRIPT.read_text(encoding="utf-8").replace("export default", "window.made =")
    page.add_script_tag(content=f"{script}\nwindow.exchanger = exchanger;")
    run = "([table, all]) => { const one = exchanger(table); return all.map(one); }"
    return lambda code, all_of: list(page.evaluate(run, [texts(code), all_of]))


@pytest.mark.parametrize("code", list(languages()))
def test_every_text_of_every_panel_is_in_the_file(code: str, exchange: Callable[..., Any], tmp_path: Path) -> None:
    shell = Shell(Session(tmp_path))
    for name in PANELS.names():
        if name != "help":  # the documents are in English
            shell.open(name)
    assert shell.on_code is not None
    shell.on_code()  # what is made once somebody looks at it
    fields = {repr(each): each for each in fields_of(shell.session) if not isinstance(each, Rows)}
    views = [FieldView(Choices([field]), field.name) for field in fields.values()]
    said = {" ".join(text.split()) for each in (shell.widget, *shell.panels.values(), *views) for text in said_by(each)}
    said |= {word["info"] for word in words()}  # of the editor of part programs, and of those of code
    said |= {
        word["info"]
        for role in ("controller", "model", "interpolator")
        for word in completions(role, ())
        if not word["info"].startswith("import ")
    }
    known = {*machine_names(), *library(), shell.session.machine, str(tmp_path), "English", *languages().values()}
    said = {text for text in said if re.search(r"[^\W\d_]{2}", text) and text not in known and not NAME.fullmatch(text)}
    found = dict(zip(sorted(said), exchange(code, sorted(said)), strict=True))
    missing = [text for text, put in found.items() if put is None]
    assert not missing, "\n".join(missing)
    assert len(said) > 600


def test_values_and_parts_are_put_where_they_belong(exchange: Callable[..., Any]) -> None:
    said = [
        "Amplitude [mm]",
        "middle to peak (from 0 to 75 mm)",
        " done: 250 samples ",
        "12.5",
        "my_file.py",
        "X error [mm]:",
    ]
    assert [exchanger("de")(text.strip()) for text in said] == [
        text and text.strip() for text in exchange("de", said)
    ]  # what pictures are labelled with, and what the browser puts
    assert exchange("de", said) == [
        "Amplitude [mm]",
        "von der Mitte bis zum Scheitel (von 0 bis 75 mm)",
        " fertig: 250 Abtastschritte ",
        None,
        None,
        "X Fehler [mm]:",
    ]


@pytest.mark.parametrize(
    ("reason", "put"),
    [
        (
            "timing met: all 250 samples were complete within their period",
            "Zeit eingehalten: alle 250 Abtastschritte waren innerhalb ihrer Periode fertig",
        ),
        (
            "timing void: the computer was busy (3 of 250 samples late, 2 periods discarded). This says nothing about "
            "your code. Repeat it on a quieter computer",
            "Zeit ungültig: der Rechner war ausgelastet (3 von 250 Abtastschritten verspätet, 2 Perioden verworfen). "
            "Das sagt nichts über Ihren Code. Auf einem ruhigeren Rechner wiederholen",
        ),
        (
            "your drawing: reaches the border of the drawing at row 1, column 3: its outline is open there; "
            "leave an empty row or column around the shape",
            "Ihre Zeichnung: reicht bis an den Rand der Zeichnung bei Zeile 1, Spalte 3: dort ist der Umriss offen; "
            "um die Form eine Zeile oder Spalte leer lassen",
        ),
        (
            "lines: 1, arcs: 0, 50.04 mm, 10.0 s at the feed; X 0 to 40, Y 0 to 30, Z -2 to 0 mm",
            "Geraden: 1, Bögen: 0, 50.04 mm, 10.0 s im Vorschub; X 0 bis 40, Y 0 bis 30, Z -2 bis 0 mm",
        ),
    ],
)
def test_a_verdict_is_in_the_language_with_its_numbers(reason: str, put: str) -> None:
    assert exchanger("de")(reason) == put


def test_each_part_of_a_note_about_the_bus_is_in_the_language() -> None:
    """The whole note has as many wordings as things can happen together; the page finds the text of each element."""
    parts = Words()
    drivers = {"missing": 830, "late": 800, "damaged": 1, "lost_ticks": 1, "cut": 3, "emergencies": 2}
    parts.feed(notes_list([bus_note(drivers, {"error_frames": 3, "struck": 1}) or ""]))
    said = [part.strip() for part in parts.found if part.strip(" ;")]
    assert len(said) == 8 and said[0] == "on the bus:"
    put = [exchanger("de")(part) or part for part in said]
    assert not set(put) & set(said)
    assert put[1].startswith("830 Antworten von Modulen kamen nicht innerhalb der Periode, 800 davon später (an ihrer")


def test_the_page_is_in_the_language_that_is_chosen_and_back_again(
    second_app: Any, open_page: Callable[..., Any]
) -> None:
    (second_app.folder / "session.json").write_text(json.dumps({"page": {"language": "de"}}))
    page = open_page(on=second_app)
    page.wait_for_selector('.rds-nav button:text-is("Regelung")')
    page.click('.rds-nav button:text-is("Regelung")')
    page.wait_for_selector('.rds-title h1:text-is("Regelung")')
    page.get_by_label("Endzeit").fill("0.25")
    page.keyboard.press("Control+Enter")
    page.wait_for_selector('.rds-notice:has-text("fertig: 250 Abtastschritte"):visible')
    assert page.get_attribute("html", "lang") == "de"
    page.select_option(".rds-language select", label="English")
    page.wait_for_selector('.rds-title h1:text-is("Equipment control")')
    page.wait_for_selector('button:visible:text-is("Run")')
    assert page.get_attribute("html", "lang") == "en"


@pytest.mark.parametrize("code", languages())
def test_what_a_check_finds_in_a_students_file_is_in_the_language(code: str) -> None:
    find = exchanger(code)
    assert all(find(each) for name, each in vars(clauses).items() if name.isupper())

    def forgets(t: Any, r: Any, y: Any, state: Any, params: Any) -> Any:
        pass

    def fails(t: Any, r: Any, y: Any, state: Any, params: Any) -> Any:
        return params["Kp"] * (r.position - y), state

    def has_no_number(t: Any, r: Any, y: Any, state: Any, params: Any) -> Any:
        return float("nan"), state

    def takes_too_few(t: Any, r: Any) -> Any:
        return 0.0, ()

    for bad in (forgets, fails, has_no_number, takes_too_few):
        for fault in check_controller(bad).faults:
            said = _words(fault)
            shown, named = find(said), find(f"law.py, line 3: {said}")
            assert shown is not None and shown != said and "rule:" not in shown, said
            assert named is not None and named.endswith(shown), named
            text = 'def control(t, r, y, state, params):\n    return params["Kp"] * (r.position - y), state\n'
            below = told(Mark(2, said), text, ["Kd"]).text  # in the editor
            assert find(below) not in (None, below), below
    assert find("law.py: 2 faults: line 3, line 7") not in (None, "law.py: 2 faults: line 3, line 7")
