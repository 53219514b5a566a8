#!/usr/bin/env sh
# Makes the FMU of a folder with one model in C (NAME.c, modelDescription.xml) with a C compiler and Python's zipfile:
#     make_fmu.sh FOLDER [OUT]        writes NAME.fmu into the folder, or into OUT
set -eu
from=$(cd "$1" && pwd)
out=$(cd "${2:-$from}" && pwd)
if [ ! -f "$from/modelDescription.xml" ]; then
    echo "$from: no modelDescription.xml; give a folder with NAME.c and modelDescription.xml" >&2
    exit 1
fi
name=$(basename "$from"/*.c .c)
build=$(mktemp -d)
trap 'rm -rf "$build"' EXIT
mkdir -p "$build/binaries/linux64"
cp "$from/modelDescription.xml" "$build"
"${CC:-cc}" -O2 -std=c99 -Wall -shared -fPIC "$from/$name.c" -o "$build/binaries/linux64/$name.so" -lm
cd "$build"
python3 -m zipfile -c "$out/$name.fmu" modelDescription.xml binaries/
echo "$out/$name.fmu"
