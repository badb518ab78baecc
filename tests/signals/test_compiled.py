"""Modules that a build may lack, or that a checkout has moved on from."""

import importlib
import zlib

import pytest

from dsd_cli.signals.compiled import compiled_module

SOURCE = b"int newest(void) { return 1; }\n"


def test_there_is_none_where_nothing_was_built():
    assert compiled_module("dsd_cli.no_such") is None


@pytest.mark.parametrize(
    ("beside", "taken"),
    [(SOURCE, True), (b"int newest(int more) { return more; }\n", False), (None, True)],
    ids=["built from it", "the source moved on", "no source lies beside it"],
)
def test_a_module_is_taken_if_it_is_of_the_source_beside_it(beside, taken, tmp_path, monkeypatch):
    """Called as a newer Python side does, a module that an older checkout built raises a TypeError, or worse."""
    name = f"built_{beside is None}_{taken}"
    (tmp_path / f"{name}.py").write_text(f'"""Passes. {zlib.crc32(SOURCE):08x}"""\n')
    if beside is not None:
        (tmp_path / f"{name}.c").write_bytes(beside)
    monkeypatch.syspath_prepend(tmp_path)
    assert (compiled_module(name) is importlib.import_module(name)) is taken


def test_a_module_of_a_build_that_did_not_say_its_source_is_left_alone(tmp_path, monkeypatch):
    (tmp_path / "silent.py").write_text("")
    (tmp_path / "silent.c").write_bytes(SOURCE)
    monkeypatch.syspath_prepend(tmp_path)
    assert compiled_module("silent") is None


MODULES = ["effects._memory", "detect._kernel", "detect._goodness", "signals._passes", "signals._signed"]


@pytest.mark.parametrize("name", [*MODULES, "files._csv_text"])
def test_every_module_says_its_source(name):
    """One that does not would never be taken, and all would be slow; without a compiler there is none."""
    built = pytest.importorskip(f"dsd_cli.{name}")
    assert compiled_module(f"dsd_cli.{name}") is built
