#!/usr/bin/env bash
# The documentation site in out/site, in an environment of its own with the wheel of a folder: `docs/site/build.sh out/wheel`.
# Notebooks run on that wheel.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
wheels=$1
python=out/docs-env/bin/python
"$python" -m pip --version >/dev/null 2>&1 || "${PYTHON:-python3}" -m venv --clear out/docs-env
"$python" -m pip install --quiet --disable-pip-version-check -r docs/site/requirements.txt
"$python" -m pip install --quiet --disable-pip-version-check --force-reinstall --no-deps "$wheels"/airloop-*.whl
"$python" docs/site/stage.py out/site-pages
exec "$python" -m mkdocs build --strict --quiet
