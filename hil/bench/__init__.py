"""Takes a scenario and gives a measured run: a recording of both buses, its numbers and its verdict.

`bench_run` is one run, carried by `real` (processes on buses) or `virtual` (one process, virtual time). `session` and
`controls` steer it by hand or from a test; `monitor` holds the latest frames and numbers while it goes on, for any live
view; `run` measures and judges it. `playback` sends a recording to a bus again, `compare` holds two runs side by side.
"""
