"""Only the compiled modules live here: detection kernels, recursions of effects, passes over samples and text of CSV.
The rest is in pyproject.toml.

All are optional: without a compiler `dsd` runs on their Python twins, and `dsd --version` says so. DSD_PURE=1 leaves
them out: the wheel is one for any machine (`make wheels` builds both; one `python -m build` makes one wheel).
"""

import os
import zlib

from setuptools import Extension, setup

PURE = os.environ.get("DSD_PURE") == "1"
#: No fused multiply-add: labels, loads and texts are those of the Python twins, bit by bit.
AS_TWIN = "-ffp-contract=off"


def compiled(module: str, *flags: str) -> Extension:
    """An optional module of the stable ABI, from the C file beside where it is imported; it says of which one, so that
    it is left alone where a checkout has moved on (`signals.compiled`)."""
    source = f"dsd_cli/{module.replace('.', '/')}.c"
    with open(source, "rb") as file:
        text = f'"{zlib.crc32(file.read()):08x}"'
    return Extension(
        f"dsd_cli.{module}",
        sources=[source],
        define_macros=[("Py_LIMITED_API", "0x030B0000"), ("DSD_SOURCE", text)],
        extra_compile_args=list(flags),
        py_limited_api=True,
        optional=True,
    )


setup(
    options={} if PURE else {"bdist_wheel": {"py_limited_api": "cp311"}},
    ext_modules=[]
    if PURE
    else [
        compiled("detect._kernel", "-O3", AS_TWIN, "-Wno-psabi"),
        compiled("detect._goodness", "-O3", AS_TWIN),
        compiled("effects._memory", "-O2", AS_TWIN),
        compiled("signals._passes", "-O3", "-fno-math-errno", "-fno-trapping-math", "-Wno-psabi"),
        compiled("signals._signed", "-O2"),
        compiled("files._csv_text", "-O3", AS_TWIN),
    ],
)
