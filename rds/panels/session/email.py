"""Results by e-mail: an SMTP server from the folder's `email.toml` or the environment; files stay where they are.

host = "mail.example.edu"
port = 587
security = "starttls"      # "tls", "starttls" or "none"
sender = "lab@example.edu"
user = "lab"               # optional; for a server that asks for a password

A password comes from RDS_SMTP_PASSWORD only, and goes to the server that the environment names beside it
(RDS_SMTP_HOST, _PORT, _SECURITY): whoever wrote the folder's file could be anybody.
"""

from __future__ import annotations

import contextlib
import mimetypes
import os
import re
import smtplib
import socket
import ssl
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from email.message import EmailMessage
from email.utils import make_msgid
from pathlib import Path

from rds.core.errors import InputError, MachineError
from rds.core.loopback import is_loopback
from rds.core.toml_table import TomlTable

FILE = "email.toml"
SECURITY = ("starttls", "tls", "none")
TIMEOUT = 20.0  # s for each answer of the server
LONGEST = 180.0  # s for all of it: a server that answers by drops never exceeds the other
_LOOKS = 0.1  # s
LARGEST = 20 << 20  # bytes of all attachments: what most servers take
_WORD = r"[A-Za-z0-9!#$%&'*+/=?^_`{|}~-]+"  # RFC 5321's atom: what no mail program takes for something else
_ADDRESS = re.compile(rf"{_WORD}(\.{_WORD})*@(?=.{{1,253}}\Z)[A-Za-z0-9-]+(\.[A-Za-z0-9-]+)*")
_KEYS = ("host", "port", "security", "sender", "user")
_WHERE = ("host", "port", "security")  # which decide who can read a password


@dataclass(frozen=True)
class Server:
    """Where mail is handed in, and as whom. InputError for a password that others could read on its way."""

    host: str
    port: int
    sender: str
    security: str = "starttls"
    user: str | None = None
    password: str | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        if self.password is not None and self.security == "none" and not is_loopback(self.host.casefold()):
            raise InputError(
                f'security = "none" would send the password to {self.host} for all to read on its way; '
                'use "starttls" or "tls"'
            )


def mail_server(folder: Path, environment: Mapping[str, str] = os.environ) -> Server:
    """The server of `folder`/email.toml, over which RDS_SMTP_HOST, _PORT, _SECURITY, _SENDER, _USER have precedence.

    InputError that says what is missing or will not do, and for a file that names another server than the environment
    where a password would be sent.
    """
    path = folder / FILE
    of_file = dict(TomlTable.open(path).table) if path.is_file() else {}
    if unknown := [key for key in of_file if key not in _KEYS]:
        raise InputError(f"there is no key {unknown[0]!r}; there are {', '.join(_KEYS)}", str(path))
    of_user = {key: environment[_variable(key)] for key in _KEYS if _variable(key) in environment}
    given = of_file | of_user
    for key in ("host", "sender"):
        if not given.get(key) or not isinstance(given[key], str):
            raise InputError(f"no mail server is set up: {key} is missing; write it into {path}, or set RDS_SMTP_HOST")
    security = given.get("security", "starttls")
    if security not in SECURITY:
        raise InputError(f"security = {security!r} must be one of {', '.join(SECURITY)}", str(path))
    said = str(given.get("port", _port(security)))
    port = int(said) if said.isascii() and said.isdigit() else 0
    if not 0 < port < 65536:
        raise InputError(f"port = {given.get('port')!r} must be a whole number from 1 to 65535", str(path))
    user = given.get("user")
    if user is not None and not isinstance(user, str):
        raise InputError(f"user = {user!r} must be text", str(path))
    password = environment.get("RDS_SMTP_PASSWORD") if user is not None else None
    if user is not None:
        if password is None:
            raise InputError("the mail server has a user but no password; set RDS_SMTP_PASSWORD", str(path))
        _check_where(of_file, of_user, path)
    return Server(given["host"], port, check_address(given["sender"]), security, user, password)


def _check_where(of_file: Mapping[str, object], of_user: Mapping[str, str], path: Path) -> None:
    """InputError unless the environment alone says where the password goes."""
    if "host" not in of_user:
        raise InputError(
            "the password in RDS_SMTP_PASSWORD goes only to the server that the environment names beside it: "
            f"set RDS_SMTP_HOST to your mail server; {path} may be anybody's"
        )
    meant = {"security": SECURITY[0], **of_user}
    meant.setdefault("port", _port(meant["security"]))
    for key in _WHERE:
        if key in of_file and str(of_file[key]).casefold() != meant[key].casefold():
            raise InputError(
                f"{key} = {of_file[key]!r} is not where the password in RDS_SMTP_PASSWORD goes: in the environment it "
                f"is {meant[key]!r}. Take {key} out of the file; or if you know that server, set {_variable(key)}",
                str(path),
            )


def _port(security: object) -> str:
    return "465" if security == "tls" else "587"


def _variable(key: str) -> str:
    return f"RDS_SMTP_{key.upper()}"


