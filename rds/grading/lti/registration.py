"""What a platform and this tool know of each other: `lti.toml`, with the tool's own key beside it.

issuer = "https://moodle.example.edu"
client_id = "Qw1..."
deployment_id = "1"
auth_login_url = "https://moodle.example.edu/mod/lti/auth.php"
auth_token_url = "https://moodle.example.edu/mod/lti/token.php"
key_set_url = "https://moodle.example.edu/mod/lti/certs.php"
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from rds.core.errors import InputError
from rds.core.extras import needed_for
from rds.core.private_files import write_private
from rds.core.toml_file import read_toml

FILE, KEY, LAUNCHES = "lti.toml", "lti-key.pem", "lti-launches.jsonl"
_BITS = 2048
_LOOPBACK = ("127.0.0.1", "::1", "localhost")


@dataclass(frozen=True)
class Registration:
    """As the platform shows it when the tool is registered there; all are texts."""

    issuer: str
    client_id: str
    deployment_id: str
    auth_login_url: str
    auth_token_url: str
    key_set_url: str


def read_registration(folder: Path) -> Registration:
    """The registration in a folder. InputError for a key that is missing, unknown, or no safe address."""
    path = folder / FILE
    if not path.is_file():
        raise InputError(f"there is no {FILE}; write what your platform says of the tool into it", str(folder))
    words: Mapping[str, Any] = read_toml(path)[0]
    names = [field.name for field in fields(Registration)]
    if unknown := sorted(set(words) - set(names)):
        raise InputError(f"{unknown[0]} is no key of it; there are {', '.join(names)}", str(path))
    for name in names:
        value = words.get(name)
        if not isinstance(value, str) or not value:
            raise InputError(f"{name} is missing; give the platform's value, as a text", str(path))
        if name.endswith("_url") or name == "issuer":
            check_address(value, f"{path}: {name}")
    return Registration(**{name: words[name] for name in names})


def check_address(url: str, place: str) -> None:
    """InputError for an address that is neither https nor on this computer: launches carry who somebody is."""
    parts = urlsplit(url)
    if parts.scheme == "https" or (parts.scheme == "http" and parts.hostname in _LOOPBACK):
        return
    raise InputError(f"{url!r} must begin with https:// (http:// is for this computer only)", place)


def tool_key(folder: Path) -> tuple[str, str]:
    """The tool's private and public key, PEM; made, readable by its user alone, where there is none yet."""
    with needed_for("LTI"):
        from cryptography.hazmat.primitives import serialization as form
        from cryptography.hazmat.primitives.asymmetric import rsa
    path = folder / KEY
    if not path.exists():
        made = rsa.generate_private_key(public_exponent=65537, key_size=_BITS)
        data = made.private_bytes(form.Encoding.PEM, form.PrivateFormat.PKCS8, form.NoEncryption())
        write_private(path, data, is_own=True)
    private = path.read_bytes()
    try:
        key = form.load_pem_private_key(private, None)
    except ValueError as error:
        raise InputError(f"is no private key ({error}); remove it, and register the new one", str(path)) from error
    public = key.public_key().public_bytes(form.Encoding.PEM, form.PublicFormat.SubjectPublicKeyInfo)
    return private.decode(), public.decode()


def tool_config(registration: Registration, keys: tuple[str, str]) -> Any:
    """Both as the library has them."""
    with needed_for("LTI"):
        from pylti1p3.tool_config import ToolConfDict
    about: Any = {
        "default": True,
        "client_id": registration.client_id,
        "auth_login_url": registration.auth_login_url,
        "auth_token_url": registration.auth_token_url,
        "key_set_url": registration.key_set_url,
        "deployment_ids": [registration.deployment_id],
    }
    config = ToolConfDict({registration.issuer: about})
    config.set_private_key(registration.issuer, keys[0])
    config.set_public_key(registration.issuer, keys[1])
    return config
