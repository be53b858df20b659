"""One instance of an FMI 3 FMU through FMPy's plain calls."""

import shutil
from contextlib import contextmanager

from fmpy import extract, read_model_description
from fmpy.fmi3 import FMU3Slave


class FmuInstance:
    """An instance of an unpacked FMU."""

    def __init__(self, path, event_mode=False):
        self.description = read_model_description(str(path))
        self.folder = extract(str(path))
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        self.said = []
        self.fmu = FMU3Slave(
            guid=self.description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName="one",
        )
        self.fmu.instantiate(eventModeUsed=event_mode, logMessage=self._log)

    def _log(self, _environment, _status, _category, message):
        self.said.append(message.decode() if isinstance(message, bytes) else message)

    def names(self, causality, kind="Float64"):
        return [v.name for v in self.description.modelVariables if v.causality == causality and v.type == kind]

    def set(self, values):
        self.fmu.setFloat64([self.references[name] for name in values], list(values.values()))

    def get(self, names):
        return self.fmu.getFloat64([self.references[name] for name in names])

    def start(self, values=None):
        if values:
            self.set(values)
        self.fmu.enterInitializationMode(startTime=0.0)
        self.fmu.exitInitializationMode()

    def step(self, time_s, step_s):
        return self.fmu.doStep(currentCommunicationPoint=time_s, communicationStepSize=step_s)

    def close(self):
        self.fmu.freeInstance()
        shutil.rmtree(self.folder, ignore_errors=True)


@contextmanager
def instance(path, event_mode=False):
    one = FmuInstance(path, event_mode)
    try:
        yield one
    finally:
        one.close()
