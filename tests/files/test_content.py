"""Packed files and texts of other encodings: the same table as the plain file, or one line with its name."""

import bz2
import gzip
import io
import lzma
import subprocess
import sys
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.errors import DataError
from dsd_cli.files.content import content_of
from dsd_cli.files.formats.base import understanding
from dsd_cli.files.tables_in import open_table

COLUMNS = {"t": "t", "u": "u"}
PLAIN = "t,u\n" + "".join(f"{k / 1000},{k % 7 - 3}\n" for k in range(5000))


def zipped(content: bytes, *names: str) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in names or ("log.csv",):
            archive.writestr(name, content)
    return packed.getvalue()


PACKERS = {"gz": gzip.compress, "bz2": bz2.compress, "xz": lzma.compress, "zip": zipped}


def numbers(path: Path) -> np.ndarray:
    batches = list(open_table(path, COLUMNS).batches())
    return np.array([np.concatenate([batch.columns[name] for batch in batches]) for name in COLUMNS])


def written(folder: Path, content: bytes) -> Path:
    (folder / "log.csv").write_bytes(content)
    return folder / "log.csv"


@pytest.mark.parametrize("pack", PACKERS)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-16-le", "utf-16-be"])
def test_the_numbers_are_those_of_the_plain_file(pack: str, encoding: str, tmp_path: Path) -> None:
    plain = numbers(written(tmp_path, PLAIN.encode()))
    assert np.array_equal(numbers(written(tmp_path, PACKERS[pack](PLAIN.encode(encoding)))), plain)
    assert np.array_equal(numbers(written(tmp_path, PLAIN.encode(encoding))), plain)


def test_a_plain_file_is_read_as_it_is(tmp_path: Path) -> None:
    assert content_of(written(tmp_path, PLAIN.encode())) is None
    assert content_of(written(tmp_path, "t,u,größe\n".encode("latin-1"))) is None


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (zipped(b"", "xl/workbook.xml", "[Content_Types].xml"), "an Excel workbook and cannot be unpacked"),
        (zipped(PLAIN.encode(), "a.csv", "b.csv"), "a zip archive of 2 files (a.csv, b.csv): unpack it first"),
        (zipped(b"", "mimetype", "content.xml", "styles.xml"), "a file of an office program: save the sheet"),
        (zipped(b"", "[Content_Types].xml", "word/document.xml"), "a file of an office program: save the sheet"),
        (zipped(PLAIN.encode(), "xl/workbook.xml")[:-9], "a zip archive or a spreadsheet and cannot be unpacked"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(4096), "a workbook of an old Excel (.xls): save it as .xlsx"),
        (zipped(PLAIN.encode(), "folder/"), "a zip archive of 0 files: unpack it first"),
        (gzip.compress(PLAIN.encode(), mtime=0)[:-900], "gzip-compressed and cannot be unpacked"),
        (lzma.compress(PLAIN.encode())[:-90], "xz-compressed and cannot be unpacked"),
        (bz2.compress(PLAIN.encode())[:-90], "bzip2-compressed and cannot be unpacked"),
        (
            gzip.compress(b"MATLAB 5.0\0\1\2\3" * 99, mtime=0),
            "gzip-compressed, and what is in it is no text: unpack it first",
        ),
    ],
)
def test_what_cannot_be_unpacked_is_one_line_with_its_name(content: bytes, said: str, tmp_path: Path) -> None:
    path = written(tmp_path, content)
    with pytest.raises(DataError) as caught:
        numbers(path)
    assert str(caught.value).startswith(f"{path}: is ")
    assert said in str(caught.value)


def test_what_is_written_about_a_log_may_lie_beside_it_in_a_zip(tmp_path: Path) -> None:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("run/meta.json", '{"operator": "x"}')
        archive.writestr("run/log.csv", PLAIN)
        archive.writestr("README.txt", "what it is")
    plain = numbers(written(tmp_path, PLAIN.encode()))
    assert np.array_equal(numbers(written(tmp_path, packed.getvalue())), plain)


@pytest.mark.parametrize("behind", [b"\0" * 512, b"and what a logger added"])
def test_bytes_behind_the_end_of_a_gzip_file_are_none_of_it(behind: bytes, tmp_path: Path) -> None:
    plain = numbers(written(tmp_path, PLAIN.encode()))
    assert np.array_equal(numbers(written(tmp_path, gzip.compress(PLAIN.encode()) + behind)), plain)


def test_a_bomb_that_is_no_text_is_refused_at_its_first_bytes(tmp_path: Path) -> None:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("log.csv", "w") as file:
        for _ in range(200):
            file.write(bytes(1 << 20))
    path = written(tmp_path, packed.getvalue())
    tracemalloc.start()
    with pytest.raises(DataError, match="what is in it is no text"):
        content_of(path)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 16 << 20  # of 200 MiB


