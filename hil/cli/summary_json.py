"""The summary of a log as the plain values that ``--json`` prints."""

import math
from typing import Any

from hil.log.several import Logs, Part
from hil.log.signals.decode import NOT_A_FRAME
from hil.log.signals.decoded import SignalCount, TransportCount
from hil.log.summary.contents import Contents, SignalSummary
from hil.log.summary.values import Backwards, ChannelSummary, IdSummary, Summary


def summary_values(logs: Logs, contents: Contents, summary: Summary, warnings: tuple[str, ...]) -> dict[str, Any]:
    """Everything of the summary, by the keys that docs/json.md names."""
    lost = sum(part.account.rejected for part in logs.parts)
    cuts = [part.account.truncated_at for part in logs.parts if part.account.truncated_at is not None]
    counts = contents.counts
    reasons = dict(counts.reasons) | ({NOT_A_FRAME: lost} if lost else {})
    unknown = [one for one in summary.ids if contents.name(one.channel, one.can_id, one.extended) is None]
    unknown_ids = {f"{one.channel} {one.name}": one.count for one in sorted(unknown, key=lambda one: -one.count)}
    return {
        "log": ", ".join(str(part.path) for part in logs.parts),
        "format": ", ".join(dict.fromkeys(part.format for part in logs.parts)),
        "frames": summary.frames + lost,
        "decoded": counts.decoded,
        "unknown": counts.unknown,
        "rejected": counts.rejected + lost,
        "truncated_at": cuts[0] if cuts else None,
        "duration_s": summary.duration_s,
        "first_ns": summary.first_ns,
        "last_ns": summary.last_ns,
        "logs": [_part(part) for part in logs.parts],
        "notes": [*logs.notes, *counts.notes],
        "channels": {one.name: _channel(one) for one in summary.channels},
        "ids": [_id(one, contents) for one in summary.ids],
        "frames_of_other_ids": summary.other_frames,
        "stamps_back": _back(summary.backwards),
        "messages": {
            name: {
                "count": one.count,
                "rate_hz": one.rate_hz,
                "short": one.short,
                "longer": one.longer,
                "transported": one.transported,
            }
            for name, one in counts.messages.items()
        },
        "signals": {
            name: _signal(one, counts.signals.get(name, SignalCount(0))) for name, one in contents.signals.items()
        },
        "protection": {
            name: {
                "received": one.received,
                "corrupt": one.corrupt,
                "repeated": one.repeated,
                "lost": one.lost,
                "legacy": one.is_legacy,
            }
            for name, one in contents.protection().items()
        },
        "transport": _transport(counts.transport),
        "unknown_ids": unknown_ids,
        "rejected_reasons": reasons,
        "first_rejected": [
            {"log": str(part.path), "offset": one.offset, "text": one.text}
            for part in logs.parts
            for one in part.account.first_rejected
        ],
        "dbc_warnings": list(warnings),
    }


def _transport(one: TransportCount) -> dict[str, Any]:
    return {
        "frames": one.frames,
        "joined": one.joined,
        "broken": dict(one.broken),
        "unknown": dict(one.unknown),
        "open": one.open,
    }


def _part(part: Part) -> dict[str, Any]:
    account = part.account
    return {
        "log": str(part.path),
        "format": part.format,
        "frames": part.frames,
        "rejected": account.rejected,
        "truncated_at": account.truncated_at,
        "passed_over": dict(account.passed_over),
        "start_ns": account.start_ns,
        "notes": list(account.notes),
    }


def _back(back: Backwards | None) -> dict[str, Any] | None:
    if back is None:
        return None
    return {"count": back.count, "first_frame": back.frame, "first_line": back.line, "first_ns": back.time_ns}


def _channel(one: ChannelSummary) -> dict[str, Any]:
    return {
        "frames": one.frames,
        "errors": one.errors,
        "remote": one.remote,
        "fd": one.fd,
        "sent": one.sent,
        "first_ns": one.first_ns,
        "last_ns": one.last_ns,
        "duration_s": one.duration_s,
        "bit_rate": one.bit_rate,
        "data_bit_rate": one.data_bit_rate,
        "load": one.load,
        "worst_load": one.worst_load,
        "bits_per_s": one.bits_per_s,
        "worst_bits_per_s": one.worst_bits_per_s,
        "worst_at_ns": one.worst_at_ns,
    }


def _id(one: IdSummary, contents: Contents) -> dict[str, Any]:
    cycle = one.cycle
    return {
        "channel": one.channel,
        "id": one.can_id,
        "extended": one.extended,
        "message": contents.name(one.channel, one.can_id, one.extended),
        "count": one.count,
        "first_ns": one.first_ns,
        "last_ns": one.last_ns,
        "cycle": None
        if cycle is None
        else {
            "stated_ms": None if cycle.nominal_ns is None else cycle.nominal_ns / 1e6,
            "min_ms": cycle.min_ns / 1e6,
            "p50_ms": cycle.p50_ns / 1e6,
            "p99_ms": cycle.p99_ns / 1e6,
            "max_ms": cycle.max_ns / 1e6,
            "mean_ms": cycle.mean_ns / 1e6,
            "gaps": cycle.gaps,
            "max_at_ns": cycle.max_at_ns,
        },
        "lengths": list(one.lengths),
        "length_changes": one.length_changes,
        "stamps_back": _back(one.backwards),
        "remote": one.remote,
        "fd": one.fd,
        "sent": one.sent,
    }


def _signal(one: SignalSummary, count: SignalCount) -> dict[str, Any]:
    return {
        "count": count.n,
        "not_available": count.sna,
        "out_of_range": count.out_of_range,
        "least": _finite(one.least),
        "greatest": _finite(one.greatest),
        "unit": one.signal.unit,
    }


def _finite(value: float | int | None) -> float | int | None:
    return None if value is None or not math.isfinite(value) else value
