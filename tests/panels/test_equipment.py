"""Equipment model and equipment control in a browser: the main paths, each refusal, what happens meanwhile."""

from __future__ import annotations

import email
import shutil
import socket
import tomllib
from collections.abc import Callable
from email.policy import default
from pathlib import Path
from typing import Any

import pytest

from rds.panels.equipment import strip as live_strip
from tests.panels.conftest import App, begin_with

FAULTY = "def control(t, r, y, state, params):\n    error = r.positoin - y\n    return 10.0 * error, state\n"
MODEL = """initial_state = [0.0, 0.0]

def advance(x, u, T, params):
    kept = 2.718281828 ** (-T / 0.009943)
    toward = 1.764 * u[0]
    return [x[0] + toward * T + 0.009943 * (1.0 - kept) * (x[1] - toward), toward + kept * (x[1] - toward)]
"""


class Equipment:
    """A page at one of the equipment panels, as a person uses it."""

    def __init__(self, page: Any):
        self.page = page
        self._before = self._saved_in()

    def field(self, label: str) -> Any:
        return self.page.locator(".rds-field:visible", has_text=label).first

    def choose(self, label: str, option: str) -> None:
        box = self.field(label).locator("select")
        if box.evaluate("(box) => box.selectedOptions[0]?.label") != option:
            box.select_option(label=option)
            self.settle()

    def settle(self) -> None:
        """A choice may bring other fields, in the place of those that are there: wait as a click does, until the kernel
        has answered (presence.js), and until the page has nothing to do.
        """
        self.page.evaluate("""() => {
            const here = document.querySelector(".rds-nav .rds-here");
            window.settled = false;
            here.addEventListener("click", () => requestIdleCallback(() => { window.settled = true; }), { once: true });
            here.click();
        }""")
        self.page.wait_for_function("window.settled")

    def type(self, label: str, value: str) -> None:
        box = self.field(label).locator("input[type=text]")
        if box.input_value() == value:
            return
        box.fill(value)
        box.press("Enter")

    def refusal(self, label: str) -> str:
        text = self.field(label).locator(".rds-refusal [role=alert]")
        text.wait_for()
        return str(text.inner_text())

    def press(self, text: str) -> None:
        if text == "Run":
            self._before = self._saved_in()
        self.page.click(f'button:visible:text-is("{text}")')

    def tab(self, title: str) -> None:
        self.page.click(f'.lm-TabBar-tab:visible:has-text("{title}")')

    def sees(self, text: str) -> None:
        self.page.wait_for_selector(f':text("{text}"):visible')

    def says(self, text: str) -> None:
        """Wait for what is said over the panel."""
        self.page.wait_for_selector(f'.rds-main > .rds-notice [role]:visible:has-text("{text}")')

    def run(self) -> Path:
        """Run, and wait for the files of this run."""
        self.press("Run")
        return self.saved()

    def saved(self) -> Path:
        """Wait until the files of the run are written, not of one that was shown before it; their folder."""
        self.page.wait_for_function(
            """(before) => [...document.querySelectorAll('code')].some(
                (each) => each.offsetParent && each.parentElement.innerText.startsWith('Saved with')
                    && each.innerText !== before)""",
            arg=self._before,
        )
        return Path(self._saved_in())

    def _saved_in(self) -> str:
        place = self.page.locator(':text("Saved with its report in") code').filter(visible=True)
        return str(place.inner_text()) if place.count() else ""


@pytest.fixture
def at(same_page: Callable[[str], Any]) -> Callable[..., Equipment]:
    """Go to an equipment panel, with the choices of a first run of half a second."""

    def show(panel: str = "Equipment control") -> Equipment:
        equipment = Equipment(same_page(panel))
        equipment.choose("System", "X axis")
        equipment.choose("Mode", "Simulation")
        equipment.choose("Voltage signal" if panel == "Equipment model" else "Reference", "Sinusoid")
        equipment.type("Final time", "0.5")
        equipment.type("Sample period", "0.001")
        if panel == "Equipment control":
            equipment.choose("Controller", "Proportional")
            for label, value in (("Amplitude", "5"), ("Frequency", "0.2"), ("Offset", "0")):
                equipment.type(label, value)
        return equipment

    return show


def test_three_actions_from_the_page_to_a_tracked_sine(second_app: App, open_page: Callable[..., Any]) -> None:
    begin_with(second_app)
    page = open_page(on=second_app)
    page.evaluate("window.actions = 0; document.addEventListener('click', () => { window.actions += 1 }, true)")
    page.click('button:text-is("Track a sine")')
    page.click('button:visible:text-is("Run")')
    page.wait_for_selector(':text("RMS error"):visible')
    page.wait_for_selector(".rds-figure canvas:visible")
    assert page.evaluate("window.actions") <= 3
    Equipment(page).says("done: 10000 samples")
    wide = page.evaluate("[document.documentElement.scrollWidth, window.innerWidth]")
    assert wide[0] <= wide[1]


