"""J1939 messages by the node that sends them."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

MAX_SOURCES = 1000
"""Sources of all messages together that are told apart beside the first of each; further ones share "MESSAGE@other"."""


class FromSource(NamedTuple):
    """Frames of a message under one name, as places ``begin`` to ``end`` in the order of `Sources.split`."""

    name: str
    source: int | None
    begin: int
    end: int


class Sources:
    """Names of the columns of each source: the first of a message has the plain name, see `hil.log.signals.decode`.

    Attributes
    ----------
    notes : what came from several sources, by message.
    """

    def __init__(self) -> None:
        self._names: dict[str, dict[int, str]] = {}
        self._told_apart = 0
        self.notes: dict[str, str] = {}

    def name(self, message: str, source: int) -> str:
        """Name of the columns of a source."""
        names = self._names.setdefault(message, {})
        if source not in names:
            names[source] = self._new(message, source, first=not names)
            if len(names) > 1:
                addresses = ", ".join(f"{one:02X}" for one in names)
                plain = f"{next(iter(names)):02X}"
                self.notes[message] = (
                    f"{message} comes from the source addresses {addresses}; {message} is that of {plain}"
                )
        return names[source]

    def split(self, message: str, sources: npt.NDArray[np.uint8]) -> tuple[npt.NDArray[np.int64], list[FromSource]]:
        """Return an order of the frames that has those of one name together (and in their order), and the names."""
        present, first = np.unique(sources, return_index=True)
        for source in present[np.argsort(first)].tolist():
            self.name(message, source)
        names = self._names[message]
        distinct = list(dict.fromkeys(names.values()))
        number = {name: i for i, name in enumerate(distinct)}
        code = np.zeros(256, np.int16)
        for source, name in names.items():
            code[source] = number[name]
        codes = code[sources]
        order = np.argsort(codes, kind="stable")
        bounds = np.concatenate(([0], np.cumsum(np.bincount(codes, minlength=len(distinct))))).tolist()
        address = {name: source for source, name in names.items() if name != f"{message}@other"}
        parts = [FromSource(n, address.get(n), a, b) for n, a, b in zip(distinct, bounds[:-1], bounds[1:], strict=True)]
        return order, [part for part in parts if part.begin < part.end]

    def _new(self, message: str, source: int, first: bool) -> str:
        if first:
            return message
        if self._told_apart >= MAX_SOURCES:
            return f"{message}@other"
        self._told_apart += 1
        return f"{message}@{source:02X}"
