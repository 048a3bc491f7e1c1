"""`rds jobs`: part programs and experiments that other programs start."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rds.cli.common import refusals, writes_files

app = typer.Typer(no_args_is_help=True, help="Let other programs of this computer load, run and watch jobs.")

Socket = Annotated[
    Path | None, typer.Option("--socket", help="Unix socket; by default jobs.sock in your runtime folder.")
]
Port = Annotated[
    int | None, typer.Option(min=1, max=65535, help="Instead of a Unix socket, a port of 127.0.0.1.", metavar="N")
]
Secret = Annotated[
    Path | None, typer.Option("--secret", help="File of the secret; by default beside the socket, ending in .secret.")
]


@app.command()
@writes_files
def serve(
    folder: Annotated[Path, typer.Argument(help="Folder whose files jobs may use.")] = Path("."),
    socket: Socket = None,
    port: Port = None,
    secret: Secret = None,
    no_secret: Annotated[
        bool, typer.Option("--no-secret", help="Ask for no secret (Unix socket only, which is yours alone).")
    ] = False,
) -> None:
    """Serve the part programs and experiments of a folder to other programs, by JSON lines, until Ctrl-C."""
    with refusals():
        from rds.core.errors import InputError
        from rds.jobs.address import Address
        from rds.jobs.folder import Folder
        from rds.jobs.jobs import Jobs
        from rds.jobs.server import serve as serve_jobs

        if no_secret and secret is not None:
            raise InputError("--no-secret and --secret FILE contradict each other; give one of them")
        address = Address.of(socket, port, secret)
        place = address.path or f"127.0.0.1:{address.port}"

        def ready() -> None:
            said = "no secret" if no_secret else f"secret in {address.secret_file}"
            typer.echo(f"jobs of {folder} at {place}, {said}; Ctrl-C ends", err=True)

        serve_jobs(Jobs(Folder(folder)), address, not no_secret, ready)


@app.command()
def send(
    requests: Annotated[list[str], typer.Argument(help="""JSON objects, as in '{"do": "jobs"}'.""")],
    socket: Socket = None,
    port: Port = None,
    secret: Secret = None,
) -> None:
    """Send requests to the server, one after the other, and print its answers; exit code 1 if one is a refusal."""
    with refusals():
        from rds.core.errors import MachineError
        from rds.jobs.address import Address
        from rds.jobs.client import Client

        fine = True
        address = Address.of(socket, port, secret)
        try:
            client = Client(address)
        except OSError as error:
            place = address.path or f"127.0.0.1:{address.port}"
            remedy = "start one by `rds jobs serve FOLDER` in another terminal, or name its --socket or --port"
            raise MachineError(f"no server of jobs answers at {place}; {remedy}") from error
        with client:
            for request in requests:
                for line, answered in client.ask(request):
                    typer.echo(line)
                    fine = fine and answered["ok"]
    raise typer.Exit(0 if fine else 1)
