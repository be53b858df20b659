"""What stands in a DBC's text as values for a decoder: everything that can be decoded, the rest as warnings."""

import math
import re
from collections import Counter

from dbc.database_checks import Placed, merged, printable_name, signal_problem, sound_signals
from dbc.database_values import Message, Signal, Warnings, shown
from dbc.dbc_details import MuxRule, number
from dbc.dbc_scan import SignalText
from dbc.dbc_text import DbcText, Draft

INDEPENDENT = "VECTOR__INDEPENDENT_SIG_MSG"  # Vector's home of signals that belong to no message
NO_SENDER = "Vector__XXX"
_ODD_LETTERS = re.compile(r"[^A-Za-z0-9_]")

Selection = tuple[str | None, tuple[tuple[int, int], ...]]  # multiplexer (None: always there), its raw values


class DbcMessages:
    """Makes messages of one text."""

    def __init__(self, text: DbcText, warnings: Warnings) -> None:
        self._drafts = text.drafts
        self._details = text.details
        self._warnings = warnings
        self._numbers: dict[str, float | None] = {}  # by how they are written: a database repeats few
        self._ranges: dict[tuple[str, str], tuple[float | None, float | None]] = {}  # sound ones, likewise
        self._odd_letters = False

    def bit_rate(self) -> int | None:
        """Bit rate that the attribute Baudrate states, bit/s."""
        rate = self._details.numeric_attribute("Baudrate")
        return int(rate) if rate is not None and 1 <= rate <= 1e9 else None

    def messages(self) -> dict[tuple[int, bool], Message]:
        """Return the messages that can be used, by (identifier, extended)."""
        last: dict[tuple[int, bool], Draft] = {}
        for draft in self._drafts:
            where = draft.text.position
            if draft.text.name == INDEPENDENT:
                continue
            name = shown(self._named(draft.text.name))
            if draft.problem is not None:
                self._warnings.add(where, f"message {name}: {draft.problem}; left out")
                continue
            key = draft.can_id, draft.extended
            other = last.pop(key, None)
            if other is not None:
                both = f"{shown(self._named(other.text.name))} and {name}"
                self._warnings.add(where, f"identifier {key[0]:#x}: {both} share it; the last one is used")
            last[key] = draft
        names: set[str] = set()
        messages = {key: self._message(draft, names) for key, draft in last.items()}
        self._unclaimed()
        return messages

    def _named(self, name: str) -> str:
        """Return a name of letters, digits and '_' alone."""
        return _ODD_LETTERS.sub("_", name)

    def _name(self, name: str, long_name: str | None, position: int) -> str:
        named = printable_name(long_name) if long_name else self._named(name)
        name = long_name or name
        if named != name and not self._odd_letters:
            self._odd_letters = True
            what = "letters outside ASCII" if not name.isascii() else "signs other than letters and digits"
            self._warnings.add(position, f"{what} in names are read as '_'")
        return named

    def _message(self, draft: Draft, names: set[str]) -> Message:
        text, details, owner = draft.text, self._details, (draft.key, "")
        can_id, extended = draft.can_id, draft.extended
        stated = details.attributes.get(owner, {})
        name = self._name(text.name, details.long_names.get(owner), text.position)
        if name in names:
            other = f"{name}_{can_id:X}"
            while other in names:
                other += "_"
            said = f"message {shown(name)}: its name is used twice; {can_id:#x} is called {shown(other)}"
            self._warnings.add(text.position, said)
            name = other
        names.add(name)
        sender = text.sender if text.sender not in ("", NO_SENDER) else details.senders.get(draft.key, "")
        frame_format = details.frame_format(owner)
        j1939 = (details.attribute("ProtocolType") or "").upper() == "J1939" and "VFrameFormat" not in stated
        cycle_ms = details.numeric_attribute("GenMsgCycleTime", owner)
        e2e = details.numeric_attribute("E2EDataID", owner) if "E2EDataID" in stated else None
        return Message(
            name=name,
            can_id=can_id,
            extended=extended,
            length=draft.length,
            signals=sound_signals(shown(name), self._signals(draft, shown(name)), self._warnings),
            cycle_time_ms=cycle_ms if cycle_ms is not None and cycle_ms > 0 else None,
            sender=details.nodes.get(sender, sender),
            pgn_match=extended and (j1939 or frame_format == "J1939PG"),
            e2e_data_id=int(e2e) if e2e is not None and e2e == int(e2e) else None,
            is_fd=frame_format.endswith("CAN_FD"),
            comment=details.comments.get(owner, ""),
        )

    def _signals(self, draft: Draft, message: str) -> list[Placed]:
        multiplexers = {s.name: s for s in draft.signals if s.marker is not None and s.marker.endswith("M")}
        names = self._final_names(draft)
        found: list[Placed] = []
        for text in draft.signals:
            signal = self._signal(draft, text, message, multiplexers, names)
            if signal is not None:
                found.append((text.position, signal))
        return found

    def _number(self, text: str) -> float | None:
        try:
            return self._numbers[text]
        except KeyError:
            return self._numbers.setdefault(text, number(text))

    def _signal(
        self, draft: Draft, text: SignalText, message: str, multiplexers: dict[str, SignalText], names: dict[str, str]
    ) -> Signal | None:
        at, short, marker, start_text, length_text, order, sign, factor_text, offset_text, *_, unit = text
        details, owner = self._details, (draft.key, short)
        name = names.get(short, short)
        start, length, big_endian = int(start_text), int(length_text), order == "0"
        value_type = details.value_types.get(owner, (0, 0))
        is_float = value_type[1] in (1, 2)
        problem = signal_problem(start, length, big_endian, is_float, draft.length)
        factor, offset = self._number(factor_text), self._number(offset_text)
        if factor is None or offset is None or not math.isfinite(factor) or not math.isfinite(offset):
            problem = problem or f"factor {shown(factor_text)}, offset {shown(offset_text)}, expected finite numbers"
        if problem is not None or factor is None or offset is None:
            self._warnings.add(at, f"signal {message}.{shown(name)}: {problem}; left out")
            return None
        if factor == 0:
            self._warnings.add(at, f"signal {message}.{shown(name)}: factor 0, so its value is always {offset}")
        if is_float and length != 32 * value_type[1]:
            said = f"signal {message}.{shown(name)}: SIG_VALTYPE_ {value_type[1]} means {32 * value_type[1]} bits"
            self._warnings.add(value_type[0], f"{said}; read as a float of {length}")
        multiplexer: str | None = None
        ranges: tuple[tuple[int, int], ...] = ()
        rule = details.mux.get(owner)
        if marker is not None or rule is not None:
            selected = self._selected(text, rule, multiplexers, f"signal {message}.{shown(name)}")
            if selected is None:
                return None
            multiplexer, ranges = selected
            if multiplexer:
                multiplexer = names.get(multiplexer, multiplexer)
        limits = self._ranges.get((text.minimum, text.maximum))
        if limits is None:
            limits = self._limits(text, f"signal {message}.{shown(name)}")
        return Signal(
            name,
            start,
            length,
            big_endian,
            sign == "-" and not is_float,
            is_float,
            factor,
            offset,
            unit,
            limits[0],
            limits[1],
            details.choices(owner) if details.values or details.types else {},
            multiplexer or None,
            ranges,
            details.comments.get(owner, ""),
        )

    def _final_names(self, draft: Draft) -> dict[str, str]:
        """Names by what the text calls a signal, where the two differ; no two signals come to one name."""
        long_names, key = self._details.long_names, draft.key
        if not long_names and not _ODD_LETTERS.search("".join([s.name for s in draft.signals])):
            return {}
        final: dict[str, str] = {}
        uses: Counter[str] = Counter()
        for signal in draft.signals:
            if signal.name in final:
                continue
            name = self._name(signal.name, long_names.get((key, signal.name)), signal.position)
            uses[name] += 1
            final[signal.name] = name if uses[name] == 1 else f"{name}_{uses[name]}"
        return final

    def _selected(
        self, text: SignalText, rule: MuxRule | None, multiplexers: dict[str, SignalText], where: str
    ) -> Selection | None:
        """What selects a signal; None, with a warning, where that is not said."""
        marker = text.marker or ""
        own = marker.strip("mM")
        single = next(iter(multiplexers)) if len(multiplexers) == 1 else None
        if rule is not None and rule.multiplexer != text.name:
            ranges = list(rule.ranges)
            if own and rule.multiplexer == single:
                ranges.append((int(own), int(own)))
            selector = multiplexers.get(rule.multiplexer)
            if selector is not None and max(b for _, b in ranges) >> int(selector.length):
                said = f"multiplexer {shown(rule.multiplexer)} has {selector.length} bits, fewer than its values need"
                self._warnings.add(rule.position, f"{where}: {said}")
            return rule.multiplexer, merged(ranges)
        if not own:
            return None, ()
        if single == text.name:  # the message's only multiplexer, m0M: nothing above it selects it
            return None, ()
        others = len(multiplexers) - (text.name in multiplexers)
        if others == 1:
            return next(name for name in multiplexers if name != text.name), ((int(own), int(own)),)
        why = "no SG_MUL_VAL_ says by which multiplexer" if others else "no signal of its message is a multiplexer"
        self._warnings.add(text.position, f"{where}: selected by value {own[:20]}, but {why}; left out")
        return None

    def _limits(self, text: SignalText, where: str) -> tuple[float | None, float | None]:
        low, high = self._number(text.minimum), self._number(text.maximum)
        if low is None or high is None or not math.isfinite(low) or not math.isfinite(high):
            said = f"range {shown(text.minimum)}|{shown(text.maximum)} is none of two finite numbers; not used"
            self._warnings.add(text.position, f"{where}: {said}")
            return None, None
        if low > high:
            self._warnings.add(text.position, f"{where}: minimum {low} above maximum {high}; range not used")
            return None, None
        limits = (None, None) if low == high == 0 else (low, high)
        self._ranges[text.minimum, text.maximum] = limits
        return limits

    def _unclaimed(self) -> None:
        """Report what is said of signals that do not exist."""
        details = self._details
        said = (
            ("VAL_", {owner: named.position for owner, named in details.values.items()}),
            ("SIG_VALTYPE_", {owner: position for owner, (position, _) in details.value_types.items()}),
            ("SG_MUL_VAL_", {owner: rule.position for owner, rule in details.mux.items()}),
        )
        keys = {owner[0] for _, owners in said for owner in owners}
        known = {(d.key, s.name) for d in self._drafts if d.key in keys for s in d.signals}
        for keyword, owners in said:
            for owner, position in owners.items():
                if owner not in known:
                    what = f"{keyword} of {owner[0]} {shown(owner[1])}: no such signal"
                    self._warnings.add(position, f"{what}; left out")
