"""A real browser on a real page of `rds app`; skipped, with how to get it, where there is no Chromium."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Generator, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import pytest

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
HOW = "no Chromium here: install it (Debian: apt-get install chromium) to run the tests in a browser"
PATIENCE = 60_000  # ms, on a busy computer
SEEN = Path(tempfile.gettempdir()) / "rds-screenshots"  # of tests that fail
KEPT = Path(os.environ["RDS_SCREENSHOTS"]) if "RDS_SCREENSHOTS" in os.environ else None  # of all tests
FAILED = pytest.StashKey[bool]()  # of a test, or of the last one of a file
PAGES = pytest.StashKey[list[Any]]()  # of a test, or those that the tests of a file share
PROGRAM_TEXT = "document.querySelector('.rds-editor').view.state.doc.toString()"  # the page has the lines in sight


class App(NamedTuple):
    """A running `rds app`."""

    url: str
    folder: Path
    process: subprocess.Popen[bytes]
    runtime: str  # its XDG_RUNTIME_DIR, where the built-in bus is


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Lets the fixtures of a test see that it has failed."""
    report = yield
    item.stash[FAILED] = report.failed or item.stash.get(FAILED, False)
    if (file := item.getparent(pytest.Module)) is not None:
        file.stash[FAILED] = report.failed or (report.when != "setup" and file.stash.get(FAILED, False))
    return report


@pytest.fixture(scope="package")
def start_app(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., App]]:
    """Start `rds app` on a folder; ended with the tests."""
    if CHROMIUM is None:
        pytest.skip(HOW)
    pytest.importorskip("voila", reason="Voilà is not installed: it is in the extra lab")
    runtime = tempfile.mkdtemp(prefix="rds", dir="/tmp")  # short, because a socket's path is
    started: list[App] = []

    def start(folder: Path | None = None, *options: str) -> App:
        folder = folder or tmp_path_factory.mktemp("student")
        log = tmp_path_factory.mktemp("app") / "stderr.txt"
        with log.open("w") as stderr:
            process = subprocess.Popen(
                [sys.executable, "-m", "rds", "app", str(folder), "--no-browser", *options],
                stderr=stderr,
                start_new_session=True,
                env=os.environ | {"XDG_RUNTIME_DIR": runtime},
            )
        while process.poll() is None:
            if found := re.search(r"http://127\.0\.0\.1\S+token=\S+(?=\s)", log.read_text()):
                app = App(found.group(0), folder, process, runtime)
                started.append(app)
                return app
            time.sleep(0.05)
        raise AssertionError("rds app did not start:\n" + log.read_text())

    yield start
    end(*started)
    shutil.rmtree(runtime, ignore_errors=True)


def end(*apps: App) -> None:
    """End them beside each other."""
    going = [app.process for app in apps if app.process.poll() is None]
    for process in going:
        os.killpg(process.pid, signal.SIGTERM)
    for process in going:
        process.wait(20)


@pytest.fixture(scope="package")
def app(start_app: Callable[..., App]) -> App:
    """One `rds app` for all tests that can share its folder."""
    return start_app()


@pytest.fixture(scope="package")
def second_app(start_app: Callable[..., App]) -> App:
    """One for tests that say what its panels begin with, by `begin_with`, or do worse to it."""
    return start_app()


def begin_with(app: App, **chosen: Any) -> None:
    """Let an app's next page begin with these choices of equipment control, and with the defaults else."""
    (app.folder / "session.json").write_text(json.dumps({"equipment control": chosen}))


@pytest.fixture(scope="package")
def browser() -> Iterator[Any]:
    """Chromium without a window, as a context whose pages share a cache on disk: what a page has loaded and compiled
    the next one has.
    """
    if CHROMIUM is None:
        pytest.skip(HOW)
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed: it is in the extra dev")
    with sync_api.sync_playwright() as playwright, tempfile.TemporaryDirectory(prefix="rds-chromium-") as profile:
        context = playwright.chromium.launch_persistent_context(
            profile, executable_path=CHROMIUM, args=["--no-sandbox"]
        )
        yield context
        context.close()


@pytest.fixture
def new_page(browser: Any, request: pytest.FixtureRequest) -> Iterator[Callable[..., Any]]:
    """An empty page of this width and height, px; fails the test if it asked another host for anything.

    With a `clock`, time can be put forward. A screenshot of each page is kept at the end of a test that fails, in a
    temporary folder, and of any test in $RDS_SCREENSHOTS.
    """
    yield from _pages(browser, request)


@pytest.fixture(scope="module")
def new_page_for_all(browser: Any, request: pytest.FixtureRequest) -> Iterator[Callable[..., Any]]:
    """The same of a page that the tests of a file share: loading one takes longer than most of what is done there."""
    yield from _pages(browser, request)


