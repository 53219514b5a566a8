"""Language of the Rust sources: fails with file:line where a comment or a name leaves the rules of CONTRIBUTING.md.

    python scripts/check_words.py [FILE.rs ...]

Without files: every .rs file that git knows. The rules: comment lines have at most 120 columns; a documentation
paragraph does not begin with a headless "What ..."; spelling is American; words that mean something else in the field
are not used (a trajectory is no "course").
"""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
COLUMNS = 120

DOC = re.compile(r"\s*//[/!]")
COMMENT = re.compile(r"\s*//")
HEADLESS = re.compile(r"\s*//[/!] (What|Whatever)\b")
BRITISH = re.compile(
    r"normalis|penalis|linearis|localis|initialis|optimis|stabilis|minimis|maximis|discretis|factoris|parametris"
    r"|generalis|summaris|recognis|synchronis|serialis|regularis|quantis|randomis|visualis|characteris(?!t)"
    r"|colour|neighbour|behaviour|favour|catalogue|artefact|analyse(?!s\b)|modell(?!ica)|labell(?!ed\b)"
    r"|\b(centre|metre|litre|fibre|grey|learnt|towards|whilst|amongst|fulfil|licence|judgement)s?\b",
    re.IGNORECASE,
)
# (what is not written, what is written instead); anywhere in a line of code or comment.
WORDS = [
    (re.compile(r"(?<![Oo]f )\b[Cc]ourse\b"), "trajectory"),
    (re.compile(r"\bcomplain"), "report, refuse"),
    (re.compile(r"\bforeign (FMU|system)", re.IGNORECASE), "third-party"),
    (re.compile(r"\bshare told\b"), "explained variance"),
    (re.compile(r"\b(by the|their) company\b|\bfn company\b"), "other effects"),
    (re.compile(r"\bkept back\b"), "held out"),
    (re.compile(r"\bto the bits\b"), "bit for bit"),
]
# Names given by others: an attribute of files that are broken on purpose, a type of the crate `qdldl`.
GIVEN = re.compile(r"colour=|no attribute colour|QDLDLFactorisation")


def faults(text):
    """(line, fault) of every fault in the text of a source file.

    >>> list(faults("/// What it is.\\n/// A force.\\nlet colour = 1;\\n"))
    [(1, 'headless "What ..."; begin with a noun or a verb'), (3, 'British spelling "colour"')]
    >>> list(faults("// " + "x" * 118))
    [(1, '121 columns, more than 120')]
    >>> list(faults("// What is known\\nlet a = 1; // of course\\n"))
    []
    """
    lines = text.splitlines()
    for number, line in enumerate(lines, 1):
        is_comment = COMMENT.match(line)
        if is_comment and len(line) > COLUMNS:
            yield number, f"{len(line)} columns, more than {COLUMNS}"
        before = lines[number - 2] if number > 1 else ""
        begins = not DOC.match(before) or before.strip() in ("///", "//!")
        if HEADLESS.match(line) and begins:
            yield number, 'headless "What ..."; begin with a noun or a verb'
        spelled = BRITISH.search(GIVEN.sub("", line))
        if spelled:
            yield number, f'British spelling "{spelled[0]}"'
        for pattern, instead in WORDS:
            found = pattern.search(line)
            if found:
                yield number, f'"{found[0]}": write {instead}'


def main(arguments):
    if arguments:
        names = arguments
    else:
        listed = subprocess.run(["git", "ls-files", "*.rs"], cwd=ROOT, capture_output=True, text=True, check=True)
        names = [ROOT / name for name in listed.stdout.splitlines()]
    count = 0
    for path in map(Path, names):
        if not path.exists():
            continue
        place = path.relative_to(ROOT) if path.is_absolute() else path
        for number, fault in faults(path.read_text(encoding="utf-8")):
            print(f"{place}:{number}: {fault}", file=sys.stderr)
            count += 1
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
