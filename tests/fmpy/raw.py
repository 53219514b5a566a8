"""FMI 2.0 through bare ctypes: every function by its exact name, status codes returned, every log message kept.

FMPy raises on a bad status and prints messages; most of this suite is about bad statuses and messages, so it calls the
library itself. What the FMU is (variables, GUID, paths) comes from `fmu.py`.
"""

import ctypes
import struct
from ctypes import CFUNCTYPE, POINTER, byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p

OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)
STATUS_NAMES = ["fmi2OK", "fmi2Warning", "fmi2Discard", "fmi2Error", "fmi2Fatal", "fmi2Pending"]
MODEL_EXCHANGE, CO_SIMULATION = 0, 1
DO_STEP_STATUS, PENDING_STATUS, LAST_SUCCESSFUL_TIME, TERMINATED = range(4)

# The sixth argument is the first variadic one; it is looked at only when the format asks for it.
LOGGER = CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p, c_void_p)
ALLOCATE = CFUNCTYPE(c_void_p, c_size_t, c_size_t)
FREE = CFUNCTYPE(None, c_void_p)
STEP_FINISHED = CFUNCTYPE(None, c_void_p, c_int)


class CallbackFunctions(ctypes.Structure):
    _fields_ = [
        ("logger", LOGGER),
        ("allocateMemory", ALLOCATE),
        ("freeMemory", FREE),
        ("stepFinished", STEP_FINISHED),
        ("componentEnvironment", c_void_p),
    ]


class EventInfo(ctypes.Structure):
    _fields_ = [
        ("newDiscreteStatesNeeded", c_int),
        ("terminateSimulation", c_int),
        ("nominalsOfContinuousStatesChanged", c_int),
        ("valuesOfContinuousStatesChanged", c_int),
        ("nextEventTimeDefined", c_int),
        ("nextEventTime", c_double),
    ]


# The memory functions of the C library, as an importer passes them on.
_CALLOC = ctypes.cast(ctypes.CDLL(None).calloc, ALLOCATE)
_RELEASE = ctypes.cast(ctypes.CDLL(None).free, FREE)

_reals, _integers, _strings, _references = POINTER(c_double), POINTER(c_int), POINTER(c_char_p), POINTER(c_uint)
_access = [c_void_p, _references, c_size_t]
_SIGNATURES = {
    "fmi2GetTypesPlatform": [],
    "fmi2GetVersion": [],
    "fmi2SetDebugLogging": [c_void_p, c_int, c_size_t, _strings],
    "fmi2Instantiate": [c_char_p, c_int, c_char_p, c_char_p, c_void_p, c_int, c_int],
    "fmi2FreeInstance": [c_void_p],
    "fmi2SetupExperiment": [c_void_p, c_int, c_double, c_double, c_int, c_double],
    "fmi2EnterInitializationMode": [c_void_p],
    "fmi2ExitInitializationMode": [c_void_p],
    "fmi2Terminate": [c_void_p],
    "fmi2Reset": [c_void_p],
    "fmi2GetReal": [*_access, _reals],
    "fmi2GetInteger": [*_access, _integers],
    "fmi2GetBoolean": [*_access, _integers],
    "fmi2GetString": [*_access, _strings],
    "fmi2SetReal": [*_access, _reals],
    "fmi2SetInteger": [*_access, _integers],
    "fmi2SetBoolean": [*_access, _integers],
    "fmi2SetString": [*_access, _strings],
    "fmi2GetFMUstate": [c_void_p, POINTER(c_void_p)],
    "fmi2SetFMUstate": [c_void_p, c_void_p],
    "fmi2FreeFMUstate": [c_void_p, POINTER(c_void_p)],
    "fmi2SerializedFMUstateSize": [c_void_p, c_void_p, POINTER(c_size_t)],
    "fmi2SerializeFMUstate": [c_void_p, c_void_p, c_void_p, c_size_t],
    "fmi2DeSerializeFMUstate": [c_void_p, c_void_p, c_size_t, POINTER(c_void_p)],
    "fmi2GetDirectionalDerivative": [c_void_p, _references, c_size_t, _references, c_size_t, _reals, _reals],
    "fmi2EnterEventMode": [c_void_p],
    "fmi2NewDiscreteStates": [c_void_p, POINTER(EventInfo)],
    "fmi2EnterContinuousTimeMode": [c_void_p],
    "fmi2CompletedIntegratorStep": [c_void_p, c_int, _integers, _integers],
    "fmi2SetTime": [c_void_p, c_double],
    "fmi2SetContinuousStates": [c_void_p, _reals, c_size_t],
    "fmi2GetDerivatives": [c_void_p, _reals, c_size_t],
    "fmi2GetEventIndicators": [c_void_p, _reals, c_size_t],
    "fmi2GetContinuousStates": [c_void_p, _reals, c_size_t],
    "fmi2GetNominalsOfContinuousStates": [c_void_p, _reals, c_size_t],
    "fmi2SetRealInputDerivatives": [*_access, _integers, _reals],
    "fmi2GetRealOutputDerivatives": [*_access, _integers, _reals],
    "fmi2DoStep": [c_void_p, c_double, c_double, c_int],
    "fmi2CancelStep": [c_void_p],
    "fmi2GetStatus": [c_void_p, c_int, _integers],
    "fmi2GetRealStatus": [c_void_p, c_int, _reals],
    "fmi2GetIntegerStatus": [c_void_p, c_int, _integers],
    "fmi2GetBooleanStatus": [c_void_p, c_int, _integers],
    "fmi2GetStringStatus": [c_void_p, c_int, _strings],
}
FUNCTIONS = tuple(_SIGNATURES)
_RESULTS = {
    "fmi2GetTypesPlatform": c_char_p,
    "fmi2GetVersion": c_char_p,
    "fmi2Instantiate": c_void_p,
    "fmi2FreeInstance": None,
}


