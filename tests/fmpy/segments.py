"""Records of a study as files, and the segments of its study.toml that name them."""

import numpy as np


def write_segments(folder, records, header, initial):
    """Writes r0.csv, r1.csv, ... with these columns; the text of their segments, the last one for validation. `initial`: text
    of the initial states of each record."""
    text = ""
    for k, (columns, begin) in enumerate(zip(records, initial)):
        np.savetxt(folder / f"r{k}.csv", columns, delimiter=",", header=header, comments="", fmt="%.8g")
        role = "estimation" if k + 1 < len(records) else "validation"
        text += f'[[segment]]\nfile = "r{k}.csv"\nrole = "{role}"\ninitial = {begin}\n'
    return text


def write_mass_study(folder, records, damping):
    """A study of a mass of 1 kg with viscous friction `damping` [N s/m], at rest at first: records of time, held force and position."""
    folder.mkdir()
    text = (
        f'system = "airloop:rigid-mass"\n[parameters]\nm = 1.0\nb = {damping}\n[inputs]\nF = {{ column = "u", hold = true }}\n'
        '[outputs]\nx = { column = "x", unit = "m" }\n'
    )
    text += write_segments(folder, records, "time,u,x", len(records) * ["{ x = 0.0, v = 0.0 }"])
    (folder / "study.toml").write_text(text)
    return folder / "study.toml"
