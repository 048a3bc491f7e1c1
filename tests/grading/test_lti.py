"""LTI 1.3 with a platform on loopback: launch, hand in, and the points back; and what is refused."""

from __future__ import annotations

import json
import re
import socket
import struct
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from email.message import Message
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl, urlencode, urlsplit

import pytest

from rds.core.errors import InputError
from rds.grading.exports.export import export
from rds.grading.exports.exported import ExportOptions
from rds.grading.intake import collect
from rds.grading.lti.launches import Launched, keep_submission
from rds.grading.lti.registration import read_registration
from rds.grading.lti.tool import _multipart
from tests.grading.grades import batch_in, grade

jwt = pytest.importorskip("jwt", reason="pylti1p3next is not installed: pip install '.[lti]'")
pytest.importorskip("pylti1p3", reason="pylti1p3next is not installed: pip install '.[lti]'")
CLAIM = "https://purl.imsglobal.org/spec/lti/claim/"
AGS = "https://purl.imsglobal.org/spec/lti-ags/"
SCORE = f"{AGS}scope/score"


class Platform:
    """A learning platform's part of LTI 1.3: it signs launches, gives tokens to the tool alone, takes scores."""

    def __init__(self, tool_keys: dict[str, Any]):
        from cryptography.hazmat.primitives.asymmetric import rsa

        self.key = rsa.generate_private_key(public_exponent=65537, key_size=2048)
        self.scores: list[dict[str, Any]] = []
        self.tool_keys = tool_keys
        platform = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                public = json.loads(jwt.algorithms.RSAAlgorithm.to_jwk(platform.key.public_key()))
                self.say({"keys": [public | {"kid": "1", "alg": "RS256", "use": "sig"}]})

            def do_POST(self) -> None:
                body = self.rfile.read(int(self.headers["Content-Length"])).decode()
                if self.path == "/token":
                    form = dict(parse_qsl(body))
                    key = jwt.PyJWK(platform.tool_keys["keys"][0]).key
                    jwt.decode(form["client_assertion"], key, ["RS256"], audience=f"{platform.url}/token")
                    assert form["scope"] == SCORE
                    self.say({"access_token": "secret", "expires_in": 3600})
                else:
                    assert self.path == "/line/scores" and self.headers["Authorization"] == "Bearer secret"
                    platform.scores.append(json.loads(body))
                    self.say({})

            def say(self, value: Any) -> None:
                data = json.dumps(value).encode()
                self.send_response(200)
                self.send_header("Content-Type", "application/json")
                self.send_header("Content-Length", str(len(data)))
                self.end_headers()
                self.wfile.write(data)

            def log_message(self, format: str, *args: Any) -> None:
                pass

        self.server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self.server.server_address[1]}"

    def token(self, nonce: str, **changes: Any) -> str:
        """A launch message, as the platform signs it."""
        now = int(time.time())
        data = {
            "iss": self.url,
            "aud": "the-tool",
            "sub": "user-7",
            "exp": now + 300,
            "iat": now,
            "nonce": nonce,
            "name": "Ada Lovelace",
            "email": "Ada@example.edu",
            f"{CLAIM}deployment_id": "1",
            f"{CLAIM}message_type": "LtiResourceLinkRequest",
            f"{CLAIM}version": "1.3.0",
            f"{CLAIM}resource_link": {"id": "3"},
            f"{CLAIM}target_link_uri": "http://127.0.0.1/launch",
            f"{CLAIM}roles": ["http://purl.imsglobal.org/vocab/lis/v2/membership#Learner"],
            f"{AGS}claim/endpoint": {"lineitem": f"{self.url}/line", "scope": [SCORE]},
        }
        return str(jwt.encode(data | changes, self.key, "RS256", headers={"kid": "1"}))


