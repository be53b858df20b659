"""Writes an FMU: descriptions, numbers, the wrapper compiled for this machine, and its source."""

import json
import platform
import shutil
import sys
import tempfile
import zipfile
from importlib import resources
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from hil.fmu import description
from hil.fmu.model import MODEL_FILE, FmuError, Kind, numbers_of, token_of, variables_of
from hil.fmu.variables import Table
from hil.log.atomic_write import atomic_write
from hil.rt.process import output_of
from hil.scenario.scenario import Scenario

SOURCE = "wrapper.c"
_COMPILERS = ("cc", "gcc", "clang")
_OPTIONS = ("-std=c11", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-s")
_COMPILE_TIMEOUT_S = 120.0
_EPOCH = (1980, 1, 1, 0, 0, 0)  # of all entries, so that the same export gives the same bytes


def compiler() -> list[str]:
    """Command of a C compiler: that of the system, or the one in the package ziglang.

    Raises
    ------
    FmuError : there is none.
    """
    found = next((path for name in _COMPILERS if (path := shutil.which(name))), None)
    if found:
        return [found]
    if find_spec("ziglang") is not None:
        return [sys.executable, "-m", "ziglang", "cc"]
    raise FmuError(
        f"no C compiler: expected one of {', '.join(_COMPILERS)} on the PATH, or the package ziglang; "
        "install gcc, or run pip install ziglang"
    )


def compiled() -> bytes:
    """The wrapper as a shared library of this machine."""
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / SOURCE, Path(folder) / "wrapper.so"
        source.write_bytes(_source())
        command = [*compiler(), *_OPTIONS, str(source), "-o", str(target)]
        if output_of(command, _COMPILE_TIMEOUT_S) is None:
            raise FmuError(f"the wrapper did not compile: try {' '.join(command[:-4])} on hil/fmu/{SOURCE}")
        return target.read_bytes()


def _source() -> bytes:
    return (resources.files("hil.fmu") / SOURCE).read_bytes()


def export(kind: Kind, scenario: Scenario, out: Path, overwrite: bool = False) -> None:
    """Write an FMU with a scenario's numbers.

    Raises
    ------
    FmuError : no compiler, or not Linux.
    hil.log.frames.LogError : the file exists, or cannot be written.
    """
    if sys.platform != "linux":
        raise FmuError(f"an FMU for {sys.platform}: expected Linux, whose calls the wrapper uses")
    numbers, ours = numbers_of(kind, scenario), version("brakebench")
    table = Table(variables_of(kind, numbers))
    token, name = token_of(kind, numbers), description.identifier(kind)
    model = {"kind": kind, "brakebench": ours, "scenario": scenario.name, "numbers": numbers}
    files = {
        "modelDescription.xml": description.model_description(kind, table, token, ours),
        f"binaries/{platform.machine()}-linux/{name}.so": compiled(),
        f"resources/{MODEL_FILE}": json.dumps(model, indent=1).encode(),
        f"sources/{SOURCE}": _source(),
        "sources/buildDescription.xml": description.build_description(kind, SOURCE),
        "documentation/index.html": _page(name, ours),
    }
    if kind == "ecu":
        files["terminalsAndIcons/terminalsAndIcons.xml"] = description.terminals()
        files["extra/org.fmi-standard.fmi-ls-bus/fmi-ls-manifest.xml"] = description.manifest()
    with atomic_write(out, overwrite) as part, zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as archive:
        for path, content in files.items():
            entry = zipfile.ZipInfo(path, _EPOCH)
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, content, zipfile.ZIP_DEFLATED)


def _page(name: str, ours: str) -> bytes:
    needs = description.NEEDS.format(version=ours)
    return f'<!DOCTYPE html>\n<meta charset="utf-8">\n<title>{name}</title>\n<p>{needs}</p>\n'.encode()
