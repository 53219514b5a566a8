#!/usr/bin/env sh
# Makes arm.fmu in this folder, or in the one given, with a C compiler and Python's zipfile.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
out=$(cd "${1:-$here}" && pwd)
build=$(mktemp -d)
trap 'rm -rf "$build"' EXIT
mkdir -p "$build/binaries/linux64"
cp "$here/modelDescription.xml" "$build"
"${CC:-cc}" -O2 -std=c99 -Wall -shared -fPIC "$here/arm.c" -o "$build/binaries/linux64/arm.so" -lm
cd "$build"
python3 -m zipfile -c "$out/arm.fmu" modelDescription.xml binaries/
echo "$out/arm.fmu"
