"""Names of ISO 14229-1:2020, and of the services of ISO 15031-5 (OBD) that share its identifiers on the bus."""

from collections.abc import Mapping

RESPONSE_OFFSET = 0x40
NEGATIVE_RESPONSE = 0x7F
PENDING = 0x78
"""Negative response code: the request is taken, the answer follows within P2*."""
SUPPRESS_BIT = 0x80
"""Bit of a sub-function: no positive answer is wanted."""
READ_DATA, READ_PERIODICALLY = 0x22, 0x2A
STOP_SENDING = 0x04
"""Transmission mode of ReadDataByPeriodicIdentifier that ends it."""

SERVICES: Mapping[int, str] = {
    0x10: "DiagnosticSessionControl",
    0x11: "ECUReset",
    0x14: "ClearDiagnosticInformation",
    0x19: "ReadDTCInformation",
    0x22: "ReadDataByIdentifier",
    0x23: "ReadMemoryByAddress",
    0x24: "ReadScalingDataByIdentifier",
    0x27: "SecurityAccess",
    0x28: "CommunicationControl",
    0x29: "Authentication",
    0x2A: "ReadDataByPeriodicIdentifier",
    0x2C: "DynamicallyDefineDataIdentifier",
    0x2E: "WriteDataByIdentifier",
    0x2F: "InputOutputControlByIdentifier",
    0x31: "RoutineControl",
    0x34: "RequestDownload",
    0x35: "RequestUpload",
    0x36: "TransferData",
    0x37: "RequestTransferExit",
    0x38: "RequestFileTransfer",
    0x3D: "WriteMemoryByAddress",
    0x3E: "TesterPresent",
    0x83: "AccessTimingParameter",
    0x84: "SecuredDataTransmission",
    0x85: "ControlDTCSetting",
    0x86: "ResponseOnEvent",
    0x87: "LinkControl",
}
OBD_SERVICES: Mapping[int, str] = {
    0x01: "OBD current data",
    0x02: "OBD freeze frame data",
    0x03: "OBD stored codes",
    0x04: "OBD clear codes",
    0x05: "OBD oxygen sensor results",
    0x06: "OBD on-board test results",
    0x07: "OBD pending codes",
    0x08: "OBD control of a system",
    0x09: "OBD vehicle information",
    0x0A: "OBD permanent codes",
}
WITH_SUBFUNCTION = frozenset({0x10, 0x11, 0x19, 0x27, 0x28, 0x29, 0x2C, 0x31, 0x3E, 0x83, 0x85, 0x86, 0x87})
"""Services whose second byte is a sub-function, with its bit that asks for no positive answer."""
REPEATED: Mapping[int, int] = {
    0x10: 1,
    0x11: 1,
    0x19: 1,
    0x22: 2,
    0x27: 1,
    0x28: 1,
    0x2E: 2,
    0x2F: 2,
    0x31: 3,
    0x3E: 1,
    0x85: 1,
}
"""Bytes of a request behind its service that a positive answer repeats: sub-function, identifier."""

NEGATIVE_CODES: Mapping[int, str] = {
    0x10: "general reject",
    0x11: "service not supported",
    0x12: "sub-function not supported",
    0x13: "incorrect message length or invalid format",
    0x14: "response too long",
    0x21: "busy, repeat the request",
    0x22: "conditions not correct",
    0x24: "request sequence error",
    0x25: "no response from a subnet component",
    0x26: "a failure prevents the requested action",
    0x31: "request out of range",
    0x33: "security access denied",
    0x34: "authentication required",
    0x35: "invalid key",
    0x36: "exceeded number of attempts",
    0x37: "required time delay not expired",
    0x38: "secure data transmission required",
    0x39: "secure data transmission not allowed",
    0x3A: "secure data verification failed",
    0x50: "certificate verification failed: invalid time period",
    0x51: "certificate verification failed: invalid signature",
    0x52: "certificate verification failed: invalid chain of trust",
    0x53: "certificate verification failed: invalid type",
    0x54: "certificate verification failed: invalid format",
    0x55: "certificate verification failed: invalid content",
    0x56: "certificate verification failed: invalid scope",
    0x57: "certificate verification failed: revoked",
    0x58: "ownership verification failed",
    0x59: "challenge calculation failed",
    0x5A: "setting access rights failed",
    0x5B: "session key creation failed",
    0x5C: "configuration data usage failed",
    0x5D: "de-authentication failed",
    0x70: "upload or download not accepted",
    0x71: "transfer data suspended",
    0x72: "general programming failure",
    0x73: "wrong block sequence counter",
    0x78: "response pending",
    0x7E: "sub-function not supported in the active session",
    0x7F: "service not supported in the active session",
    0x81: "engine speed too high",
    0x82: "engine speed too low",
    0x83: "engine is running",
    0x84: "engine is not running",
    0x85: "engine run time too low",
    0x86: "temperature too high",
    0x87: "temperature too low",
    0x88: "vehicle speed too high",
    0x89: "vehicle speed too low",
    0x8A: "throttle or pedal too high",
    0x8B: "throttle or pedal too low",
    0x8C: "transmission not in neutral",
    0x8D: "transmission not in gear",
    0x8F: "brake switch not closed",
    0x90: "shifter lever not in park",
    0x91: "torque converter clutch locked",
    0x92: "voltage too high",
    0x93: "voltage too low",
    0x94: "resource temporarily not available",
}

