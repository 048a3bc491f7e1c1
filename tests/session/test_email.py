"""E-mail of results: against a real SMTP server on loopback, and every way in which that fails."""

from __future__ import annotations

import contextlib
import email
import socket
import threading
from collections.abc import Iterator
from email.policy import default
from pathlib import Path
from typing import Any

import pytest

from rds.core.errors import InputError, MachineError
from rds.panels.session.email import Server, check_address, mail_server, send_files

aiosmtpd_controller = pytest.importorskip(
    "aiosmtpd.controller", reason="aiosmtpd is not installed: it is in the extra dev"
)
AuthResult = pytest.importorskip("aiosmtpd.smtp").AuthResult


class Box:
    """Keeps what it is handed; refuses one address."""

    def __init__(self) -> None:
        self.mails: list[Any] = []

    async def handle_RCPT(self, server: Any, session: Any, envelope: Any, address: str, options: Any) -> str:
        if address.startswith("nobody@"):
            return "550 there is no such user"
        envelope.rcpt_tos.append(address)
        return "250 OK"

    async def handle_DATA(self, server: Any, session: Any, envelope: Any) -> str:
        self.mails.append(envelope)
        return "250 taken"


@pytest.fixture
def box() -> Iterator[tuple[Box, Server]]:
    handler = Box()
    controller = aiosmtpd_controller.Controller(handler, hostname="127.0.0.1", port=free_port())
    controller.start()
    yield handler, Server("127.0.0.1", controller.port, "lab@example.edu", "none")
    controller.stop()


def free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return int(found.getsockname()[1])


def test_files_arrive_as_they_were(box: tuple[Box, Server], tmp_path: Path) -> None:
    handler, server = box
    data = bytes(range(256)) * 40
    (tmp_path / "result.csv").write_bytes(b"time,X\n0,1\n")
    (tmp_path / "result.mat").write_bytes(data)
    files = [tmp_path / "result.csv", tmp_path / "result.mat"]
    said = send_files(server, "me@example.edu, you@example.edu", "RDS: a\nrun", "Hello.\n", files)
    assert said == "sent to me@example.edu, you@example.edu: result.csv, result.mat"
    (mail,) = handler.mails
    assert mail.rcpt_tos == ["me@example.edu", "you@example.edu"]
    message = email.message_from_bytes(mail.content, policy=default)
    assert message["Subject"] == "RDS: a run" and message["From"] == "lab@example.edu"
    found = {part.get_filename(): part.get_payload(decode=True) for part in message.iter_attachments()}
    assert found["result.mat"] == data and found["result.csv"].replace(b"\r\n", b"\n") == b"time,X\n0,1\n"


@pytest.mark.parametrize(
    ("to", "security", "reason"),
    [("nobody@example.edu", "none", "550 there is no such user"), ("me@example.edu", "starttls", "STARTTLS")],
)
def test_a_refusal_says_why_and_where_the_files_are(
    box: tuple[Box, Server], tmp_path: Path, to: str, security: str, reason: str
) -> None:
    handler, server = box
    (tmp_path / "result.csv").write_text("kept")
    with pytest.raises(MachineError) as caught:
        send_files(Server(server.host, server.port, server.sender, security), to, "s", "t", [tmp_path / "result.csv"])
    assert reason in str(caught.value) and f"the files are kept in {tmp_path}" in str(caught.value)
    assert (tmp_path / "result.csv").read_text() == "kept" and not handler.mails


def test_no_server_there_says_so(tmp_path: Path) -> None:
    with pytest.raises(MachineError, match="nothing listens there"):
        send_files(Server("127.0.0.1", free_port(), "lab@example.edu", "none"), "me@example.edu", "s", "t", [])


@pytest.mark.parametrize("to", ["", "me", "me@a b", "a@b\nBcc: c@d", " , "])
def test_an_address_that_is_none_is_refused(to: str) -> None:
    with pytest.raises(InputError, match=r"no e-mail address|whom to send"):
        send_files(Server("127.0.0.1", 1, "lab@example.edu"), to, "s", "t", [])


