#!/bin/sh
# PrairieLearn starts the container for each submission, and reads results/results.json.
grade="${GRADE:-/grade}"
mkdir -p "$grade/results"
exec "${PYTHON:-python3}" -P -m rds.grading.exports.one_submission prairielearn "$grade"
