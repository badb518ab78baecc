"""Only the compiled detection kernels, recursions of effects and text of CSV live here; the rest is in pyproject.toml.

All are optional: without a compiler `dsd` runs on their Python twins, and `dsd --version` says so. DSD_PURE=1 leaves
them out: the wheel is one for any machine.
"""

import os

from setuptools import Extension, setup

PURE = os.environ.get("DSD_PURE") == "1"

setup(
    options={} if PURE else {"bdist_wheel": {"py_limited_api": "cp311"}},
    ext_modules=[]
    if PURE
    else [
        Extension(
            "dsd_cli.detect._kernel",
            sources=["dsd_cli/detect/_kernel.c"],
            define_macros=[("Py_LIMITED_API", "0x030B0000")],
            # -ffp-contract=off: no fused multiply-add, so that labels equal those of the NumPy twin
            extra_compile_args=["-O3", "-ffp-contract=off", "-Wno-psabi"],
            py_limited_api=True,
            optional=True,
        ),
        Extension(
            "dsd_cli.detect._goodness",
            sources=["dsd_cli/detect/_goodness.c"],
            define_macros=[("Py_LIMITED_API", "0x030B0000")],
            extra_compile_args=["-O3", "-ffp-contract=off"],  # as above
            py_limited_api=True,
            optional=True,
        ),
        Extension(
            "dsd_cli.effects._memory",
            sources=["dsd_cli/effects/_memory.c"],
            define_macros=[("Py_LIMITED_API", "0x030B0000")],
            extra_compile_args=["-O2", "-ffp-contract=off"],  # as above: equal to the Python loops
            py_limited_api=True,
            optional=True,
        ),
        Extension(
            "dsd_cli.signals._passes",
            sources=["dsd_cli/signals/_passes.c"],
            define_macros=[("Py_LIMITED_API", "0x030B0000")],
            extra_compile_args=["-O3", "-fno-math-errno", "-fno-trapping-math", "-Wno-psabi"],
            py_limited_api=True,
            optional=True,
        ),
        Extension(
            "dsd_cli.signals._signed",
            sources=["dsd_cli/signals/_signed.c"],
            define_macros=[("Py_LIMITED_API", "0x030B0000")],
            extra_compile_args=["-O2"],
            py_limited_api=True,
            optional=True,
        ),
        Extension(
            "dsd_cli.files._csv_text",
            sources=["dsd_cli/files/_csv_text.c"],
            define_macros=[("Py_LIMITED_API", "0x030B0000")],
            extra_compile_args=["-O3", "-ffp-contract=off"],
            py_limited_api=True,
            optional=True,
        ),
    ],
)
