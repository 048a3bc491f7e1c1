"""`rds app` on a computer that others use as well, who can connect to its ports and read what is not protected: nothing
of the page is theirs, and nothing of it a page's of another site that the same browser shows.
"""

from __future__ import annotations

import contextlib
import http.client
import http.server
import os
import re
import signal
import socket
import threading
import warnings
import webbrowser
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import urlsplit

import pytest

from rds.panels.app import serve
from tests.panels.conftest import App

# not imported to find out, which takes seconds of each worker of the tests
IS_THERE = find_spec("voila") is not None
pytestmark = pytest.mark.skipif(not IS_THERE, reason="Voilà is not installed: it is in the extra lab")

SOMEBODY = 61_234  # a user who owns nothing here
UPGRADE = {
    "Connection": "Upgrade",
    "Upgrade": "websocket",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
}


def processes(app: App) -> set[int]:
    """The app's process and all that it has started."""
    parents = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            parents[int(stat.parent.name)] = int(stat.read_text().rpartition(")")[2].split()[1])
        except OSError:  # it has just ended
            continue
    found = {app.process.pid}
    while more := {process for process, parent in parents.items() if parent in found} - found:
        found |= more
    return found


def tcp_ports(app: App) -> list[int]:
    """Where the app's processes listen for connections by TCP."""
    held = set()
    for process in processes(app):
        for descriptor in Path(f"/proc/{process}/fd").iterdir():
            with contextlib.suppress(FileNotFoundError):  # closed since it was listed
                held.update(re.findall(r"^socket:\[(\d+)\]", os.readlink(descriptor)))
    lines = [line.split() for name in ("tcp", "tcp6") for line in Path("/proc/net", name).read_text().splitlines()[1:]]
    return [int(line[1].rpartition(":")[2], 16) for line in lines if line[3] == "0A" and line[9] in held]


def tried_by_somebody(act: Callable[[], list[str]]) -> list[str]:
    """What `act` gives where another user of the computer does it."""
    theirs, ours = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of the threads here, which the child does not need
        child = os.fork()
    if child == 0:
        try:
            os.setgroups([])
            os.setresgid(SOMEBODY, SOMEBODY, SOMEBODY)
            os.setresuid(SOMEBODY, SOMEBODY, SOMEBODY)
            os.write(ours, "\n".join(act()).encode())
        except BaseException as error:
            os.write(ours, f"{error!r}".encode())
        finally:
            os._exit(0)
    os.close(ours)
    with os.fdopen(theirs, "rb") as answer:
        said = answer.read().decode()
    os.waitpid(child, 0)
    return said.splitlines()


def ask(app: App, path: str, method: str = "GET", **headers: str) -> tuple[int, bytes]:
    """Status and body for `path` under the app's own path, with these headers as they stand."""
    parts = urlsplit(app.url)
    connection = http.client.HTTPConnection("127.0.0.1", parts.port, timeout=60)
    try:
        connection.putrequest(method, parts.path + path, skip_host=True)
        for name, value in ({"Host": parts.netloc} | headers).items():
            connection.putheader(name.replace("_", "-"), value)
        connection.endheaders()
        answer = connection.getresponse()
        return answer.status, b"" if answer.status == 101 else answer.read()
    finally:
        connection.close()


@pytest.fixture(scope="module")
def shown(app: App, page_for_all: Any) -> tuple[Any, str, dict[str, str]]:
    """A page of the app, its kernel's name, and the app's cookies by their names."""
    page = page_for_all
    kernel = page.evaluate("JSON.parse(document.getElementById('jupyter-config-data').textContent).kernelId")
    path = urlsplit(app.url).path  # other servers of this computer, such as a JupyterLab's, may have set some for "/"
    cookies = {each["name"]: each["value"] for each in page.context.cookies(app.url) if each["path"] == path}
    assert any(name.startswith("username-") for name in cookies)
    return page, kernel, cookies


