"""A dask scheduler: its address, and what protects the connection to it.

Whoever can connect to a dask scheduler can run code on its workers and clients: what goes to and fro is pickled.
With TLS both sides show a certificate of one authority of their own. Plain TCP protects nothing.
"""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rds.core.errors import InputError
from rds.core.loopback import is_loopback

_HELP = "see 'On several computers' in docs/submissions.md"
_ADDRESS = re.compile(r"(?:(?P<protocol>[a-z]+)://)?(?P<host>\[[0-9a-fA-F:.%]+\]|[^\s:/\[\]]+):(?P<port>[0-9]{1,5})")


class ClusterWarning(UserWarning):
    """That other users of this computer can connect to the scheduler as well."""


@dataclass(frozen=True, repr=False)
class Scheduler:
    """Where it is: `tls://HOST:PORT`, or `tcp://127.0.0.1:PORT` on this computer.

    `ca`, `cert` and `key` are PEM files: the authority's certificate, one's own, and its private key. Those that are
    not given are dask's (its configuration, or DASK_DISTRIBUTED__COMM__TLS__CA_FILE and so on). `insecure` allows plain
    TCP to other computers, where whoever reaches the network can run code as its users.
    """

    address: str
    ca: str | Path | None = None
    cert: str | Path | None = None
    key: str | Path | None = None
    insecure: bool = False

    def __repr__(self) -> str:
        return repr(self.address)

    @classmethod
    def of(cls, scheduler: str | Scheduler) -> Scheduler:
        """A mere address with dask's own certificates."""
        return scheduler if isinstance(scheduler, Scheduler) else cls(scheduler)

    @property
    def is_tls(self) -> bool:
        """Whether the connection is encrypted, and both sides are who they say."""
        return self._parts()[0] == "tls"

    def check(self) -> None:
        """InputError where it is not to be connected to. Nothing is sent, and no name is looked up."""
        protocol, host = self._parts()
        given = [name for name in ("ca", "cert", "key") if getattr(self, name) is not None]
        if protocol == "tcp":
            if given:
                raise InputError(
                    f"scheduler {self!r} is plain TCP, which takes no certificates ({', '.join(given)} given); start "
                    f"it with TLS and give tls://..., {_HELP}"
                )
            if not is_loopback(host) and not self.insecure:
                raise InputError(
                    f"scheduler {self!r} is plain TCP: whoever reaches or imitates it runs code as you, here and on "
                    f"its workers. Start scheduler and workers with TLS and give tls://... ({_HELP}), or, on a network "
                    "that only you can reach, say --insecure-cluster (in Python Scheduler(..., insecure=True))"
                )
        else:
            for name in given:
                if not Path(getattr(self, name)).is_file():
                    raise InputError(f"--tls-{name} {str(getattr(self, name))!r}: there is no such file; {_HELP}")

    def warning(self) -> str:
        """What is to be said of plain TCP; "" with TLS."""
        protocol, host = self._parts()
        if protocol == "tls":
            return ""
        who = "every user of this computer" if is_loopback(host) else "whoever reaches it over the network"
        return f"scheduler {self!r} is plain TCP: {who} can run code as its users; tls:// keeps others out, {_HELP}"

    def security(self) -> Any:
        """dask's Security for it; InputError where certificates are missing. Warns of plain TCP."""
        from distributed.security import Security

        if not self.is_tls:
            warnings.warn(self.warning(), ClusterWarning, stacklevel=2)
            return Security()
        files = {"tls_ca_file": self.ca, "tls_client_cert": self.cert, "tls_client_key": self.key}
        security = Security(
            require_encryption=True, **{name: str(Path(file).resolve()) for name, file in files.items() if file}
        )
        options = zip(("--tls-ca", "--tls-cert", "--tls-key"), files, strict=True)
        missing = [option for option, name in options if not getattr(security, name)]
        if missing:
            raise InputError(
                f"scheduler {self!r} needs {', '.join(missing)} (PEM files), or them in dask's configuration; {_HELP}"
            )
        try:
            security.get_connection_args("client")
        except (OSError, ValueError) as error:  # ssl's errors are OSError
            raise InputError(f"scheduler {self!r}: the certificates cannot be read ({error}); {_HELP}") from error
        return security

    def _parts(self) -> tuple[str, str]:
        """Protocol and host; InputError for an address that is none."""
        found = _ADDRESS.fullmatch(str(self.address))
        protocol = found["protocol"] or "tcp" if found else ""
        if found is None or protocol not in ("tls", "tcp"):
            raise InputError(
                f"scheduler {self!r} is no address of a dask scheduler; give tls://HOST:PORT, such as "
                "tls://192.168.0.10:8786, or tcp://127.0.0.1:PORT on this computer"
            )
        return protocol, found["host"].strip("[]")


def refused(error: BaseException) -> str | None:
    """What TLS says where it is why there is no connection: one side does not know the other's certificate."""
    text, seen = "", error
    while seen is not None:
        text, seen = f"{text} {seen}", seen.__cause__ or seen.__context__  # type: ignore[assignment]
    if "CERTIFICATE_VERIFY_FAILED" in text:
        return (
            "its certificate is not of the authority in --tls-ca: it is another scheduler, or one that imitates yours"
        )
    if "alert" in text.lower():
        return "it does not accept the certificate in --tls-cert; take one of the authority that it was started with"
    if "WRONG_VERSION_NUMBER" in text:
        return "what answers there speaks no TLS; start the scheduler with --tls-ca-file, --tls-cert and --tls-key"
    return None
