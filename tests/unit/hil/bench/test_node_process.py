"""What a node's process says of itself."""

from hil.bench.node_process import grants_in

PLANT = """plant: on loopback:demo, every 10 ms
plant: timer slack: granted, 1 ns
plant: SCHED_FIFO: NOT granted, Operation not permitted; allow it: `ulimit -r 50` (limits.conf: rtprio)
plant: no garbage collection: granted, 81234 objects frozen
"""


def test_grants_of_all_nodes_in_one_line():
    ecu = PLANT.replace("plant", "ecu").replace("81234", "5")
    assert grants_in([PLANT, ecu]) == (
        "timer slack, no garbage collection: granted; "
        "SCHED_FIFO: NOT granted, Operation not permitted; allow it: `ulimit -r 50` (limits.conf: rtprio)"
    )
    assert grants_in([ecu, PLANT.replace("timer slack: granted", "timer slack: NOT granted")]).startswith(
        "no garbage collection: granted; "
    )
    assert grants_in([]) == ""
