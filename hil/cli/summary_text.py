"""The summary of a log as text: what it is, its channels, identifiers with cycle times, and what was noticed."""

from collections.abc import Iterator
from datetime import tzinfo

from hil.cli.columns import columns, wrapped
from hil.log.several import UNDATED_NS, Logs, Part
from hil.log.signals.decode import NOT_A_FRAME
from hil.log.signals.decoded import DecodedCounts, SignalCount
from hil.log.summary.contents import Contents, SignalSummary
from hil.log.summary.values import ChannelSummary, Cycle, IdSummary, Summary
from hil.log.wall_clock import wall_clock_of

SHOWN = 10  # of each kind of note
SHOWN_IDS = 400
SHOWN_UNKNOWN = 5
SHOWN_CHANNELS = 50


def summary_lines(
    logs: Logs, contents: Contents, summary: Summary, zone: tzinfo, width: int, warnings: tuple[str, ...]
) -> list[str]:
    """Lines of at most ``width`` letters, where names and notes can be broken."""
    counts = contents.counts
    lines = [line for part in logs.parts for line in wrapped(_part(part), width)]
    lines += wrapped(_account(logs, counts, summary, zone), width)
    if summary.channels:
        lines += ["", *_channels(summary, logs.first_ns, width)]
    if summary.ids:
        lines += ["", *_ids(contents, summary, width)]
    notes = [*_notes(logs, contents, counts, summary), *_warned(warnings)]
    if notes:
        lines.append("")
    return lines + [line for note in notes for line in wrapped(note, width, "    ")]


def _part(part: Part) -> str:
    return f"{part.path}: {part.format}, {_count(part.frames, 'frame')}"


def _account(logs: Logs, counts: DecodedCounts, summary: Summary, zone: tzinfo) -> str:
    rejected = counts.rejected + sum(part.account.rejected for part in logs.parts)
    when = ""
    if summary.frames:
        when = f" in {summary.duration_s:.3f} s"
        if summary.first_ns >= UNDATED_NS:
            stamp = wall_clock_of(summary.first_ns, zone).isoformat(" ", "milliseconds")
            when += f" from {stamp} {zone}"
    total = summary.frames + rejected - counts.rejected
    return (
        f"{_count(total, 'frame')}{when}: {counts.decoded:,} decoded, {counts.unknown:,} unknown, {rejected:,} rejected"
    )


def _count(n: int, what: str) -> str:
    return f"{n:,} {what}{'' if n == 1 else 's'}"


def _channels(summary: Summary, begin_ns: int, width: int) -> Iterator[str]:
    heads = ("channel", "frames", "error", "remote", "FD", "Tx", "seconds", "load", "worst 1 s", "at s", "bit rate")
    rows = []
    for one in summary.channels[:SHOWN_CHANNELS]:
        load, worst = _loads(one)
        at = _seconds(one.worst_at_ns - begin_ns) if worst else ""
        counts = [f"{n:,}" if n else "" for n in (one.errors, one.remote, one.fd, one.sent)]
        rate = "" if one.bit_rate is None else _rate(one.bit_rate)
        if rate and one.data_bit_rate:
            rate += f"/{_rate(one.data_bit_rate)}"
        rows.append((one.name, f"{one.frames:,}", *counts, f"{one.duration_s:.1f}", load, worst, at, rate))
    yield from columns(heads, rows, width)
    if len(summary.channels) > SHOWN_CHANNELS:
        yield f"and {len(summary.channels) - SHOWN_CHANNELS} more channels (all of them with --json)"
    if any(one.load is not None or one.bits_per_s is not None for one in summary.channels):
        hint = "" if all(one.bit_rate for one in summary.channels) else "; give --bitrate for the share"
        yield from wrapped(f"(bus load with all stuff bits that a frame may need{hint})", width)


def _loads(one: ChannelSummary) -> tuple[str, str]:
    if one.load is not None:
        return f"{100 * one.load:.1f} %", "" if one.worst_load is None else f"{100 * one.worst_load:.1f} %"
    if one.bits_per_s is None:
        return "", ""
    worst = "" if one.worst_bits_per_s is None else f"{one.worst_bits_per_s / 1000:.1f} kbit/s"
    return f"{one.bits_per_s / 1000:.1f} kbit/s", worst


