"""Compiles van_der_pol.c and packs it with its description: van_der_pol.fmu (Linux, 64 bits).

    python3 examples/03_swing_up/third_party/make_fmu.py [FOLDER]

The FMU goes to FOLDER, by default out/third_party. CC names another C compiler.
"""

import os
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

HERE = Path(__file__).resolve().parent


def main(folder):
    folder.mkdir(parents=True, exist_ok=True)
    target = folder / "van_der_pol.fmu"
    with tempfile.TemporaryDirectory() as scratch:
        library = Path(scratch) / "van_der_pol.so"
        compiler = os.environ.get("CC", "cc")
        subprocess.run([compiler, "-shared", "-fPIC", "-O2", "-o", library, HERE / "van_der_pol.c"], check=True)
        with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.write(HERE / "modelDescription.xml", "modelDescription.xml")
            archive.write(library, "binaries/linux64/van_der_pol.so")
    print(target)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/third_party"))
