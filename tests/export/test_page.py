"""docs/export.md has the table of what targets say of each effect. `python -m tests.export.test_page` prints it."""

from pathlib import Path

from dsd_cli.export.base import Joint
from dsd_cli.export.targets import targets
from dsd_cli.plant.model import PlantModel
from tests.export.cases import EFFECTS, joint

PAGE = Path(__file__).parents[2] / "docs/export.md"
#: Targets that carry the same, by one heading.
PROGRAMS = ("c", "fmu", "matlab", "modelica", "python", "st")

#: Learnt tables over other channels than the speed.
LEARNT = tuple(
    (name, over)
    for name in ("curve", "friction_curve")
    for over in (["position"], ["u"], ["time"], ["velocity", "position"])
)


def table() -> list[str]:
    columns = [name for name in targets() if name not in PROGRAMS]
    heads = ["", "programs", *(f"`{name}`" for name in columns)]
    lines = ["| " + " | ".join(heads) + " |", "|---" * len(heads) + "|"]
    for part in ("delay", *EFFECTS):
        one = joint("viscous_friction") if part == "delay" else joint(part, delay=0.0)
        carried = {name: target.judge(one, part).carried for name, target in targets().items()}
        assert len({carried[name] for name in PROGRAMS}) == 1
        cells = ["yes" if carried[name] else "-" for name in ("c", *columns)]
        lines.append("| " + " | ".join([f"`{part}`", *cells]) + " |")
    for name, over in LEARNT:
        table = {"channels": over, "knots": [[0.0, 1.0]] * len(over), "factor": "one", "scale": 1.0}
        values = [[0.1, 0.2], [0.3, 0.4]] if len(over) > 1 else [0.1, 0.2]
        one = Joint(PlantModel(0.5, 0.0, {name: {**table, "values": values}}), 1e-3)
        said = {target: found.judge(one, name) for target, found in targets().items()}
        assert not any("numpy" in verdict.how for verdict in said.values())
        cells = ["yes" if said[target].carried else "-" for target in ("c", *columns)]
        assert len({said[target].carried for target in PROGRAMS}) == 1
        lines.append("| " + " | ".join([f"`{name}` over {' and '.join(over)}", *cells]) + " |")
    return lines


def test_the_page_has_the_table() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert "\n".join(table()) in text, "docs/export.md: python -m tests.export.test_page prints the table as it is"


if __name__ == "__main__":
    print("\n".join(table()))