def check_address(text: str) -> str:
    """One address; InputError if it is none."""
    text = text.strip()
    if not _ADDRESS.fullmatch(text) or "=?" in text:  # =? begins a word in another alphabet, line ends and all
        raise InputError(f"{text!r:.80} is no e-mail address; as in name@example.edu")
    return text


def check_addresses(text: str) -> None:
    """Addresses, separated by commas; InputError for the first that is none."""
    for each in text.split(","):
        check_address(each)


def send_files(
    server: Server,
    to: str,
    subject: str,
    text: str,
    files: Sequence[Path],
    asked: Callable[[], bool] = lambda: False,
) -> str:
    """Send `files` to the addresses in `to`, separated by commas; a sentence that says so.

    Waits for the server, LONGEST s at most and until `asked()` says that it should end. MachineError with its reason
    where that fails, InputError for what cannot be sent; the files stay where they are.
    """
    recipients = [check_address(each) for each in to.split(",") if each.strip()]
    if not recipients:
        raise InputError("say whom to send it to, as in name@example.edu")
    message = _message(server, recipients, subject, text, files)
    kept = f"; the files are kept in {files[0].parent}" if files else ""
    connection = _connection(server)
    why: list[str] = []
    try:
        with _ended_in_time(connection, asked, why), connection:
            _greet(connection, server)
            if server.user is not None and server.password is not None:
                connection.login(server.user, server.password)
            refused = connection.send_message(message)
    except (smtplib.SMTPException, OSError, ValueError) as error:
        reason = why[0] if why else _reason(error)
        raise MachineError(f"not sent: {server.host}, port {server.port}: {reason}{kept}") from error
    if refused:
        raise MachineError(f"not sent to {', '.join(refused)}: the server refused the address{kept}")
    return f"sent to {', '.join(recipients)}: {', '.join(file.name for file in files)}"


def _message(server: Server, to: Sequence[str], subject: str, text: str, files: Sequence[Path]) -> EmailMessage:
    size = sum(file.stat().st_size for file in files if file.is_file())
    if size > LARGEST:
        raise InputError(
            f"the files have {size / 1e6:.0f} MB; a mail takes {LARGEST >> 20} MB; send the report alone, or copy them"
        )
    message = EmailMessage()
    message["From"], message["To"] = server.sender, ", ".join(to)
    message["Subject"] = " ".join(subject.split())
    message["Message-ID"] = make_msgid(domain=server.sender.partition("@")[2])
    message.set_content(text)
    for file in files:
        try:
            data = file.read_bytes()
        except OSError as error:
            raise InputError(f"cannot be read: {error.strerror}", str(file)) from error
        kind, _, subkind = (mimetypes.guess_type(file.name)[0] or "application/octet-stream").partition("/")
        message.add_attachment(data, maintype=kind, subtype=subkind, filename=file.name)
    return message


def _connection(server: Server) -> smtplib.SMTP:
    """Not yet connected, so that the wait for a connection can be ended as well."""
    if server.security == "tls":
        return smtplib.SMTP_SSL(timeout=TIMEOUT, context=ssl.create_default_context())
    return smtplib.SMTP(timeout=TIMEOUT)


def _greet(connection: smtplib.SMTP, server: Server) -> None:
    connection._host = server.host  # type: ignore[attr-defined]  # which the constructor sets, for the certificate
    code, said = connection.connect(server.host, server.port)
    if code != 220:
        raise smtplib.SMTPConnectError(code, said)
    if server.security == "starttls":
        connection.starttls(context=ssl.create_default_context())


@contextlib.contextmanager
def _ended_in_time(connection: smtplib.SMTP, asked: Callable[[], bool], why: list[str]) -> Iterator[None]:
    """Cut the connection when `asked()` is true or LONGEST s have gone by, and put the reason into `why`."""
    over = threading.Event()

    def watch() -> None:
        deadline = time.monotonic() + LONGEST
        while not over.wait(_LOOKS):
            if not why and (asked() or time.monotonic() > deadline):
                why.append("it was stopped" if asked() else f"the server took more than {LONGEST:g} s")
            if why and connection.sock is not None:  # None while it is being connected
                with contextlib.suppress(OSError, ValueError):
                    connection.sock.shutdown(socket.SHUT_RDWR)

    watcher = threading.Thread(target=watch, name="rds mail", daemon=True)
    watcher.start()
    try:
        yield
    finally:
        over.set()
        watcher.join()


def _reason(error: Exception) -> str:
    if isinstance(error, smtplib.SMTPResponseException):
        said = error.smtp_error
        return f"{error.smtp_code} {said.decode(errors='replace') if isinstance(said, bytes) else said}"
    if isinstance(error, smtplib.SMTPRecipientsRefused):
        return "it refused the address: " + "; ".join(
            f"{to}: {code} {text.decode(errors='replace')}" for to, (code, text) in error.recipients.items()
        )
    if isinstance(error, socket.gaierror):
        return "there is no such host"
    if isinstance(error, ConnectionRefusedError):
        return "nothing listens there"
    return str(error) or type(error).__name__
