"""The controller as a unit of co-simulation: on a CAN bus (FMI-LS-BUS), or with signals in and out.

Its state is everything that it was told since its start: going back to a state does all of it again.
"""

from collections.abc import Iterator
from struct import Struct

import numpy as np

from dbc.batch import Batch
from dbc.contract import contract, spec_of
from dbc.frame import BusName, Received
from ecu.node import SENT, SOURCES, EcuNode
from ecu.parameters.ecu import EcuParameters
from hil.fmu.can_node import CanNode
from hil.fmu.plant_unit import STEPS_BEHIND, StateError
from hil.fmu.variables import Table, Variable, is_integer, parameter_variables, signal_variables, with_parameters

PERIOD_NS = 10_000_000
BUS_NOTIFICATIONS = "org.fmi_standard.fmi_ls_bus.Can_BusNotifications"
NOT_AVAILABLE = -1  # an integer that the bus calls not available
_MAGIC = b"bbecu001"
_HEAD, _EVENT = Struct("<8sQ"), Struct("<cI")
_START, _INPUTS, _TICKS, _RECEIVED, _SAID = b"S", b"I", b"T", b"R", b"O"


def variables(parameters: EcuParameters) -> list[Variable]:
    """All variables: inputs, outputs, parameters."""
    of = [v for kind in SOURCES for v in signal_variables(kind, "input")]
    of += [v for kind in SENT for v in signal_variables(kind, "output")]
    about = "Specifies whether the FMU relies on bus notifications."
    of.append(Variable(BUS_NOTIFICATIONS, "Boolean", "structuralParameter", 0, description=about))
    return [*of, *parameter_variables(parameters)]


