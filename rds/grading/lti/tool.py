"""The tool that a platform launches: login, launch, hand in. It runs nothing of what is handed in.

It listens on this computer alone; the way in from outside is the web server that has the certificate for `url`.
"""

from __future__ import annotations

import json
import re
import secrets
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from email.message import Message
from html import escape
from http.cookies import CookieError, SimpleCookie
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Lock
from typing import Any
from urllib.parse import parse_qsl

from rds.core.errors import InputError
from rds.core.extras import needed_for
from rds.grading.intake.notebooks import LARGEST
from rds.grading.lti.launches import Launched, keep_launch, keep_submission, read_launches, student_of
from rds.grading.lti.registration import check_address, read_registration, tool_config, tool_key
from rds.results.report import page

_AGS = "https://purl.imsglobal.org/spec/lti-ags/claim/endpoint"
_ROLES = "https://purl.imsglobal.org/spec/lti/claim/roles"
_PASS_LIFE = 3600.0  # s in which a student may hand in after a launch
_MOST_PASSES = 10_000
_MOST_FORM = 1 << 20  # bytes of a launch
_PATIENCE = 30.0  # s for a slow sender
_FORM = re.compile(r'multipart/form-data *; *boundary="?([^\s";]{1,70})"?', re.IGNORECASE)
_SAYS = re.compile(rb'; *(name|filename)="([^"\r\n]*)"', re.IGNORECASE)  # of a part of a form, in its head
_MOST_PARTS, _MOST_HEAD = 10, 4096  # bytes
_MOST_DIGITS = 12  # of a length
_POLICY = "default-src 'none'; style-src 'unsafe-inline'; form-action 'self'"


class Refused(Exception):
    """What the browser is told, with 403."""


class Tool:
    """What the server does, without the server. `url` is where browsers find it, `place` where submissions go."""

    def __init__(self, folder: Path, place: Path, url: str, title: str):
        check_address(url, "--url")
        with needed_for("LTI"):
            from rds.grading.lti.library import Storage
        self.url, self.title = url.rstrip("/"), title
        self._folder, self._place = folder, place
        self._config = tool_config(read_registration(folder), tool_key(folder))
        self._storage = Storage()
        self._passes: dict[str, tuple[float, Launched]] = {}
        self._lock = Lock()

    @property
    def is_https(self) -> bool:
        """Whether browsers come by https."""
        return self.url.startswith("https:")

    def keys(self) -> dict[str, Any]:
        """The tool's public key, for the platform."""
        return {"keys": self._config.get_jwks()["keys"]}

    def login(self, fields: Mapping[str, str]) -> tuple[str, dict[str, tuple[str, int]]]:
        """Where to send the browser, and its cookies. Refused where the platform is not the registered one."""
        from rds.grading.lti.library import Cookies, Login, LtiRequest, session

        cookies = Cookies({})
        with self._lock:
            login = Login(
                LtiRequest(fields, self.is_https),
                self._config,
                session_service=session(self._storage),
                cookie_service=cookies,
            )
            try:
                return login.get_redirect_object(f"{self.url}/launch").get_redirect_url(), cookies.given
            except Exception as error:  # the library knows no common base: an unknown issuer is a plain one
                raise Refused(str(error)) from error

    def launch(self, fields: Mapping[str, str], sent: Mapping[str, str]) -> tuple[str, Launched]:
        """A pass for handing in, and who it is. Refused where the message is not the platform's own, for this "
        "tool, now."""
        from rds.grading.lti.library import Cookies, Launch, LtiRequest, session

        with self._lock:
            launch = Launch(
                LtiRequest(fields, self.is_https),
                self._config,
                session_service=session(self._storage),
                cookie_service=Cookies(sent),
            )
            try:
                data: Mapping[str, Any] = launch.get_launch_data()
            except Exception as error:  # as above; whatever it cannot read of a message is no launch
                raise Refused(f"the launch is not valid: {error}") from error
            found = _launched(data)
            known = read_launches(self._folder).get(found.student)
            if known is not None and known.user != found.user:  # whose file this one's would take the place of
                found = replace(found, student=student_of(found.user, ""))
            keep_launch(self._folder, found)
            word = secrets.token_urlsafe(32)
            while len(self._passes) >= _MOST_PASSES:
                del self._passes[next(iter(self._passes))]
            self._passes[word] = time.monotonic() + _PASS_LIFE, found
        return word, found

    def hand_in(self, word: str, name: str, data: bytes) -> Launched:
        """Keep what the student with this pass hands in. Refused without a pass; InputError for what is no program."""
        with self._lock:
            until, found = self._passes.get(word, (0.0, None))
            if found is None or until < time.monotonic():
                raise Refused("this page is too old, or was not opened from the course: open it there again")
            keep_submission(self._place, found, name, data)
            return found


def _launched(data: Mapping[str, Any]) -> Launched:
    user, email = str(data.get("sub") or ""), str(data.get("email") or "")
    if not user:
        raise Refused("the platform does not say who it is; switch on that it sends its users' identifiers")
    roles = {str(role).rpartition("#")[2] for role in data.get(_ROLES) or ()}  # in LTI also without their address
    if not roles & {"Learner", "Student"}:
        raise Refused("only students hand in; to try it, open it in a student's role")
    endpoint = data.get(_AGS) or {}
    return Launched(
        student_of(user, email),
        user,
        str(data.get("name") or ""),
        email,
        str(endpoint.get("lineitem") or ""),
        tuple(str(scope) for scope in endpoint.get("scope") or ()),
    )


