"""The fault campaign: every fault of the library at many instants of a stop, beside the same stop without it."""
