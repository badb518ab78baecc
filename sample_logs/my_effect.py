"""my_effect.py: an eddy-current brake; its force falls again beyond a critical speed."""

from dsd_cli.effects import Effect, Parameter, Role


def columns(channels, shape):
    ratio = channels.velocity / shape["critical_speed"]
    return (-2.0 * ratio / (1.0 + ratio**2),)  # force on the axis per unit of `force`; one column per linear parameter


EFFECT = Effect(
    id="eddy_brake",
    role=Role.APPLIED,
    law="-2 F (v/vc) / (1 + (v/vc)^2)",
    summary="Eddy-current brake: strongest at its critical speed.",
    pattern="the residual opposes the speed up to the critical speed and fades beyond it",
    parameters=(
        Parameter("force", "{u}", "F, the largest braking force", lower=0.0),
        Parameter("critical_speed", "{v}", "vc, where it brakes most", lower=1e-6, linear=False),
    ),
    needs=("velocity",),
    columns=columns,
    starts=lambda ranges: [{"critical_speed": share * ranges.top_speed} for share in (0.1, 0.2, 0.4, 0.8)],
)
