"""A student's code that holds its page's kernel, or ends it: the emergency stop works, and the page begins again."""

from __future__ import annotations

import os
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from rds.core.errors import MachineError
from rds.panels.app.kernel_stack import ask, own_line
from rds.panels.page.shell import Rescue, Shell
from rds.panels.session import Session
from tests.panels.conftest import App, begin_with, turn_to
from tests.panels.test_interrupted import wait_for

CONTROLLER = '''"""Proportional control, until a sample that no check gets to."""

import os

initial_state = [0]


def control(t, r, y, state, params):
    if state[0] == 9000:
        open("there", "w").close()
        {last}
    return 30.0 * (r.position - y), [state[0] + 1]
'''
HELD = 7000  # ms of the page's clock after which it says that it gets no answer


@pytest.fixture
def held_app(second_app: App) -> App:
    """An app whose equipment control is about to run a student's controller."""
    begin_with(second_app, mode="simulation", controller="user", controller_file="own.py")
    return second_app


@pytest.fixture(scope="module")
def clock_page(new_page_for_all: Callable[..., Any]) -> Any:
    """A page whose time can be put forward."""
    return new_page_for_all(1280, 800, clock=True)


@pytest.fixture
def run_until(held_app: App, clock_page: Any, folders: set[Path]) -> Callable[[str], Any]:
    """A page whose simulation has come to this statement of its controller, as it looks some seconds later."""

    def run(last: str) -> Any:
        (held_app.folder / "own.py").write_text(CONTROLLER.format(last=last))
        (held_app.folder / "there").unlink(missing_ok=True)
        folders.add(held_app.folder)
        page = clock_page
        page.goto(held_app.url)
        page.wait_for_selector(".rds-app .rds-nav button")
        turn_to(page, "Equipment control")
        page.click('button:visible:text-is("Run")')
        wait_for((held_app.folder / "there").is_file)
        page.clock.run_for(HELD)
        return page

    return run


@pytest.fixture
def served_machine(held_app: App) -> Iterator[None]:
    """The machine's modules, in a process of their own."""
    command = [sys.executable, "-m", "rds", "machine", "serve", "mini-cnc"]
    env = os.environ | {"XDG_RUNTIME_DIR": held_app.runtime}
    with subprocess.Popen(command, env=env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as process:
        assert process.stdout is not None
        process.stdout.readline()
        yield
        process.terminate()


def refusal(url: str, method: str, page: Any) -> int:
    """The status of a request that has the page's login and not its secret: another site's."""
    return int(page.request.fetch(url, method=method).status)


@pytest.mark.usefixtures("served_machine")
def test_a_call_that_never_returns_keeps_neither_the_emergency_stop_nor_the_page(
    held_app: App, run_until: Callable[[str], Any]
) -> None:
    page = run_until("return sum(range(10**12)), state")
    page.wait_for_selector('.rds-rescue p:has-text("own.py, line 11, in control() has not returned")')
    page.click("button.rds-stop")
    page.wait_for_selector('.rds-rescue p:has-text("emergency stop: 4 modules are at zero volts")')

    root, kernel = (
        held_app.url.partition("?")[0],
        page.evaluate("JSON.parse(document.getElementById('jupyter-config-data').textContent).kernelId"),
    )
    ours = f"{root}rds/kernel/{kernel}"
    assert refusal(ours, "DELETE", page) == refusal(f"{root}rds/emergency-stop", "POST", page) == 403
    with pytest.raises(urllib.error.HTTPError, match="403"):
        urllib.request.urlopen(ours)  # without the token

    page.click('.rds-rescue button:text-is("Begin again")')
    page.wait_for_selector('.rds-rescue p:has-text("own.py, line 11, in control() did not return, and was ended")')
    assert page.request.get(f"{root}api/kernels/{kernel}").status == 404
    page.click('.rds-rescue button:text-is("OK")')
    page.wait_for_selector(".rds-rescue-box", state="hidden")
    page.click('.rds-nav button:text-is("Equipment control")')
    page.wait_for_function("[...document.querySelectorAll('input')].some((each) => each.value === 'own.py')")


def test_a_kernel_that_its_code_ends_is_said_and_begun_again(run_until: Callable[[str], Any]) -> None:
    page = run_until("os._exit(1)")
    page.wait_for_selector('.rds-rescue p:has-text("has ended")')
    page.click('.rds-rescue button:text-is("Begin again")')
    page.wait_for_selector('.rds-rescue p:has-text("begun again")')


def test_a_process_says_its_line_while_compiled_code_holds_it(tmp_path: Path) -> None:
    code = (
        "import sys; from pathlib import Path; from rds.panels.app.kernel_stack import answer_asks\n"
        "answer_asks(Path(sys.argv[1])); sys.path.insert(0, sys.argv[1]); import own\n"
    )
    (tmp_path / "own.py").write_text("def held():\n    return print(flush=True) or sum(range(10**12))\n\n\nheld()\n")
    with subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], stdout=subprocess.PIPE) as process:
        try:
            assert process.stdout is not None
            process.stdout.readline()
            assert [ask(process, tmp_path) for _ in range(2)] == ["own.py, line 2, in held()"] * 2
            (tmp_path / str(process.pid)).unlink()
            assert ask(process, tmp_path) is None  # the signal would end it
            assert process.poll() is None
        finally:
            process.kill()
    assert ask(process, tmp_path) is None
    assert own_line('  File "<string>", line 1 in <module>\n  File "/a/b.py", line ??? in f\n') == ""


def test_the_page_tells_its_server_of_the_channels_it_started_and_hears_what_failed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("jupyter_server", reason="jupyter_server is not installed: it is in the extra lab")
    from rds.panels.app.page import BUS, FOLDER, MACHINE
    from rds.panels.app.rescue import emergency_stop

    shell = Shell(Session(tmp_path))
    shell.session.channels |= {"second", "first"}
    shell.ticker.tick()
    named = next(each.channels for each in shell.widget.children if isinstance(each, Rescue))
    assert named == ["first", "second"]

    monkeypatch.setenv(FOLDER, str(tmp_path))
    monkeypatch.setenv(MACHINE, "mini-cnc")
    monkeypatch.setenv(BUS, '{"channel": "bench"}')
    for error, said in ((MachineError("bus failed; cut the power"), "bus failed"), (KeyError("x"), "cut the power")):

        def fails(session: Session, error: Exception = error) -> str:
            assert session.channels == set(named) and session.bus == {"channel": "bench"}
            raise error

        monkeypatch.setattr(Session, "emergency_stop", fails)
        text, kind = emergency_stop(named)
        assert said in text and kind == "error"
