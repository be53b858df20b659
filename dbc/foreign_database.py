"""ARXML, KCD and SYM as the values of `dbc.database`, read by cantools, and by canmatrix what cantools refuses.

Of the public files seen (44 with cantools 41.0.0, 5 with canmatrix 1.2), canmatrix reads files that cantools 45.1.0
refuses (SYM before version 6.0, some ARXML), but silently loses signals of SYM 6.0 and system descriptions that
cantools has; so cantools comes first. Both are foreign: run this in a guarded process when the file is not one's own.
"""

import importlib
import logging
import math
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from dbc.database_checks import Placed, merged, message_problem, printable_name, signal_problem, sound_signals
from dbc.database_values import Database, DatabaseError, Message, Signal, Warnings, shown
from dbc.lean_cantools import cantools
from dbc.text_encoding import cleaned, decoded

FORMATS = ("arxml", "kcd", "sym")
_DECLARED = re.compile(rb"<\?xml[^>]{0,200}?encoding\s*=\s*[\"']([A-Za-z0-9_.-]{1,40})[\"']")
_DECLARATION = re.compile(r"^\s*<\?xml.*?\?>", re.DOTALL)


@dataclass(slots=True)
class _Draft:
    """A message as a foreign reader gives it."""

    name: str
    can_id: int
    extended: bool
    length: int
    cycle_time_ms: float | None
    sender: str
    comment: str
    is_fd: bool
    pgn_match: bool = False
    e2e_data_id: int | None = None
    signals: list[Signal] = field(default_factory=list)


def parse_foreign(content: bytes | str, source: str, format: str) -> Database:
    """Read a database that is no DBC; what is sound is loaded, what is not becomes a warning.

    Parameters
    ----------
    content : the file's bytes or text.
    source : what messages call it, usually the file's name.
    format : "arxml", "kcd" or "sym", as `dbc.database.sniff_database` tells it.

    Raises
    ------
    DatabaseError
        When no reader takes it, or it holds no message that can be used.
    """
    if format not in FORMATS:
        raise DatabaseError(f"{source}: format {format!r}; expected one of {', '.join(FORMATS)}")
    notes: list[str] = []
    text = _text(content, format, notes)
    if format != "sym" and "<!ENTITY" in text:
        raise DatabaseError(f"{source}: XML with entities of its own, which no database needs; left unread")
    warnings = Warnings()
    with _quiet():
        try:
            drafts, bit_rate = _by_cantools(text, format, warnings)
        except Exception as error:  # it raises whatever its parsers trip over
            refused = f"cantools cannot read it ({_short(error)})"
            drafts, bit_rate = _by_canmatrix(text, format, f"{source}: {refused}", warnings), None
            empty = sum(not draft.signals for draft in drafts)
            lost = f"which may lose signals unsaid: {empty} of its {len(drafts)} messages come without signals"
            notes.append(f"{refused}; read by canmatrix, {lost}")
    messages = _messages(drafts, warnings)
    said = (*notes, *warnings.lines())
    if not messages:
        raise DatabaseError(f"{source}: no message that can be used in it{': ' + said[0] if said else ''}")
    return Database(source, messages, said, bit_rate)


def _text(content: bytes | str, format: str, notes: list[str]) -> str:
    if isinstance(content, str):
        return cleaned(content, notes)
    declared = _DECLARED.search(content[:1000]) if format != "sym" else None
    if declared is None:
        return decoded(content, notes)
    try:
        text = content.decode(declared[1].decode("ascii"), errors="replace")
    except LookupError:
        return decoded(content, notes)
    return cleaned(text.lstrip("\ufeff"), notes)


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep both readers from logging what we report ourselves."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        yield
    finally:
        logging.disable(before)


def _short(error: Exception) -> str:
    return shown((str(error).splitlines() or [""])[0]) or type(error).__name__


def _messages(drafts: Iterable[_Draft], warnings: Warnings) -> dict[tuple[int, bool], Message]:
    messages: dict[tuple[int, bool], Message] = {}
    names: set[str] = set()
    for draft in drafts:
        name = shown(draft.name)
        problem = message_problem(draft.can_id, draft.extended, draft.length)
        if problem is not None:
            warnings.add(None, f"message {name}: {problem}; left out")
            continue
        key = draft.can_id, draft.extended
        if key in messages:
            other = messages.pop(key).name
            names.discard(other)
            warnings.add(None, f"identifier {key[0]:#x}: {shown(other)} and {name} share it; the last one is used")
        final = printable_name(draft.name)
        if final in names:
            final = f"{final}_{draft.can_id:X}{'x' * draft.extended}"
            warnings.add(None, f"message {name}: its name is used twice; {draft.can_id:#x} is called {shown(final)}")
        names.add(final)
        placed: list[Placed] = []
        for signal in draft.signals:
            problem = _problem(signal, draft.length)
            if problem is None:
                placed.append((None, signal))
            else:
                warnings.add(None, f"signal {name}.{shown(signal.name)}: {problem}; left out")
        messages[key] = Message(
            final,
            draft.can_id,
            draft.extended,
            draft.length,
            sound_signals(name, placed, warnings),
            draft.cycle_time_ms,
            draft.sender,
            draft.pgn_match,
            draft.e2e_data_id,
            draft.is_fd,
            draft.comment,
        )
    return messages