class EcuUnit:
    """The controller between two communication points; it ticks every 10 ms, first 10 ms after the start.

    Parameters
    ----------
    parameters : before the importer's changes, which are in the table.
    on_bus : frames come and go by events; else signals are read at each tick, and sent to it as frames.
    """

    def __init__(self, parameters: EcuParameters, on_bus: bool) -> None:
        self._set = parameters
        self._on_bus = on_bus
        self.table = Table(variables(parameters))
        fields = [(spec_of(kind).name, field) for kind in SOURCES for field in spec_of(kind).fields]
        integer = [is_integer(field) for _, field in fields]
        names = [f"{message}.{field.signal}" for message, field in fields]
        self._input_is_integer = np.array(integer)
        self._real_inputs = self.table.real_indices([n for n, i in zip(names, integer, strict=True) if not i])
        self._integer_inputs = self.table.integer_indices([n for n, i in zip(names, integer, strict=True) if i])
        self._sent = {spec_of(kind).can_id: spec_of(kind) for kind in SENT}
        self._forget()

    def _forget(self) -> None:
        self._log = bytearray()
        self._ticks = self._logged_ticks = 0
        self._node: EcuNode | None = None
        self._can = CanNode(contract(BusName.VEHICLE).bit_rate, False)
        self._batch = Batch(SOURCES)
        self._last_inputs = b""
        self.outgoing = b""

    def preview(self) -> None:
        """Outputs of the start: nothing was sent, they are what they were."""
        with_parameters(self._set, self.table)

    def initialise(self) -> None:
        """Start the controller."""
        self._forget()
        self._write(_START, self.table.reals.tobytes() + self.table.integers.tobytes())
        self._node = EcuNode(with_parameters(self._set, self.table), PERIOD_NS)
        self._can = CanNode(contract(BusName.VEHICLE).bit_rate, bool(self.table[BUS_NOTIFICATIONS]))
        self.outgoing = self._can.outgoing() if self._on_bus else b""

    def _write(self, kind: bytes, content: bytes = b"") -> None:
        if self._logged_ticks < self._ticks:  # ticks between two events are counted
            self._log += _EVENT.pack(_TICKS, self._ticks - self._logged_ticks)
            self._logged_ticks = self._ticks
        self._log += _EVENT.pack(kind, len(content)) + content

    def advance_to(self, time_s: float) -> None:
        """Do all ticks up to a time since the start, s; signals hold meanwhile."""
        due = int(time_s * 1e9 / PERIOD_NS + STEPS_BEHIND)
        if due > self._ticks and not self._on_bus:
            values = np.empty(self._input_is_integer.size)
            values[~self._input_is_integer] = self.table.reals[self._real_inputs]
            values[self._input_is_integer] = self.table.integers[self._integer_inputs]
            self._take(values.tobytes())
        while self._ticks < due:
            self._tick()
        if self._on_bus and not self.outgoing:
            self._say()

    def _take(self, inputs: bytes) -> None:
        if inputs != self._last_inputs:
            self._write(_INPUTS, inputs)
            self._last_inputs = inputs
            self._batch.values[:] = np.frombuffer(inputs)

    def _tick(self) -> None:
        assert self._node is not None
        self._ticks += 1
        now_ns = self._ticks * PERIOD_NS
        inbox: list[Received] = [*(self._can.inbox(now_ns) if self._on_bus else self._batch.frames(now_ns))]
        frames = self._node.step(now_ns, inbox)
        if self._on_bus:
            self._can.send(frames)
        for frame in frames:
            spec = self._sent.get(frame.can_id) if frame.bus is BusName.VEHICLE else None
            if spec is not None:
                for field, value in zip(spec.fields, spec.decode(frame.data), strict=True):
                    self._tell(f"{spec.name}.{field.signal}", value)

    def _tell(self, name: str, value: float | None) -> None:
        table, reference = self.table, self.table.references[name]
        if reference < table.reals.size:
            table.reals[reference] = np.nan if value is None else value
        else:
            table.integers[table.integer_indices([name])] = NOT_AVAILABLE if value is None else value

    def _say(self) -> None:
        said = self._can.outgoing()
        if said or self.outgoing:
            self._write(_SAID)
        self.outgoing = said

    def event(self, received: bytes) -> None:
        """End an event: what was to be said has been read, and this has come."""
        if received:
            self._write(_RECEIVED, received)
            self._can.receive(self._ticks * PERIOD_NS, received)
        self._say()

    def state(self) -> bytes:
        """All that it was told."""
        ticks = _EVENT.pack(_TICKS, self._ticks - self._logged_ticks)
        values = self.table.reals.tobytes() + self.table.integers.tobytes()
        return _HEAD.pack(_MAGIC, len(values)) + values + bytes(self._log) + ticks

    def restore(self, state: bytes) -> None:
        """Go back to a state: all that it was told, told again.

        Raises
        ------
        StateError : no state of this FMU.
        """
        values = self.table.reals.nbytes + self.table.integers.nbytes
        if len(state) < _HEAD.size + values or _HEAD.unpack_from(state) != (_MAGIC, values):
            raise StateError("state: expected one of this FMU")
        self._forget()
        for kind, number, content in _events(state[_HEAD.size + values :]):
            if kind == _START:
                self._set_values(content)
                self.initialise()
            elif kind == _TICKS:
                for _ in range(number):
                    self._tick()
            elif kind == _INPUTS:
                self._take(content)
            elif kind == _RECEIVED:
                self._write(_RECEIVED, content)
                self._can.receive(self._ticks * PERIOD_NS, content)
            else:
                self._say()
        self._set_values(state[_HEAD.size : _HEAD.size + values])

    def _set_values(self, values: bytes) -> None:
        table = self.table
        if len(values) != table.reals.nbytes + table.integers.nbytes:
            raise StateError("state: expected one of this FMU")
        table.reals[:] = np.frombuffer(values, np.float64, table.reals.size)
        table.integers[:] = np.frombuffer(values, np.int64, table.integers.size, table.reals.nbytes)


def _events(log: bytes) -> Iterator[tuple[bytes, int, bytes]]:
    at = 0
    while at + _EVENT.size <= len(log):
        kind, number = _EVENT.unpack_from(log, at)
        at += _EVENT.size
        content = b"" if kind == _TICKS else log[at : at + number]
        at += len(content)
        yield kind, number, content
