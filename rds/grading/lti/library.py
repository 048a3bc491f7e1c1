"""The library's door: its requests, cookies and storage, for one server process.

PyLTI1p3 checks the platform's signature, the state, the nonce, the deployment and the message; nothing of that is here.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

from pylti1p3.cookie import CookieService
from pylti1p3.launch_data_storage.base import LaunchDataStorage
from pylti1p3.message_launch import MessageLaunch
from pylti1p3.oidc_login import OIDCLogin
from pylti1p3.redirect import Redirect
from pylti1p3.request import Request
from pylti1p3.service_connector import ServiceConnector
from pylti1p3.session import SessionService

_MOST = 10_000  # of what is kept: who sends logins without end fills no memory
_LIFE = 600.0  # s


class LtiRequest(Request):
    """One request: its fields, and whether the browser came by https."""

    def __init__(self, fields: Mapping[str, str], is_https: bool):
        self._fields, self._is_https = fields, is_https

    @property
    def session(self) -> dict[str, Any]:
        """What the library would keep in a framework's session; here the storage keeps it."""
        return {}

    def is_secure(self) -> bool:
        """Whether by https."""
        return self._is_https

    def get_param(self, key: str) -> str:
        """A field; empty where it is not there."""
        return self._fields.get(key, "")


class Cookies(CookieService):
    """The browser's cookies, and those that it is to be given: by name, value and life in s."""

    def __init__(self, sent: Mapping[str, str]):
        self._sent = sent
        self.given: dict[str, tuple[str, int]] = {}

    def get_cookie(self, name: str) -> str | None:
        """What the browser sent."""
        return self._sent.get(f"{self._cookie_prefix}-{name}")

    def set_cookie(self, name: str, value: Any, exp: int | None = 3600) -> None:
        """To be sent with the answer."""
        self.given[f"{self._cookie_prefix}-{name}"] = str(value), exp or 3600


class Storage(LaunchDataStorage[Any]):
    """Nonces and launches in memory, for ten minutes. A nonce is good for one launch."""

    def __init__(self) -> None:
        super().__init__()
        self._kept: dict[str, tuple[float, Any]] = {}

    def can_set_keys_expiration(self) -> bool:
        """They expire."""
        return True

    def get_value(self, key: str) -> Any:
        """What is kept by that name, None where it is not."""
        until, value = self._kept.get(self._prepare_key(key), (0.0, None))
        return value if until > time.monotonic() else None

    def set_value(self, key: str, value: Any, exp: int | None = None) -> None:
        """Keep it for a while; the oldest goes where there is too much."""
        while len(self._kept) >= _MOST:
            del self._kept[next(iter(self._kept))]
        self._kept[self._prepare_key(key)] = time.monotonic() + min(float(exp or _LIFE), _LIFE), value

    def check_value(self, key: str) -> bool:
        """Whether it is kept; then it is no more, so that no launch can be played again."""
        is_kept = self.get_value(key) is not None
        self._kept.pop(self._prepare_key(key), None)
        return is_kept


class RedirectTo(Redirect[str]):
    """An address to be sent to."""

    def __init__(self, url: str):
        self._url = url

    def do_redirect(self) -> str:
        """The address."""
        return self._url

    def do_js_redirect(self) -> str:
        """The address, too: no script is used."""
        return self._url

    def set_redirect_url(self, location: str) -> None:
        """Another one."""
        self._url = location

    def get_redirect_url(self) -> str:
        """The address."""
        return self._url


class Login(OIDCLogin[Any, Any, Any, Any, Any]):
    """The first step: the platform says who is to be launched, and is asked to prove it."""

    def get_redirect(self, url: str) -> RedirectTo:
        """Where the browser is sent."""
        return RedirectTo(url)


class Launch(MessageLaunch[Any, Any, Any, Any]):
    """The second step: the platform's signed message."""

    def _get_request_param(self, key: str) -> str:
        return str(self._request.get_param(key))


class Connector(ServiceConnector):
    """Asks the platform's services; a token is used until a minute before its end."""

    def __init__(self, registration: Any):
        super().__init__(registration)
        self._tokens: dict[str, tuple[float, str]] = {}

    def _get_cached_access_token(self, scope_key: str) -> str | None:
        until, token = self._tokens.get(scope_key, (0.0, ""))
        return token if until > time.monotonic() else None

    def _cache_access_token(self, scope_key: str, access_token: str, expires_in: float) -> None:
        self._tokens[scope_key] = time.monotonic() + float(expires_in) - 60.0, access_token


def session(storage: Storage) -> SessionService:
    """The library's session over the storage."""
    made = SessionService(LtiRequest({}, True))
    made.set_data_storage(storage)
    return made
