"""How far the parameters of one record of a driven carriage carry a free run of another: a reference for `airloop run --study
--free-run`, with equations and fits typed here.

`M v' = u - F_v v - F_c tanh(v/v_t) - offset - c x^2`, viscous friction of its own in either direction where `directed`. FOLDER has
estimation.csv and validation.csv with the columns time [s], drive_force [N], position [m]. Parameters come from the force residual
(least squares on signals behind a zero-phase low-pass of 40 Hz) or from the free run of the whole record, with initial position and
velocity fitted along ("joint") or, as the error asks, to the first 0.5 s alone ("rest"); the error is that of a free run whose initial
states are fitted to its first 0.5 s, over the rest.

    python free_run_of_axis.py FOLDER
"""

import argparse
import ctypes
import pathlib
import subprocess
import tempfile

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import butter, sosfiltfilt

BEGINNING, CORNER, WIDTH, LEAST_SPEED = 0.5, 40.0, 1e-3, 0.01
# Parameters: mass, viscous friction forward and backward, Coulomb friction, offset, quadratic in the position.
SOURCE = f"""
#include <math.h>
static double rate(const double *p, double u, double x, double v) {{
  return (u - (v > 0 ? p[1] : p[2]) * v - p[3] * tanh(v / {WIDTH}) - p[4] - p[5] * x * x) / p[0];
}}
void run(const double *p, const double *u, int n, double h, double x, double v, double *found) {{
  for (int k = 0; k < n; k++) {{
    found[k] = x;
    for (int i = 0; i < 2; i++) {{
      double d = h / 2, a = rate(p, u[k], x, v), v2 = v + d / 2 * a, b = rate(p, u[k], x + d / 2 * v, v2);
      double v3 = v + d / 2 * b, c = rate(p, u[k], x + d / 2 * v2, v3), v4 = v + d * c, e = rate(p, u[k], x + d * v3, v4);
      x += d / 6 * (v + 2 * v2 + 2 * v3 + v4);
      v += d / 6 * (a + 2 * b + 2 * c + e);
    }}
  }}
}}
"""


def library():
    folder = pathlib.Path(tempfile.mkdtemp())
    (folder / "run.c").write_text(SOURCE)
    subprocess.run(["cc", "-O2", "-shared", "-fPIC", "-o", folder / "run.so", folder / "run.c", "-lm"], check=True)
    return ctypes.CDLL(str(folder / "run.so"))


LIBRARY = library()


def run(p, record, x, v):
    time, force, _ = record
    pointer = lambda a: a.ctypes.data_as(ctypes.POINTER(ctypes.c_double))  # noqa: E731
    found, p = np.empty_like(force), np.ascontiguousarray(p, dtype=float)
    LIBRARY.run(pointer(p), pointer(force), len(force), ctypes.c_double(time[1] - time[0]), ctypes.c_double(x), ctypes.c_double(v), pointer(found))
    return found


def rest(p, record):
    """Residuals of a free run behind its beginning [m], to which its initial states are fitted."""
    time, _, position = record
    begin = int(round(BEGINNING / (time[1] - time[0])))
    short = [column[:begin] for column in record]
    fitted = least_squares(lambda z: 1e6 * (run(p, short, *z) - short[2]), [position[0], 0.0], x_scale=[1e-5, 1e-3]).x
    return (run(p, record, *fitted) - position)[begin:]


def error(p, record):
    """Rms error of a free run [m]."""
    return np.sqrt(np.mean(rest(p, record) ** 2))


def by_force(record, directed, quadratic):
    time, force, position = record
    sos = butter(4, CORNER, fs=1 / (time[1] - time[0]), output="sos")
    x, u = sosfiltfilt(sos, position), sosfiltfilt(sos, force)
    v = np.gradient(x, time)
    a = np.gradient(v, time)
    forward, backward = np.maximum(v, 0), np.minimum(v, 0)
    columns = [a, *([forward, backward] if directed else [v]), np.tanh(v / WIDTH), np.ones_like(v), *([x * x] if quadratic else [])]
    counts = np.abs(v) > LEAST_SPEED
    counts[:300] = counts[-300:] = False
    found, *_ = np.linalg.lstsq(np.array(columns).T[counts], u[counts], rcond=None)
    return full(found, directed, quadratic)


def full(found, directed, quadratic):
    found = list(found) if directed else [found[0], found[1], *found[1:]]
    return found if quadratic else [*found, 0.0]


def by_free_run(record, start, directed, quadratic, joint):
    keep = [0, 1, *([2] if directed else []), 3, 4, *([5] if quadratic else [])]
    own, scale = ([values[k] for k in keep] for values in (start, [1, 2, 2, 1, 0.1, 10.0]))
    parameters = lambda z: full(z[: len(keep)], directed, quadratic)  # noqa: E731
    if joint:
        residual = lambda z: 1e3 * (run(parameters(z), record, *z[-2:]) - record[2])  # noqa: E731
        own, scale = [*own, record[2][0], 0.0], [*scale, 1e-4, 1e-3]
    else:
        residual = lambda z: 1e3 * rest(parameters(z), record)  # noqa: E731
    return parameters(least_squares(residual, own, x_scale=scale).x)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=pathlib.Path)
    folder = parser.parse_args().folder
    read = lambda name: [np.ascontiguousarray(c) for c in np.loadtxt(folder / name, delimiter=",", skiprows=1, usecols=(0, 1, 2)).T]  # noqa: E731
    records = {"estimation": read("estimation.csv"), "validation": read("validation.csv")}
    print(f"{'terms':30s} {'fitted to':30s} {'estimation':>10s} {'validation':>10s}   M, F_v forward, backward, F_c, offset, c")
    for directed, quadratic in [(False, False), (True, False), (True, True)]:
        terms = "mass, viscous, Coulomb, offset" if not directed else "+ directed" + (", x^2" if quadratic else "")
        fits = {f"force, {name}": by_force(own, directed, quadratic) for name, own in records.items()}
        start = fits["force, estimation"]
        for joint in (True, False):
            word = "free run, estimation, " + ("joint" if joint else "rest")
            fits[word] = by_free_run(records["estimation"], start, directed, quadratic, joint)
        for name, p in fits.items():
            errors = " ".join(f"{1e3 * error(p, own):7.2f} mm" for own in records.values())
            print(f"{terms:30s} {name:30s} {errors}   {' '.join(f'{value:.2f}' for value in p)}", flush=True)


if __name__ == "__main__":
    main()
