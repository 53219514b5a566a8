"""Figures of a report, and effects of one's own given as tables and texts."""

import xml.etree.ElementTree as xml

import numpy as np
import pytest

import airloop
from pendulum import study as pendulum_study

SPRING = {
    "kind": "stop",
    "port": "torque",
    "formula": "k*x^3",
    "parameters": {"k": {"unit": "N.m", "bounds": [0, 10], "start": [1e-3, 1e-1]}},
}


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Three records of a pendulum with a cubic spring of 0.05 N.m, which the declared model lacks; Runge-Kutta of order 4."""
    folder = tmp_path_factory.mktemp("pendulum")

    def rate(y):
        torque = -0.15 * 9.81 * 0.15 * np.sin(y[0]) - 1e-4 * y[1] - 0.05 * y[0] ** 3
        return np.array([y[1], torque / 3.4e-3])

    noise = np.random.default_rng(5)
    for name, angle in (("a", 1.2), ("b", 0.8), ("c", 1.0)):
        y, h, rows = np.array([angle, 0.0]), 0.0025, []
        for k in range(2401):
            if k % 4 == 0:
                rows.append((k * h, y[0] + 1e-4 * noise.normal()))
            a = rate(y)
            b = rate(y + h / 2 * a)
            c = rate(y + h / 2 * b)
            y = y + h / 6 * (a + 2 * b + 2 * c + rate(y + h * c))
        np.savetxt(folder / f"{name}.csv", rows, delimiter=",", header="time,angle", comments="", fmt="%.6f")
    return folder, pendulum_study({"m": 0.15, "l": 0.15, "I": 3.4e-3, "b": 1e-4})


@pytest.fixture(scope="module")
def report(study):
    folder, table = study
    return airloop.refine(table, folder=folder, effects=[SPRING], progress=False)


def test_an_effect_given_as_a_table_is_found(report):
    assert report.verdict == "effect", report
    chosen = [one for one in report.data["effects"] if one["selected"]]
    assert len(chosen) == 1 and "stop" in chosen[0]["id"], chosen
    # 5 %: the noise of 0.1 mrad is one part in ten thousand of the motion.
    assert chosen[0]["params"]["k"]["value"] == pytest.approx(0.05, rel=0.05)


def test_text_path_and_table_of_an_effect_are_the_same(report, study, tmp_path):
    folder, table = study
    text = (
        'kind = "stop"\nport = "torque"\nformula = "k*x^3"\n'
        '[parameters]\nk = { unit = "N.m", bounds = [0, 10], start = [1e-3, 1e-1] }\n'
    )
    (tmp_path / "stop.toml").write_text(text)
    for effects in (text, tmp_path / "stop.toml", [tmp_path / "stop.toml"]):
        other = airloop.refine(table, folder=folder, effects=effects, progress=False)
        assert other.data["effects"] == report.data["effects"]


def test_figures_stand_alone(report, tmp_path):
    titles = [one.title for one in report.figures]
    assert len(titles) >= 3
    for one in report.figures:
        root = xml.fromstring(one.svg)
        assert root.tag == "{http://www.w3.org/2000/svg}svg" and root[0].tag.endswith("style")
    one = report.figure(titles[0])
    assert one.title == titles[0] and one._repr_svg_() == one.svg
    assert one.save(tmp_path / "one.svg").read_text() == one.svg
    record = next(one.record for one in report.figures if one.record)
    title = next(one.title for one in report.figures if one.record == record)
    assert report.figure(title, record).record == record
    with pytest.raises(KeyError, match="there is no figure `nothing`; titles: "):
        report.figure("nothing")
