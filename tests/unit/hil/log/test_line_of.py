import pytest

from hil.log import builder, open_log, read
from hil.log.source import ReadOptions

ROWS = 50


@pytest.mark.parametrize("fast", [False, True])
@pytest.mark.parametrize("frame", [0, 1, 6, 7, ROWS - 1, ROWS, ROWS + 1, 2 * ROWS - 1, 2 * ROWS, 2 * ROWS + 9])
def test_the_line_of_a_frame(tmp_path, monkeypatch, frame, fast):
    monkeypatch.setattr(builder.FrameBuilder.__init__, "__defaults__", (None, ROWS))
    monkeypatch.setattr(read, "ROWS", ROWS)
    lines = ["no frame"]
    for i in range(2 * ROWS + 10):
        lines.append(f"(1.{i:06d}) can0 {i % 2048:03X}#11")
        if i % 7 == 0:
            lines.append("junk" if i % 2 else "x" * 5000)
    (tmp_path / "a.log").write_text("\n".join(lines))
    with open_log(tmp_path / "a.log", options=ReadOptions(fast=fast)) as log:
        line = log.line_of(frame)
        assert lines[line - 1].startswith(f"(1.{frame:06d})")
        assert log.line_of(10**7) is None
        assert len(log.frames()) == 2 * ROWS + 10