class Course:
    """A platform, the tool, and a browser."""

    def __init__(self, folder: Path):
        from rds.grading.lti.tool import Tool, serve

        self.folder = folder
        self.platform = Platform({})
        words = {"issuer": "", "auth_login_url": "/auth", "auth_token_url": "/token", "key_set_url": "/jwks"}
        lines = [f'{key} = "{self.platform.url}{path}"' for key, path in words.items()]
        (folder / "lti.toml").write_text("\n".join([*lines, 'client_id = "the-tool"', 'deployment_id = "1"']))
        self.tool = Tool(folder, folder / "in", "http://127.0.0.1:1", "Tracking")
        self.server = serve(self.tool, 0)
        self.url = f"http://127.0.0.1:{self.server.server_address[1]}"
        self.platform.tool_keys = json.loads(urllib_of(self.tool.keys()))
        for each in (self.server, self.platform.server):
            threading.Thread(target=each.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()

    def login(self) -> tuple[dict[str, str], str]:
        """State and nonce as the tool sends the browser to the platform with them, and the browser's cookie."""
        form = {"iss": self.platform.url, "login_hint": "7", "client_id": "the-tool", "target_link_uri": "x"}
        opener = urllib.request.build_opener(NoRedirect)
        with pytest.raises(urllib.error.HTTPError) as said:
            opener.open(f"{self.url}/login", urlencode(form).encode())
        assert said.value.code == 302
        asked = urlsplit(said.value.headers["Location"])
        assert asked.path == "/auth"
        return dict(parse_qsl(asked.query)), said.value.headers["Set-Cookie"].partition(";")[0]

    def launch(self, token: str, state: str, cookie: str) -> tuple[int, str]:
        return self.post("/launch", urlencode({"id_token": token, "state": state}).encode(), {"Cookie": cookie})

    def hand_in(self, word: str, name: str, data: bytes) -> tuple[int, str]:
        parts = [
            b'--b\r\nContent-Disposition: form-data; name="pass"\r\n\r\n' + word.encode(),
            f'--b\r\nContent-Disposition: form-data; name="file"; filename="{name}"\r\n'.encode()
            + b"Content-Type: application/octet-stream\r\n\r\n"
            + data,
            b"--b--\r\n",
        ]
        return self.post("/hand-in", b"\r\n".join(parts), {"Content-Type": "multipart/form-data; boundary=b"})

    def post(self, path: str, data: bytes, headers: dict[str, str]) -> tuple[int, str]:
        try:
            with urllib.request.urlopen(urllib.request.Request(f"{self.url}{path}", data, headers)) as answer:
                return answer.status, answer.read().decode()
        except urllib.error.HTTPError as error:
            return error.code, error.read().decode()

    def close(self) -> None:
        for each in (self.server, self.platform.server):
            each.shutdown()
            each.server_close()


class NoRedirect(urllib.request.HTTPRedirectHandler):
    def redirect_request(self, *args: Any) -> None:
        return None


def urllib_of(keys: dict[str, Any]) -> str:
    return json.dumps(keys)


@pytest.fixture
def course(tmp_path: Path) -> Iterator[Course]:
    made = Course(tmp_path)
    yield made
    made.close()


def test_a_student_hands_in_from_the_course_and_the_points_go_back(course: Course) -> None:
    asked, cookie = course.login()
    code, page = course.launch(course.platform.token(asked["nonce"]), asked["state"], cookie)
    assert code == 200 and "Ada Lovelace" in page
    (word,) = re.findall(r'name="pass" value="([^"]+)"', page)
    assert course.hand_in(word, "law.ipynb", b"{}")[0] == 200
    assert course.hand_in(word, "law.py", b"x = 1\r\n")[0] == 200  # takes the place of the first
    (row,) = collect(course.folder / "in").rows
    assert row.read() == b"x = 1\r\n" and row.time is not None
    ada = grade(row.student)
    out = batch_in(course.folder / "out", [ada, grade("eve")])
    done = export(out, "lti", None, ExportOptions(course.folder, points=60.0))
    (score,) = course.platform.scores
    assert (score["scoreGiven"], score["scoreMaximum"], score["userId"]) == (52.0, 60.0, "user-7")
    assert done.students == 1 and set(done.left_out) == {"eve"}
    assert (course.folder / "lti-key.pem").stat().st_mode & 0o077 == 0


def test_a_launch_counts_once_for_who_began_it(course: Course) -> None:
    asked, cookie = course.login()
    token = course.platform.token(asked["nonce"])
    assert course.launch(token, asked["state"], "lti1p3-other=1")[0] == 403
    assert course.launch(token, asked["state"], cookie)[0] == 200
    code, page = course.launch(token, asked["state"], cookie)
    assert code == 403 and "Nonce" in page


@pytest.mark.parametrize(
    "changes",
    [
        {"iss": "http://127.0.0.1:9"},
        {"aud": "another-tool"},
        {"exp": 1},
        {f"{CLAIM}deployment_id": "2"},
        {f"{CLAIM}roles": ["http://purl.imsglobal.org/vocab/lis/v2/membership#Instructor"]},
        {"sub": ""},
    ],
)
def test_a_message_that_is_not_for_this_tool_is_refused(course: Course, changes: dict[str, Any]) -> None:
    asked, cookie = course.login()
    code, _ = course.launch(course.platform.token(asked["nonce"], **changes), asked["state"], cookie)
    assert code == 403 and not (course.folder / "lti-launches.jsonl").exists()


def test_a_role_may_be_a_word(course: Course) -> None:
    asked, cookie = course.login()
    token = course.platform.token(asked["nonce"], **{f"{CLAIM}roles": ["Learner"]})
    assert course.launch(token, asked["state"], cookie)[0] == 200


def test_a_message_that_others_signed_is_refused(course: Course) -> None:
    asked, cookie = course.login()
    other = Platform({})
    other.server.server_close()
    other.url = course.platform.url
    assert course.launch(other.token(asked["nonce"]), asked["state"], cookie)[0] == 403
    none = jwt.encode(jwt.decode(other.token(asked["nonce"]), options={"verify_signature": False}), None, "none")
    assert course.launch(none, asked["state"], cookie)[0] == 403


def test_nothing_is_kept_without_a_pass_or_under_another_name(course: Course) -> None:
    assert course.hand_in("guessed", "law.py", b"")[0] == 403
    asked, cookie = course.login()
    _, page = course.launch(course.platform.token(asked["nonce"]), asked["state"], cookie)
    (word,) = re.findall(r'name="pass" value="([^"]+)"', page)
    assert course.hand_in(word, "../../law.sh", b"")[0] == 400
    assert course.hand_in(word, "../../law.py", b"y = 2")[0] == 200
    (path,) = course.folder.glob("**/*.py")
    assert path.parent.parent == course.folder / "in"


def test_times_that_a_spreadsheet_has_saved_are_kept_on(tmp_path: Path) -> None:
    (tmp_path / "timestamps.csv").write_text("student;timestamp\nben;2026-01-10T13:00:00+00:00\n")
    keep_submission(tmp_path, Launched("ada", "7"), "law.py", b"x = 1")
    students = [line.partition(",")[0] for line in (tmp_path / "timestamps.csv").read_text().splitlines()]
    assert students == ["student", "ada", "ben"]


def test_a_registration_without_https_is_refused(tmp_path: Path) -> None:
    words = ("issuer", "client_id", "deployment_id", "auth_login_url", "auth_token_url", "key_set_url")
    lines = [f'{word} = "http://lms.example.edu"' for word in words]
    (tmp_path / "lti.toml").write_text("\n".join(lines))
    with pytest.raises(InputError, match="must begin with https"):
        read_registration(tmp_path)


@pytest.mark.parametrize(
    "part",
    [
        b'Content-Disposition: form-data; name=file; filename="' + b"=?utf-8?q?a?= " * 10_000 + b'.py"\r\n\r\nx',
        b"Content-Disposition: form-data" + b"; a=b" * 100_000 + b"\r\n\r\nx",
        b"".join(b"Content-Type: multipart/mixed; boundary=b%d\r\n\r\n--b%d\r\n" % (n, n) for n in range(20_000)),
        b"\r\n\r\n--b\r\n" * 200_000,
    ],
    ids=["encoded words", "parameters", "forms in forms", "parts"],
)
def test_a_form_that_is_made_to_take_long_is_refused_at_once(part: bytes) -> None:
    """Anybody can send one: a few hundred kB took a minute and 3 GB, or a traceback."""
    headers = Message()
    headers["Content-Type"] = "multipart/form-data; boundary=b"
    began = time.process_time()
    with pytest.raises(InputError, match="no file came with it"):
        _multipart(headers, b"--b\r\n" + part + b"\r\n--b--\r\n")
    assert time.process_time() - began < 1.0


def test_a_form_of_a_browser_is_read_to_the_byte() -> None:
    headers = Message()
    headers["Content-Type"] = "multipart/form-data; boundary=----WebKitFormBoundary7MA4YWxkTrZu0gW"
    data = b"--b\r\nx = '\xc3\xbc'\r\n\r\n--\r\n"
    body = b"------WebKitFormBoundary7MA4YWxkTrZu0gW\r\n".join(
        [
            b"",
            b'Content-Disposition: form-data; name="pass"\r\n\r\nword\r\n',
            'Content-Disposition: form-data; name="file"; filename="Übung (1) %22.py"\r\n'.encode()
            + b"Content-Type: text/x-python\r\n\r\n"
            + data,
        ]
    )
    body += b"\r\n------WebKitFormBoundary7MA4YWxkTrZu0gW--\r\n"
    assert _multipart(headers, body) == ({"pass": "word"}, "Übung (1) %22.py", data)


@pytest.mark.parametrize(
    "sent",
    [
        b"POST http://[x/hand-in HTTP/1.1\r\nContent-Length: 0\r\n\r\n",
        b"POST /hand-in HTTP/1.1\r\nContent-Length: " + b"9" * 5000 + b"\r\n\r\n",
        b"POST /hand-in HTTP/1.1\r\nContent-Length: 1000\r\n\r\nabc",
    ],
    ids=["no address", "a length of 5000 digits", "gone before its end"],
)
def test_what_anybody_sends_is_no_fault_of_the_tool(
    sent: bytes, course: Course, monkeypatch: pytest.MonkeyPatch
) -> None:
    faults: list[Any] = []
    monkeypatch.setattr(course.server, "handle_error", lambda *about: faults.append(about))
    with socket.create_connection(course.server.server_address[:2]) as browser:  # type: ignore[arg-type]
        browser.sendall(sent)
        if b"abc" in sent:
            time.sleep(0.1)  # until the rest of it is waited for
            browser.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # cut off at once
        else:
            assert b" 40" in browser.recv(100)
    time.sleep(0.2)
    assert not faults


def test_nobody_takes_the_place_of_another_by_an_e_mail_address(course: Course) -> None:
    """Users of some platforms write their address themselves."""
    for user, text in (("user-7", b"ada = 1"), ("user-8", b"eve = 1"), ("user-7", b"ada = 2")):
        asked, cookie = course.login()
        _, page = course.launch(course.platform.token(asked["nonce"], sub=user), asked["state"], cookie)
        (word,) = re.findall(r'name="pass" value="([^"]+)"', page)
        assert course.hand_in(word, "law.py", text)[0] == 200
    assert sorted(row.read() for row in collect(course.folder / "in").rows) == [b"ada = 2", b"eve = 1"]
