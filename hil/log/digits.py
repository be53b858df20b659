"""Lines of text from columns, without a Python object per row: matrices of letters and which of them are kept."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

Letters = tuple[npt.NDArray[np.uint8], npt.NDArray[np.bool_]]
"""Letters of one field, uint8 (rows, width), and which of them stand in the line, bool of the same shape."""
_HEX = np.frombuffer(b"0123456789ABCDEF", np.uint8)


def decimal(values: npt.NDArray[np.uint64], width: int, padded: bool = False) -> Letters:
    """Decimal digits of non-negative numbers (n,), at most ``width`` of them; ``padded`` with zeros to that width."""
    letters = np.empty((len(values), width), np.uint8)
    rest = values
    for column in range(width - 1, -1, -1):
        rest, digit = np.divmod(rest, np.uint64(10))
        letters[:, column] = digit
    kept = np.ones(letters.shape, np.bool_)
    if not padded:
        kept[:, :-1] = np.logical_or.accumulate(letters[:, :-1] != 0, axis=1)
    return letters + np.uint8(48), kept


def hexadecimal(data: npt.NDArray[np.uint8], count: npt.NDArray[np.int64]) -> Letters:
    """Hex digits of the first ``count`` (n,) bytes of each row of ``data`` (n, width)."""
    n, width = data.shape
    letters = np.empty((n, width, 2), np.uint8)
    letters[..., 0], letters[..., 1] = _HEX[data >> 4], _HEX[data & 15]
    return letters.reshape(n, 2 * width), np.arange(2 * width) < 2 * count[:, None]


def chosen(texts: Sequence[bytes], index: npt.NDArray[np.integer]) -> Letters:
    """One of some texts for each row."""
    width = max(map(len, texts), default=0)
    letters = np.frombuffer(b"".join(text.ljust(width) for text in texts), np.uint8).reshape(len(texts), width)
    kept = np.arange(width) < np.array([len(text) for text in texts], np.int64)[:, None]
    return letters[index], kept[index]


def lines(n: int, pieces: Sequence[bytes | Letters]) -> bytes:
    """Return ``n`` rows, each made of the pieces; bytes stand in every row."""
    fields = [piece if isinstance(piece, tuple) else chosen([piece], np.zeros(n, np.int64)) for piece in pieces]
    letters = np.concatenate([field[0] for field in fields], axis=1)
    kept = np.concatenate([field[1] for field in fields], axis=1)
    return bytes(letters[kept].tobytes())