def header(cookies: dict[str, str]) -> str:
    return "; ".join(f"{name}={value}" for name, value in cookies.items())


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="who listens where is read from Linux's /proc")
def test_only_the_page_itself_listens_on_a_port(app: App, shown: Any) -> None:
    """But for the pages of reports that tests before this one have opened, which serve nobody without their secret."""
    page = urlsplit(app.url).port
    ports = tcp_ports(app)
    assert page in ports
    for port in set(ports) - {page}:
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
        connection.request("GET", "/")
        answer = connection.getresponse()
        assert answer.status == 404 and "SimpleHTTP" in answer.headers["Server"]
        connection.close()


@pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0 or not Path("/proc").exists(),
    reason="only root can try it as another user",
)
def test_another_user_reads_nothing_of_it(app: App, shown: Any) -> None:
    os.chmod(app.runtime, 0o755)  # what protects is of the app's own making
    private = list(Path(app.runtime).rglob("*"))
    sockets = [str(path) for path in private if path.is_socket()]
    files = [str(path) for path in private if path.is_file()]
    assert len([path for path in sockets if "voila_" in path]) >= 12  # of two kernels: the page's, and the next one's
    assert [path for path in files if path.endswith(".json")]
    secrets = [app.url.rpartition("=")[2], urlsplit(app.url).path.strip("/")]

    def attack() -> list[str]:
        got = []
        for path in sockets:
            with contextlib.suppress(PermissionError, FileNotFoundError), socket.socket(socket.AF_UNIX) as client:
                client.connect(path)
                got.append(f"connected to {path}")
        for path in files:
            with contextlib.suppress(PermissionError, FileNotFoundError):  # a kernel that was kept ready may end
                got.append(Path(path).read_text())
        for process in processes_seen:
            with contextlib.suppress(FileNotFoundError):
                command = Path(f"/proc/{process}/cmdline").read_text()
                got += [f"{process}: {command}" for secret in secrets if secret in command]
        for port in ports:
            with socket.create_connection(("127.0.0.1", port), timeout=10) as client:
                client.sendall(b"GET / HTTP/1.0\r\nHost: 127.0.0.1:%d\r\n\r\n" % port)
                answer = b"".join(iter(lambda: client.recv(4096), b""))
                got += [f"port {port}: {answer!r}" for secret in secrets if secret.encode() in answer]
                got += [] if b" 404 " in answer.split(b"\r\n")[0] else [f"port {port}: {answer!r}"]
        return [*got, "tried all"]

    processes_seen, ports = processes(app), tcp_ports(app)
    assert tried_by_somebody(attack) == ["tried all"]


@pytest.mark.parametrize("host", ["rebound.example:PORT", "rebound.example", "127.0.0.1.rebound.example:PORT", "x"])
def test_a_host_that_is_not_this_computer_is_refused_by_all_that_answers(app: App, shown: Any, host: str) -> None:
    _, kernel, cookies = shown
    own = {"Host": host.replace("PORT", str(urlsplit(app.url).port)), "Cookie": header(cookies)}
    websocket = f"api/kernels/{kernel}/channels"
    token = f"?{urlsplit(app.url).query}"
    for path in ("", token, "voila/static/voila.js", "login", f"api/kernels/{kernel}", f"rds/kernel/{kernel}", "x"):
        status, body = ask(app, path, **own)
        assert (status, b"answers at 127.0.0.1 and localhost only" in body) == (403, True), path
    assert ask(app, websocket, **own, **UPGRADE)[0] == 403
    assert ask(app, "rds/emergency-stop", "POST", **own, **{"X-XSRFToken": cookies.get("_xsrf", "")})[0] == 403


@pytest.mark.parametrize("host", ["127.0.0.1:PORT", "localhost:PORT", "localhost:9999", "LOCALHOST:9999"])
def test_its_own_names_are_taken_and_a_forwarded_port(app: App, host: str) -> None:
    status, body = ask(app, "login", Host=host.replace("PORT", str(urlsplit(app.url).port)))
    assert status == 200 and b"password" in body.lower()  # who has no token is asked for it