def test_a_bomb_that_says_how_large_it_is_is_refused_before_it_is_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("os.sysconf", lambda name: 100)  # 10 kB of memory
    with pytest.raises(DataError, match="unpacks to"):
        content_of(written(tmp_path, zipped(PLAIN.encode())), 100)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_a_bad_cell_is_found_in_its_line(encoding: str, tmp_path: Path) -> None:
    path = written(tmp_path, gzip.compress(PLAIN.replace("\n4.0,0", "\n4.0,oops").encode(encoding)))
    with pytest.raises(DataError, match='line 4002, column "u": "oops" is not a number'):
        numbers(path)


def test_more_than_the_memory_is_refused_before_it_is_full(tmp_path: Path) -> None:
    path = tmp_path / "bomb.csv.gz"
    with gzip.open(path, "wb", compresslevel=1) as file:
        file.write(PLAIN.encode())
        for _ in range(300):
            file.write(b"0.1,2\n" * (1 << 17))
    code = (
        "import re, sys\n"
        "from dsd_cli.files import content\n"
        "content.check_size.__globals__['os'].sysconf = lambda name: 1 << 13\n"
        "try:\n    content.content_of(sys.argv[1])\n"
        "except Exception as error:\n"
        "    print(error, re.search(r'VmHWM:\\s*(\\d+)', open('/proc/self/status').read())[1])\n"
    )
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True)
    assert "bomb.csv.gz: unpacks to" in done.stdout
    assert int(done.stdout.split()[-1]) < 300_000  # KiB; all of it would be 230 MB more


def test_a_file_that_asks_for_more_memory_than_there_is_has_its_name() -> None:
    with (
        pytest.raises(DataError, match=r"log\.mcap: there is not enough memory to read it as MCAP"),
        understanding("log.mcap", "MCAP"),
    ):
        raise MemoryError


def test_a_packed_text_is_held_once(tmp_path: Path) -> None:
    text = b"0.1,2\n" * (1 << 22)
    path = written(tmp_path, gzip.compress(text, 1))
    tracemalloc.start()
    content = content_of(path)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert content == text
    assert most < 1.5 * len(text)


@pytest.mark.parametrize("line", [b"(1764060000.100000) can0 181#00C8FF12\n", b"  can0  181   [4]  00 C8 FF 12\n"])
def test_raw_frames_of_a_bus_say_what_explains_them(line: bytes, tmp_path: Path) -> None:
    with pytest.raises(DataError, match="raw frames of a CAN bus") as caught:
        numbers(written(tmp_path, 50 * line))
    assert "DBC" in str(caught.value)


def test_lists_in_cells_are_columns(tmp_path):
    """Packed or not; texts with brackets that are no lists stay."""
    rows = "".join(f'{k},"[{k}.5, -{k}]","(a [b])"\n' for k in range(9))
    for name, packed in (("log.csv", bytes), ("log.csv.gz", gzip.compress)):
        (tmp_path / name).write_bytes(packed(f"t,q,note\n{rows}".encode()))
        table = open_table(tmp_path / name, {"t": "t", "u": "q/2"})
        assert table.column_names == ["t", "q/1", "q/2", "note"]
        np.testing.assert_array_equal(np.concatenate([one.columns["u"] for one in table.batches()]), -np.arange(9.0))
    (tmp_path / "texts.csv").write_text('t,u,note\n1,2,"see [1]"\n2,3,""\n')
    assert content_of(tmp_path / "texts.csv") is None


@pytest.mark.parametrize("form", ["[{}, {}]", "[{} {}]", "[ {}\n  {}]", "array('d', [{}, {}])", "({}, {})"])
def test_lists_as_python_and_numpy_write_them_are_columns(form: str, tmp_path: Path) -> None:
    """sensor_msgs/JointState of a bag, by pandas: of its effort was said that it holds no numbers."""
    rows = "".join(f'{k},"[\'base\', \'elbow_1\']","{form.format(f"{k}.5", -k)}","(a, b)"\n' for k in range(9))
    (tmp_path / "log.csv").write_text(f"t,name,effort,note\n{rows}", encoding="utf-8")
    table = open_table(tmp_path / "log.csv", {"t": "t", "u": "effort/2", "position": "effort/1"})
    assert table.column_names == ["t", "name/1", "name/2", "effort/1", "effort/2", "note"]
    found = {name: np.concatenate([one.columns[name] for one in table.batches()]) for name in ("u", "position")}
    np.testing.assert_array_equal(found["u"], -np.arange(9.0))
    np.testing.assert_array_equal(found["position"], np.arange(9.0) + 0.5)


@pytest.mark.parametrize("head", [b'a\rb,"x"\n', b"a\r\r\n"], ids=["return", "returns"])
def test_a_lone_return_in_the_header_is_left_to_the_reader(head: bytes, tmp_path: Path) -> None:
    """It is no traceback of what reads lists in cells."""
    assert content_of(written(tmp_path, head + b'1,"[1,2]"\n2,"[3,4]"\n')) is None
