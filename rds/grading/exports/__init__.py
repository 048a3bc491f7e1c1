"""Gradebooks by name, one file each. A module has

- `FILE`: what is written if nobody says otherwise, counted from the batch's folder: a file, or a folder without an end;
- `export(finished, wanted) -> Exported`.

`wanted` are `ExportOptions`; an option that a gradebook has no use for is refused by the module's `USES`.
"""

from __future__ import annotations

from types import MappingProxyType

from rds.core.registry import Registry

GRADEBOOKS = Registry(
    "gradebook",
    MappingProxyType(
        {
            "nbgrader": "rds.grading.exports.nbgrader",
            "moodle": "rds.grading.exports.moodle",
            "moodle-feedback": "rds.grading.exports.moodle_feedback",
            "canvas": "rds.grading.exports.canvas",
            "brightspace": "rds.grading.exports.brightspace",
            "blackboard": "rds.grading.exports.blackboard",
            "gradescope": "rds.grading.exports.gradescope",
            "lti": "rds.grading.exports.lti",
            "prairielearn": "rds.grading.exports.prairielearn",
        }
    ),
    own=False,
)
