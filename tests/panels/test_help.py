"""The help: built from the documents without a fault, searchable, opened at the page of the panel one is in."""

from __future__ import annotations

import shutil
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from rds.core.errors import InputError
from rds.panels.help.build import _cache, _fingerprint, _local, contents, help_pages, page_file, sources
from rds.panels.registry import PANELS
from rds.results.serve import OWN_SCRIPT, FolderServer


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built anew. A panel has these, too, where nobody has built its own before."""
    built = help_pages(tmp_path_factory.mktemp("help") / "pages")
    if not (kept := _cache() / _fingerprint(sources())).exists():
        shutil.copytree(built, kept)
    return built


@pytest.fixture
def server(pages: Path) -> Iterator[FolderServer]:
    server = FolderServer(pages, OWN_SCRIPT)
    yield server
    server.close()


def test_every_document_is_a_page_and_found_by_the_search(pages: Path) -> None:
    index = (pages / "searchindex.js").read_text()
    for name in sources():
        assert (pages / f"{name}.html").is_file() and f'"{name}' in index, name
    assert "stick" in index


def test_pages_ask_nobody_for_anything(pages: Path) -> None:
    for page in pages.glob("*.html"):
        text = page.read_text()
        assert 'src="http' not in text and "@import" not in text, page
        assert not [line for line in text.splitlines() if "<link" in line and 'href="http' in line], page


def test_every_panel_names_a_page_that_exists() -> None:
    for name in PANELS.names():
        subject = PANELS.module(name).HELP
        assert page_file(subject) == f"{subject}.html", f"panel {name}: no document {subject}"


def test_links_to_other_files_of_the_checkout_become_text() -> None:
    text = _local("[a](examples/x.toml), [b](docs/bus.md#x), [c](#here), [d](https://e.org)", {"bus"})
    assert text == "a, [b](bus.md#x), [c](#here), [d](https://e.org)"


def test_pictures_are_shown(pages: Path) -> None:
    assert _local("![a sine](docs/pictures/first-sine.png)", set()) == "![a sine](first-sine.png)"
    assert "first-sine.png" in (pages / "readme.html").read_text()
    assert (pages / "_images" / "first-sine.png").is_file()


def test_the_documents_have_an_order() -> None:
    """docs/index.md names each once, under what kind of document it is; pages and their navigation follow it."""
    documents = sources()
    order = contents(documents["index"].read_text(encoding="utf-8"))
    assert list(order) == ["Start", "Tutorials", "How to", "Reference", "Why"]
    named = [name for names in order.values() for name in names]
    assert sorted([*named, "index"]) == sorted(documents), "name each document once in docs/index.md"


def test_the_navigation_beside_a_page_has_that_order(pages: Path) -> None:
    text = (pages / "bus.html").read_text()
    places = [text.index(heading) for heading in (">Start<", ">Tutorials<", ">How to<", ">Reference<", ">Why<")]
    assert places == sorted(places)


def test_a_folder_with_other_things_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(InputError, match="other things"):
        help_pages(tmp_path)
    with pytest.raises(InputError, match="is no folder"):
        help_pages(tmp_path / "thesis.txt")
    assert (tmp_path / "thesis.txt").read_text() == "mine"


def test_building_ends_when_it_is_asked_to_and_leaves_nothing(tmp_path: Path) -> None:
    class Enough(Exception):
        pass

    def pulse() -> None:
        raise Enough

    with pytest.raises(Enough):
        help_pages(tmp_path / "pages", pulse)
    assert list(tmp_path.iterdir()) == []


ENDS_MEANWHILE = """
import sys, threading
from pathlib import Path
from rds.panels.help.build import help_pages
from rds.panels.session.task import Task

begun = threading.Event()
Task("help", lambda task: help_pages(Path(sys.argv[1]) / "pages", begun.set)).start()
begun.wait()
"""


def test_a_process_that_ends_while_it_builds_says_nothing_and_leaves_nothing(tmp_path: Path) -> None:
    command = [sys.executable, "-c", ENDS_MEANWHILE, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert (done.stderr, done.returncode) == ("", 0)
    assert list(tmp_path.iterdir()) == []


def test_only_who_knows_the_path_reads_the_pages(server: FolderServer) -> None:
    with urllib.request.urlopen(server.url("experiments.html"), timeout=10) as answer:
        assert b"Experiments" in answer.read()
    base = server.url("").rsplit("/", 2)[0]
    for path in ("/", "/experiments.html", "/x/experiments.html", server.url("../../../etc/passwd")[len(base) :]):
        with pytest.raises(urllib.error.HTTPError):
            urllib.request.urlopen(base + path, timeout=10)


@pytest.mark.usefixtures("pages")
def test_help_opens_at_the_page_of_the_panel(open_page: Callable[..., Any]) -> None:
    page = open_page("Equipment control")
    page.click('.rds-head button:text-is("Help")')
    frame = page.frame_locator(".rds-guide iframe")
    frame.locator('h1:has-text("Equipment")').wait_for()
    frame.locator('input[name="q"]').fill("friction")
    frame.locator('input[name="q"]').press("Enter")
    frame.locator("#search-results li").first.wait_for()
    page.click('.rds-head button:text-is("Dark")')  # the help follows, and stays where it is
    frame.locator('body[data-theme="dark"] #search-results li').first.wait_for()
    assert page.locator('.rds-guide a[href$="colours=dark"]').count() == 1
    page.click('.rds-nav button:text-is("Main menu")')
    page.click('.rds-nav button:text-is("Help")')  # also when it is shown again
    frame.locator('body[data-theme="dark"] #search-results li').first.wait_for()
    page.click('.rds-nav button:text-is("Equipment control")')
    page.click('.rds-head button:text-is("Help")')  # and when it is asked for its first page again
    frame.locator('body[data-theme="dark"] h1:has-text("Equipment")').wait_for()
    page.wait_for_selector('.rds-guide a[href$="colours=dark"]')


def test_a_page_is_dark_as_its_address_says_or_the_browser_prefers(
    server: FolderServer, new_page: Callable[..., Any]
) -> None:
    page = new_page(1280, 800)
    back = "getComputedStyle(document.body).backgroundColor"
    page.emulate_media(color_scheme="dark")
    page.goto(server.url("oacs.html"))
    assert page.evaluate(back) == "rgb(20, 24, 29)"
    page.goto(server.url("oacs.html") + "?colours=light")
    page.click('.sidebar-tree a:has-text("Safety")')  # what was named holds on the next page too
    page.wait_for_selector('h1:has-text("Safety")')
    assert page.evaluate(back) == "rgb(255, 255, 255)"
