"""`rds grade lti`: the hand-in page that a learning platform launches."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rds.cli.common import refusals, writes_files


@writes_files
def lti(
    folder: Annotated[Path, typer.Argument(help="The folder with lti.toml; the tool's key and the launches go there.")],
    submissions: Annotated[Path, typer.Option("--out", "-o", help="The folder that submissions are kept in.")],
    url: Annotated[str, typer.Option(help="Where browsers find this page: https://..., by your web server.")],
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port on this computer; 0: any free one.")] = 8378,
    title: Annotated[str, typer.Option(help="Heading of the page.")] = "Hand in your file",
) -> None:
    """Let students hand in from their course by LTI 1.3, until Ctrl-C.

    `rds grade export --to lti` sends the points back.
    """
    with refusals():
        from rds.grading.lti.tool import Tool, serve

        tool = Tool(folder, submissions, url, title)
        server = serve(tool, port)
        typer.echo(f"login {tool.url}/login, launch {tool.url}/launch, keys {tool.url}/jwks", err=True)
        typer.echo(f"listening on http://127.0.0.1:{server.server_address[1]}; Ctrl-C ends it", err=True)
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            pass
        finally:
            server.server_close()
