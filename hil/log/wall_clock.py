"""Start times in the headers of logs: wall clocks without a zone, to nanoseconds since 1970 and back.

CANoe, PCAN-View and Wireshark write the recording computer's local time and no zone; so the zone is chosen by whoever
reads (UTC when nobody chose), and never taken from the computer that reads.
"""

from datetime import UTC, datetime, timedelta, tzinfo

EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
MAX_START_NS = 2**62  # of a start time, years 1824 to 2116: stamps that count from it fit into 64 bits


def wall_clock_ns(wall_clock: datetime, zone: tzinfo, below_us_ns: int = 0) -> int:
    """Nanoseconds since 1970 of a wall clock (naive) in a zone, plus what is finer than its microseconds."""
    since = wall_clock.replace(tzinfo=zone).astimezone(UTC) - EPOCH
    return (since // timedelta(microseconds=1)) * 1000 + below_us_ns


def wall_clock_of(time_ns: int, zone: tzinfo) -> datetime:
    """Wall clock (naive) in a zone of a time in nanoseconds since 1970, cut to the microsecond."""
    return (EPOCH + timedelta(microseconds=time_ns // 1000)).astimezone(zone).replace(tzinfo=None)