def test_wrong_values_are_refused_beside_their_fields(at: Callable[..., Equipment]) -> None:
    control = at()
    for label, value, reason in (
        ("Amplitude", "900", "Amplitude must be from 0 to 75 mm, not 900"),
        ("Frequency", "0", "Frequency must be more than 0"),
        ("Offset", "twelve", "Offset must be a number in mm, not 'twelve'"),
        ("Final time", "1e9", "Final time must be more than 0 and at most 3600 s"),
        ("Sample period", "0.0000001", "Sample period must be from 1e-06 to 1000 s"),
    ):
        control.type(label, value)
        assert reason in control.refusal(label)
    control.press("Run")
    control.says("first mend what is refused on the left: Amplitude, Frequency, Offset")
    for label, value in (("Amplitude", "5"), ("Frequency", "0,2"), ("Offset", "0"), ("Final time", "0.5")):
        control.type(label, value)
    control.type("Sample period", "0.001 s")
    control.choose("Reference", "User-defined")
    control.type("CSV file, or formula", "open('x')")
    assert "the formula knows no 'open'" in control.refusal("CSV file, or formula")
    control.type("CSV file, or formula", "no-such.csv")
    control.press("Run")
    control.sees("there is no such file")
    control.choose("Reference", "Sinusoid")
    control.choose("Controller", "User-defined")
    control.type("File of the controller", "")
    control.press("Build")
    control.sees("name the file of your controller")


def test_a_fault_is_marked_at_its_line(at: Callable[..., Equipment], app: Any) -> None:
    (app.folder / "faulty.py").write_text(FAULTY)
    control = at()
    control.choose("Controller", "User-defined")
    control.type("File of the controller", "faulty.py")
    control.press("Build")
    fault = control.page.wait_for_selector(".rds-source-fault:visible")
    assert fault.inner_text().split() == ["2", "error", "=", "r.positoin", "-", "y"]
    control.says("faulty.py, line 2")
    assert control.page.locator("svg[role=img]:visible").get_attribute("aria-label").count("faulty.py") == 1
    (app.folder / "faulty.py").write_text(FAULTY.replace("positoin", "position"))
    control.press("Build")
    control.sees("faulty.py: the controller keeps its interface")
    control.press("Run")
    control.saved()


def test_a_gain_changes_while_it_runs_and_a_run_is_stopped(at: Callable[..., Equipment]) -> None:
    control = at()
    control.choose("Mode", "Emulation")
    control.type("Final time", "600")  # it is stopped, however long the steps before take
    control.type("Sample period", "0.005")  # a loop of 1 ms would take the page's processor
    control.press("Load")
    control.says("loaded: 120000 samples, 5 ms each")
    control.press("Run")
    gain = control.page.locator(".rds-live-values .rds-field:visible", has_text="Pgain")
    number, slider = gain.locator("input[type=text]"), gain.locator("input[type=range]")
    before = number.input_value()
    new = f"{round(float(before)) + 1}"  # a try again begins with what an earlier one has left
    number.fill("-3")
    number.press("Enter")
    gain.locator("[role=alert]").wait_for()
    assert control.page.locator('.rds-field:visible:has-text("Pgain")').count() == 1  # one box, which is live
    assert "Pgain, proportional gain must be at least 0 V/mm, not -3" in gain.inner_text()
    control.page.wait_for_function("+(document.querySelector('[data-samples]')?.dataset.samples || 0) > 20")
    number.fill(new)
    number.press("Enter")
    control.page.wait_for_selector('td:text-is("X.Pgain"):visible')
    slider.press("ArrowRight")
    control.page.wait_for_selector('.rds-live-values + button:text-is("Undo"):enabled')
    control.page.wait_for_function(
        "document.querySelectorAll('td').length && "
        "document.querySelector('[data-marks]').dataset.marks.split('X.Pgain').length === 3"
    )
    for count in (4, 5):
        control.press("Undo")
        control.page.wait_for_function(
            f"document.querySelector('[data-marks]').dataset.marks.split('X.Pgain').length === {count}"
        )
    marks = control.page.locator("[data-marks]").get_attribute("data-marks")
    assert marks.endswith(f"X.Pgain {float(before):g}"), marks
    number.fill(new)
    number.press("Enter")
    control.page.wait_for_selector(f'[data-marks$="X.Pgain {new}"]')
    control.press("Stop")
    control.sees("ended early: stopped")
    control.saved()
    control.page.wait_for_selector(f'td:text-is("{new}"):visible')
    control.tab("Live")
    control.page.wait_for_selector('[data-marks$=" stopped"]')
    control.page.click('.jupyter-widget-Collapse-header:visible:has-text("1 changed")')
    assert control.field("Pgain").locator("input[type=text]").input_value() == new  # what it became is the next run's
    control.tab("Timing")
    control.page.wait_for_selector('td:has-text("lateness"):visible')
    control.page.wait_for_selector(".rds-figure canvas:visible")


