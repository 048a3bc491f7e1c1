"""What a run of the tests has skipped is told at its end: how many, why, and the command that includes them.

Without bubblewrap and a browser, a tenth of the tests would go missing without a word. The files that are skipped as
they are imported count as one each: pytest-xdist does not hand them on by itself.
"""

from __future__ import annotations

import re
from typing import Any

import pytest
from _pytest.terminal import TerminalReporter

# What to look for in the reason of a skip: the command that installs what is missing.
REMEDIES = {
    "bubblewrap is missing": "sudo apt install bubblewrap libseccomp2",
    "libseccomp is missing": "make setup && sudo apt install libseccomp2",
    "no Chromium": "sudo apt install chromium",
    "rs274 .*is missing": "sudo apt install linuxcnc-uspace",
    "openssl is missing": "sudo apt install openssl",
    "no C compiler": "sudo apt install gcc",
    "make is not installed": "sudo apt install make",
    "uv is not installed": "pip install uv",
    "eds-utils is not installed": ".venv/bin/pip install eds-utils",
    "could not import|is in the extra|is not installed": "make setup",
    "only root can": "sudo make test",
    "not a worker of pytest-xdist": "make test",
}
NOT_FOR_THIS_COMPUTER = "nothing to install: this computer, or this way to run the tests, has no such thing"


def remedy(reason: str) -> str | None:
    """The command that would include a test that is skipped for this reason; None where there is none."""
    for pattern, command in REMEDIES.items():
        if re.search(pattern, reason):
            return command
    named = re.findall(r"`([^`]+)`", reason)
    return named[-1] if named else None


def told(skipped: list[str]) -> list[str]:
    """The lines about tests that were skipped for these reasons, one reason for each."""
    lines, commands = [], []
    for reason in sorted(set(skipped), key=lambda reason: (-skipped.count(reason), reason)):
        lines.append(f"{skipped.count(reason):5}  {reason}")
        command = remedy(reason)
        lines.append(f"{'':7}include them: {command}" if command else f"{'':7}{NOT_FOR_THIS_COMPUTER}")
        if command and command not in commands and "make test" not in command:
            commands.append(command)
    if commands:
        lines.append("All that can be installed, then: " + " && ".join([*commands, "make test"]))
    return lines


def pytest_configure(config: pytest.Config) -> None:
    config.pluginmanager.register(_Skipped())


class _Skipped:
    """The files that are skipped as they are imported, with their reasons; at the end, the summary."""

    def __init__(self) -> None:
        self._files: dict[str, str] = {}

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.skipped:
            self._files[report.nodeid] = _plain(report.longrepr)

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        output: dict[str, Any] | None = getattr(session.config, "workeroutput", None)
        if output is not None:
            output["skipped_files"] = self._files

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any) -> None:
        """A worker of pytest-xdist has ended; all of them have collected the same files."""
        self._files.update(getattr(node, "workeroutput", {}).get("skipped_files", {}))

    @pytest.hookimpl(trylast=True)
    def pytest_terminal_summary(self, terminalreporter: TerminalReporter) -> None:
        reports = terminalreporter.stats.get("skipped", [])
        tests = [_plain(report.longrepr) for report in reports if isinstance(report, pytest.TestReport)]
        if skipped := [*tests, *self._files.values()]:
            terminalreporter.write_sep("=", f"skipped: {len(skipped)} tests and files of tests", yellow=True, bold=True)
            for line in told(skipped):
                terminalreporter.write_line(line)


def _plain(longrepr: object) -> str:
    text = str(longrepr[2]) if isinstance(longrepr, tuple) else str(longrepr)
    return text.removeprefix("Skipped: ")
