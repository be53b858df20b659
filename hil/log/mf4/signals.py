"""Writes decoded signals as an ASAM MDF 4.11 file: one group per message, with units, comments, names of values."""

from collections.abc import Iterable, Mapping, Sequence
from typing import IO, Any, Protocol

import numpy as np
import numpy.typing as npt

from hil.log.mf4.write import FLOAT, SIGNED, UNSIGNED, Channel, GroupWriter, MdfWriter

BLOCK_BYTES = 1 << 20  # of one block of data, not packed
HELD_BYTES = 64 << 20  # of all groups together; above, the largest one is written
SIGNALS = "decoded signals"


class SignalText(Protocol):
    """What is written of a signal beside its values.

    ``choices`` names values as they are given to `SignalsWriter.add`.
    """

    @property
    def name(self) -> str: ...  # noqa: D102 (the class says what)

    @property
    def unit(self) -> str: ...  # noqa: D102 (the class says what)

    @property
    def choices(self) -> Mapping[int, str]: ...  # noqa: D102 (the class says what)

    @property
    def comment(self) -> str: ...  # noqa: D102 (the class says what)


class SignalsWriter:
    """Writes groups of signals piece by piece; memory grows with the number of groups, not with their length.

    Parameters
    ----------
    file : open for reading and writing in binary, empty.
    start_ns : start time, ns since 1970; the time of every sample counts from it, in whole nanoseconds.

    >>> with path.open("w+b") as file:  # doctest: +SKIP
    ...     writer = SignalsWriter(file, start_ns)
    ...     wheels = writer.group("WHEELS", "can0", message.signals, [np.float64] * 4)
    ...     writer.add(wheels, time_ns, columns, [None] * 4)
    ...     writer.close()
    """

    def __init__(self, file: IO[bytes], start_ns: int) -> None:
        self.start_ns = max(0, start_ns)
        self._writer = MdfWriter(file, self.start_ns, SIGNALS)
        self._groups: list[_Group] = []
        self._sources: dict[str, int] = {}
        self._held = 0

    def group(
        self, name: str, channel: str, signals: Sequence[SignalText], dtypes: Sequence[npt.DTypeLike], comment: str = ""
    ) -> int:
        """Add the group of a message; returns its index.

        Parameters
        ----------
        name, channel : of the message, and of the bus that it came on.
        signals : one per column.
        dtypes : types of the columns: whole numbers of 8 to 64 bits, or floating-point numbers of 16 to 64.

        Raises
        ------
        TypeError
            For another type.
        """
        if channel not in self._sources:
            self._sources[channel] = self._writer.source(channel)
        kinds = [np.dtype(kind).newbyteorder("<") for kind in dtypes]
        self._groups.append(_Group(self._writer, name, self._sources[channel], signals, kinds, comment))
        return len(self._groups) - 1

    def add(
        self,
        index: int,
        time_ns: npt.NDArray[np.int64],
        columns: Sequence[npt.NDArray[Any]],
        invalid: Sequence[npt.NDArray[np.bool_] | None],
    ) -> None:
        """Append samples to a group.

        Parameters
        ----------
        time_ns : (n,), ns since 1970, not running back.
        columns : values (n,), one array per signal.
        invalid : mask (n,) of the samples without a value, one per signal; None where all have one.
        """
        group = self._groups[index]
        self._held += group.add(np.asarray(time_ns, np.int64) - self.start_ns, columns, invalid)
        if group.size >= BLOCK_BYTES:
            self._held -= group.flush()
        while self._held > HELD_BYTES:
            self._held -= max(self._groups, key=lambda g: g.size).flush()

    def close(self) -> None:
        """Write what is left; the file itself stays open."""
        for group in self._groups:
            group.flush()
            group.close()


class _Group:
    """Samples of one message, on their way into its group."""

    def __init__(
        self,
        writer: MdfWriter,
        name: str,
        source: int,
        signals: Sequence[SignalText],
        kinds: Sequence[np.dtype[Any]],
        comment: str,
    ) -> None:
        fields: list[Any] = [("time", "<i8")]
        fields += [(str(k), kind) for k, kind in enumerate(kinds)]
        inval_bytes = (len(kinds) + 7) // 8
        self.dtype = np.dtype([*fields, ("invalid", "u1", (inval_bytes,))])
        channels, byte = [], 8
        for k, (signal, kind) in enumerate(zip(signals, kinds, strict=True)):
            channels.append(_channel(signal, kind, byte, k))
            byte += kind.itemsize
        self.writer: GroupWriter = writer.group(name, source, channels, byte, inval_bytes, comment=comment)
        self.parts: list[npt.NDArray[np.void]] = []
        self.size = 0

    def add(
        self,
        time_ns: npt.NDArray[np.int64],
        columns: Sequence[npt.NDArray[Any]],
        invalid: Sequence[npt.NDArray[np.bool_] | None],
    ) -> int:
        """Append samples; returns their bytes."""
        records = np.zeros(len(time_ns), self.dtype)
        records["time"] = time_ns
        for k, (column, mask) in enumerate(zip(columns, invalid, strict=True)):
            records[str(k)] = column if mask is None else np.where(mask, np.zeros(1, self.dtype[str(k)]), column)
            if mask is not None:
                records["invalid"][:, k // 8] |= mask.astype(np.uint8) << np.uint8(k % 8)
        self.parts.append(records)
        self.size += records.nbytes
        return records.nbytes

    def flush(self) -> int:
        """Write what is held; returns its bytes."""
        size, self.size = self.size, 0
        if size:
            content = b"".join(part.tobytes() for part in self.parts)
            step = max(1, BLOCK_BYTES * 2 // self.dtype.itemsize) * self.dtype.itemsize
            for begin in range(0, len(content), step):
                self.writer.write(content[begin : begin + step])
        self.parts = []
        return size

    def close(self) -> None:
        """Write the number of records."""
        self.writer.close()


def _channel(signal: SignalText, kind: np.dtype[Any], byte: int, number: int) -> Channel:
    data_type = {"u": UNSIGNED, "i": SIGNED, "f": FLOAT, "b": UNSIGNED}.get(kind.kind)
    if data_type is None or kind.itemsize > 8:
        raise TypeError(f"signal {signal.name}: values of type {kind} have no place in MDF; give whole or real numbers")
    texts = {float(value): text for value, text in signal.choices.items()}
    return Channel(
        signal.name,
        data_type,
        byte,
        8 * kind.itemsize,
        unit=signal.unit or "",
        comment=signal.comment or "",
        texts=texts,
        invalid_bit=number,
    )


def write_signals_mf4(
    file: IO[bytes],
    start_ns: int,
    groups: Iterable[
        tuple[
            str,
            str,
            Sequence[SignalText],
            npt.NDArray[np.int64],
            Sequence[npt.NDArray[Any]],
            Sequence[npt.NDArray[np.bool_] | None],
        ]
    ],
) -> None:
    """Write whole groups: name, channel, signals, time_ns, columns, invalid, as `SignalsWriter` takes them."""
    writer = SignalsWriter(file, start_ns)
    for name, channel, signals, time_ns, columns, invalid in groups:
        index = writer.group(name, channel, signals, [column.dtype for column in columns])
        writer.add(index, time_ns, columns, invalid)
    writer.close()