def test_model_validation_has_a_fit_and_a_verdict(at: Callable[..., Equipment], app: Any) -> None:
    (app.folder / "axis.py").write_text(MODEL)
    model = at("Equipment model")
    model.choose("Mode", "Model validation")
    model.type("Final time", "1")
    model.press("User-defined")
    model.type("File of the model", "axis.py")
    model.press("Run")
    model.saved()
    model.sees("fit [%]")
    model.sees("Does the model hold?")


def test_a_system_test_has_no_model(at: Callable[..., Equipment]) -> None:
    model = at("Equipment model")
    model.choose("Mode", "System test")
    model.page.wait_for_selector(':text("File of the model")', state="hidden")
    model.choose("Voltage signal", "User-defined")
    model.type("CSV file, or formula", "2*sin(2*pi*t)")
    model.press("Run")
    folder = model.saved()
    assert "machine" not in folder.name and "system-test" in folder.name
    model.press("View model")
    assert "Machine, X axis" in model.page.locator("svg[role=img]:visible").get_attribute("aria-label")


def test_earlier_runs_are_reopened_and_laid_over(at: Callable[..., Equipment]) -> None:
    control = at()
    for gain in ("10", "20"):
        if not control.page.locator('.rds-field:visible:has-text("Pgain")').count():
            control.page.click('.jupyter-widget-Collapse-header:visible:has-text("Parameters")')
        control.type("Pgain", gain)
        control.run()
        control.page.wait_for_selector(".rds-figure canvas:visible")
    control.tab("Earlier runs")
    control.press("Open")
    control.sees("tick a run in the table first")
    row = control.page.locator(".rds-runs tbody tr")
    row.nth(0).locator(".rds-runs-open").click()
    control.saved()
    control.tab("Earlier runs")
    assert "Pgain 10 → 20" in row.nth(0).inner_text() and "mm" in row.nth(0).inner_text()
    row.nth(0).locator("input[type=text]").fill("the better one")
    control.page.keyboard.press("Tab")
    row.nth(0).locator(".rds-runs-star").click()
    control.page.wait_for_selector('.rds-runs-star[aria-pressed="true"]')
    row.nth(1).locator("input[type=checkbox]").check()
    control.press("What differs")
    control.page.wait_for_selector('.rds-main td:text-is("Pgain"):visible')
    assert row.nth(0).locator("input[type=text]").input_value() == "the better one"
    control.press("Open")
    control.sees("2 runs over each other")
    control.page.wait_for_selector(".rds-figure canvas:visible")
    assert control.page.locator(".rds-figure .jupyter-matplotlib:visible").count() == 1
    assert control.page.locator(".widget-tab-contents table:visible tbody tr").count() == 2

    control.tab("Earlier runs")
    row.nth(0).locator("input[type=checkbox]").uncheck()
    control.press("As ghost")
    control.sees("stands behind the live strip, dotted")
    control.tab("Live")
    strip = control.page.locator("[data-lanes]:visible")
    control.page.wait_for_selector('[data-ghost$="X simulation"]')
    assert strip.get_attribute("data-lanes") == "3"
    control.press("error")
    control.page.wait_for_selector('[data-lanes="2"]')
    control.press("Cursors")
    said = control.page.wait_for_selector('.rds-strip-read th:has-text("B − A")').inner_text()
    control.page.locator('input[aria-label="cursor A"]:visible').press("ArrowLeft")
    control.page.wait_for_function(
        "(said) => !document.querySelector('.rds-strip-read').innerText.includes(said)", arg=said
    )
    with control.page.expect_download() as saved:
        control.press("Save picture")
    assert (
        Path(saved.value.path()).read_bytes().startswith(b"\x89PNG") and saved.value.suggested_filename == "strip.png"
    )


