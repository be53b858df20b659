"""J1939 messages by the node that sends them."""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

MAX_SOURCES = 1000
"""Sources of all messages together that are told apart beside the first of each; further ones share "MESSAGE@other"."""


class Sources:
    """Names of the columns of each source: the first of a message has the plain name, see `hil.log.decode`."""

    def __init__(self) -> None:
        self._names: dict[str, dict[int, str]] = {}
        self._told_apart = 0
        self.notes: dict[str, str] = {}

    def split(
        self, message: str, sources: npt.NDArray[np.uint8]
    ) -> Iterator[tuple[str, int | None, npt.NDArray[np.int64] | None]]:
        """Yield name, source address (None for several) and positions (None for all) for each name."""
        names = self._names.setdefault(message, {})
        present, first = np.unique(sources, return_index=True)
        before = len(names)
        for source in present[np.argsort(first)].tolist():
            if source not in names:
                names[source] = self._name(message, source, first=not names)
        if len(names) > max(1, before):
            self.notes[message] = _note(message, names)
        by_name: dict[str, list[int]] = {}
        for source in present.tolist():
            by_name.setdefault(names[source], []).append(source)
        if len(by_name) == 1 and len(present) == 1:
            yield names[int(present[0])], int(present[0]), None
            return
        order = np.argsort(sources, kind="stable")
        bounds = np.searchsorted(sources[order], np.arange(257))
        for name in dict.fromkeys(names.values()):
            if name in by_name:
                some = by_name[name]
                chosen = np.concatenate([order[bounds[s] : bounds[s + 1]] for s in some])
                yield name, some[0] if name != f"{message}@other" else None, np.sort(chosen)

    def _name(self, message: str, source: int, first: bool) -> str:
        if first:
            return message
        if self._told_apart >= MAX_SOURCES:
            return f"{message}@other"
        self._told_apart += 1
        return f"{message}@{source:02X}"


def _note(message: str, names: dict[int, str]) -> str:
    addresses = ", ".join(f"{source:02X}" for source in names)
    return f"{message} comes from the source addresses {addresses}; {message} is that of {next(iter(names)):02X}"