SESSIONS: Mapping[int, str] = {1: "default", 2: "programming", 3: "extended", 4: "safety system"}
RESETS: Mapping[int, str] = {
    1: "hard reset",
    2: "key off on",
    3: "soft reset",
    4: "enable rapid power shutdown",
    5: "disable rapid power shutdown",
}
DTC_REPORTS: Mapping[int, str] = {
    0x01: "number of codes by status mask",
    0x02: "codes by status mask",
    0x03: "snapshot identification",
    0x04: "snapshot by code",
    0x05: "stored data by record number",
    0x06: "extended data by code",
    0x07: "number of codes by severity mask",
    0x08: "codes by severity mask",
    0x09: "severity of a code",
    0x0A: "supported codes",
    0x0B: "first failed code",
    0x0C: "first confirmed code",
    0x0D: "most recent failed code",
    0x0E: "most recent confirmed code",
    0x0F: "mirror memory codes by status mask",
    0x10: "mirror memory extended data by code",
    0x11: "number of mirror memory codes by status mask",
    0x12: "number of emissions codes by status mask",
    0x13: "emissions codes by status mask",
    0x14: "fault detection counters",
    0x15: "codes with permanent status",
    0x16: "extended data by record number",
    0x17: "user memory codes by status mask",
    0x18: "user memory snapshot by code",
    0x19: "user memory extended data by code",
    0x1A: "codes that support an extended data record",
    0x42: "WWH-OBD codes by mask",
    0x55: "WWH-OBD codes with permanent status",
    0x56: "codes by readiness group",
}
COMMUNICATION: Mapping[int, str] = {
    0: "enable reception and transmission",
    1: "enable reception, disable transmission",
    2: "disable reception, enable transmission",
    3: "disable reception and transmission",
    4: "enable reception, disable transmission, enhanced address",
    5: "enable reception and transmission, enhanced address",
}
COMMUNICATION_TYPES: Mapping[int, str] = {
    1: "normal messages",
    2: "network management",
    3: "normal messages and network management",
}
ROUTINES: Mapping[int, str] = {1: "start", 2: "stop", 3: "result"}
IO_CONTROLS: Mapping[int, str] = {
    0: "return control to the ECU",
    1: "reset to default",
    2: "freeze current state",
    3: "short-term adjustment",
}
PERIODIC_RATES: Mapping[int, str] = {1: "slow", 2: "medium", 3: "fast", 4: "stop"}
DYNAMIC_DIDS: Mapping[int, str] = {1: "define by identifier", 2: "define by memory address", 3: "clear"}
DTC_SETTINGS: Mapping[int, str] = {1: "on", 2: "off"}
AUTHENTICATION: Mapping[int, str] = {
    0: "de-authenticate",
    1: "verify certificate, unidirectional",
    2: "verify certificate, bidirectional",
    3: "proof of ownership",
    4: "transmit certificate",
    5: "request challenge",
    6: "verify proof of ownership, unidirectional",
    7: "verify proof of ownership, bidirectional",
    8: "authentication configuration",
}
EVENTS: Mapping[int, str] = {
    0: "stop",
    1: "on DTC status change",
    2: "on timer interrupt",
    3: "on change of data identifier",
    4: "report activated events",
    5: "start",
    6: "clear",
    7: "on comparison of values",
}
LINKS: Mapping[int, str] = {1: "verify fixed bit rate", 2: "verify specific bit rate", 3: "transition"}
TIMINGS: Mapping[int, str] = {1: "read extended set", 2: "set to default", 3: "read active set", 4: "set to given"}
FILE_MODES: Mapping[int, str] = {1: "add", 2: "delete", 3: "replace", 4: "read", 5: "read folder", 6: "resume"}

SUBFUNCTIONS: Mapping[int, Mapping[int, str]] = {
    0x10: SESSIONS,
    0x11: RESETS,
    0x19: DTC_REPORTS,
    0x28: COMMUNICATION,
    0x29: AUTHENTICATION,
    0x2C: DYNAMIC_DIDS,
    0x31: ROUTINES,
    0x3E: {0: ""},
    0x83: TIMINGS,
    0x85: DTC_SETTINGS,
    0x86: EVENTS,
    0x87: LINKS,
}

DIDS: Mapping[int, str] = {
    0xF180: "boot software identification",
    0xF181: "application software identification",
    0xF182: "application data identification",
    0xF183: "boot software fingerprint",
    0xF184: "application software fingerprint",
    0xF185: "application data fingerprint",
    0xF186: "active diagnostic session",
    0xF187: "spare part number",
    0xF188: "ECU software number",
    0xF189: "ECU software version",
    0xF18A: "system supplier",
    0xF18B: "ECU manufacturing date",
    0xF18C: "ECU serial number",
    0xF18D: "supported functional units",
    0xF18E: "kit assembly part number",
    0xF190: "VIN",
    0xF191: "ECU hardware number",
    0xF192: "supplier hardware number",
    0xF193: "supplier hardware version",
    0xF194: "supplier software number",
    0xF195: "supplier software version",
    0xF196: "exhaust regulation or type approval number",
    0xF197: "system name or engine type",
    0xF198: "repair shop code or tester serial number",
    0xF199: "programming date",
    0xF19A: "calibration equipment",
    0xF19B: "calibration date",
    0xF19C: "calibration equipment software",
    0xF19D: "ECU installation date",
    0xF19E: "ODX file",
    0xF19F: "entity",
    0xFF00: "UDS version",
}
STATUS_BITS = (
    "failed now",
    "failed this cycle",
    "pending",
    "confirmed",
    "not tested since clear",
    "failed since clear",
    "not tested this cycle",
    "warning lamp",
)
"""Bits 0 to 7 of a DTC's status byte."""
