"""What a process of ours need not load, and that it is there for whoever wants it."""

import subprocess
import sys


def said_by(code: str) -> str:
    return subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout.strip()


def test_neither_controller_nor_plant_nor_recorder_loads_python_can():
    code = (
        "import sys, ecu.node, plant.node, hil.bench.node_process, hil.bench.recorder; "
        "print({'can', 'pandas'} & {*sys.modules})"
    )
    assert said_by(code) == "set()"


def test_the_tester_of_cantools_is_there_when_it_is_wanted():
    assert said_by("import dbc.contract, cantools; print(cantools.tester.Tester)") == "<class 'cantools.tester.Tester'>"
    assert said_by("import dbc.contract, cantools.tester as t; print(t.Tester)") == "<class 'cantools.tester.Tester'>"
    assert said_by("import cantools, dbc.contract; print(cantools.tester.Tester)") == "<class 'cantools.tester.Tester'>"
