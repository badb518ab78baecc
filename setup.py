"""Only the compiled detection kernel lives here; everything else is in pyproject.toml.

The extension is optional: without a compiler `dsd` runs on its NumPy twin, and `dsd --version` says so.
"""

from setuptools import Extension, setup

setup(
    ext_modules=[
        Extension(
            "dsd_cli.detect._kernel",
            sources=["dsd_cli/detect/_kernel.c"],
            define_macros=[("Py_LIMITED_API", "0x030B0000")],
            # -ffp-contract=off: no fused multiply-add, so that labels equal those of the NumPy twin
            extra_compile_args=["-O3", "-ffp-contract=off", "-Wno-psabi"],
            py_limited_api=True,
            optional=True,
        )
    ]
)