def test_a_websocket_of_another_origin_is_refused(app: App, shown: Any) -> None:
    _, kernel, cookies = shown
    own, login = f"http://{urlsplit(app.url).netloc}", {"Cookie": header(cookies)}
    path = f"api/kernels/{kernel}/channels"
    for origin in ("http://127.0.0.1:1", "http://other.example", "null"):
        assert ask(app, path, **login, **UPGRADE, Origin=origin)[0] == 403
    assert ask(app, path, **UPGRADE, Origin=own)[0] == 403  # without a login
    assert ask(app, path, **login, **UPGRADE, Origin=own)[0] == 101
    assert ask(app, f"voila/query/{kernel}", **UPGRADE, Origin=own)[0] != 101  # would tell the page's address


class Other(http.server.BaseHTTPRequestHandler):
    """A server of another user, which keeps what cookies it is sent."""

    seen: list[str]

    def do_GET(self) -> None:
        self.seen.append(self.headers.get("Cookie", ""))
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(b"<p>come in</p>")

    def log_message(self, format: str, *args: Any) -> None:
        """Nobody reads it."""


@pytest.fixture
def other() -> Iterator[tuple[str, list[str]]]:
    """The address of a site of another user of this computer, and the cookies that it was sent."""
    seen: list[str] = []
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), type("Kept", (Other,), {"seen": seen}))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_address[1]}/", seen
    server.shutdown()
    server.server_close()


ATTACK = """async ([root, kernel]) => {
    const got = [];
    const opened = await new Promise((done) => {
        const line = new WebSocket(`${root.replace("http", "ws")}api/kernels/${kernel}/channels`);
        line.onopen = () => done(true);
        line.onerror = () => done(false);
    });
    if (opened) got.push("a websocket");
    for (const path of ["", `rds/kernel/${kernel}`, `api/kernels/${kernel}`])
        try { got.push(await (await fetch(root + path, { credentials: "include" })).text()); } catch {}
    await fetch(`${root}rds/kernel/${kernel}`, { method: "DELETE", credentials: "include" }).catch(() => {});
    await fetch(`${root}rds/emergency-stop`, { method: "POST", mode: "no-cors", credentials: "include" });
    return [got, document.cookie];
}"""


def test_a_page_of_another_users_server_gets_nothing_from_the_same_browser(
    app: App, shown: Any, other: tuple[str, list[str]], new_page: Callable[..., Any]
) -> None:
    page, kernel, cookies = shown
    address, seen = other
    root = app.url.partition("?")[0]
    theirs = new_page(800, 600)
    theirs.goto(address)
    got, cookies_there = theirs.evaluate(ATTACK, [root, kernel])
    assert got == []  # not even with the path, which it cannot know
    assert seen and not [each for each in cookies.values() if each in cookies_there + "".join(seen)]
    assert page.request.get(f"{root}api/kernels/{kernel}").status == 200  # it lives


def test_the_browser_is_started_with_a_file_that_only_its_user_reads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[str] = []
    ready = threading.Event()

    def start(address: str, new: int) -> None:
        started.append(address)
        ready.set()

    monkeypatch.setattr(webbrowser, "get", lambda _: SimpleNamespace(open=start))
    from rds.panels.app.server import PanelsServer  # here, as each worker would spend 2 s as it collects

    server = PanelsServer(ip="127.0.0.1", port=8866, base_url="/path/")
    server.connection_dir = str(tmp_path)
    server.identity_provider = SimpleNamespace(token="secret", token_generated=True)
    server.launch_browser()
    assert ready.wait(30)
    assert started == [(tmp_path / "open.html").as_uri()]
    assert (tmp_path / "open.html").stat().st_mode & 0o777 == 0o600
    assert "http://127.0.0.1:8866/path/?token=secret" in (tmp_path / "open.html").read_text()


def test_a_folder_has_no_settings_of_the_server(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "voila.py").write_text("open('was-run', 'w')\n")
    (tmp_path / "voila.json").write_text('{"Voila": {"token": "", "ip": "0.0.0.0"}}')
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(signal, "signal", lambda *_: None)  # it is the tests' process
    from rds.panels.app.server import PanelsServer  # here, as each worker would spend 2 s as it collects

    server = PanelsServer()
    server.initialize([str(Path(serve.__file__).parent / "page.ipynb"), "--Voila.ip=127.0.0.1"])
    assert not (tmp_path / "was-run").exists()
    assert (server.ip, server.token) == ("127.0.0.1", None)
