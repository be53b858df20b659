"""Takes out of a DBC's text what cannot be used, or would make a parser hang, and says so."""

import re
from bisect import bisect_right
from dataclasses import dataclass, field

MAX_MESSAGE_BYTES = 64  # CAN FD
MAX_SIGNAL_BITS = 64
MAX_MUX_IDS = 4096  # of one SG_MUL_VAL_ statement

_STRING = re.compile(r'"(?:\\"|[^"])*"')
_MESSAGE = re.compile(r"^[ \t]*BO_\s+(\d+)\s+(\w+)\s*:\s*(\d+)[^\n]*", re.MULTILINE)
_SIGNAL = re.compile(
    r"\bSG_\s+(?P<name>\w+)(?:\s+\w+)?\s*:\s*(?P<start>\d+)\s*\|\s*(?P<length>\d+)\s*@\s*(?P<order>\d)[^\n]*"
)
_DETAIL = re.compile(r"\b(VAL_|SIG_VALTYPE_|SG_MUL_VAL_)\s+(\d+)\s+(\w+)\b([^;]*);")
_RANGE = re.compile(r"(\d+)\s*-\s*(\d+)")


@dataclass(slots=True)
class Block:
    """One message of the text with what belongs to it, for loading it alone."""

    name: str
    key: str
    length: int
    spans: list[tuple[int, int]]
    signals: dict[str, int] = field(default_factory=dict)  # name -> length in bits


@dataclass(slots=True)
class SupportedText:
    """Text whose unsound statements are blanked out, its messages, and what was wrong."""

    text: str
    blocks: list[Block]
    warnings: list[str]

    def alone(self, block: Block) -> str:
        """Text of a database that holds nothing but one message."""
        return "\n".join(self.text[a:b] for a, b in block.spans) + "\n"


def supported_subset(text: str) -> SupportedText:
    """Find the messages of a DBC and blank out what no CAN frame can carry.

    Taken out: identifiers beyond 11 or 29 bits, messages longer than a CAN FD frame, signals of no bit, of more
    than 64 bits or outside their message, floating-point signals of an impossible length, absurd multiplexer
    ranges, and value tables and types of signals that do not exist. Every warning names the line.
    """
    warnings: list[str] = []
    line_starts = [0, *(m.end() for m in re.finditer("\n", text))]

    def line(position: int) -> str:
        return f"line {bisect_right(line_starts, position)}"

    # Structure is looked for with the strings blanked: a comment may quote a whole message.
    masked = _STRING.sub(lambda m: '"' + "_" * (len(m[0]) - 2) + '"', text)
    letters = list(text)
    foreign = [i for i, c in enumerate(masked) if ord(c) > 127]
    if foreign:
        warnings.append(f"{line(foreign[0])}: letters outside ASCII in names are read as '_'")
        for i in foreign:
            letters[i] = "_"
        masked = re.sub(r"[^\x00-\x7f]", "_", masked)
    float_types = {(m[2], m[3]) for m in _DETAIL.finditer(masked) if m[1] == "SIG_VALTYPE_" and "0" not in m[4]}

    blocks: list[Block] = []
    dropped: set[str] = set()
    found = sorted([*_MESSAGE.finditer(masked), *_SIGNAL.finditer(masked)], key=lambda m: m.start())
    block: Block | None = None
    for match in found:
        where = line(match.start())
        if match.re is _MESSAGE:
            block = Block(match[2], match[1], int(match[3]), [match.span()])
            problem = _message_problem(block)
            if problem is None:
                blocks.append(block)
                continue
            if block.name != "VECTOR__INDEPENDENT_SIG_MSG":
                warnings.append(f"{where}: message {block.name}: {problem}; left out")
            dropped.add(block.key)
            block = None
        elif block is not None:
            problem = _signal_problem(match, block, (block.key, match["name"]) in float_types)
            if problem is None:
                block.signals[match["name"]] = int(match["length"])
                block.spans.append(match.span())
                continue
            warnings.append(f"{where}: signal {block.name}.{match['name']}: {problem}; left out")
        _blank(letters, match)

    by_key = {block.key: block for block in blocks}
    for match in _DETAIL.finditer(masked):
        kind, key, name, rest = match.groups()
        owner = by_key.get(key)
        if owner is None or name not in owner.signals:
            if key not in dropped:
                warnings.append(f"{line(match.start())}: {kind} of {key} {name}: no such signal; left out")
        elif kind == "SG_MUL_VAL_" and sum(int(b) - int(a) + 1 for a, b in _RANGE.findall(rest)) > MAX_MUX_IDS:
            warnings.append(
                f"{line(match.start())}: {owner.name}.{name}: more than {MAX_MUX_IDS} multiplexer "
                "values; statement left out"
            )
        else:
            owner.spans.append(match.span())
            continue
        _blank(letters, match)
    return SupportedText("".join(letters), blocks, warnings)


def _message_problem(block: Block) -> str | None:
    raw = int(block.key)
    extended = bool(raw & 0x8000_0000)
    limit = 0x1FFF_FFFF if extended else 0x7FF
    if raw > 0xFFFF_FFFF or raw & 0x7FFF_FFFF > limit:
        return f"identifier {raw:#x} is not an 11-bit one nor (with bit 31 set) a 29-bit one"
    if block.length > MAX_MESSAGE_BYTES:
        return f"{block.length} bytes, a CAN FD frame has at most {MAX_MESSAGE_BYTES}"
    return None


def _signal_problem(match: re.Match[str], block: Block, is_float: bool) -> str | None:
    start, length = int(match["start"]), int(match["length"])
    if not 1 <= length <= MAX_SIGNAL_BITS:
        return f"length {length} bits, expected 1 to {MAX_SIGNAL_BITS}"
    first = 8 * (start // 8) + 7 - start % 8 if match["order"] == "0" else start
    if first + length > 8 * block.length:
        return f"bits {start}|{length} do not fit into {block.length} bytes"
    if is_float and length not in (16, 32, 64):
        return f"floating point of {length} bits, expected 32 or 64"
    return None


def _blank(letters: list[str], match: re.Match[str]) -> None:
    for i in range(match.start(), match.end()):
        if letters[i] != "\n":
            letters[i] = " "
