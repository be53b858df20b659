"""A channel map and a vehicle set drafted from a stranger's log, every guess with what was measured beside it.

`signals` puts all signals of the logs on one grid, `names` reads their names and units, `compare` compares two of them.
`speeds`, `turning` and `forces` choose signals for channels and `unit_choice` their units; `drafting.draft` is the
whole of it, and `files` writes it as TOML.
"""