def _rate(bit_rate: int) -> str:
    return f"{bit_rate / 1e6:g} Mbit/s" if bit_rate >= 1_000_000 else f"{bit_rate / 1e3:g} kbit/s"


def _seconds(ns: int) -> str:
    return f"{ns / 1e9:.3f}"


def milliseconds(ns: float) -> str:
    """Time in ms, three digits or whole numbers."""
    ms = ns / 1e6
    if ms >= 1e7:
        return f"{ms:.1e}"
    return f"{ms:.0f}" if ms >= 100 else f"{ms:.1f}" if ms >= 10 else f"{ms:.2f}"


def _ids(contents: Contents, summary: Summary, width: int) -> Iterator[str]:
    several = len(summary.channels) > 1
    heads = ("channel", "id", "message", "frames", "stated", "min", "p50", "p99", "max ms", "gaps")
    rows = []
    for one in summary.ids[:SHOWN_IDS]:
        rows.append(
            (
                one.channel if several else "",
                _id_text(one),
                contents.name(one.channel, one.can_id, one.extended) or "-",
                f"{one.count:,}",
                *_cycle(one.cycle),
            )
        )
    yield from columns(heads, rows, width, left=(0, 1, 2))
    if len(summary.ids) > SHOWN_IDS:
        yield f"and {len(summary.ids) - SHOWN_IDS} more identifiers (all of them with --json)"


def _cycle(cycle: Cycle | None) -> tuple[str, ...]:
    if cycle is None:
        return ("",) * 6
    return (
        "" if cycle.nominal_ns is None else milliseconds(cycle.nominal_ns),
        *(milliseconds(ns) for ns in (cycle.min_ns, cycle.p50_ns, cycle.p99_ns, cycle.max_ns)),
        "" if not cycle.gaps else f"{cycle.gaps:,}",
    )


def _usual_ns(cycle: Cycle) -> float:
    return float(cycle.nominal_ns or cycle.p50_ns) or 1.0


def _cycles(cycle: Cycle) -> str:
    return f"{cycle.max_ns / _usual_ns(cycle):.3g} cycles of {milliseconds(_usual_ns(cycle))} ms"


def _some(notes: list[str], more: str) -> Iterator[str]:
    yield from notes[:SHOWN]
    if len(notes) > SHOWN:
        yield f"{more}: {len(notes) - SHOWN} more (all of them with --json)"


def _notes(logs: Logs, contents: Contents, counts: DecodedCounts, summary: Summary) -> Iterator[str]:
    """What the reader should know beside the numbers: what is lost first."""
    yield from _losses(logs, counts)
    back = summary.backwards
    if back is not None:
        where = _seconds(back.time_ns - logs.first_ns)
        line = "" if back.line is None else f" (line {back.line:,})"
        yield (
            f"stamps run back {_count(back.count, 'time')}, first at frame {back.frame:,}{line}, "
            f"which is stamped {where} s after the first one"
        )
    yield from _protection(contents)
    ids = summary.ids

    def name(one: IdSummary) -> str:
        return f"{one.channel} {_id_text(one)} {contents.name(one.channel, one.can_id, one.extended) or ''}".rstrip()

    gaps = [(one, one.cycle) for one in ids if one.cycle is not None and one.cycle.gaps]
    gaps.sort(key=lambda pair: pair[1].max_ns / _usual_ns(pair[1]), reverse=True)
    yield from _some(
        [
            f"gap: {name(one)} is silent for {milliseconds(cycle.max_ns)} ms ({_cycles(cycle)}) "
            f"from {_seconds(cycle.max_at_ns - logs.first_ns)} s on"
            for one, cycle in gaps
        ],
        "gap",
    )
    yield from _some(
        [
            f"length: {name(one)} changes {_count(one.length_changes, 'time')} between "
            f"{', '.join(map(str, one.lengths))} bytes"
            for one in ids
            if one.length_changes
        ],
        "length",
    )
    signals = contents.signals
    found = {name: count for name, count in counts.signals.items() if name in signals}
    outside = [_outside(name, signals[name], count) for name, count in found.items() if count.out_of_range]
    yield from _some(outside, "out of range")
    yield from _some(_missing(found), "not available")
    yield from counts.notes
    yield from _transport(counts)
    unknown = sorted((one for one in ids if _is_unknown(contents, one)), key=lambda one: -one.count)
    if unknown:
        shown = ", ".join(f"{one.channel} {_id_text(one)} ({one.count:,})" for one in unknown[:SHOWN_UNKNOWN])
        more = f", and {len(unknown) - SHOWN_UNKNOWN} more" if len(unknown) > SHOWN_UNKNOWN else ""
        hint = (
            "; give the database of this log with --dbc"
            if contents.databases.guessed and counts.unknown > counts.decoded
            else ""
        )
        yield f"unknown: {shown}{more}{hint}"
    if summary.other_frames:
        yield f"{_count(summary.other_frames, 'frame')} of more than {len(ids):,} identifiers have no statistics"


