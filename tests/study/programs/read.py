"""The programs of `orchestrator/optim/tests/programs/*.txt` as CasADi expressions.

What a line means is said in `orchestrator/optim/tests/programs/read.rs`, which reads the same files for our solver.
"""

import math
import re
from dataclasses import dataclass, field
from pathlib import Path

import casadi

FOLDER = Path(__file__).resolve().parents[3] / "orchestrator" / "optim" / "tests" / "programs"
FUNCTIONS = {
    "sin": casadi.sin, "cos": casadi.cos, "tanh": casadi.tanh, "exp": casadi.exp, "ln": casadi.log, "sqrt": casadi.sqrt,
    "pi": math.pi, "inf": math.inf,
}  # fmt: skip
NUMBERS = {"sin": math.sin, "cos": math.cos, "exp": math.exp, "ln": math.log, "sqrt": math.sqrt, "pi": math.pi, "inf": math.inf}


@dataclass
class Program:
    name: str
    x: casadi.SX = None
    start: list = field(default_factory=list)
    lower: list = field(default_factory=list)
    upper: list = field(default_factory=list)
    objective: casadi.SX = 0
    rows: list = field(default_factory=list)
    row_lower: list = field(default_factory=list)
    row_upper: list = field(default_factory=list)
    minima: list = field(default_factory=list)
    lets: dict = field(default_factory=dict)

    def resize(self, count):
        self.x = casadi.SX.sym("x", count)
        self.start, self.lower, self.upper = [0.0] * count, [-math.inf] * count, [math.inf] * count

    def value(self, text, loop):
        """An expression of the variables."""
        return _evaluate(text, {**FUNCTIONS, **self.lets, **loop}, self.x)

    def number(self, text, loop):
        return float(_evaluate(text, {**NUMBERS, **loop}, None))

    def place(self, text, loop):
        """Place, from 0, of the variable that the text names."""
        found = re.fullmatch(r"x(\d+)|x\[(.*)\]", text.strip())
        return round(self.number(found[1] or found[2], loop)) - 1

    def line(self, word, rest, loop):
        if word == "variables":
            self.resize(int(rest))
        elif word == "start" and "=" in rest:
            where, value = rest.split("=")
            self.start[self.place(where, loop)] = self.number(value, loop)
        elif word == "start":
            values = rest.split(",")
            self.resize(len(values))
            self.start = [self.number(value, loop) for value in values]
        elif word == "bound":
            where, values = rest.split("=")
            low, high = (self.number(value, loop) for value in values.split(","))
            places = range(len(self.start)) if where.strip() == "all" else [self.place(where, loop)]
            for place in places:
                self.lower[place], self.upper[place] = low, high
        elif word == "let":
            name, value = rest.split("=")
            self.lets[name.strip()] = self.value(value, loop)
        elif word == "minimize":
            self.objective += self.value(rest, loop)
        elif word in ("zero", "positive"):
            self.row(0.0, 0.0 if word == "zero" else math.inf, self.value(rest, loop))
        elif word == "within":
            limits, rest = rest.split(" of ")
            low, high = (self.number(value, loop) for value in limits.split(","))
            self.row(low, high, self.value(rest, loop))
        elif word == "minimum":
            self.minima = [self.number(value, loop) for value in rest.split(",")]
        else:
            raise ValueError(f"{self.name}: `{word}` is no word of a program")

    def row(self, low, high, value):
        self.rows.append(value)
        self.row_lower.append(low)
        self.row_upper.append(high)


def _evaluate(text, names, x):
    """Value of a formula; `^` is the power, `x3` and `x[i + 1]` are variables, from 1."""
    text = re.sub(r"x\[([^\]]*)\]", r"_x(\1)", text)
    text = re.sub(r"\bx(\d+)\b", r"_x(\1)", text).strip().replace("^", "**")
    # Names of loops are numbers, as in a text where they have been replaced: 1/3 is a quotient of numbers.
    return eval(text, {"__builtins__": {}}, {**names, "_x": lambda k: x[round(k) - 1]})


def loops(text, outer=()):
    """Values of the loop variables of `for i = 1..3, j = i + 1..4`, in order."""
    outer = dict(outer)
    head, _, rest = text.partition(",")
    name, span = head.split("=")
    first, last = (round(_evaluate(end, {**NUMBERS, **outer}, None)) for end in span.split(".."))
    for k in range(first, last + 1):
        inner = {**outer, name.strip(): k}
        yield from loops(rest, inner) if rest else [inner]


def programs():
    """All programs of the files."""
    found = []
    for file in ("hock_schittkowski.txt", "cutest.txt", "schittkowski.txt"):
        for line in (FOLDER / file).read_text().splitlines():
            line = line.partition("#")[0].strip()
            if not line:
                continue
            turns = [{}]
            if line.startswith("for "):
                head, line = line[4:].split(":", 1)
                turns = list(loops(head))
            word, _, rest = line.strip().partition(" ")
            if word == "program":
                found.append(Program(rest.strip()))
                continue
            for loop in turns:
                found[-1].line(word, rest, loop)
    return found
