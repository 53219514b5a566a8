"""The examples and `airloop run`: the acceptance numbers through the binary, from the files of this repository."""

import csv
import json
from pathlib import Path

import fmpy
import numpy as np
import pytest
from lxml import etree

from command import ROOT, airloop
from test_reference import load_reference, parameter_set, reference, relative_rms_error

SYSTEM = ROOT / "examples" / "01_run" / "system.ssd"
SCHEMAS = Path(fmpy.__file__).parent / "ssp" / "schema"


def schema(name):
    return etree.XMLSchema(etree.parse(str(SCHEMAS / name)))


def test_system_descriptions_are_valid_ssp():
    for path in sorted((ROOT / "examples").rglob("*.ssd")):
        schema("SystemStructureDescription.xsd").assertValid(etree.parse(str(path)))
    for path in sorted((ROOT / "examples").rglob("*.ssv")):
        schema("SystemStructureParameterValues.xsd").assertValid(etree.parse(str(path)))


def test_parameter_sets_inside_the_fmus_are_valid_and_name_their_parameters(fmu):
    for path in sorted(fmu.resources.glob("*.ssv")):
        schema("SystemStructureParameterValues.xsd").assertValid(etree.parse(str(path)))
        known = {v.name for v in fmu.of("parameter")}
        assert set(parameter_set(path)) <= known


def test_cart_set_of_the_example_is_the_one_in_the_fmu(shipped):
    inside = parameter_set(shipped("friction").resources / "cart.ssv")
    assert parameter_set(SYSTEM.parent / "cart.ssv") == inside


@pytest.fixture(scope="module")
def sine(tmp_path_factory):
    """The command of the reference trajectory as a CSV file."""
    path = tmp_path_factory.mktemp("input") / "sine.csv"
    with open(path, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["time", "u"])
        for k in range(3001):
            writer.writerow([f"{k * 1e-3:.3f}", repr(float(reference.command(k)))])
    return path


@pytest.mark.parametrize(
    "step, master, low, high",
    [
        ("0.01ms", "gauss-seidel", 0.0, 0.01),
        ("1ms", "gauss-seidel", 0.073, 0.093),
        ("1ms", "jacobi", 0.174, 0.194),
    ],
)
def test_airloop_run_agrees_with_the_reference_trajectory(sine, tmp_path, step, master, low, high):
    options = ["--stop", "3", "--step", step, "--master", master, "--input", sine, "--interpolation", "hold"]
    airloop("run", SYSTEM, *options, "--no-plots", "-o", tmp_path)
    result = np.genfromtxt(tmp_path / "result.csv", delimiter=",", names=True, deletechars="")
    stored = load_reference()
    stride = round(stored["time"][1] / result["time"][1])
    assert np.max(np.abs(result["time"][::stride] - stored["time"])) < 1e-9
    error = relative_rms_error(result["x"][::stride], stored["x"])
    print(f"{master}, {step}: RMS error in x {error:.4f} %")
    assert low <= error <= high


def test_example_01_gives_the_expected_fits(tmp_path):
    expected = json.loads((SYSTEM.parent / "expected.json").read_text())
    record = ROOT / expected["measured"]
    airloop("run", SYSTEM, "--measured", record, "-o", tmp_path)
    summary = json.loads((tmp_path / "summary.json").read_text())
    fits = {row["name"]: row for row in summary["signals"]}
    assert set(fits) == set(expected["fits"])
    for name, numbers in expected["fits"].items():
        assert fits[name]["fit_percent"] == pytest.approx(numbers["fit_percent"], abs=expected["tolerance_percent"])
    assert (tmp_path / "index.html").exists()
