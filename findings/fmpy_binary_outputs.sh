#!/usr/bin/env bash
# FMPy 0.3.32 simulates a valid FMI 3.0 FMU that has a binary output and a string output beside a number, but the result
# of simulate_fmu has the number alone: Recorder collects a getter for every output that is wanted and then makes columns
# for a list of types in which Binary, String and Clock are missing. Asking for the binary output by name changes nothing,
# and nothing is said. Read by hand (getBinary) the value is there. The FMU is built here, in C, with the system's
# compiler.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet fmpy==0.3.32
mkdir -p "$folder/fmu/binaries/x86_64-linux"
cat > "$folder/fmu/modelDescription.xml" <<'XML'
<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="bytes" instantiationToken="{1}">
  <CoSimulation modelIdentifier="bytes"/>
  <ModelVariables>
    <Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
    <Float64 name="number" valueReference="1" causality="output" variability="discrete" initial="calculated"/>
    <Binary name="frame" valueReference="2" causality="output" variability="discrete" initial="calculated"/>
    <String name="text" valueReference="3" causality="output" variability="discrete" initial="calculated"/>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="1"/><Output valueReference="2"/><Output valueReference="3"/>
    <InitialUnknown valueReference="1"/><InitialUnknown valueReference="2"/><InitialUnknown valueReference="3"/>
  </ModelStructure>
</fmiModelDescription>
XML
cat > "$folder/bytes.c" <<'C'
#include <fmi3Functions.h>
static double now;
static const unsigned char frame[] = {0xCA, 0xFE, 0x00, 0x01};
const char* fmi3GetVersion(void) { return fmi3Version; }
fmi3Status fmi3SetDebugLogging(fmi3Instance i, fmi3Boolean on, size_t n, const fmi3String c[]) { return fmi3OK; }
fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String path, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early, const fmi3ValueReference r[], size_t n,
    fmi3InstanceEnvironment e, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) { return &now; }
void fmi3FreeInstance(fmi3Instance i) {}
fmi3Status fmi3EnterInitializationMode(fmi3Instance i, fmi3Boolean given, fmi3Float64 tolerance, fmi3Float64 start,
    fmi3Boolean stops, fmi3Float64 stop) { now = start; return fmi3OK; }
fmi3Status fmi3ExitInitializationMode(fmi3Instance i) { return fmi3OK; }
fmi3Status fmi3Terminate(fmi3Instance i) { return fmi3OK; }
fmi3Status fmi3DoStep(fmi3Instance i, fmi3Float64 t, fmi3Float64 h, fmi3Boolean keep, fmi3Boolean* event,
    fmi3Boolean* ends, fmi3Boolean* early, fmi3Float64* last) {
  now = t + h; *event = *ends = *early = fmi3False; *last = now; return fmi3OK;
}
fmi3Status fmi3GetFloat64(fmi3Instance i, const fmi3ValueReference r[], size_t n, fmi3Float64 v[], size_t k) {
  for (size_t j = 0; j < n; j++) v[j] = now;
  return fmi3OK;
}
fmi3Status fmi3GetBinary(fmi3Instance i, const fmi3ValueReference r[], size_t n, size_t size[], fmi3Binary v[],
    size_t k) { for (size_t j = 0; j < n; j++) { size[j] = sizeof frame; v[j] = frame; } return fmi3OK; }
fmi3Status fmi3GetString(fmi3Instance i, const fmi3ValueReference r[], size_t n, fmi3String v[], size_t k) {
  for (size_t j = 0; j < n; j++) v[j] = "hello";
  return fmi3OK;
}
C
headers=$("$folder/venv/bin/python" -c "import fmpy, pathlib; print(pathlib.Path(fmpy.__file__).parent / 'c-code')")
# every other function of the standard is there and answers "error" (3), as one does that is not of use here
for name in $(grep -oE '\bfmi3[A-Z][A-Za-z0-9]+TYPE' "$headers/fmi3Functions.h" | sed 's/TYPE$//' | sort -u); do
  grep -q "$name(" "$folder/bytes.c" || echo "int $name(void) { return 3; }"
done > "$folder/others.c"
cc -shared -fPIC -w -I "$headers" "$folder/bytes.c" "$folder/others.c" -o "$folder/fmu/binaries/x86_64-linux/bytes.so"
(cd "$folder/fmu" && "$folder/venv/bin/python" -m zipfile -c ../bytes.fmu modelDescription.xml binaries)
"$folder/venv/bin/python" - "$folder/bytes.fmu" <<'PY'
import sys
import warnings

import fmpy
from fmpy.fmi3 import FMU3Slave
from fmpy.simulation import simulate_fmu

warnings.simplefilter("error")
path, said = sys.argv[1], []
description = fmpy.read_model_description(path)  # validates
print("fmpy", fmpy.__version__, "validates it; outputs:", [v.name for v in description.modelVariables][1:])
fmu = FMU3Slave(
    unzipDirectory=fmpy.extract(path), guid=description.guid, instanceName="one",
    modelIdentifier=description.coSimulation.modelIdentifier,
)
fmu.instantiate()
fmu.enterInitializationMode()
fmu.exitInitializationMode()
print("getBinary gives", fmu.getBinary([2]), "and getString", fmu.getString([3]))
assert list(fmu.getBinary([2])) == [b"\xca\xfe\x00\x01"]
for wanted in (None, ["frame", "text", "number"]):
    result = simulate_fmu(path, stop_time=1.0, output_interval=0.5, output=wanted, logger=lambda *w: said.append(w))
    print(f"simulate_fmu(output={wanted}) has the columns {result.dtype.names}; it says {said}")
    if "frame" in result.dtype.names or said:
        raise SystemExit("binary outputs are recorded, or it is said that they are not: the finding no longer holds")
    assert result.dtype.names == ("time", "number")
PY
