"""docs/export.md has the table of what targets say of each effect. `python -m tests.export.test_page` prints it."""

from pathlib import Path

from dsd_cli.export.targets import targets
from tests.export.cases import ALONE, EFFECTS, TABLES, joint

PAGE = Path(__file__).parents[2] / "docs/export.md"
#: Targets that carry the same, by one heading.
PROGRAMS = ("c", "fmu", "matlab", "modelica", "python", "st")


def table() -> list[str]:
    columns = [name for name in targets() if name not in PROGRAMS]
    heads = ["", "programs", *(f"`{name}`" for name in columns)]
    lines = ["| " + " | ".join(heads) + " |", "|---" * len(heads) + "|"]
    for part in ("delay", *EFFECTS, *TABLES):
        one = joint("viscous_friction") if part == "delay" else joint(part, delay=0.0)
        name = part if part == "delay" else ALONE[part][0]
        said = {target: found.judge(one, name) for target, found in targets().items()}
        assert not any("numpy" in verdict.how for verdict in said.values())
        assert len({said[target].carried for target in PROGRAMS}) == 1
        cells = ["yes" if said[target].carried else "-" for target in ("c", *columns)]
        lines.append("| " + " | ".join([f"`{name}`" + part.removeprefix(name), *cells]) + " |")
    return lines


def test_the_page_has_the_table() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert "\n".join(table()) in text, "docs/export.md: python -m tests.export.test_page prints the table as it is"


if __name__ == "__main__":
    print("\n".join(table()))
