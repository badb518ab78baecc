"""A config in another folder names the same files, and nothing else of its text changes."""

from pathlib import Path

import pytest

from dsd_cli.files.config.moved import moved

TEXT = """\
# mine
[detector]
transition = { file = "A.csv" }  # of the rig

[simulate.reference]
file = 'in/ref.csv'
column = "q"

[effects]
from = ["/abs/one.py", "two.py"]
"""


@pytest.mark.parametrize(
    ("new", "files"),
    [("out", ("../A.csv", "../in/ref.csv", "../two.py")), ("in", ("../A.csv", "ref.csv", "../two.py"))],
)
def test_relative_files_are_the_same_files(tmp_path: Path, new: str, files: tuple[str, ...]) -> None:
    wanted = TEXT.replace('"A.csv"', f'"{files[0]}"').replace("'in/ref.csv'", f'"{files[1]}"')
    wanted = wanted.replace('"two.py"', f'"{files[2]}"')
    (tmp_path / new).mkdir()
    # "in/ref.csv" from `in` is "ref.csv" there
    there = moved(TEXT, tmp_path, tmp_path / new)
    assert there == wanted
    assert moved(there, tmp_path / new, tmp_path) == TEXT.replace("'in/ref.csv'", '"in/ref.csv"')


def test_the_same_folder_leaves_every_byte(tmp_path: Path) -> None:
    assert moved(TEXT, tmp_path, tmp_path / "." / "") == TEXT


def test_a_folder_behind_a_link_is_where_it_leads(tmp_path: Path) -> None:
    (tmp_path / "far" / "deep").mkdir(parents=True)
    (tmp_path / "near").symlink_to(tmp_path / "far" / "deep")
    assert '"../../A.csv"' in moved(TEXT, tmp_path, tmp_path / "near")


@pytest.mark.parametrize(
    "text",
    [
        """[effects]\nfrom = [\n  "/abs/one.py",  # "theirs", not ours\n  # next: "two.py"\n  'two.py',\n]\n""",
        """[simulate]\nreference = { "file" = 'two.py', column = 'two.py' }  # 'two.py'\n""",
    ],
)
def test_comments_and_other_texts_of_a_value_stay(tmp_path: Path, text: str) -> None:
    (tmp_path / "out").mkdir()
    assert moved(text, tmp_path, tmp_path / "out") == text.replace("'two.py'", '"../two.py"', 1)
