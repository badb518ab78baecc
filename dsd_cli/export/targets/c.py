"""C99: one header of inline functions for a controller: feed-forward, compensation, friction, and the axis itself."""

from __future__ import annotations

from pathlib import Path

from dsd_cli.export.base import Joint, Motion, Target, number
from dsd_cli.export.c_text import header
from dsd_cli.export.computing import compiled, judge, scratch, velocities
from dsd_cli.signals.log import Array

_MAIN = """#include <stdio.h>
#include "joint.h"

int main(void)
{{
    {name}_plant axis;
    double u;
    {name}_plant_init(&axis, {position}, {velocity});
    while (fread(&u, sizeof u, 1, stdin) == 1) {{
        fwrite(&axis.velocity, sizeof u, 1, stdout);
        {name}_plant_step(&axis, u);
    }}
    return 0;
}}
"""


def _write(joint: Joint) -> bytes:
    return header(joint).encode("ascii")


def _run(content: bytes, joint: Joint, motion: Motion) -> Array:
    main = _MAIN.format(name=joint.name, position=number(motion.position), velocity=number(motion.velocity))
    with scratch() as folder:
        model = compiled({"joint.h": content.decode(), "main.c": main}, Path(folder))
        return velocities([str(model)], motion)


TARGET = Target(
    id="c",
    summary="C99: one header of inline functions, no allocation.",
    suffix=".h",
    judge=judge,
    write=_write,
    run=_run,
)
