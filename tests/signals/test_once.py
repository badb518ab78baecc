"""Answers that are kept with their object."""

from dsd_cli.signals.once import once, with_answers


class Counting:
    """Counts what it is asked."""

    def __init__(self) -> None:
        self.asked: list[tuple[int, bool]] = []

    @once
    def twice(self, x: int, negative: bool = False) -> list[int]:
        """A new list each time that it is made."""
        self.asked.append((x, negative))
        return [-2 * x if negative else 2 * x]

    @once
    def half(self, x: int) -> float:
        return x / 2


def test_an_answer_is_made_once_for_the_same_arguments():
    one = Counting()
    assert one.twice(2) is one.twice(2)
    assert one.twice(2, negative=True) == [-4]
    assert one.twice(3) == [6]
    assert one.asked == [(2, False), (2, True), (3, False)]


def test_methods_and_objects_have_their_own():
    one, other = Counting(), Counting()
    assert one.twice(4) == [8]
    assert one.half(4) == 2.0
    assert one.twice(4) is not other.twice(4)


def test_answers_outlive_the_object_that_made_them():
    answers = {}
    first = with_answers(Counting(), answers).twice(5)
    again = with_answers(Counting(), answers)
    assert again.twice(5) is first
    assert again.asked == []
