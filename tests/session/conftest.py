"""What tests of a page's runs share."""

from __future__ import annotations

import pytest


@pytest.fixture
def nothing_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """For tests of a run's numbers: its tables are written as ever, without pictures and reports."""
    monkeypatch.setattr("rds.panels.equipment.run.made_beside", lambda *_: {})
