"""The emergency stop as a page gives it: whatever happens, a sentence comes of it, which says so where it failed."""

from __future__ import annotations

import logging

from rds.core.errors import RdsError
from rds.panels.session.session import Session


def emergency_stop(session: Session) -> tuple[str, str]:
    """Stop all modules of the session's machine. The sentence for the page, and how to show it: warning or error."""
    try:
        return session.emergency_stop(), "warning"
    except RdsError as error:
        return str(error), "error"
    except Exception as error:  # nobody may believe that the machine was stopped
        logging.getLogger(__name__).exception("emergency stop")
        return f"emergency stop failed: {str(error) or type(error).__name__}; cut the power", "error"
