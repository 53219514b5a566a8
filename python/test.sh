#!/usr/bin/env bash
# Installs the wheel of a folder into a fresh environment and tests it there: `python/test.sh out/wheel [PYTEST ARGUMENTS]`.
# That of a release stays below 20 MB.
set -euo pipefail
wheels=$(realpath "$1")
shift
for wheel in "$wheels"/airloop-*.whl; do
    bytes=$(wc -c <"$wheel")
    if [ "${AIRLOOP_WHEEL_PROFILE:-release}" = release ] && [ "$bytes" -ge 20000000 ]; then
        echo "$wheel has $bytes bytes, 20,000,000 or more" >&2
        exit 1
    fi
done
cd "$(dirname "${BASH_SOURCE[0]}")"
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
python=$folder/venv/bin/python
"$python" -m pip install --quiet --disable-pip-version-check -r requirements-test.txt "$wheels"/airloop-*.whl
"$python" -m mypy --config-file pyproject.toml
"$folder/venv/bin/pytest" --quiet -p no:cacheprovider tests "$@"
