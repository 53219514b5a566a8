"""The archive: what is in it, how it was packed, what its library needs and exports."""

import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import raw
from fmu import PLATFORM, SUFFIX

LINUX = PLATFORM.startswith("linux")

NEEDED = re.compile(r"^(libc\.so\.6|libm\.so\.6|libgcc_s\.so\.1|ld-linux[-\w]*\.so\.\d|linux-vdso\.so\.1|libdl\.so\.2|libpthread\.so\.0)$")


def run(*command):
    if shutil.which(command[0]) is None:
        pytest.skip(f"{command[0]} is not installed (Debian: apt-get install binutils)")
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def test_holds_description_binary_documentation_icon_license_and_resources(fmu):
    with zipfile.ZipFile(fmu.path) as archive:
        names = archive.namelist()
    assert "modelDescription.xml" in names
    assert f"binaries/{PLATFORM}/{fmu.model_identifier}{SUFFIX}" in names
    assert "documentation/index.html" in names
    assert "model.png" in names
    assert any(name.startswith("resources/") for name in names)
    assert any(re.search(r"licen[cs]e", name, re.IGNORECASE) for name in names)


def test_names_are_relative_unique_and_use_forward_slashes(fmu):
    with zipfile.ZipFile(fmu.path) as archive:
        names = [entry.orig_filename for entry in archive.infolist()]
        assert archive.testzip() is None
    for name in names:
        assert "\\" not in name and not name.startswith("/") and ".." not in name.split("/"), name
    assert len({name.lower() for name in names}) == len(names)


def test_entries_carry_one_fixed_time_so_that_equal_sources_give_equal_bytes(fmu):
    with zipfile.ZipFile(fmu.path) as archive:
        entries = archive.infolist()
    assert len({entry.date_time for entry in entries}) == 1
    assert entries[0].date_time[0] <= 2000, f"looks like the time of the build: {entries[0].date_time}"
    names = [entry.filename for entry in entries]
    assert names == sorted(names) or names[0] == "modelDescription.xml"


def test_icon_is_a_png_of_visible_size(fmu):
    data = (fmu.folder / "model.png").read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    width, height = (int.from_bytes(data[i : i + 4], "big") for i in (16, 20))
    assert width >= 64 and height >= 64


def test_documentation_names_every_input_and_output(fmu):
    text = (fmu.folder / "documentation" / "index.html").read_text(encoding="utf-8")
    missing = [v.name for v in fmu.of("input", "output") if v.name not in text]
    assert not missing


@pytest.mark.skipif(not LINUX, reason="reads ELF files")
def test_library_needs_only_the_system_libraries_and_has_no_rpath(fmu):
    dynamic = run("readelf", "-d", str(fmu.binary))
    needed = re.findall(r"\(NEEDED\).*\[(.*)\]", dynamic)
    assert [name for name in needed if not NEEDED.match(name)] == []
    assert "RPATH" not in dynamic and "RUNPATH" not in dynamic
    resolved = [line.split()[0].rsplit("/", 1)[-1] for line in run("ldd", str(fmu.binary)).splitlines() if line.strip()]
    assert [name for name in resolved if not NEEDED.match(name)] == []


@pytest.mark.skipif(not LINUX, reason="reads ELF files")
def test_library_needs_no_newer_glibc_than_its_documentation_states(fmu):
    text = (fmu.folder / "documentation" / "index.html").read_text(encoding="utf-8")
    stated = re.search(r"glibc\s+(\d+)\.(\d+)", text)
    assert stated, "the documentation states no glibc version"
    symbols = run("nm", "-D", "--undefined-only", str(fmu.binary))
    versions = {tuple(map(int, v.split("."))) for v in re.findall(r"@GLIBC_([\d.]+)", symbols)}
    assert max(versions) <= tuple(map(int, stated.groups())), sorted(versions)[-3:]


@pytest.mark.skipif(not LINUX, reason="reads ELF files")
def test_every_library_runs_from_glibc_2_28_on(tmp_path):
    """RHEL 8. The library of exported systems, `template/airloop-system.fmu`, is among them."""
    script = Path(__file__).parents[2] / "scripts" / "check_symbols.py"
    libraries = []
    for path in (Path(__file__).parents[2] / "target" / "fmu").rglob("*.fmu"):
        with zipfile.ZipFile(path) as archive:
            for name in archive.namelist():
                if name.startswith(f"binaries/{PLATFORM}/"):
                    libraries.append(archive.extract(name, tmp_path / path.stem))
    assert any(name.endswith("airloop_system.so") for name in libraries)
    output = subprocess.run([sys.executable, str(script), "2.28", *libraries], capture_output=True, text=True).stdout
    assert [line for line in output.splitlines() if "it needs glibc" in line] == []
    assert f"{len(libraries)} libraries" in output


@pytest.mark.skipif(not LINUX, reason="reads ELF files")
def test_the_check_of_portable_libraries_names_what_is_too_new(fmu):
    """`make portable` ends with this check; these libraries need more than glibc 2.2 and less than 9.9."""
    script = Path(__file__).parents[2] / "scripts" / "check_symbols.py"
    check = [sys.executable, str(script)]
    run_for = lambda version: subprocess.run([*check, version, str(fmu.binary)], capture_output=True, text=True)  # noqa: E731
    old, new = run_for("2.2"), run_for("9.9")
    assert old.returncode == 1 and "it needs glibc 2." in old.stdout
    assert "it needs glibc" not in new.stdout
    assert new.returncode == ("it needs lib" in new.stdout)


@pytest.mark.skipif(not LINUX, reason="reads ELF files")
def test_library_exports_exactly_the_functions_of_fmi_2_and_3(fmu):
    lines = run("nm", "-D", "--defined-only", str(fmu.binary)).splitlines()
    exported = {line.split()[-1].split("@")[0] for line in lines}
    # One library serves the archives of both versions (test_fmi3.py has the list of 3.0).
    assert {name for name in exported if not name.startswith("fmi3")} == set(raw.FUNCTIONS)


def test_version_and_types_platform(fmu):
    assert fmu.library.fmi2GetVersion() == b"2.0"
    assert fmu.library.fmi2GetTypesPlatform() == b"default"
