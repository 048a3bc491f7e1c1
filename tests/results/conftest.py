"""The result that most tests start from."""

import pytest
from made_results import make_result

from rds.results import Result


@pytest.fixture
def result() -> Result:
    """An implementation run of one axis: reference, measured, modelled, simulated, timing with three late samples."""
    return make_result("implementation")
