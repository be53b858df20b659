"""``brakebench decode --uds``: diagnostic requests and answers of a log in words, line by line as they are read."""

import argparse
import json
import sys
from collections.abc import Iterator
from typing import Any

from hil.cli.columns import say
from hil.cli.log_options import check_found, paths, unused, words_of
from hil.cli.progress import Progress
from hil.log.account import printable
from hil.log.choice import Choice
from hil.log.several import Logs
from hil.log.source import ReadOptions
from hil.uds import own
from hil.uds.addresses import Addresses, Identifier
from hil.uds.conversation import NO_FIRST, NO_ISOTP, Conversation, Spoken
from hil.uds.find_pairs import PairFinder
from hil.uds.known import FOREIGN, SHOWN_BYTES, Names, hex_text
from hil.uds.words import Kind, service_text

_MOST_TEXT = 400  # letters of a message in a line: lists of all codes are longer


def run_uds(args: argparse.Namespace, choice: Choice, limit_bytes: int | None) -> int:
    """Print the messages, then what they were; 1 where a message, a frame or a part of the log is missing."""
    told = words_of(args.uds_ids)
    addresses = Addresses.parse(told) if told else None
    with (
        Logs(paths(args.log), ReadOptions(timezone=args.timezone), limit_bytes) as logs,
        Progress(2) as progress,
    ):
        finder = PairFinder(own.SIGN, (own.REQUEST, own.ANSWER, own.PERIODIC))
        finder.take(choice.frames(logs.tables(progress)))
        foreign = {name for name in finder.strange if name not in finder.signed}
        if addresses is None:
            pairs = finder.pairs() + ([(own.REQUEST, own.ANSWER)] if set(logs.channels) - foreign else [])
            addresses = Addresses.of(pairs, periodic=(own.PERIODIC,) if set(logs.channels) - foreign else ())

        def names_of(channel: str, identifier: Identifier) -> Names:
            return FOREIGN if channel in foreign else own.names_of(identifier)

        progress.part(1, "reading")
        conversation = Conversation(addresses, names_of)
        frames = 0

        def counted() -> Iterator[Any]:
            nonlocal frames
            for table in choice.frames(logs.tables(progress)):
                frames += len(table)
                yield table

        write = _write_json if args.json else _write_text
        write(conversation, conversation.messages(counted()), logs)
        check_found(choice, frames, logs)
        notes = unused("--channel", choice.channels, logs)
        parts = [part for part in logs.parts if not part.account.whole]
    for part in parts:
        cut = f", cut off at byte {part.account.truncated_at}" if part.account.truncated_at is not None else ""
        notes.append(f"{printable(str(part.path))}: {part.account.rejected} pieces are no frames{cut}")
    for note in notes:
        print(note, file=sys.stderr)
    if not frames:
        print("brakebench: no frame could be read; give a CAN log", file=sys.stderr)
        return 2
    return 0 if logs.whole and conversation.counts.whole else 1


def _write_text(conversation: Conversation, tables: Iterator[list[Spoken]], logs: Logs) -> None:
    say([f"{'time s':>12}  {'channel':8}  {'id':8}  {'':8}  {'after ms':>8}  message  [bytes]"])
    for messages in tables:
        say(_line(one, logs.first_ns) for one in messages)
    say(["", *summary_lines(conversation)])


def _line(one: Spoken, first_ns: int) -> str:
    after = "" if one.after_ns is None else f"{one.after_ns * 1e-6:.1f}"
    if one.error is None:
        kind, text = one.said.kind.value if one.said.kind is not Kind.OTHER else "", one.said.text
    else:
        service = "" if one.said.service is None else f" of {service_text(one.said.service)}"
        kind, text = "broken", f"{len(one.data)} of {one.length} bytes{service}: {one.error.value}"
    if len(text) > _MOST_TEXT:
        text = f"{text[:_MOST_TEXT]} ... (all of it with --json)"
    shown = f"[{hex_text(one.data)}]" if len(one.data) <= SHOWN_BYTES else f"[{one.data[:SHOWN_BYTES].hex(' ').upper()}"
    if len(one.data) > SHOWN_BYTES:
        shown += f" ... {len(one.data)} bytes]"
    time_s = (one.start_ns - first_ns) * 1e-9
    return printable(f"{time_s:12.6f}  {one.channel:8}  {one.identifier!s:8}  {kind:8}  {after:>8}  {text}  {shown}")


def summary_lines(conversation: Conversation) -> list[str]:
    """What of diagnostics there was, and what is missing of it."""
    counts = conversation.counts
    if not counts.identifiers and not counts.lost_frames:
        return ["no message of diagnostics; name their identifiers with --uds-ids where they are others"]
    kinds = counts.messages
    told = [
        (kinds[Kind.REQUEST], "requests"),
        (kinds[Kind.ANSWER], "answers"),
        (kinds[Kind.REFUSAL], "refusals"),
        (kinds[Kind.PENDING], "response pending"),
        (kinds[Kind.OTHER], "others"),
    ]
    lines = [", ".join(f"{n:,} {what}" for n, what in told if n) or "no complete message"]
    odd = [(counts.unanswered, "requests without an answer"), (counts.unasked, "answers without a request")]
    lines += [f"{n:,} {what}" for n, what in odd if n]
    lines += [f"{n:,} messages incomplete: {error.value}" for error, n in counts.broken.items()]
    left = [
        (counts.frames[NO_FIRST], "consecutive frames without a first frame"),
        (counts.frames[NO_ISOTP], "frames that are not ISO-TP"),
    ]
    lines += [f"{n:,} {what}" for n, what in left if n]
    for (channel, identifier), n in sorted(counts.identifiers.items()):
        lines.append(printable(f"{channel} {identifier}{_role(conversation.addresses, identifier)}: {n:,} messages"))
    return lines


def _role(addresses: Addresses, identifier: Identifier) -> str:
    if addresses.is_functional(identifier):
        return " (to all)"
    partner = addresses.partner(identifier)
    return "" if partner is None else f" (with {partner})"


def _write_json(conversation: Conversation, tables: Iterator[list[Spoken]], logs: Logs) -> None:
    """One object, written piece by piece: a log of any length is not held."""
    begin = '{"uds": ['
    for messages in tables:
        for one in messages:
            print(begin + json.dumps(_values(one), allow_nan=False), end="")
            begin = ",\n"
    print(begin if begin.startswith("{") else "", end="")
    counts = conversation.counts
    values = {
        "messages": {kind.value: counts.messages[kind] for kind in Kind},
        "incomplete": {error.name: n for error, n in counts.broken.items()},
        "frames": dict(counts.frames),
        "unanswered": counts.unanswered,
        "unasked": counts.unasked,
        "identifiers": [
            {"channel": channel, "id": identifier.can_id, "extended": identifier.extended, "messages": n}
            for (channel, identifier), n in sorted(counts.identifiers.items())
        ],
        "rejected": sum(part.account.rejected for part in logs.parts),
        "truncated_at": next((p.account.truncated_at for p in logs.parts if p.account.truncated_at is not None), None),
    }
    print("], " + json.dumps(values)[1:])


def _values(one: Spoken) -> dict[str, Any]:
    return {
        "start_ns": one.start_ns,
        "end_ns": one.end_ns,
        "channel": one.channel,
        "id": one.identifier.can_id,
        "extended": one.identifier.extended,
        "kind": one.said.kind.value,
        "service": one.said.service,
        "text": one.said.text,
        "length": one.length,
        "data": one.data.hex(),
        "incomplete": None if one.error is None else one.error.name,
        "after_ns": one.after_ns,
    }
