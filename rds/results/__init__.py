"""What a run leaves: its table with units, its metrics, files, comparisons, plots and report.

Light to import: pandas, pyarrow and matplotlib are imported by the functions that need them.
"""

from rds.core.face import face
from rds.results.compare import AxisComparison, Comparison, compare
from rds.results.files import save_all, save_result
from rds.results.metrics import axis_metrics, metric_notes, metric_units
from rds.results.report import write_report
from rds.results.result import Result, open_result

__all__ = [
    "AxisComparison",
    "Comparison",
    "Result",
    "axis_metrics",
    "compare",
    "metric_notes",
    "metric_units",
    "open_result",
    "save_all",
    "save_result",
    "write_report",
]

__getattr__ = face(__name__, {"make_report": "reports", "write": "reports.write"})[0]