def serve(tool: Tool, port: int) -> ThreadingHTTPServer:
    """A server of the tool on 127.0.0.1; port 0 is any free one. Call `serve_forever()`, then `server_close()`."""

    class Handler(_Handler):
        own = tool

    return ThreadingHTTPServer(("127.0.0.1", port), Handler)


class _Handler(BaseHTTPRequestHandler):
    own: Tool
    timeout = _PATIENCE
    server_version, sys_version = "rds", ""

    def handle(self) -> None:
        """One request; who goes away before the answer is no fault of the tool's."""
        with suppress(ConnectionError):
            super().handle()

    def do_GET(self) -> None:
        """Keys; some platforms begin a login by GET."""
        path, _, query = self.path.partition("?")
        if path == "/jwks":
            self._answer(200, json.dumps(self.own.keys()).encode(), "application/json")
        elif path == "/login":
            self._guarded(lambda: self._login(dict(parse_qsl(query))))
        else:
            self._page(404, "There is nothing here", "Open the assignment in your course.")

    def do_POST(self) -> None:
        """Login, launch, hand in."""
        path = self.path.partition("?")[0]
        steps = {"/login": self._post_login, "/launch": self._launch, "/hand-in": self._hand_in}
        if path in steps:
            self._guarded(steps[path])
        else:
            self._page(404, "There is nothing here", "Open the assignment in your course.")

    def log_message(self, format: str, *args: Any) -> None:
        """Nothing: a log of who handed in when would be one more file to guard."""

    def _guarded(self, step: Any) -> None:
        try:
            step()
        except Refused as error:
            self._page(403, "Not handed in", str(error))
        except InputError as error:
            self._page(400, "Not handed in", str(error))

    def _post_login(self) -> None:
        self._login(self._form())

    def _login(self, fields: Mapping[str, str]) -> None:
        where, cookies = self.own.login(fields)
        self.send_response(302)
        self.send_header("Location", where)
        for name, (value, life) in cookies.items():
            # the page is in a frame of the platform's: there a browser sends cookies of other sites only with None
            safe = "; Secure; SameSite=None" if self.own.is_https else "; SameSite=Lax"
            self.send_header("Set-Cookie", f"{name}={value}; Max-Age={life}; Path=/; HttpOnly{safe}")
        self.send_header("Content-Length", "0")
        self.end_headers()

    def _launch(self) -> None:
        try:
            cookies = {name: morsel.value for name, morsel in SimpleCookie(self.headers.get("Cookie", "")).items()}
        except CookieError:
            cookies = {}
        word, who = self.own.launch(self._form(), cookies)
        form = (
            f'<form method="post" action="hand-in" enctype="multipart/form-data">'
            f'<input type="hidden" name="pass" value="{escape(word)}">'
            '<p><input type="file" name="file" accept=".py,.ipynb" required aria-label="Your file"></p>'
            "<p><button>Hand in</button></p></form>"
        )
        self._page(200, self.own.title, f"For {who.name or who.email or who.user}: a .py file, or a notebook.", form)

    def _hand_in(self) -> None:
        fields, name, data = _multipart(self.headers, self._body(LARGEST + _MOST_FORM))
        self.own.hand_in(fields.get("pass", ""), name, data)
        self._page(200, "Handed in", f"{len(data)} bytes were kept. A later file takes the place of this one.")

    def _form(self) -> dict[str, str]:
        return dict(parse_qsl(self._body(_MOST_FORM).decode("utf-8", "replace")))

    def _body(self, most: int) -> bytes:
        length = self.headers.get("Content-Length", "")
        if not length.isdecimal() or len(length) > _MOST_DIGITS or int(length) > most:
            self.close_connection = True
            raise Refused(f"the file is larger than {most} bytes, or its size is not said")
        return self.rfile.read(int(length))

    def _page(self, code: int, head: str, text: str, form: str = "") -> None:
        body = f"<header><h1>{escape(head)}</h1></header><p>{escape(text)}</p>{form}"
        self._answer(code, page(head, body).encode("utf-8", "replace"), "text/html; charset=utf-8")

    def _answer(self, code: int, data: bytes, kind: str) -> None:
        self.send_response(code)
        headers = {"Content-Type": kind, "Content-Length": str(len(data)), "Cache-Control": "no-store"}
        for name, value in (
            headers | {"X-Content-Type-Options": "nosniff", "Content-Security-Policy": _POLICY}
        ).items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(data)


def _multipart(headers: Message, body: bytes) -> tuple[dict[str, str], str, bytes]:
    """Fields, and the name and bytes of the one file, of a form as browsers send it.

    Anybody can send one, so it is cut here: a reader of e-mail takes minutes and gigabytes for one that is made for it.
    """
    kind = _FORM.fullmatch(headers.get("Content-Type", ""))
    fields: dict[str, str] = {}
    found: tuple[str, bytes] | None = None
    parts = (b"\r\n" + body).split(b"\r\n--" + kind[1].encode(), _MOST_PARTS) if kind else []
    for part in parts[1:]:
        if part.startswith(b"--"):
            break
        head, _, data = part.partition(b"\r\n\r\n")
        said = {name.lower(): text.decode("utf-8", "replace") for name, text in _SAYS.findall(head[:_MOST_HEAD])}
        if b"filename" in said:
            found = said[b"filename"], data
        elif b"name" in said:
            fields[said[b"name"]] = data.decode("utf-8", "replace")
    if found is None:
        raise InputError("no file came with it; choose one")
    return fields, *found
