"""What the package promises about itself: names, documentation, stubs."""

import ast
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import airloop


def test_every_public_name_exists_and_is_documented():
    assert sorted(airloop.__all__) == dir(airloop) == sorted(airloop._WHERE)
    for name in airloop.__all__:
        public = getattr(airloop, name)
        if name == "__version__":
            continue
        assert inspect.getdoc(public), name
        members = vars(public) if inspect.isclass(public) or inspect.ismodule(public) else {}
        for member, value in members.items():
            own = getattr(value, "__module__", "").startswith("airloop") or isinstance(value, (property, classmethod))
            if not member.startswith("_") and own:
                assert inspect.getdoc(value), f"{name}.{member}"
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        airloop.nothing  # noqa: B018


def test_the_stub_of_the_extension_module_names_all_that_it_has():
    native = sys.modules["airloop._native"]
    stub = ast.parse(Path(native.__file__).with_name("_native.pyi").read_text(encoding="utf-8"))
    known = {}
    for one in stub.body:
        if isinstance(one, (ast.ClassDef, ast.FunctionDef)):
            known[one.name] = one
    for name, value in vars(native).items():
        if name.startswith("_"):
            continue
        assert name in known, name
        if inspect.isclass(value) and not issubclass(value, Exception):
            declared = {item.name for item in known[name].body if isinstance(item, ast.FunctionDef)}
            real = {member for member in vars(value) if not member.startswith("_")}
            assert declared - {"__init__"} == real, name


def test_code_of_users_is_checked_by_mypy(tmp_path):
    pytest.importorskip("mypy")
    code = """
import airloop

result: airloop.Result = airloop.System("system.ssd").run(stop=1.0, step="1ms", set={"m": 1.0})
fits: dict[str, airloop.Fit] = result.fit("record.csv")
with airloop.System("system.ssd").instantiate(batch=4) as batch:
    batch.set(u=1.0)
with airloop.System("system.ssd").instantiate() as sim:
    sim.set(u=1.0)
    time: float = sim.step()
report: airloop.Report = airloop.refine({"name": "x"})
names: list[str] = report.selected
"""
    wrong = ["result.fit(3)", "sim.set(u='text')", "airloop.System(1)"]
    (tmp_path / "use.py").write_text(code + "\n".join(wrong) + "\n")
    command = [sys.executable, "-m", "mypy", "--strict", "--no-incremental", "use.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    first = len(code.splitlines()) + 1
    places = [line.split(":")[1] for line in done.stdout.splitlines() if "error:" in line]
    assert places == [str(first + index) for index in range(len(wrong))], done.stdout
