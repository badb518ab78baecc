"""Traces of CODESYS: known by their first line however it is spaced, and only as a file."""

from pathlib import Path

import numpy as np
import pytest

from dsd_cli.files.formats.codesys import CodesysTrace
from dsd_cli.files.formats.known import CODESYS, HEAD_BYTES, format_of
from tests.cli.rig import dsd, refused

BODY = "0.Variable; PLC.u\n;;\n; 0; 1\n; 1; 2\n1.Variable; PLC.q\n;;\n; 0; 3\n; 1; 4\n"


@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
@pytest.mark.parametrize("first", ["[key]; [value]", "[key];[value]", "[key] ; [value] \r"])
def test_its_first_line_is_known(mark: bytes, first: str, tmp_path: Path) -> None:
    path = tmp_path / "a.trace.csv"
    path.write_bytes(mark + f"{first}\n{BODY}".encode())
    assert format_of(path, path.read_bytes()[:HEAD_BYTES]) is CODESYS
    assert list(CodesysTrace(str(path)).groups[0].units) == ["time", "PLC.u", "PLC.q"]


def test_a_variable_that_stands_there_twice_is_two(tmp_path: Path) -> None:
    path = tmp_path / "a.trace.csv"
    path.write_text("[key]; [value]\n" + BODY.replace("PLC.q", "PLC.u"))
    trace = CodesysTrace(str(path))
    (group,) = trace.groups
    found = trace.read(group, ["PLC.u", "PLC.u 2"], 0, 9)
    np.testing.assert_array_equal(found["PLC.u"], [1.0, 2.0])
    np.testing.assert_array_equal(found["PLC.u 2"], [3.0, 4.0])


def test_in_a_pipe_it_says_that_it_has_to_be_a_file(tmp_path: Path) -> None:
    (tmp_path / "dsd.toml").write_text('[signals]\nu = "PLC.u"\nposition = "PLC.q"\n')
    content = f"[key];[value]\n{BODY}"
    refused(dsd("detect", "-", stdin=content, cwd=tmp_path), 1, "<stdin>: is a trace of CODESYS", "write it to a file")
    content = '{"u": 1, "q": 2}\n'
    refused(dsd("detect", "-", stdin=content, cwd=tmp_path), 1, "<stdin>: is JSON", "write it to a file")