def test_the_server_comes_from_the_folder_and_the_environment(tmp_path: Path) -> None:
    (tmp_path / "email.toml").write_text('host = "a.edu"\nsender = "lab@a.edu"\nport = 2525\nsecurity = "none"\n')
    server = mail_server(tmp_path, {"RDS_SMTP_HOST": "b.edu", "RDS_SMTP_PASSWORD": "secret"})
    assert server == Server("b.edu", 2525, "lab@a.edu", "none")  # nobody to log in, so the password stays here
    assert mail_server(tmp_path, {}) == Server("a.edu", 2525, "lab@a.edu", "none")


@pytest.mark.parametrize(
    ("text", "environment", "server"),
    [
        ("", {"USER": "lab"}, Server("b.edu", 587, "lab@a.edu", "starttls", "lab", "secret")),
        ('user = "lab"', {}, Server("b.edu", 587, "lab@a.edu", "starttls", "lab", "secret")),
        ('user = "lab"\nhost = "B.edu"\nport = 587\nsecurity = "starttls"', {},
         Server("b.edu", 587, "lab@a.edu", "starttls", "lab", "secret")),
        ('user = "lab"\nhost = "b.edu"\nport = 465', {"SECURITY": "tls"},
         Server("b.edu", 465, "lab@a.edu", "tls", "lab", "secret")),
    ],
)  # fmt: skip
def test_a_password_goes_to_the_server_that_the_environment_names(
    tmp_path: Path, text: str, environment: dict[str, str], server: Server
) -> None:
    (tmp_path / "email.toml").write_text(f'sender = "lab@a.edu"\n{text}\n')
    named = {"HOST": "b.edu", "PASSWORD": "secret"} | environment
    assert mail_server(tmp_path, {f"RDS_SMTP_{key}": value for key, value in named.items()}) == server


def test_a_folder_that_names_another_server_is_sent_nothing(
    tmp_path: Path, box: tuple[Box, Server], monkeypatch: pytest.MonkeyPatch
) -> None:
    handler, own = box
    for key, value in {
        "HOST": own.host, "PORT": str(own.port), "SECURITY": "none", "USER": "lab", "PASSWORD": "secret"
    }.items():  # fmt: skip
        monkeypatch.setenv(f"RDS_SMTP_{key}", value)
    with socket.create_server(("127.0.0.1", 0)) as others:  # of another user, on the same computer
        others.setblocking(False)
        port = others.getsockname()[1]
        for text in (f'host = "localhost"\nport = {port}', f"port = {port}", 'host = "mail.others.example"'):
            (tmp_path / "email.toml").write_text(f'sender = "lab@a.edu"\nsecurity = "none"\n{text}\n')
            with pytest.raises(InputError, match="is not where the password in RDS_SMTP_PASSWORD goes"):
                send_files(mail_server(tmp_path), "me@example.edu", "s", "t", [])
        with pytest.raises(BlockingIOError):
            others.accept()
    monkeypatch.delenv("RDS_SMTP_HOST")
    with pytest.raises(InputError, match="set RDS_SMTP_HOST to your mail server"):
        mail_server(tmp_path)
    assert handler.mails == []


def test_a_password_that_is_sent_arrives(tmp_path: Path) -> None:
    told: list[Any] = []

    def authenticate(server: Any, session: Any, envelope: Any, mechanism: str, data: Any) -> Any:
        told.append((data.login, data.password))
        return AuthResult(success=data.password == b"secret", handled=False)  # the server gives its answer

    handler = Box()
    options = {"authenticator": authenticate, "auth_require_tls": False, "auth_required": True}
    options["auth_exclude_mechanism"] = ["LOGIN"]  # else a refused password is sent once more
    controller = aiosmtpd_controller.Controller(handler, hostname="127.0.0.1", port=free_port(), **options)
    controller.start()
    try:
        (tmp_path / "email.toml").write_text('sender = "lab@a.edu"\n')
        named = {"HOST": "127.0.0.1", "PORT": str(controller.port), "SECURITY": "none", "USER": "lab"}
        environment = {f"RDS_SMTP_{key}": value for key, value in named.items()}
        server = mail_server(tmp_path, environment | {"RDS_SMTP_PASSWORD": "secret"})
        send_files(server, "me@example.edu", "s", "t", [])
        with pytest.raises(MachineError, match=r"not sent.*535") as refused:
            send_files(
                mail_server(tmp_path, environment | {"RDS_SMTP_PASSWORD": "wrong"}), "me@example.edu", "s", "t", []
            )
    finally:
        controller.stop()
    assert told == [(b"lab", b"secret"), (b"lab", b"wrong")] and len(handler.mails) == 1
    assert "wrong" not in str(refused.value)


