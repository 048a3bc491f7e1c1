"""The options that say which dask cluster does the work, and what protects the connection."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from rds.core.errors import InputError

if TYPE_CHECKING:
    from rds.core.parallel import Scheduler

_PANEL = "Cluster"
Address = Annotated[
    str | None,
    typer.Option("--scheduler", help="A dask scheduler, as tls://HOST:8786.", rich_help_panel=_PANEL),
]
Ca = Annotated[
    Path | None,
    typer.Option("--tls-ca", help="Certificate of the cluster's authority; default: dask's.", rich_help_panel=_PANEL),
]
Cert = Annotated[
    Path | None, typer.Option("--tls-cert", help="Your certificate; default: dask's.", rich_help_panel=_PANEL)
]
Key = Annotated[
    Path | None, typer.Option("--tls-key", help="Its private key; default: dask's.", rich_help_panel=_PANEL)
]
Insecure = Annotated[
    bool,
    typer.Option(
        "--insecure-cluster",
        help="Plain TCP to other computers: whoever reaches the network runs code as you.",
        rich_help_panel=_PANEL,
    ),
]


class ClusterOptions(NamedTuple):
    """All of them."""

    scheduler: Address = None
    tls_ca: Ca = None
    tls_cert: Cert = None
    tls_key: Key = None
    insecure_cluster: Insecure = False

    def given(self) -> list[str]:
        """Those that are given."""
        values = {f"--{name.replace('_', '-')}": value for name, value in self._asdict().items()}
        return [option for option, value in values.items() if value not in (None, False)]

    def chosen(self) -> Scheduler | None:
        """What these options say; InputError for those of a cluster without one."""
        if self.scheduler is None:
            if lone := self.given():
                raise InputError(f"{' and '.join(lone)} without --scheduler; give its address, as tls://HOST:8786")
            return None
        from rds.core.parallel.scheduler import ClusterWarning, Scheduler

        found = Scheduler(self.scheduler, self.tls_ca, self.tls_cert, self.tls_key, self.insecure_cluster)
        found.check()
        if warning := found.warning():
            typer.echo(f"rds: warning: {warning}", err=True)
            warnings.simplefilter("ignore", ClusterWarning)  # it has been said
        return found
