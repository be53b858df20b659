"""Commands on the bench bus, which are sent on change: each stands for itself.

A command counts by its check value alone, not by its place in a sequence: several may come in one tick, and from two
senders.
"""

from collections.abc import Iterable, Iterator, Sequence

from dbc.contract import Message, spec_of
from dbc.e2e import check_value
from dbc.frame import BusName, LinkEvent, Received


class CommandReader:
    """Picks commands out of an inbox.

    Parameters
    ----------
    types : protected messages of the bench bus without a cycle.
    """

    def __init__(self, types: Iterable[type[Message]]) -> None:
        self._specs = {spec.can_id: spec for spec in map(spec_of, types)}

    def read(self, inbox: Sequence[Received]) -> Iterator[Message]:
        """Commands that came, in order; frames with a wrong check value or length are passed over."""
        known = self._specs
        for item in inbox:
            if item[1] not in known:  # nearly all
                continue
            if isinstance(item, LinkEvent) or item.bus is not BusName.BENCH or item.extended:
                continue
            spec, data = known[item.can_id], item.data
            if len(data) == spec.length and spec.data_id is not None and data[0] == check_value(spec.data_id, data):
                yield spec.decode(data)
