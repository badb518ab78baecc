"""A joint of a simulator, or a table of values, as a model: the way back of `dsd export`."""

from __future__ import annotations

from pathlib import Path

from dsd_cli.errors import DataError
from dsd_cli.export.reading.found import Found

#: What `dsd export` or other tools write and nothing here reads.
_NOT_READ = (".fmu", ".h", ".mo", ".py", ".st", ".usd", ".usda", ".usdc", ".usdz")


def read_joint(path: Path, joint: str | None) -> Found:
    """The joint of that name, or the only one that turns or slides.

    Raises
    ------
    DataError : no such file, not one that is understood, or nothing in it that moves.
    UsageError : no joint of that name, or several and none named.
    """
    from dsd_cli.export.reading import mjcf, parameters, urdf
    from dsd_cli.export.reading.xml_text import parse_xml, text_of

    if path.exists() and path.suffix.lower() in _NOT_READ:
        raise DataError(f"{path}: {path.suffix} is not read", "MJCF, URDF, or values by name (CSV, text) are")
    text = text_of(path)
    if not text.lstrip().startswith("<"):
        return parameters.read(path, text)
    root = parse_xml(path, text)
    if root.tag == "mujoco":
        return mjcf.read(path, joint)
    if root.tag == "robot":
        return urdf.read(path, root, joint)
    raise DataError(f"{path}: <{str(root.tag)[:40]}> is neither MJCF (<mujoco>) nor URDF (<robot>)", "convert it first")