def test_the_panel_as_a_file(at: Callable[..., Equipment], app: Any) -> None:
    control = at()
    control.press("View model")
    control.page.click('.jupyter-widget-Collapse-header:visible:has-text("Show as file")')
    text = control.page.inner_text("pre:visible")
    table = tomllib.loads(text)
    assert table["axis"] == "X" and table["duration"] == 0.5 and table["controller"]["name"] == "p"
    (app.folder / "mine.toml").unlink(missing_ok=True)
    control.page.fill('input[placeholder="experiment.toml"]:visible', "mine.toml")
    control.page.keyboard.press("Enter")
    control.press("Save the file")
    control.sees("in a terminal: rds run mine.toml")
    assert tomllib.loads((app.folder / "mine.toml").read_text()) == table
    control.press("Save the file")
    control.sees("mine.toml: there is such a file already")


def test_a_result_is_saved_and_sent(at: Callable[..., Equipment], app: Any) -> None:
    aiosmtpd_controller = pytest.importorskip("aiosmtpd.controller", reason="aiosmtpd is not installed")
    mails: list[Any] = []

    class Box:
        async def handle_DATA(self, server: Any, session: Any, envelope: Any) -> str:
            mails.append(envelope.content)
            return "250 taken"

    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        port = found.getsockname()[1]
    (app.folder / "email.toml").unlink(missing_ok=True)
    (app.folder / "kept.csv").unlink(missing_ok=True)
    control = at()
    control.press("Run")
    control.saved()
    control.type("Save as", "kept.csv")
    control.press("Save")
    control.sees("saved as")
    assert (app.folder / "kept.csv").is_file()
    control.press("Save")
    control.sees("kept.csv: there is such a file already")
    control.type("E-mail to", "me at home")
    assert "no e-mail address" in control.refusal("E-mail to")
    control.type("E-mail to", "me@example.edu")
    control.press("Send")
    control.sees("no mail server is set up")
    (app.folder / "email.toml").write_text(
        f'host = "127.0.0.1"\nport = {port}\nsecurity = "none"\nsender = "lab@example.edu"\n'
    )
    control.press("Send")
    control.sees("nothing listens there; the files are kept in")
    server = aiosmtpd_controller.Controller(Box(), hostname="127.0.0.1", port=port)
    server.start()
    try:
        control.press("Send")
        control.sees("sent to me@example.edu: report.html, result.csv")
    finally:
        server.stop()
    (mail,) = mails
    names = [part.get_filename() for part in email.message_from_bytes(mail, policy=default).iter_attachments()]
    assert names == ["report.html", "result.csv"]


def test_the_machine_moves_with_the_strip(at: Callable[..., Equipment]) -> None:
    control = at()
    control.type("Final time", "5")
    control.press("Run")
    control.saved()
    control.tab("Live")
    control.press("Show the machine")
    control.page.wait_for_selector('canvas[aria-label^="the machine at"]:visible')
    control.page.wait_for_selector('[data-rows]:not([data-rows="0"])')  # with these it begins to play
    scrub = control.page.locator('input[aria-label="time shown"]:visible').first
    scrub.evaluate("(box) => { box.value = 250; box.dispatchEvent(new Event('input')) }")
    control.sees("X 4.9")  # a sine of 5 mm and 0.2 Hz is near its top then
    assert control.page.locator("[data-now]").first.get_attribute("data-now").startswith("1.2")


def test_two_axes_follow_a_circle_under_one_controller(at: Callable[..., Equipment], app: App) -> None:
    shutil.copy(Path(__file__).parents[2] / "examples" / "cross_coupled.py", app.folder)
    control = at()
    control.choose("System", "X and Y")
    control.choose("Reference", "Circle of X and Y")
    control.type("Radius", "0.5")
    control.choose("Motion", "tustin")
    control.choose("Controller", "User-defined")
    control.type("File of the controller", "cross_coupled.py")
    control.field("One controller for all axes").locator("input").check()
    assert (control.run() / "program.html").is_file()
    control.sees("off the programmed path")
    assert control.page.locator(".rds-figure:visible").count() == 2  # the path, and the axes over time
    control.choose("System", "X axis")
    assert not control.field("One controller for all axes").count()


def test_numbers_at_the_axes_of_the_strip_are_those_of_the_page_in_every_browser(new_page: Callable[..., Any]) -> None:
    """uPlot's own are as the browser's language has them: 1.500 and 0,3 in a German one."""
    script = (Path(live_strip.__file__).parent / "static" / "strip.js").read_text(encoding="utf-8")
    page = new_page(400, 300)
    page.set_content("<html></html>")
    page.add_script_tag(content=script.replace("export default", "window.made =") + "\nwindow.plain = plain;")
    shown = page.evaluate("plain(null, [1500, 0.1 + 0.2, -2.5, 1e-4, null])")
    assert shown == ["1500", "0.3", "-2.5", "0.0001", None]
