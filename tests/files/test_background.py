"""Reading ahead: same items, errors where they are taken, and no thread left behind."""

import threading
import time

import pytest

from dsd_cli.files.background import read_ahead


def readers() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == "reader"]


def test_the_same_items_in_the_same_order():
    with read_ahead(range(100)) as items:
        assert list(items) == list(range(100))


def test_what_the_source_raises_is_raised_where_it_is_taken():
    def broken():
        yield 1
        raise OSError("disk")

    with read_ahead(broken()) as items:
        assert next(items) == 1
        with pytest.raises(OSError, match="disk"):
            next(items)


def test_the_thread_has_ended_when_the_block_is_left_early():
    def slow():
        while True:
            time.sleep(0.01)
            yield 1

    with read_ahead(slow()) as items:
        next(items)
    assert not readers()
