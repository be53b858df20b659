"""Detection limit of each effect: down to which signal-to-noise ratio it is found by its name."""

from collections import defaultdict
from collections.abc import Sequence

from hil.validation.blind_trials.metrics import Record
from hil.validation.blind_trials.reading import is_found

_MOST = 0.5


def detection_limits(records: Sequence[Record]) -> dict[str, float | None]:
    """Smallest ratio at which at least half of an effect's cases name it, and at every larger one too.

    Ratios that a physical bound keeps an effect from are left out; None where it is not found at the largest one left.
    """
    found: dict[str, dict[float, list[bool]]] = defaultdict(lambda: defaultdict(list))
    for record in records:
        sizes = found[record["hidden"][0]["effect"]]
        if record["reached"]:
            sizes[record["size"]].append(is_found(record))
    return {effect: _limit(sizes) for effect, sizes in sorted(found.items())}


def _limit(sizes: dict[float, list[bool]]) -> float | None:
    limit = None
    for size in sorted(sizes, reverse=True):
        if sum(sizes[size]) < _MOST * len(sizes[size]):
            break
        limit = size
    return limit
