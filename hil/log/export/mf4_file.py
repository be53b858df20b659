"""Decoded signals as an MF4 file with one group for each message."""

from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import Self

import numpy as np

from dbc.database import Signal
from hil.log.export.blocks import Block, Field, Layout, grouped, of_message
from hil.log.mf4.signals import SignalsWriter


def _named(one: Field) -> Signal:
    """Signal whose names are those of its values, not of its raw values."""
    if not one.signal.choices:
        return one.signal
    raw = np.array([number for number in one.signal.choices if -(2**63) <= number < 2**63], np.int64)
    values = np.asarray(raw * float(one.signal.factor) + float(one.signal.offset))
    whole = {
        int(value): one.signal.choices[number]
        for value, number in zip(values, raw.tolist(), strict=True)
        if np.isfinite(value) and value == np.round(value)
    }
    return replace(one.signal, choices=whole)


class Mf4Groups(AbstractContextManager["Mf4Groups"]):
    """Writes blocks as groups of an MF4 file; where a message came on several channels, they share its group."""

    def __init__(self, path: Path, layout: Layout) -> None:
        self._file = path.open("w+b")
        self._writer = SignalsWriter(self._file, layout.start_ns)
        self._groups = grouped(layout)
        self._index = {
            message: self._writer.group(
                message,
                layout.channel_of.get(message, ""),
                [_named(one) for one in fields],
                [one.dtype for one in fields],
            )
            for message, fields in self._groups.items()
        }

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Finish the file."""
        self._writer.close()
        self._file.close()

    def write(self, block: Block) -> None:
        """Write further rows."""
        for message, fields in self._groups.items():
            own = of_message(block, message, fields)
            if own is None:
                continue
            columns, invalid = [], []
            for one in fields:
                dense = np.zeros(len(own), one.dtype)
                empty = np.ones(len(own), np.bool_)
                if one.name in own.columns:
                    at, values = own.columns[one.name]
                    dense[at] = values
                    empty[at] = False
                columns.append(dense)
                invalid.append(empty)
            self._writer.add(self._index[message], own.time_ns, columns, invalid)
