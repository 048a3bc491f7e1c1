#!/usr/bin/env bash
# Gradescope runs this once, as root, when it builds the container: Python, the sandbox, rds.
set -euo pipefail
source="${1:-/autograder/source}"
apt-get update
apt-get install -y --no-install-recommends python3 python3-venv bubblewrap libseccomp2
python3 -m venv /autograder/venv
wheel=$(ls "$source"/mini_cnc_rds-*.whl)
/autograder/venv/bin/pip install --no-cache-dir "mini-cnc-rds[grading] @ file://$wheel"
# the assignment holds hidden cases: nobody but root reads them
chmod -R go= "$source"
