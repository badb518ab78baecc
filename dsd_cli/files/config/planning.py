"""The section [plan] of `dsd.toml`: what a planned motion may reach."""

from __future__ import annotations

from dsd_cli.files.config.rules import Section, key, number, span

_ABOVE = number(above=0)


class Plan(Section):
    """[plan]: limits of `dsd plan`; what is not given is what the logs reached."""

    position: tuple[float, float] | None = key(span(), "lowest and highest position", "rad or m", default=None)
    velocity: float | None = key(_ABOVE, "largest speed", "rad/s or m/s", default=None)
    acceleration: float | None = key(_ABOVE, "largest acceleration", "rad/s2 or m/s2", default=None)
    jerk: float | None = key(_ABOVE, "largest jerk", "rad/s3 or m/s3", default=None)
    u: float | None = key(_ABOVE, "largest size of u", "unit of u", default=None)
    start: float | None = key(
        number(), "position of rest at begin and end; none is the middle of the range", "rad or m", default=None
    )
    seconds: float | None = key(
        _ABOVE, "length of the motion; none is 10, and 20 where 10 are not enough", "s", default=None
    )
