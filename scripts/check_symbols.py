"""Fails if a shared library needs a newer glibc than a version, or a library that is not part of glibc.

    python check_symbols.py 2.28 LIBRARY.so ...
"""

import re
import subprocess
import sys
from pathlib import Path

GLIBC = re.compile(r"(libc|libm|libdl|libpthread|librt|ld-linux[-\w]*)\.so\.\d+")


def read(*command):
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def faults(library, allowed):
    """Reasons why the library does not load on a system with this version of glibc."""
    needed = re.findall(r"NEEDED.*\[(.*)\]", read("readelf", "--dynamic", "--wide", str(library)))
    versions = re.findall(r"@GLIBC_([\d.]+)", read("nm", "--dynamic", "--undefined-only", str(library)))
    newer = {version for version in versions if tuple(map(int, version.split("."))) > allowed}
    yield from (f"{library}: it needs {name}" for name in needed if not GLIBC.fullmatch(name))
    yield from (f"{library}: it needs glibc {version}" for version in sorted(newer))


def main(version, libraries):
    allowed = tuple(map(int, version.split(".")))
    found = [fault for library in libraries for fault in faults(library, allowed)]
    print(*found, sep="\n", end="\n" if found else "")
    print(f"{len(libraries)} libraries, {len(found)} faults against glibc {version}")
    sys.exit(bool(found) or not libraries)


if __name__ == "__main__":
    main(sys.argv[1], [Path(name) for name in sys.argv[2:]])