def _pages(browser: Any, request: pytest.FixtureRequest) -> Iterator[Callable[..., Any]]:
    pages: list[Any] = request.node.stash.setdefault(PAGES, [])
    contexts: list[Any] = []
    abroad: list[str] = []

    def asked(message: Any) -> None:
        if not re.match(r"(https?|wss?)://(127\.0\.0\.1|localhost)[:/]|data:|blob:|about:", message.url):
            abroad.append(message.url)

    def make(width: int, height: int, clock: bool = False) -> Any:
        context = browser
        if clock:  # it is the clock of all pages of a context
            context = browser.browser.new_context()
            context.clock.install()
            contexts.append(context)
        page = context.new_page()
        page.set_viewport_size({"width": width, "height": height})
        page.set_default_timeout(PATIENCE)
        page.wait_for_selector = partial(see, page)
        page.on("request", asked)
        page.warned = []  # what its console has of warnings and errors
        page.on("console", lambda said: page.warned.append(said.text) if said.type in ("warning", "error") else None)
        pages.append(page)
        return page

    yield make
    _keep_pictures(pages, request.node)
    while pages:
        pages.pop().close()
    for context in contexts:
        context.close()
    assert not abroad, f"the page asked other hosts: {abroad}"


def _keep_pictures(pages: list[Any], node: pytest.Item | pytest.Collector) -> None:
    if KEPT or node.stash.get(FAILED, False):
        name = re.sub(r"\W+", "-", node.name).strip("-")
        for number, page in enumerate(pages):
            page.screenshot(path=(KEPT or SEEN) / f"{name}-{number}.png")


@pytest.fixture
def spoiled(request: pytest.FixtureRequest) -> Iterator[bool]:
    """Whether the test of this file before this one has failed: it may have left a page that they share anyhow."""
    file = request.node.getparent(pytest.Module)
    yield file.stash.get(FAILED, False)
    _keep_pictures(file.stash.get(PAGES, []), request.node)


def see(page: Any, selector: str, state: str = "visible", timeout: float = PATIENCE) -> Any:
    """Playwright's `wait_for_selector`, which looks twice a second only; here the wait is at most a tenth longer than
    need be. Gives the first element that fits, for the states visible and hidden as it was seen to be.
    """
    first = page.locator(selector).first
    is_so = {"visible": first.is_visible, "hidden": first.is_hidden, "attached": first.count}[state]
    begun = time.monotonic()
    while not is_so():
        waited = (time.monotonic() - begun) * 1e3
        if waited > timeout:
            first.wait_for(state=state, timeout=1)  # which says in its error what is there instead
        page.wait_for_timeout(min(max(waited / 10, 10), 100))
    return first


@pytest.fixture
def folders() -> Iterator[set[Path]]:
    """Those of the pages that a test opens or uses. At its end, and however it ends, no run goes on there, the machine
    is free, and nothing is left but the runs: the next test, or the same one tried again, begins as in a new folder.
    """
    from rds.core.errors import InputError
    from rds.panels.session import Session

    used: set[Path] = set()
    yield used
    for folder in used:
        session, nobody = Session(folder), object()
        for run in session.runs_that_go_on():
            run.stop()
        deadline = time.monotonic() + PATIENCE / 1e3
        while time.monotonic() < deadline:
            try:
                session.take_machine("the next test", nobody)
            except InputError:
                time.sleep(0.1)
            else:
                session.give_machine_back(nobody)
                break
        _empty(folder)


def _empty(folder: Path) -> None:
    """Take away what a test has left beside its runs, whose reports may still be drawn."""
    for left in folder.iterdir():
        if left.name == "runs" or (left.name.startswith(".") and left.suffix != ".draft"):
            continue
        if left.is_dir() and not left.is_symlink():
            shutil.rmtree(left, ignore_errors=True)
        else:
            left.unlink(missing_ok=True)


@pytest.fixture(scope="module")
def page_for_all(new_page_for_all: Callable[..., Any], app: App) -> Any:
    """A page of the app for all tests of a file."""
    page = new_page_for_all(1280, 800)
    page.goto(app.url)
    page.wait_for_selector(".rds-app .rds-nav button")
    return page


def turn_to(page: Any, panel: str) -> None:
    """Go to a panel of a page by its title."""
    page.click(f'.rds-nav button:text-is("{panel}")')
    page.wait_for_selector(f'.rds-title h1:text-is("{panel}")')
    page.wait_for_selector(".rds-panel:not(.rds-opening)")


@pytest.fixture
def same_page(page_for_all: Any, folders: set[Path], app: App, spoiled: bool) -> Callable[[str], Any]:
    """Go to a panel of the page that the tests of a file share. It is light, 1280 x 800 px, and the panel as the test
    before has left it; but after one that failed the page is a new one.
    """
    if spoiled:
        page_for_all.goto(app.url)

    def show(panel: str) -> Any:
        folders.add(app.folder)
        page_for_all.set_viewport_size({"width": 1280, "height": 800})
        turn_to(page_for_all, panel)
        if page_for_all.locator(".rds-app.rds-dark").count():
            page_for_all.click('.rds-head button:text-is("Dark")')
            page_for_all.wait_for_selector(".rds-app:not(.rds-dark)")
        return page_for_all

    return show


@pytest.fixture
def open_page(folders: set[Path], new_page: Callable[..., Any], app: App) -> Callable[..., Any]:
    """Open a page of the app, or of another one, at a panel by its title; with a `clock`, time can be put forward."""

    def show(
        panel: str | None = None, on: App | None = None, width: int = 1280, height: int = 800, clock: bool = False
    ) -> Any:
        page = new_page(width, height, clock)
        folders.add((on or app).folder)
        page.goto((on or app).url)
        page.wait_for_selector(".rds-app .rds-nav button")
        if panel is not None:
            turn_to(page, panel)
        return page

    return show
