"""One FMU under test: unpacked archive, own reading of its model description, loaded library.

The model description is read here with lxml and not through FMPy, so that the rules in `test_description.py` do not
rest on what another reader fills in or drops.
"""

import platform
import sys
import zipfile
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from lxml import etree

import raw

# FMI 2.0.4, section 2.2.7: default of `initial` for (causality, variability); absent pairs are illegal, None: no initial.
DEFAULT_INITIAL = {
    ("parameter", "fixed"): "exact",
    ("parameter", "tunable"): "exact",
    ("calculatedParameter", "fixed"): "calculated",
    ("calculatedParameter", "tunable"): "calculated",
    ("input", "discrete"): None,
    ("input", "continuous"): None,
    ("output", "constant"): "exact",
    ("output", "discrete"): "calculated",
    ("output", "continuous"): "calculated",
    ("local", "constant"): "exact",
    ("local", "fixed"): "calculated",
    ("local", "tunable"): "calculated",
    ("local", "discrete"): "calculated",
    ("local", "continuous"): "calculated",
    ("independent", "continuous"): None,
}


@dataclass
class Variable:
    """One ScalarVariable; attributes as in the standard, `initial` with the default filled in."""

    index: int  # 1-based, as ModelStructure counts
    name: str
    reference: int
    type: str
    causality: str
    variability: str
    initial: str | None
    declared_initial: str | None
    attributes: dict  # of the type element, text
    description: str | None

    def number(self, name):
        """A numeric attribute such as `min`, or None."""
        text = self.attributes.get(name)
        if text is None:
            return None
        return float(text) if self.type == "Real" else int(text)

    @property
    def start(self):
        text = self.attributes.get("start")
        if text is None or self.type == "String":
            return text
        if self.type == "Boolean":
            return text in ("true", "1")
        return self.number("start")

    @property
    def is_real(self):
        return self.type == "Real"


class Fmu:
    """An unpacked FMU."""

    def __init__(self, path, folder):
        self.path, self.folder = Path(path), Path(folder)
        with zipfile.ZipFile(path) as archive:
            archive.extractall(folder)
        self.xml = etree.parse(str(self.folder / "modelDescription.xml")).getroot()

    def __repr__(self):
        return self.path.stem

    @property
    def name(self):
        return self.path.stem

    @property
    def guid(self):
        return self.xml.get("guid")

    @property
    def resources(self):
        return self.folder / "resources"

    def interface(self, tag):
        """The <CoSimulation> or <ModelExchange> element, or None."""
        return self.xml.find(tag)

    def flag(self, kind, name):
        """A capability flag of the interface `kind`."""
        tag = "CoSimulation" if kind == raw.CO_SIMULATION else "ModelExchange"
        return self.interface(tag) is not None and self.interface(tag).get(name) in ("true", "1")

    @property
    def model_identifier(self):
        element = self.interface("CoSimulation")
        return (element if element is not None else self.interface("ModelExchange")).get("modelIdentifier")

    @property
    def binary(self):
        return self.folder / "binaries" / PLATFORM / (self.model_identifier + SUFFIX)

    @cached_property
    def library(self):
        return raw.load(self.binary)

    @cached_property
    def variables(self):
        result = []
        for index, element in enumerate(self.xml.find("ModelVariables"), start=1):
            value = next(child for child in element if child.tag != "Annotations")
            causality = element.get("causality", "local")
            variability = element.get("variability", "continuous")
            result.append(
                Variable(
                    index,
                    element.get("name"),
                    int(element.get("valueReference")),
                    value.tag,
                    causality,
                    variability,
                    element.get("initial", DEFAULT_INITIAL.get((causality, variability))),
                    element.get("initial"),
                    self._resolve(value),
                    element.get("description"),
                )
            )
        return result

    def _resolve(self, value):
        """Attributes of the type element over those of its declared type."""
        attributes = {}
        declared = value.get("declaredType")
        if declared is not None:
            simple = self.xml.find(f"TypeDefinitions/SimpleType[@name='{declared}']")
            kind = simple[0]
            attributes.update(kind.attrib)
            if kind.tag == "Enumeration":
                numbers = [int(item.get("value")) for item in kind]
                attributes.update(min=str(min(numbers)), max=str(max(numbers)))
        attributes.update(value.attrib)
        return attributes

    def variable(self, name):
        return next(v for v in self.variables if v.name == name)

    def of(self, *causalities, type=None, variability=None):
        """Variables of some causalities, in order."""
        return [
            v
            for v in self.variables
            if v.causality in causalities
            and (type is None or v.type == type)
            and (variability is None or v.variability == variability)
        ]

    @property
    def readable(self):
        """All variables that a tool may read during a run."""
        return [v for v in self.variables if v.causality != "independent"]

    def unknowns(self, tag):
        """ModelStructure entries of one kind: (variable, dependencies or None, kinds or None)."""
        result = []
        for element in self.xml.iterfind(f"ModelStructure/{tag}/Unknown"):
            indices, kinds = element.get("dependencies"), element.get("dependenciesKind")
            result.append(
                (
                    self.variables[int(element.get("index")) - 1],
                    None if indices is None else [self.variables[int(i) - 1] for i in indices.split()],
                    None if kinds is None else kinds.split(),
                )
            )
        return result

    @cached_property
    def derivatives(self):
        return [unknown for unknown, _, _ in self.unknowns("Derivatives")]

    @cached_property
    def states(self):
        return [self.variables[int(v.attributes["derivative"]) - 1] for v in self.derivatives]

    @property
    def event_indicators(self):
        return int(self.xml.get("numberOfEventIndicators", "0"))

    @property
    def stop_time(self):
        return float(self.xml.find("DefaultExperiment").get("stopTime"))

    @property
    def step_size(self):
        element = self.xml.find("DefaultExperiment")
        return float(element.get("stepSize", float(element.get("stopTime")) / 100))

    # -- instances -----------------------------------------------------------------------------------------------

    def instantiate(self, kind, **options):
        """A new instance; use as a context manager to free it."""
        return raw.Instance(self, kind, **options)


SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
PLATFORM = {"win32": "win", "darwin": "darwin"}.get(sys.platform, "linux") + platform.architecture()[0][:2]
