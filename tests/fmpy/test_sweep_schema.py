"""The schema of sweep plans: what the examples are written in, and nothing that the program would refuse."""

import json
import tomllib

import jsonschema
import pytest

from command import ROOT, airloop, start

PLANS = ["06_study/redraw.toml", "07_sweep/sweep.toml", "07_sweep/refine.toml"]


@pytest.fixture(scope="module")
def schema():
    schema = json.loads(airloop("sweep", "plan", "--schema"))
    jsonschema.Draft7Validator.check_schema(schema)
    return jsonschema.Draft7Validator(schema)


@pytest.mark.parametrize("plan", PLANS)
def test_plans_of_the_examples_follow_the_schema(schema, plan):
    schema.validate(tomllib.loads((ROOT / "examples" / plan).read_text()))


@pytest.mark.parametrize("wrong", ['kind = "dream"', 'kind = "empty"\nshard = 2', 'kind = "empty"\n[sample]\ncount = -1', "seed = 1"])
def test_schema_and_program_refuse_the_same(schema, tmp_path, wrong):
    assert not schema.is_valid(tomllib.loads(wrong))
    (tmp_path / "plan.toml").write_text(wrong + "\n")
    result = start("sweep", "plan", tmp_path / "plan.toml", "-o", tmp_path / "out")
    assert result.returncode == 1 and "plan.toml" in result.stderr, result.stderr
    assert not (tmp_path / "out").exists()
