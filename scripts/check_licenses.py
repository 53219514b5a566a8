"""Licenses of all dependencies against the list in deny.toml, for machines without cargo-deny.

    python scripts/check_licenses.py

Reads `cargo metadata`. An expression passes when its OR-alternatives hold one whose every AND-part is allowed.
Exit code 1 when a crate does not pass; each is named. An entry of the list that no crate uses is pointed out.
"""

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def licenses_used(expression, allowed):
    """The allowed licenses that satisfy an SPDX `expression`, or None when none do.

    >>> sorted(licenses_used("MIT OR Apache-2.0", {"MIT"}))
    ['MIT']
    >>> licenses_used("GPL-3.0 AND MIT", {"MIT"}) is None
    True
    >>> sorted(licenses_used("(MIT OR GPL-3.0) AND Unicode-3.0", {"MIT", "Unicode-3.0"}))
    ['MIT', 'Unicode-3.0']
    """
    # Old crates write "MIT/Apache-2.0".
    tokens = re.findall(r"[()]|[^\s()]+", expression.replace("/", " OR "))
    position = 0

    def either():
        nonlocal position
        found = both()
        while position < len(tokens) and tokens[position] == "OR":
            position += 1
            other = both()
            found = found if other is None else (other if found is None else found | other)
        return found

    def both():
        nonlocal position
        found = one()
        while position < len(tokens) and tokens[position] == "AND":
            position += 1
            other = one()
            found = None if found is None or other is None else found | other
        return found

    def one():
        nonlocal position
        token = tokens[position]
        position += 1
        if token == "(":
            found = either()
            position += 1
            return found
        if position < len(tokens) and tokens[position] == "WITH":
            token = f"{token} WITH {tokens[position + 1]}"
            position += 2
        return {token} if token in allowed else None

    return either()


def main():
    with open(ROOT / "deny.toml", "rb") as file:
        allowed = set(tomllib.load(file)["licenses"]["allow"])
    metadata = subprocess.run(
        ["cargo", "metadata", "--format-version", "1", "--locked"], cwd=ROOT, check=True, capture_output=True, text=True
    )
    packages = [p for p in json.loads(metadata.stdout)["packages"] if p["source"] is not None]
    refused, used = [], set()
    for package in packages:
        licenses = licenses_used(package["license"], allowed) if package["license"] else None
        if licenses is None:
            refused.append(f"{package['name']} {package['version']}: {package['license'] or 'no license stated'}")
        else:
            used |= licenses
    for line in refused:
        print(f"license not in deny.toml: {line}", file=sys.stderr)
    for license in sorted(allowed - used):
        print(f"deny.toml allows {license}, which no dependency uses")
    print(f"licenses: {len(packages)} dependencies, {len(refused)} refused")
    return 1 if refused else 0


if __name__ == "__main__":
    sys.exit(main())
