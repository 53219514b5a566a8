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
