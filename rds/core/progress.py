"""How long work tells of its progress: every command's bar, every panel's and every test's takes the same call."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[int, int], None]  # done, in all: samples, files, submissions, plans
