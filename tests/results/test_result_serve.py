"""The server of reports and help: what lies in its folder, for who has the address, asked by its own pages only."""

from __future__ import annotations

import http.client
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from rds.results.serve import OWN_SCRIPT, FolderServer


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Runs with a report, beside what is none of them."""
    (tmp_path / "secret.txt").write_text("secret")
    (tmp_path / "runs-of-others").mkdir()
    (tmp_path / "runs-of-others" / "secret.txt").write_text("secret")
    runs = tmp_path / "runs"
    (runs / "first").mkdir(parents=True)
    (runs / "first" / "report.html").write_text("<p>report</p>")
    return runs


@pytest.fixture
def server(folder: Path) -> Iterator[FolderServer]:
    server = FolderServer(folder)
    yield server
    server.close()


def ask(server: FolderServer, page: str, method: str = "GET", **headers: str) -> tuple[int, bytes, dict[str, str]]:
    """Status, body and headers of what is answered for `page`, whose path is sent as it stands."""
    port, path = server.url("").removeprefix("http://127.0.0.1:").split("/", 1)
    connection = http.client.HTTPConnection("127.0.0.1", int(port), timeout=10)
    try:
        connection.putrequest(method, f"/{path}{page}", skip_host=True)
        for name, value in ({"Host": f"127.0.0.1:{port}"} | headers).items():
            connection.putheader(name, value.replace("PORT", port))
        connection.endheaders()
        answer = connection.getresponse()
        return answer.status, answer.read(), dict(answer.getheaders())
    finally:
        connection.close()


def test_a_report_is_served_and_can_run_no_script(server: FolderServer) -> None:
    status, body, headers = ask(server, "first/report.html")
    assert (status, body) == (200, b"<p>report</p>")
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    assert "script-src" not in headers["Content-Security-Policy"]
    assert headers["X-Content-Type-Options"] == "nosniff" and headers["Referrer-Policy"] == "no-referrer"
    assert ask(server, "first/report.html", "HEAD")[:2] == (200, b"")
    assert ask(server, "first/report.html", "POST")[0] == 501


def test_pages_of_our_own_may_run_theirs(folder: Path) -> None:
    server = FolderServer(folder, OWN_SCRIPT)
    try:
        assert "script-src 'self'" in ask(server, "first/report.html")[2]["Content-Security-Policy"]
    finally:
        server.close()


@pytest.mark.parametrize("target", ["../../secret.txt", "{outside}/secret.txt", "../../runs-of-others/secret.txt"])
def test_a_link_out_of_the_folder_is_not_followed(server: FolderServer, folder: Path, target: str) -> None:
    (folder / "first" / "link.txt").symlink_to(target.format(outside=folder.parent))
    assert (folder / "first" / "link.txt").read_text() == "secret"
    status, body, _ = ask(server, "first/link.txt")
    assert status == 404 and b"secret" not in body


def test_nor_a_linked_folder_and_what_lies_in_it(server: FolderServer, folder: Path) -> None:
    (folder / "linked").symlink_to(folder.parent / "runs-of-others")
    (folder.parent / "runs-of-others" / "index.html").write_text("secret")
    assert [ask(server, page)[0] for page in ("linked/secret.txt", "linked/", "linked")] == [404, 404, 404]


def test_a_link_within_the_folder_is_and_a_folder_that_was_opened_by_a_link(folder: Path) -> None:
    (folder / "last").symlink_to("first")
    (folder.parent / "opened").symlink_to("runs")
    server = FolderServer(folder.parent / "opened")
    try:
        assert ask(server, "last/report.html")[:2] == (200, b"<p>report</p>")
    finally:
        server.close()


@pytest.mark.parametrize(
    "page",
    ["../secret.txt", "%2e%2e/secret.txt", "first/../../secret.txt", "..%2fsecret.txt", "/etc/passwd", "//etc/passwd",
     "../runs-of-others/secret.txt", "first%00", "first", "first/", "", "pipe"],
)  # fmt: skip
def test_no_path_leads_out_of_it_and_nothing_but_files_is_served(server: FolderServer, folder: Path, page: str) -> None:
    if hasattr(os, "mkfifo"):
        os.mkfifo(folder / "pipe")  # who opens it waits for ever
    status, body, _ = ask(server, page)
    assert status == 404 and b"secret" not in body and b"root:" not in body


@pytest.mark.parametrize(
    "host", ["rebound.example:PORT", "rebound.example", "127.0.0.1.rebound.example:PORT", "", ":1"]
)
def test_a_browser_that_believes_in_another_host_is_refused(server: FolderServer, host: str) -> None:
    status, body, _ = ask(server, "first/report.html", Host=host)
    assert status == 403 and b"report" not in body


def test_pages_of_other_sites_are_refused(server: FolderServer) -> None:
    for origin in ("http://127.0.0.1:1", "https://other.example", "null"):
        assert ask(server, "first/report.html", Origin=origin)[0] == 403
    assert ask(server, "first/report.html", Origin="http://127.0.0.1:PORT")[0] == 200
    assert ask(server, "first/report.html", Host="localhost:PORT")[0] == 200
