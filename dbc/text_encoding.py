"""A DBC's bytes as text: which letters they are meant to be is told by what they look like."""

import re

# What Western European texts have outside ASCII: accented letters and the signs of units.
_WESTERN = re.compile("[°µ²³·±×äöüÄÖÜßéèêëàâáåæãçñíîïìóòôøõúùûýÉÈÀÂÁÅÆÇÑÍÓØÚ€–…‘’“”]")
_HIGH_RUN = re.compile(rb"[\x80-\xff]++")
_GB2312 = re.compile(rb"(?:[\xa1-\xa9\xb0-\xf7][\xa1-\xfe])++")
_JAPANESE = re.compile("[\u3000-\u30ff\u4e00-\u9fff\uff01-\uff5e\u2100-\u25ff]")
_CONTROL = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]")


def decoded(content: bytes, warnings: list[str]) -> str:
    """Return the text: UTF-8 (or UTF-16 with its mark), else Windows-1252.

    Where the bytes above 127 come as pairs of a Chinese or Japanese code page and make little sense as Western
    letters, they are read as that and a warning says so. Control characters are replaced, for names and units reach
    terminals.
    """
    return cleaned(_decoded(content, warnings), warnings)


def cleaned(text: str, warnings: list[str]) -> str:
    """Return the text with control characters other than white space replaced."""
    found = _CONTROL.search(text)
    if found is None:
        return text
    line = text.count("\n", 0, found.start()) + 1
    warnings.append(f"line {line}: control character {found[0]!r}; all are read as '\N{REPLACEMENT CHARACTER}'")
    return _CONTROL.sub("\N{REPLACEMENT CHARACTER}", text)


def _decoded(content: bytes, warnings: list[str]) -> str:
    try:
        if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
            return content.decode("utf-16", errors="replace")
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
    for codec, name in (("gb18030", "Chinese (GB 18030)"), ("cp932", "Japanese (Shift-JIS)")):
        text = _two_byte(content, codec)
        if text is not None:
            warnings.append(f"line {line}: text is not Windows-1252; read as {name}")
            return text
    try:
        return content.decode("cp1252")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        warnings.append(f"line {line}: text is neither UTF-8 nor Windows-1252; odd letters are replaced")
        return content.decode("cp1252", errors="replace")


def _two_byte(content: bytes, codec: str) -> str | None:
    """Decode where the bytes above 127 look like the code page, and not like Western letters."""
    runs = _HIGH_RUN.findall(content)
    high = b"".join(runs).decode("cp1252", errors="replace")
    if 4 * len(_WESTERN.findall(high)) > 3 * len(high):
        return None
    if codec == "gb18030" and not all(_GB2312.fullmatch(run) for run in runs):
        return None
    try:
        text = content.decode(codec)
    except UnicodeDecodeError:
        return None
    foreign = [c for c in text if c > "\x7f"]
    return text if codec == "gb18030" or 10 * len(_JAPANESE.findall(text)) >= 9 * len(foreign) else None