def _problem(signal: Signal, message_length: int) -> str | None:
    if not math.isfinite(signal.factor) or not math.isfinite(signal.offset):
        return f"factor {signal.factor}, offset {signal.offset}, expected finite numbers"
    return signal_problem(signal.start, signal.length, signal.big_endian, signal.is_float, message_length)


def _range(low: Any, high: Any) -> tuple[float | None, float | None]:
    """Stated range, each end None where it is not stated or no number; (None, None) where it is none."""
    ends = [None if v is None or not math.isfinite(v) else _plain(v) for v in (low, high)]
    if ends[0] is not None and ends[1] is not None and (ends[0] > ends[1] or ends[0] == ends[1] == 0):
        return None, None
    return ends[0], ends[1]


def _plain(value: Any) -> float:
    """Return a number as int where it is one of 64 bits, else as float."""
    return int(value) if abs(value) < 2**64 and value == int(value) else float(value)


def _cycle_ms(value: Any) -> float | None:
    return _plain(value) if value is not None and value > 0 else None


def _by_cantools(text: str, format: str, warnings: Warnings) -> tuple[list[_Draft], int | None]:
    # A declared encoding is that of the bytes, which are a text by now.
    text = _DECLARATION.sub("", text, count=1)
    database: Any = cantools.database.load_string(text, database_format=format, strict=False)
    rates = {bus.baudrate for bus in database.buses if bus.baudrate}
    drafts: list[_Draft] = []
    for one in database.messages:
        if one.is_container:
            said = f"message {shown(one.name)}: the PDUs that its container holds are not decoded"
            warnings.add(None, said)
        end_to_end = one.autosar.e2e if one.autosar is not None else None
        data_ids = end_to_end.data_ids if end_to_end is not None else None
        draft = _Draft(
            one.name,
            one.frame_id,
            one.is_extended_frame,
            one.length,
            _cycle_ms(one.cycle_time),
            (one.senders or [""])[0],
            one.comment or "",
            one.is_fd,
            one.is_extended_frame and one.protocol == "j1939",
            data_ids[0] if data_ids is not None and len(data_ids) == 1 else None,
        )
        draft.signals = [_cantools_signal(signal) for signal in one.signals]
        drafts.append(draft)
    return drafts, int(rates.pop()) if len(rates) == 1 else None


def _cantools_signal(one: Any) -> Signal:
    minimum, maximum = _range(one.minimum, one.maximum)
    multiplexer = one.multiplexer_signal
    return Signal(
        name=printable_name(one.name),
        start=one.start,
        length=one.length,
        big_endian=one.byte_order == "big_endian",
        signed=one.is_signed and not one.is_float,
        is_float=one.is_float,
        factor=one.scale,
        offset=one.offset,
        unit=one.unit or "",
        minimum=minimum,
        maximum=maximum,
        choices={int(raw): str(name) for raw, name in (one.choices or {}).items()},
        multiplexer=None if multiplexer is None else printable_name(multiplexer),
        mux_ranges=merged((i, i) for i in one.multiplexer_ids or ()) if multiplexer is not None else (),
        comment=one.comment or "",
    )


def _by_canmatrix(text: str, format: str, refused: str, warnings: Warnings) -> list[_Draft]:
    try:
        formats = importlib.import_module("canmatrix.formats")
    except ImportError as error:
        raise DatabaseError(f"{refused}, and canmatrix is not installed; pip install canmatrix") from error
    try:
        content = _DECLARATION.sub("", text, count=1).encode("utf-8")
        matrices = formats.loads(content, format, **({"symImportEncoding": "utf-8"} if format == "sym" else {}))
        return [_canmatrix_message(frame) for matrix in matrices.values() for frame in matrix.frames]
    except Exception as error:  # it raises whatever its parsers trip over
        raise DatabaseError(f"{refused}; canmatrix cannot either ({_short(error)})") from error


def _canmatrix_message(frame: Any) -> _Draft:
    identifier = frame.arbitration_id
    draft = _Draft(
        frame.name,
        identifier.id,
        bool(identifier.extended),
        frame.size,
        _cycle_ms(frame.effective_cycle_time or None),
        (frame.transmitters or [""])[0],
        frame.comment or "",
        bool(frame.is_fd),
        bool(identifier.extended and frame.is_j1939),
    )
    multiplexer = next((s.name for s in frame.signals if s.is_multiplexer), None)
    for one in frame.signals:
        value = one.mux_val if one.mux_val is not None and not one.is_multiplexer else None
        selector = (one.muxer_for_signal or multiplexer) if value is not None or one.mux_val_grp else None
        minimum, maximum = _range(one.min, one.max)
        draft.signals.append(
            Signal(
                name=printable_name(one.name),
                start=one.get_startbit(bit_numbering=1),
                length=one.size,
                big_endian=not one.is_little_endian,
                signed=bool(one.is_signed and not one.is_float),
                is_float=bool(one.is_float),
                factor=_plain(one.factor),
                offset=_plain(one.offset),
                unit=one.unit or "",
                minimum=minimum,
                maximum=maximum,
                choices={int(raw): str(name) for raw, name in one.values.items()},
                multiplexer=None if selector is None else printable_name(selector),
                mux_ranges=merged(one.mux_val_grp or [(value, value)]) if selector is not None else (),
                comment=one.comment or "",
            )
        )
    return draft
