"""Which messages and signals are to become columns."""

import re
from collections.abc import Collection, Iterable
from fnmatch import translate

_GLOB = re.compile(r"[*?\[]")
_SOURCE = re.compile(r"@[0-9A-Za-z]+(?=\.|$)")


class Wanted:
    """Names "MESSAGE" or "MESSAGE.SIGNAL", with ``*`` and ``?`` for any letters.

    A name with the source address of a J1939 message ("EEC1@17.EngineSpeed") wants that source, one without it all.

    Parameters
    ----------
    names : None wants everything.
    """

    def __init__(self, names: Collection[str] | None = None) -> None:
        self.all = names is None
        given = () if names is None else tuple(names)
        self._given = given
        self._exact = frozenset(given)
        self._pattern = _any_of(given)
        bare = [_SOURCE.sub("", name) for name in given]
        self._bare_exact = frozenset(bare)
        self._bare_pattern = _any_of(bare)

    def takes(self, message: str, signal: str) -> bool:
        """Whether a signal is wanted, from any source at least."""
        if self.all or self.takes_from(message, signal):
            return True
        names = message, f"{message}.{signal}"
        if not self._bare_exact.isdisjoint(names):
            return True
        pattern = self._bare_pattern
        return pattern is not None and any(pattern.match(name) for name in names)

    def takes_from(self, group: str, signal: str) -> bool:
        """Whether a signal of this source is wanted; ``group`` is the name of its columns before the point."""
        if self.all:
            return True
        names = {group, f"{group}.{signal}", _SOURCE.sub("", group), f"{_SOURCE.sub('', group)}.{signal}"}
        if not self._exact.isdisjoint(names):
            return True
        pattern = self._pattern
        return pattern is not None and any(pattern.match(name) for name in names)

    def unmatched(self, known: Iterable[tuple[str, Iterable[str]]]) -> tuple[str, ...]:
        """Return the names that no message or signal has; ``known`` are messages with their signals."""
        names: set[str] = set()
        if not self._given:
            return ()
        for message, signals in known:
            names.add(message)
            names.update(f"{message}.{signal}" for signal in signals)
        lost = []
        for given in self._given:
            bare = _SOURCE.sub("", given)
            if given in names or bare in names:
                continue
            pattern = _any_of([given, bare])
            if pattern is None or not any(pattern.match(name) for name in names):
                lost.append(given)
        return tuple(lost)


def _any_of(names: Collection[str]) -> "re.Pattern[str] | None":
    globs = [translate(name) for name in names if _GLOB.search(name)]
    return re.compile("|".join(globs)) if globs else None