def load(binary):
    """The shared library with argument types declared; a missing function shows when it is called."""
    library = ctypes.CDLL(str(binary))
    for name, arguments in _SIGNATURES.items():
        if hasattr(library, name):
            function = getattr(library, name)
            function.argtypes, function.restype = arguments, _RESULTS.get(name, c_int)
    return library


class BadStatus(AssertionError):
    """A call that had to succeed did not."""


class Instance:
    """One instance with its own logger.

    `messages` holds (instance name, status, category, text) in the order of arrival. Methods that are named like the
    FMI function without its prefix return the status; `must(...)` raises unless it is fmi2OK.
    """

    def __init__(self, fmu, kind, *, name="fmu", guid=None, logging=True, resources=None, callbacks="full"):
        self.fmu, self.kind, self.messages = fmu, kind, []
        self.library = fmu.library
        self._logger = LOGGER(self._log)
        self._callbacks = CallbackFunctions()
        if callbacks == "full":
            self._callbacks.logger = self._logger
        if callbacks in ("full", "no logger"):
            self._callbacks.allocateMemory = _CALLOC
            self._callbacks.freeMemory = _RELEASE
        self.component = self.library.fmi2Instantiate(
            None if name is None else name.encode(),
            kind,
            (fmu.guid if guid is None else guid).encode(),
            (fmu.resources.as_uri() if resources is None else resources).encode(),
            None if callbacks == "null" else byref(self._callbacks),
            0,
            int(logging),
        )

    def _log(self, _environment, instance, status, category, message, argument):
        text = (message or b"").decode("utf-8", "replace")
        if "%s" in text and argument:
            text = text.replace("%s", ctypes.string_at(argument).decode("utf-8", "replace"), 1)
        self.messages.append(
            (
                None if instance is None else instance.decode("utf-8", "replace"),
                status,
                None if category is None else category.decode("utf-8", "replace"),
                text.replace("%%", "%"),
            )
        )

    def __enter__(self):
        assert self.component, f"fmi2Instantiate returned NULL: {self.messages}"
        return self

    def __exit__(self, *_):
        self.free()

    def free(self):
        if self.component:
            self.library.fmi2FreeInstance(self.component)
            self.component = None
        # The callback and this object hold each other; cut, so that neither waits for the garbage collector.
        self._callbacks = self._logger = None

    def call(self, name, *arguments):
        """Status of `fmi2<name>(component, ...)`."""
        return getattr(self.library, "fmi2" + name)(self.component, *arguments)

    def must(self, name, *arguments):
        """As `call`, and the status must be fmi2OK."""
        status = self.call(name, *arguments)
        if status != OK:
            raise BadStatus(f"fmi2{name}{arguments} returned {STATUS_NAMES[status]}; log: {self.messages[-3:]}")

    def log_of(self, action):
        """Messages that `action()` causes."""
        before = len(self.messages)
        action()
        return self.messages[before:]

    # -- variables -----------------------------------------------------------------------------------------------

    def get(self, variables):
        """Values of a list of variables of mixed types, in order; raises on a bad status."""
        values = {}
        for function, ctype, members in _by_function(variables):
            buffer = (ctype * len(members))()
            self.must("Get" + function, _array(c_uint, [v.reference for v in members]), len(members), buffer)
            for variable, value in zip(members, buffer):
                values[variable.name] = _from_c(function, value)
        return [values[v.name] for v in variables]

    def set(self, variables, values):
        """Sets variables of mixed types; raises on a bad status."""
        given = {v.name: value for v, value in zip(variables, values)}
        for function, ctype, members in _by_function(variables):
            buffer = _array(ctype, [_to_c(function, given[v.name]) for v in members])
            self.must("Set" + function, _array(c_uint, [v.reference for v in members]), len(members), buffer)

    def try_set(self, variable, value):
        """Status of setting one variable."""
        ((function, ctype, _),) = _by_function([variable])
        buffer = _array(ctype, [_to_c(function, value)])
        return self.call("Set" + function, _array(c_uint, [variable.reference]), 1, buffer)

    def try_get(self, variable):
        """Status of reading one variable."""
        ((function, ctype, _),) = _by_function([variable])
        return self.call("Get" + function, _array(c_uint, [variable.reference]), 1, (ctype * 1)())

    def directional_derivative(self, unknowns, knowns, seed):
        """dunknowns = J seed, as floats."""
        result = (c_double * len(unknowns))()
        self.must(
            "GetDirectionalDerivative",
            _array(c_uint, [v.reference for v in unknowns]),
            len(unknowns),
            _array(c_uint, [v.reference for v in knowns]),
            len(knowns),
            _array(c_double, seed),
            result,
        )
        return list(result)

    # -- life-cycle ----------------------------------------------------------------------------------------------

    def initialize(self, start=0.0, stop=None, tolerance=None, set_first=((), ())):
        """SetupExperiment, set the given variables, Enter- and ExitInitializationMode."""
        self.setup(start, stop, tolerance)
        self.set(*set_first)
        self.must("EnterInitializationMode")
        self.must("ExitInitializationMode")

    def setup(self, start=0.0, stop=None, tolerance=None):
        self.must(
            "SetupExperiment",
            int(tolerance is not None),
            0.0 if tolerance is None else tolerance,
            start,
            int(stop is not None),
            0.0 if stop is None else stop,
        )

    def do_step(self, time, step, no_set_state_prior=False):
        """Status of fmi2DoStep."""
        return self.call("DoStep", time, step, int(no_set_state_prior))

    def real_status(self, kind=LAST_SUCCESSFUL_TIME):
        value = c_double(float("nan"))
        self.must("GetRealStatus", kind, byref(value))
        return value.value

    def boolean_status(self, kind=TERMINATED):
        value = c_int(-1)
        self.must("GetBooleanStatus", kind, byref(value))
        return bool(value.value)

    # -- FMU state -----------------------------------------------------------------------------------------------

    def get_state(self, into=None):
        state = c_void_p(None) if into is None else into
        self.must("GetFMUstate", byref(state))
        return state

    def set_state(self, state):
        self.must("SetFMUstate", state)

    def free_state(self, state):
        self.must("FreeFMUstate", byref(state))

    def serialize(self, state):
        size = c_size_t(0)
        self.must("SerializedFMUstateSize", state, byref(size))
        buffer = ctypes.create_string_buffer(size.value)
        self.must("SerializeFMUstate", state, buffer, size.value)
        return buffer.raw

    def deserialize(self, data):
        state = c_void_p(None)
        self.must("DeSerializeFMUstate", ctypes.create_string_buffer(data, len(data)), len(data), byref(state))
        return state

    # -- Model Exchange ------------------------------------------------------------------------------------------

    def update_discrete_states(self):
        """Event iteration to its end; the last event info and the number of rounds."""
        info = EventInfo(newDiscreteStatesNeeded=1)
        rounds = 0
        while info.newDiscreteStatesNeeded and not info.terminateSimulation:
            rounds += 1
            if rounds > 100:
                raise AssertionError("fmi2NewDiscreteStates does not converge: 100 rounds")
            self.must("NewDiscreteStates", byref(info))
        return info, rounds

    def _vector(self, name, n):
        buffer = (c_double * n)()
        self.must(name, buffer, n)
        return list(buffer)

    def states(self):
        return self._vector("GetContinuousStates", len(self.fmu.states))

    def derivatives(self):
        return self._vector("GetDerivatives", len(self.fmu.states))

    def nominals(self):
        return self._vector("GetNominalsOfContinuousStates", len(self.fmu.states))

    def indicators(self):
        return self._vector("GetEventIndicators", self.fmu.event_indicators)

    def set_states(self, values):
        self.must("SetContinuousStates", _array(c_double, values), len(values))

    def completed_step(self):
        """(enter event mode, terminate) of fmi2CompletedIntegratorStep."""
        event, end = c_int(0), c_int(0)
        self.must("CompletedIntegratorStep", 1, byref(event), byref(end))
        return bool(event.value), bool(end.value)


def bits(values):
    """Exact image of a list of values: equal images mean equal bit for bit."""
    image = []
    for value in values:
        image.append(struct.pack("<d", value) if isinstance(value, float) else value)
    return image


def _array(ctype, values):
    return (ctype * len(values))(*values)


def _by_function(variables):
    """(get/set suffix, C type, variables) for each type that occurs."""
    table = {"Real": ("Real", c_double), "Boolean": ("Boolean", c_int), "String": ("String", c_char_p)}
    groups = {}
    for variable in variables:
        function, ctype = table.get(variable.type, ("Integer", c_int))
        groups.setdefault(function, (function, ctype, []))[2].append(variable)
    return groups.values()


def _to_c(function, value):
    return value.encode() if function == "String" else value


def _from_c(function, value):
    if function == "String":
        return None if value is None else value.decode("utf-8")
    return bool(value) if function == "Boolean" else value