def test_a_password_is_never_shown_and_never_sent_for_others_to_read() -> None:
    assert "secret" not in repr(Server("b.edu", 587, "lab@a.edu", "starttls", "lab", "secret"))
    for host in ("b.edu", "10.0.0.1", "localhost.b.edu", "0.0.0.0"):
        with pytest.raises(InputError, match=r'would send the password to .* use "starttls" or "tls"') as refused:
            Server(host, 25, "lab@a.edu", "none", "lab", "secret")
        assert "secret" not in str(refused.value)
    for host in ("localhost", "127.0.0.1", "127.0.1.1", "::1"):
        Server(host, 25, "lab@a.edu", "none", "lab", "secret")


@pytest.mark.parametrize(
    ("text", "environment", "reason"),
    [
        ("", {}, "no mail server is set up: host is missing"),
        ('host = "a"\n', {}, "sender is missing"),
        ('host = "a"\nsender = "l@a"\npassword = "p"\n', {}, "no key 'password'"),
        ('host = "a"\nsender = "l@a"\nsecurity = "ssl"\n', {}, "must be one of starttls, tls, none"),
        ('host = "a"\nsender = "l@a"\n', {"RDS_SMTP_PORT": "many"}, "whole number from 1 to 65535"),
        ('host = "a"\nsender = "l@a"\nuser = "u"\n', {}, "set RDS_SMTP_PASSWORD"),
        ('host = "a"\nsender = "la"\n', {}, "no e-mail address"),
        ("host = \n", {}, "email.toml"),
    ],
)
def test_a_wrong_set_up_is_told(tmp_path: Path, text: str, environment: dict[str, str], reason: str) -> None:
    if text:
        (tmp_path / "email.toml").write_text(text)
    with pytest.raises(InputError, match=reason):
        mail_server(tmp_path, environment)


@pytest.mark.parametrize(
    "address",
    ["a(b@c.de", "undisclosed:a@b.de", "=?utf-8?q?x=0aBcc?=@b.de", "a@b.de\r\nBcc: x@y.de", "a@b.de\x00", "[a@b.de]",
     "a@\ud800.de", "\u00e4@b.de", "a..b@c.de", "a@b..de", f"a@{'b' * 300}", 'a"b@c.de'],
)  # fmt: skip
def test_an_address_that_a_mail_program_could_take_for_another_is_refused(address: str) -> None:
    with pytest.raises(InputError, match="is no e-mail address"):
        check_address(address)


@pytest.mark.parametrize("address", ["me@example.edu", "first.last+rds@lab-3.example.edu", "o'neil@localhost"])
def test_ordinary_addresses_are_taken(address: str) -> None:
    assert check_address(f" {address} ") == address


@contextlib.contextmanager
def dripping() -> Iterator[int]:
    """A server whose greeting never ends: a line now and then. Its port."""
    over = threading.Event()
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            with contextlib.suppress(OSError):
                line, _ = server.accept()
                with line:
                    while not over.wait(0.02):
                        line.sendall(b"220-wait\r\n")

        thread = threading.Thread(target=serve)
        thread.start()
        yield server.getsockname()[1]
        over.set()
        thread.join()


def test_a_server_that_never_comes_to_the_point_is_left_in_time_and_at_once_when_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "result.csv").write_text("kept")
    files = [tmp_path / "result.csv"]
    with dripping() as port, pytest.raises(MachineError, match="it was stopped; the files are kept"):
        send_files(Server("127.0.0.1", port, "lab@example.edu"), "me@example.edu", "s", "t", files, lambda: True)
    monkeypatch.setattr("rds.panels.session.email.LONGEST", 0.3)
    with dripping() as port, pytest.raises(MachineError, match=r"took more than 0\.3 s"):
        send_files(Server("127.0.0.1", port, "lab@example.edu"), "me@example.edu", "s", "t", files)


@pytest.mark.parametrize("text", ["port = 587.5", "port = true", "user = 5"])
def test_words_of_the_wrong_kind_are_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "email.toml").write_text(f'host = "h"\nsender = "lab@example.edu"\n{text}\n')
    with pytest.raises(InputError, match=text.partition(" ")[0]):
        mail_server(tmp_path, {"RDS_SMTP_PASSWORD": "x"})
