"""An order to the machine that was pressed while the page's kernel stood still is not carried out when that is over."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from rds.core.errors import InputError
from rds.modes import mode_names
from rds.panels.equipment.result_actions import ResultActions
from rds.panels.grading.panel import GradingView
from rds.panels.interpolator.panel import InterpolatorView
from rds.panels.interpolator.state import Interpolating
from rds.panels.jog.hold import HoldButtons
from rds.panels.jog.panel import JogView
from rds.panels.jog.state import Jog
from rds.panels.jog.turn import TurnButtons
from rds.panels.kit.button import run_order
from rds.panels.kit.field import FieldView
from rds.panels.kit.notice import Notice
from rds.panels.machine.bus_view import BusView
from rds.panels.machine.controllers_view import ControllersView
from rds.panels.machine.state import MachineState
from rds.panels.page.presence import Presence
from rds.panels.page.shell import Shell
from rds.panels.program.operator import Operator
from rds.panels.program.setup_view import SetupView
from rds.panels.program.state import Program, program_choices
from rds.panels.session import Session
from rds.panels.session.choices import Choices
from rds.panels.session.expired_orders import LATE
from rds.panels.session.fields import Choice

KEEPS = """
window.sent = []; // what the page said of its buttons
window.kept = null; // words under way, while nothing goes through
const words = ['"kind":"settle"', '"kind":"go"', '"kind":"late"', '"kind":"step"', '"event":"click"'];
const Real = window.WebSocket;
window.WebSocket = class extends Real {
  send(data) {
    const text = typeof data === "string" ? data : new TextDecoder().decode(data);
    for (const word of words) if (text.includes(word)) window.sent.push(word.split('"')[3]);
    if (window.kept === null) super.send(data);
    else window.kept.push(() => super.send(data));
  }
};
window.goOn = () => { const kept = window.kept; window.kept = null; for (const each of kept) each(); };
"""
STEP, HOME, STOP = 'button[aria-label="X plus"]', 'button:visible:text-is("Home")', 'button:visible:text-is("Stop")'


def test_what_was_pressed_while_the_kernel_stood_still_moves_nothing_when_it_comes_back(
    app: Any, new_page: Callable[..., Any]
) -> None:
    page = new_page(1280, 800, clock=True)
    page.add_init_script(KEEPS)
    page.goto(app.url)
    page.click('.rds-nav button:text-is("Jog")')
    page.click('button:text-is("by step")')
    page.wait_for_selector(f"{STEP}.rds-order")  # the choice has come back
    for each in (STEP, HOME, STOP):  # as if the machine were taken
        page.locator(each).first.evaluate("(button) => { button.disabled = false; }")
    page.click('.rds-group:has-text("Motion") input')  # what was typed before is settled

    def press(wait: int, *buttons: str) -> None:
        """The kernel comes back `wait` ms after these buttons were pressed."""
        page.evaluate("window.kept = []")
        for each in buttons:
            page.locator(each).first.press("Enter")
        page.clock.run_for(wait)
        page.evaluate("window.goOn()")

    for button, said in ((STEP, "X plus was pressed 7 s ago"), (HOME, "Home was pressed 7 s ago")):
        page.evaluate("window.sent = []")
        press(7000, button)
        page.wait_for_selector(f'.rds-notice-warning:has-text("{said}, while this page was busy")')
        assert page.evaluate("window.sent") == ["settle", "late"]
    page.evaluate("window.sent = []")
    press(500, HOME, STOP)  # nothing that was pressed before Stop comes after it
    page.locator(HOME).evaluate("(button) => button.classList.remove('rds-order')")
    page.locator('.rds-group:has-text("Motion") input').first.press("End")
    press(500, HOME, STOP)  # nor what the page does not know yet to be an order: Run, after another mode was chosen
    press(500, STEP)
    page.wait_for_function("window.sent.includes('step')")
    assert page.evaluate("window.sent") == ["settle", "click", "settle", "click", "settle", "go", "step"]
    page.evaluate("window.sent = []")
    page.locator('.rds-group:has-text("Motion") input').first.press("End")  # a field that may have made an order of it
    press(500, '.rds-nav button:text-is("Jog")')
    page.wait_for_function("window.sent.includes('click')")
    assert page.evaluate("window.sent") == ["settle", "go", "click"]


def test_an_order_that_the_kernel_comes_to_late_is_refused_and_the_next_one_is_not() -> None:
    late: list[str] = []
    page = Presence(lambda: None, late.append)
    for stood_still in (False, True):
        page._said(None, {"kind": "settle", "number": 7}, None)
        if stood_still:
            page._answered[7] -= LATE + 3.5
        page._said(None, {"kind": "go", "number": 7, "age": 500.0}, None)
        if stood_still:
            with pytest.raises(InputError, match=r"Home was pressed 7 s ago, .* press it again"):
                page.in_time("Home")
        page.in_time("Home")
    page._said(None, {"kind": "go", "number": 7, "age": 1.0}, None)  # an answer lets one press go
    with pytest.raises(InputError):
        page.in_time("Home")
    for word in ({"kind": "late", "what": "Home", "age": float("nan")}, {"kind": "go", "number": "7"}, {}, 3, None):
        page._said(None, word, None)
    assert late == []


def test_a_late_run_is_refused_only_where_something_moves(tmp_path: Path) -> None:
    modes = {name: name for name in mode_names()}
    choices, said = Choices([Choice("mode", "Mode", "what runs", "simulation", modes)]), Notice()
    begun: list[str] = []
    shell = Shell(Session(tmp_path))
    run = run_order(shell, "", lambda: begun.append(choices["mode"]), said, choices)
    for mode in modes:
        choices.set("mode", mode)
        shell.presence._age = 7.0
        run.click()
        shell.presence._age = 0.0
    assert begun == ["simulation", "emulation"]
    assert "Run was pressed 7 s ago" in said.value


class Running:
    """A program that runs, for whoever changes its override."""

    operable = held = True
    steps = waits = False  # neither line by line nor for a confirmation

    def __init__(self) -> None:
        self.shares: list[float] = []

    def status(self) -> None:
        """Not known."""

    def override(self, share: float) -> None:
        """Note it."""
        self.shares.append(share)


def test_a_late_override_is_refused_where_it_is_more_and_taken_where_it_is_less(tmp_path: Path) -> None:
    shell, said = Shell(Session(tmp_path)), Notice()
    choices = program_choices(shell.session)
    operator = Operator(shell, choices, said, lambda: None, lambda: None)
    slider, work = operator.override, Running()

    def ask(percent: float, age: float, ordered: bool = True) -> None:
        said.clear()
        shell.presence._age = age
        slider._told(None, {"kind": "set", "percent": percent, "ordered": ordered, "number": 1}, None)

    ask(120.0, math.inf, ordered=False)  # nothing runs
    assert choices["override"] == slider.value == 120.0 and not slider.disabled
    operator.work = work  # type: ignore[assignment]
    operator.enable()
    assert slider.moves
    ask(150.0, 7.0)
    assert "The override was moved 7 s ago" in said.value and "move it again" in said.value
    ask(150.0, 0.0, ordered=False)
    assert "The override was moved too long ago" in said.value
    ask(50.0, 7.0, ordered=False)
    ask(80.0, 1.0)
    for wrong in (math.nan, "90", True, None):
        ask(wrong, 0.0)  # type: ignore[arg-type]
    assert work.shares == [0.5, 0.8] and choices["override"] == slider.value == 80.0 and not said.value
    work.operable = False
    operator.enable()
    ask(10.0, 0.0)
    assert slider.disabled and "cannot be changed now" in said.value and choices["override"] == 80.0


@pytest.mark.parametrize("kind", ["step", "turn"])
def test_a_late_step_and_a_late_turn_are_said_and_not_done(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shell = Shell(Session(tmp_path))
    jog = Jog(shell.session)
    monkeypatch.setattr(jog, kind, lambda *_: pytest.fail("it moves"))
    view = JogView(shell, jog)
    shell.presence._age = 7.0
    buttons = view._holds["X"] if kind == "step" else view._turns["spindle"]
    buttons._told(None, {"kind": kind, "direction": 1}, None)
    assert "pressed 7 s ago" in view.notice.value


def test_words_of_a_held_button_that_come_all_at_once_move_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    heard: list[str] = []
    now = [100.0]
    monkeypatch.setattr("rds.panels.jog.answers.time", SimpleNamespace(monotonic=lambda: now[0]))
    for made, kind, lasts in ((HoldButtons, "hold", 0.5), (TurnButtons, "turn", 1.0)):
        buttons = made(lambda kind, direction: heard.append(kind))
        answers: list[Any] = []
        monkeypatch.setattr(buttons, "send", answers.append)

        def say(answer: Any, buttons: Any = buttons, kind: str = kind) -> int:
            buttons._told(None, {"kind": kind, "direction": 1, "answer": answer}, None)
            return len(heard)

        first = say(None)
        assert first == (kind == "turn")  # an order, of which presence.js knows how old it is
        assert say(answers[-1]["number"]) == first + 1
        last = answers[-1]["number"]
        now[0] += lasts - 0.1
        assert say(last) == first + 2
        now[0] += 7.0  # nothing goes through
        for answer in (last, 0, True, "1", answers[0]["number"]):
            assert say(answer) == first + 2
        assert say(answers[-1]["number"]) == first + 3
        heard.clear()


def test_nothing_moves_by_a_value_that_was_refused_and_stands_in_its_field(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shell = Shell(Session(tmp_path))
    jog = Jog(shell.session)
    for kind in ("go", "step", "turn"):
        monkeypatch.setattr(jog, kind, lambda *_: pytest.fail("it moves, by the value before"))
    view = JogView(shell, jog)

    def type_in(field: FieldView, text: str) -> str:
        view.notice.clear()
        field.control.value = text
        return f"first mend what is refused: {field.field.label}"

    said = type_in(view._goal[1], "1.000,5")
    view._go.click()
    assert said in view.notice.value
    said = type_in(view._motion["speed"], "fast")
    view._holds["X"]._told(None, {"kind": "step", "direction": 1}, None)
    assert said in view.notice.value
    said = type_in(view._motion["spindle_speed"], "-1")
    view._turns["spindle"]._told(None, {"kind": "turn", "direction": 1}, None)
    assert said in view.notice.value


def test_nothing_is_kept_or_sent_of_a_value_that_was_refused_and_stands_in_its_field(tmp_path: Path) -> None:
    shell = Shell(Session(tmp_path))
    review, state = GradingView(shell), MachineState(shell.session)
    tuning, bus = ControllersView(shell, state), BusView(shell, state)
    touch_off = SetupView(Program(shell.session), dict)
    results, interpolator = ResultActions(shell), InterpolatorView(shell, Interpolating(shell.session))
    results._result = interpolator.done = object()  # type: ignore[assignment]
    results._folder = tmp_path
    saved, sent = (interpolator._save_views[name] for name in ("file", "send_to"))
    for field, act in (
        (review._words["points"], review.review),
        (tuning._tuning[1], tuning.tune),
        (tuning._steps[0], tuning.step),
        (bus._fields[0], bus.analyse),
        (bus._filter, bus.listen),
        (touch_off._views[1], touch_off._touch_off),
        (results._views["save_as"], lambda: results._save("before.csv")),
        (results._views["send_to"], lambda: results._send("before@example.edu")),
        (sent, interpolator.send),
        (saved, interpolator.save),
    ):
        field.control.value = "8 of 10"
        if field in (bus._filter, results._views["save_as"], saved):
            field.control.value = "x" * 9999
        with pytest.raises(InputError, match=f"first mend what is refused: {field.field.label}"):
            act()
