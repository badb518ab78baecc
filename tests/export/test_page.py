"""docs/export.md has the table of what targets say of each effect. `python -m tests.export.test_page` prints it."""

from pathlib import Path

from dsd_cli.export.base import Joint
from dsd_cli.export.targets import targets
from dsd_cli.plant.model import PlantModel
from tests.export.cases import ALONE, EFFECTS, TABLES, VALUES

PAGE = Path(__file__).parents[2] / "docs/export.md"
#: Targets that carry the same, by one heading.
PROGRAMS = ("c", "fmu", "matlab", "modelica", "python", "st")
#: All that the table has: what it is -> (name in a model, values).
PARTS = {
    "delay": ("viscous_friction", VALUES["viscous_friction"]),
    **{name: ALONE[name] for name in EFFECTS},
    "backlash of a load that rubs": ("backlash", {**VALUES["backlash"], "load_level": 0.1}),
    **TABLES,
}


def table() -> list[str]:
    columns = [name for name in targets() if name not in PROGRAMS]
    heads = ["", "programs", *(f"`{name}`" for name in columns)]
    lines = ["| " + " | ".join(heads) + " |", "|---" * len(heads) + "|"]
    for part, (effect, values) in PARTS.items():
        one = Joint(PlantModel(0.5, 0.0205 if part == "delay" else 0.0, {effect: values}), 2e-3)
        name = part if part == "delay" else effect
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
