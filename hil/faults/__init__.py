"""Takes what is to break and when, and gives values and nodes that do so, deterministic by seed: one family a file.

`physical` breaks parts of the car, `frames` what is on its way to the bus. A bus-off and other states of the link are
no faults from here: the bus reports them (`hil.bus.error_frame`, `dbc.frame.LinkEvent`) and each node handles them.
"""
