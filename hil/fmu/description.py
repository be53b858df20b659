"""The XML files of an FMU: model description, terminal, manifest of FMI-LS-BUS, build description."""

from collections.abc import Iterable
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from hil.fmu.can_node import MOST_BYTES
from hil.fmu.ecu_unit import BUS_NOTIFICATIONS
from hil.fmu.ls_bus import MIME_TYPE
from hil.fmu.model import Kind
from hil.fmu.units import exponents
from hil.fmu.variables import RX_CLOCK, RX_DATA, TIME, TX_CLOCK, TX_DATA, Table, Variable

CHANNEL = "CanChannel"
STEP_S = {"plant": 0.001, "ecu": 0.01}
"""Step inside, s: what the results depend on, whatever the importer's step."""
NEEDS = (
    "Needs, where it runs, Linux and Python 3.11 or later with brakebench {version} installed: the python3 on the "
    "PATH, or the one that the environment variable BRAKEBENCH_PYTHON names."
)
_ABOUT = {
    "plant": "The car of brakebench: demands of pressures and motor torques in, motion and sensors out.",
    "ecu": "The brake controller of brakebench: on a CAN bus (FMI-LS-BUS, event mode), or with signals in and out.",
}


def identifier(kind: Kind) -> str:
    """Name of the model and its binary."""
    return f"brakebench_{kind}"


def _text(root: Element) -> bytes:
    indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{tostring(root, "unicode")}\n'.encode()


def _number(value: float, kind: str) -> str:
    if kind == "Boolean":
        return "true" if value else "false"
    return str(int(value)) if kind == "Int32" else repr(float(value))


def model_description(kind: Kind, table: Table, token: str, version: str) -> bytes:
    """modelDescription.xml."""
    on_bus = kind == "ecu"
    root = Element(
        "fmiModelDescription",
        fmiVersion="3.0",
        modelName=identifier(kind),
        instantiationToken=token,
        description=f"{_ABOUT[kind]} {NEEDS.format(version=version)}",
        version=version,
        license="MIT",
        generationTool=f"brakebench {version}",
        variableNamingConvention="structured",
    )
    interface = SubElement(
        root,
        "CoSimulation",
        modelIdentifier=identifier(kind),
        needsExecutionTool="true",
        canGetAndSetFMUState="true",
        canSerializeFMUState="true",
        canHandleVariableCommunicationStepSize="true",
        fixedInternalStepSize=repr(STEP_S[kind]),
    )
    if on_bus:
        interface.set("hasEventMode", "true")
    _units(root, table.variables)
    categories = SubElement(root, "LogCategories")
    for name in ("logStatusError", "logStatusFatal"):
        SubElement(categories, "Category", name=name)
    SubElement(root, "DefaultExperiment", startTime="0.0", stopTime="10.0", stepSize=repr(STEP_S[kind]))
    variables = SubElement(root, "ModelVariables")
    SubElement(
        variables, "Float64", name="time", valueReference=str(TIME), causality="independent", variability="continuous"
    )
    for variable in table.variables:
        _variable(variables, variable, table.references[variable.name])
    if on_bus:
        _channel(variables)
    structure = SubElement(root, "ModelStructure")
    outputs = [str(table.references[v.name]) for v in table.variables if v.causality == "output"]
    for reference in outputs:
        SubElement(structure, "Output", valueReference=reference, dependencies="")
    if on_bus:
        for known in (TX_DATA, TX_CLOCK):
            SubElement(structure, "Output", valueReference=str(known), dependencies="")
    unknown = [*outputs, str(TX_CLOCK)] if on_bus else outputs
    for reference in unknown:  # without dependencies: they may follow from all parameters
        SubElement(structure, "InitialUnknown", valueReference=reference)
    return _text(root)


def _units(root: Element, variables: Iterable[Variable]) -> None:
    of = SubElement(root, "UnitDefinitions")
    for name in sorted({v.unit for v in variables if v.unit}):
        unit = SubElement(of, "Unit", name=name)
        SubElement(unit, "BaseUnit", {base: str(exponent) for base, exponent in exponents(name).items()})


def _variable(parent: Element, v: Variable, reference: int) -> None:
    discrete = v.kind != "Float64"
    one = SubElement(parent, v.kind, name=v.name, valueReference=str(reference), causality=v.causality)
    if v.description:
        one.set("description", v.description)
    if v.causality in ("parameter", "structuralParameter"):
        one.set("variability", "fixed")
    else:
        one.set("variability", "discrete" if discrete else "continuous")
    if v.causality == "output":
        one.set("initial", "calculated")
    else:
        one.set("start", _number(v.start, v.kind))
    if v.unit:
        one.set("unit", v.unit)
    for name, bound in (("min", v.low), ("max", v.high)):
        if bound is not None:
            one.set(name, _number(bound, v.kind))


def _channel(variables: Element) -> None:
    """The four variables of a bus terminal: data and clock, each way."""
    for name, data, clock, causality in (("Rx", RX_DATA, RX_CLOCK, "input"), ("Tx", TX_DATA, TX_CLOCK, "output")):
        SubElement(
            variables,
            "Clock",
            name=f"{CHANNEL}.{name}_Clock",
            valueReference=str(clock),
            causality=causality,
            variability="discrete",
            intervalVariability="triggered",
        )
        binary = SubElement(
            variables,
            "Binary",
            name=f"{CHANNEL}.{name}_Data",
            valueReference=str(data),
            causality=causality,
            variability="discrete",
            initial="exact" if causality == "input" else "calculated",
            clocks=str(clock),
            mimeType=MIME_TYPE,
            maxSize=str(MOST_BYTES),
        )
        if causality == "input":
            SubElement(binary, "Start", value="")


def terminals() -> bytes:
    """terminalsAndIcons/terminalsAndIcons.xml of a node on a CAN bus."""
    root = Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    terminal = SubElement(
        SubElement(root, "Terminals"),
        "Terminal",
        name=CHANNEL,
        terminalKind="org.fmi-ls-bus.network-terminal",
        matchingRule="org.fmi-ls-bus.transceiver",
    )
    for member in ("Tx_Data", "Rx_Data", "Tx_Clock", "Rx_Clock"):
        name = f"{CHANNEL}.{member}"
        SubElement(terminal, "TerminalMemberVariable", variableKind="signal", variableName=name, memberName=member)
    inner = SubElement(
        terminal,
        "Terminal",
        name="Configuration",
        terminalKind="org.fmi-ls-bus.network-terminal.configuration",
        matchingRule="bus",
    )
    SubElement(
        inner, "TerminalMemberVariable", variableKind="signal", variableName=BUS_NOTIFICATIONS,
        memberName=BUS_NOTIFICATIONS,
    )  # fmt: skip
    return _text(root)


def manifest() -> bytes:
    """extra/org.fmi-standard.fmi-ls-bus/fmi-ls-manifest.xml."""
    space = "{http://fmi-standard.org/fmi-ls-manifest}"
    root = Element("fmiLayeredStandardManifest", isBusSimulationFMU="false")
    root.set(f"{space}fmi-ls-name", "org.fmi-standard.fmi-ls-bus")
    root.set(f"{space}fmi-ls-version", "1.0.0")
    root.set(f"{space}fmi-ls-description", "Layered Standard for the simulation of bus communication.")
    return _text(root)


def build_description(kind: Kind, source: str) -> bytes:
    """sources/buildDescription.xml: how the binary is made of its one file."""
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = SubElement(root, "BuildConfiguration", modelIdentifier=identifier(kind))
    files = SubElement(configuration, "SourceFileSet", language="C11")
    SubElement(files, "SourceFile", name=source)
    return _text(root)
