"""``python -m airloop.demo``: a record against its model, then what another model lacks; ends with a report to open."""

import sys

from . import _folders
from .commands import into
from .refinement import refine
from .system import System


def main(folder: str = "airloop-demo") -> int:
    """Runs the demo and writes its report.

    Parameters
    ----------
    folder
        Folder for the report.
    """
    print("1. A measured command, replayed through four coupled FMUs (actuator, two frictions, cart with pole):")
    example = _folders.EXAMPLES
    result = System(example / "system.ssd").run(measured=example / "record.csv", step="1ms")
    for fit in result.fits.values():
        percent = "    -" if fit.fit_percent is None else f"{fit.fit_percent:5.1f}"
        print(f"     {fit.name:8s} fit {percent} %   RMS error {fit.rms_error:.3g} {fit.unit or ''}")
    print(f"   {result.steps} steps in {1e3 * result.simulation_s:.1f} ms.\n")
    print("2. Records of a pendulum, and a model with viscous damping only. What does the model lack?")
    place, _ = into(folder)
    report = refine(example / "study.toml", output=place)
    for one in report.data["effects"]:
        if one["selected"]:
            print(f"     {one['id']}")
    page = (report.folder / "report.html").resolve()
    print(f"\nThe report: {page.as_uri()}")
    return 0


if __name__ == "__main__":
    if len(sys.argv) > 2 or sys.argv[1:2] in (["-h"], ["--help"]):
        print("usage: python -m airloop.demo [FOLDER]")
        sys.exit(0 if len(sys.argv) == 2 else 2)
    sys.exit(main(*sys.argv[1:]))
