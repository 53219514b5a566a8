"""Build backend: puts program, FMUs and examples into the package, then lets maturin build the wheel.

`make wheel` has built what is copied here; `pip install ./python` builds it first. Needs Rust and a C compiler, and
`scripts/setup.sh build` before (libclang).
"""

import os
import platform
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import maturin
from maturin import get_requires_for_build_editable, get_requires_for_build_sdist, get_requires_for_build_wheel
from maturin import prepare_metadata_for_build_editable, prepare_metadata_for_build_wheel

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "python" / "airloop"
EXAMPLE = ("system.ssd", "cart.ssv")
STUDY = ("study.toml", "swing.csv", "tail.csv")
RECORD = Path("data/rig/v05/trial_07.csv")
PROBLEM = Path("examples/03_swing_up/problem.toml")
PROFILES = {"release": "release", "dev": "debug"}
# Functions with equal code are written once, which makes program and module some 3 % smaller: an option of LLD, the
# linker that Rust brings along from 1.90 on.
ONE_OF_EQUAL_FUNCTIONS = "-Wl,--icf=all"


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    profile = _fill()
    # The arguments that maturin reads from the environment of a build through PEP 517.
    os.environ.setdefault("MATURIN_PEP517_ARGS", f"--profile {profile} --strip")
    name = maturin.build_wheel(wheel_directory, config_settings, metadata_directory)
    _compress(Path(wheel_directory) / name)
    return name


def build_editable(wheel_directory, config_settings=None, metadata_directory=None):
    profile = _fill()
    os.environ.setdefault("MATURIN_PEP517_ARGS", f"--profile {profile}")
    return maturin.build_editable(wheel_directory, config_settings, metadata_directory)


def build_sdist(sdist_directory, config_settings=None):
    raise NotImplementedError("airloop is installed from its repository or as a wheel")


def _fill():
    """Copies what the wheel holds besides Python and the extension module; returns the Cargo profile."""
    profile = os.environ.get("AIRLOOP_WHEEL_PROFILE", "release")
    target = Path(os.environ.get("CARGO_TARGET_DIR", "target"))
    target = target if target.is_absolute() else ROOT / target
    if _has_lld():
        os.environ["AIRLOOP_LINK_ARGUMENT"] = ONE_OF_EQUAL_FUNCTIONS
    # Program and extension module in one call: their libraries are then built once.
    _cargo("build", "--profile", profile, "-p", "airloop-cli", "-p", "airloop-python")
    fmus = ROOT / "target" / "fmu"
    if not list(fmus.glob("*.fmu")):
        _cargo("run", "--profile", profile, "-p", "packager")
    name = "airloop.exe" if sys.platform == "win32" else "airloop"
    program = _fresh("bin") / name
    shutil.copy2(target / PROFILES[profile] / name, program)
    if shutil.which("strip"):
        subprocess.run(["strip", str(program)], check=True)
    into = _fresh("fmu")
    # Those of folder `test` are for our own tests only; `template` holds the parts of which export-fmu makes FMUs.
    for file in [*fmus.glob("*.fmu"), *fmus.glob("template/**/*.fmu")]:
        copy = into / file.relative_to(fmus)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(file, copy)
        _compress(copy)
    into = _fresh("examples")
    for name in EXAMPLE:
        text = (ROOT / "examples" / "01_run" / name).read_text(encoding="utf-8")
        (into / name).write_text(text.replace("../../target/fmu/", "../fmu/"), encoding="utf-8")
    text = (ROOT / PROBLEM).read_text(encoding="utf-8")
    (into / "swing_up.toml").write_text(text.replace("../01_run/", ""), encoding="utf-8")
    shutil.copy2(ROOT / RECORD, into / "record.csv")
    for name in STUDY:
        shutil.copy2(ROOT / "examples" / "06_study" / name, into)
    return profile


def _fresh(name):
    folder = PACKAGE / name
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    return folder


def _cargo(*words):
    subprocess.run(["cargo", *words, "--quiet"], cwd=ROOT, check=True)


def _has_lld():
    """Whether Rust links with LLD here."""
    if sys.platform != "linux" or platform.machine() != "x86_64":
        return False
    version = subprocess.run(["rustc", "--version"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    release = re.match(r"rustc (\d+)\.(\d+)", version)
    return release is not None and tuple(map(int, release.groups())) >= (1, 90)


def _compress(archive):
    """Writes a ZIP archive again, entry by entry, with the strongest deflate that every reader knows."""
    again = archive.with_name(archive.name + ".part")
    with zipfile.ZipFile(archive) as source, zipfile.ZipFile(again, "w") as out:
        for entry in source.infolist():
            out.writestr(entry, source.read(entry), zipfile.ZIP_DEFLATED, compresslevel=9)
    again.replace(archive)


__all__ = [
    "build_editable",
    "build_sdist",
    "build_wheel",
    "get_requires_for_build_editable",
    "get_requires_for_build_sdist",
    "get_requires_for_build_wheel",
    "prepare_metadata_for_build_editable",
    "prepare_metadata_for_build_wheel",
]