def _id_text(one: IdSummary) -> str:
    return one.name[2:].upper()


def _is_unknown(contents: Contents, one: IdSummary) -> bool:
    return contents.name(one.channel, one.can_id, one.extended) is None


def _losses(logs: Logs, counts: DecodedCounts) -> Iterator[str]:
    for part in logs.parts:
        account = part.account
        if account.rejected:
            yield f"rejected: {account.rejected:,} {NOT_A_FRAME} in {part.path}"
            yield from (f"  at byte {one.offset}: {one.text}" for one in account.first_rejected)
        if account.truncated_at is not None:
            yield f"{part.path} is cut off at byte {account.truncated_at}"
        for kind, count in account.passed_over.most_common(SHOWN):
            yield f"{part.path}: {count:,} {kind} passed over"
        yield from (f"{part.path}: {note}" for note in account.notes)
    yield from logs.notes
    yield from (f"rejected: {count:,} {reason}" for reason, count in counts.reasons.items())


def _protection(contents: Contents) -> Iterator[str]:
    found = contents.protection()
    bad = {name: one for name, one in found.items() if one.corrupt or one.repeated or one.lost}
    legacy = [name for name, one in bad.items() if one.is_legacy]
    if legacy:
        yield (
            f"end-to-end protection: {len(legacy)} messages carry the check value of older recordings; "
            "--e2e-legacy checks by it"
        )
    lines = [
        f"end-to-end protection: {name}: {one.corrupt:,} corrupt, {one.repeated:,} repeated, {one.lost:,} lost of "
        f"{one.received + one.lost:,}"
        for name, one in bad.items()
        if name not in legacy
    ]
    yield from _some(lines, "end-to-end protection")
    sound = len(found) - len(bad)
    if sound:
        yield f"end-to-end protection: {_count(sound, 'message')} sound"


def _missing(found: dict[str, SignalCount]) -> list[str]:
    """Signals that are not available, those of one message with equal counts in one line."""
    alike: dict[tuple[str, int, int], list[str]] = {}
    for name, count in found.items():
        if count.sna:
            message, _, signal = name.rpartition(".")
            alike.setdefault((message, count.n, count.sna), []).append(signal)
    return [
        f"not available: {message}.{', '.join(signals)} in {sna:,} of {_count(n, 'frame')}"
        for (message, n, sna), signals in alike.items()
    ]


def _transport(counts: DecodedCounts) -> Iterator[str]:
    """J1939 transfers that came to nothing."""
    transport = counts.transport
    for reason, count in transport.broken.items():
        yield f"J1939 transport: {_count(count, 'transfer')} broken: {reason}"
    if transport.open:
        yield f"J1939 transport: {_count(transport.open, 'transfer')} unfinished at the end"
    if transport.unknown:
        shown = ", ".join(f"{name} ({count:,})" for name, count in transport.unknown.most_common(SHOWN_UNKNOWN))
        yield f"J1939 transport: no message of the database for {shown}"


def _outside(name: str, one: SignalSummary, count: SignalCount) -> str:
    signal = one.signal
    unit = f" {signal.unit}" if signal.unit else ""
    low, high = ("-" if end is None else f"{end:g}" for end in (signal.minimum, signal.maximum))
    values = "" if one.least is None else f"{one.least:g} to {one.greatest:g}{unit}, "
    where = f"{count.out_of_range:,} of {_count(count.n, 'frame')}"
    return f"out of range: {name} in {where} ({values}stated {low} to {high})"


def _warned(warnings: tuple[str, ...]) -> Iterator[str]:
    yield from (f"database: {warning}" for warning in warnings[:SHOWN])
    if len(warnings) > SHOWN:
        yield f"database: and {len(warnings) - SHOWN} more warnings (all of them with --json)"
