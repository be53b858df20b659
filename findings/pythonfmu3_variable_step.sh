#!/usr/bin/env bash
# pythonfmu3 0.3.4 states of a slave that it can be given steps of any length (canHandleVariableCommunicationStepSize,
# "true" by default), but Fmi3Slave.to_xml writes another option's value there: its loop over the options of
# co-simulation reuses `value` of the loop over the common ones, so the attribute says what was told of the last of those,
# canSerializeFMUState. (The package's command-line builder writes the attributes again, right.)
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet pythonfmu3==0.3.4
"$folder/venv/bin/python" - <<'PY'
from pythonfmu3 import Fmi3Slave
from pythonfmu3.fmi3slave import FMI3_MODEL_OPTIONS_COMMON, FMI3_MODEL_OPTIONS_COSIM


class Slave(Fmi3Slave):
    def do_step(self, current_time, step_size):
        return True


stated = {option.name: option.value for option in FMI3_MODEL_OPTIONS_COSIM}
last = FMI3_MODEL_OPTIONS_COMMON[-1]
print("stated by the package:", stated)
print("last common option:", last.name, last.value)
for told in (False, True):
    element = Slave(instance_name="one").to_xml({last.name: told}).find("CoSimulation")
    written = element.get("canHandleVariableCommunicationStepSize")
    print(f"{last.name}={told}: canHandleVariableCommunicationStepSize is written as {written!r}")
    if written != str(told).lower():
        raise SystemExit("the option has a value of its own now: the finding no longer holds")
PY
