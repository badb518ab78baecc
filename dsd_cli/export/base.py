"""What every target fills: which parts of a model it carries, the text or archive that it is, and how that is run."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from dsd_cli.effects import Effect, get_effect
from dsd_cli.errors import UsageError
from dsd_cli.plant.model import DELAY as DELAY
from dsd_cli.plant.model import INERTIA as INERTIA
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array
from dsd_cli.signals.units import Units

#: Two _ in a row, or one at the end, are no name in IEC 61131-3.
_IDENTIFIER = re.compile(r"(?=.{1,63}$)[A-Za-z](_?[A-Za-z0-9])*", re.ASCII)
#: Words that mean something in Modelica or MATLAB, where the name stands by itself, or in the world of a simulator.
_WORDS = re.compile(
    r"algorithm|and|annotation|block|break|case|catch|class|connect|constant|constrainedby|continue|der|"
    r"discrete|each|else|elseif|elsewhen|encapsulated|end|enumeration|equation|expandable|extends|external|"
    r"false|final|flow|for|function|global|if|import|impure|in|initial|inner|input|loop|model|not|operator|or|"
    r"otherwise|outer|output|package|parameter|parfor|partial|persistent|protected|public|pure|record|redeclare|"
    r"replaceable|return|spmd|stream|switch|then|true|try|type|when|while|within|"
    r"boolean|integer|real|string|pre|sample|world|"
    # functions and variables that both have, those of Modelica, those of MATLAB
    r"abs|acos|asin|atan2?|ceil|cosh?|cross|exp|expm1|floor|log|log10|log1p|max|min|mod|ones|rem|sign|sinh?|size|sqrt|"
    r"sum|tanh?|zeros|"
    r"actualstream|array|assert|assertionlevel|cardinality|cat|change|clock|connections|delay|diagonal|div|edge|"
    r"externalobject|fill|getinstancename|homotopy|identity|instream|linspace|matrix|ndims|noevent|outerproduct|"
    r"previous|product|promote|reinit|rooted|scalar|semilinear|skew|smooth|spatialdistribution|stateselect|"
    r"symmetric|terminal|terminate|time|transpose|vector|"
    r"classdef|ans|cumsum|diff|eps|fix|hypot|i|inf|interp1|isempty|isnan|isfinite|j|length|log2|mean|nan|nargin|"
    r"nargout|numel|pi|power|prod|round|varargin|varargout",
    re.IGNORECASE,
)
#: What a comment of any target may hold: nothing that ends a comment, a string or a line.
_UNSAFE = re.compile(r"[^A-Za-z0-9 .,:;_+\-=^/()\[\]]|(?<=/)/|\(\*|\*\)")


@dataclass(frozen=True)
class Joint:
    """One axis as it goes out.

    Attributes
    ----------
    model : inertia, delay and effects with their values, in the units of the config.
    sample_time : s, the clock of the controller: u is held for so long.
    name : of the joint, function or block; letters, digits and _ (checked), so that it is no code in any target.
    linear : it slides, q is in m; else it turns. units : of u and q as the config names them.
    """

    model: PlantModel
    sample_time: float
    name: str = "joint"
    linear: bool = False
    units: Units = Units()  # noqa: RUF009 (frozen)

    def __post_init__(self) -> None:
        if _WORDS.fullmatch(self.name):
            raise UsageError(f"--name {self.name}", "that word means something in a target; take another")
        if not _IDENTIFIER.fullmatch(self.name):
            how = "at most 63 letters, digits and _ between them, beginning with a letter"
            raise UsageError(f"--name {self.name!r}", how)
        if not (math.isfinite(self.sample_time) and self.sample_time > 0.0):
            raise UsageError(f"sample time {self.sample_time:g} s", "must be above 0")

    @property
    def parts(self) -> tuple[str, ...]:
        """What a target carries or not: inertia, the delay where there is one, and each effect by its name."""
        return (INERTIA, *([DELAY] if self.model.delay > 0.0 else []), *self.model.effects)

    def effect(self, part: str) -> Effect | None:
        """The effect of that name; None for inertia and delay."""
        return None if part in (INERTIA, DELAY) else get_effect(part)

    def without(self, parts: frozenset[str]) -> Joint:
        """The joint that is left if these parts are left out; the inertia stays."""
        effects = {name: values for name, values in self.model.effects.items() if name not in parts}
        delay = 0.0 if DELAY in parts else self.model.delay
        return replace(self, model=PlantModel(self.model.inertia, delay, effects, self.model.rest_speed))


@dataclass(frozen=True)
class Verdict:
    """Whether a target carries one part of a model; `how` says by which of its means, or why not."""

    part: str
    carried: bool
    how: str


@dataclass(frozen=True)
class Motion:
    """What an exported model is run under.

    Attributes
    ----------
    u : command, held from t_k to t_k+1, shape (n,), t_k = k T; 0 before.
    sample_time : T, s. position, velocity : at t_0. source : where u is from, for the user.
    """

    u: Array
    sample_time: float
    position: float = 0.0
    velocity: float = 0.0
    source: str = "built-in motion"


class NotRun(Exception):  # noqa: N818 (not an error: the export stands, it was only not tried)
    """What is missing here to run an exported model, in one line."""


@dataclass(frozen=True)
class Target:
    """One way out, found by looking into `targets/`: a module that defines `TARGET`.

    Attributes
    ----------
    id : of `--to`. summary : one line for the user. suffix : of the file.
    judge : (joint, part) -> whether and how it carries that part of that joint.
    write : joint of carried parts only -> the content of the file; the same joint gives the same bytes.
    run : (content, joint, motion) -> velocity at t_0 ... t_n-1 of the exported model, shape (n,), in SI units;
        raises `NotRun` where what it takes (a compiler, an extra) is not there. None: cannot be run here at all.
    not_run : why not, where `run` is None.
    most : samples that it is run on at most, where it is slow; 0: all of them.
    """

    id: str
    summary: str
    suffix: str
    judge: Callable[[Joint, str], Verdict]
    write: Callable[[Joint], bytes]
    run: Callable[[bytes, Joint, Motion], Array] | None = None
    not_run: str = ""
    most: int = 0


def number(value: float) -> str:
    """The shortest text that reads back as the same double; every value of a target is written by it.

    Raises
    ------
    UsageError : a value that is not finite.
    """
    if not math.isfinite(value):
        raise UsageError(f"a value is {float(value):g}", "only finite values can be exported")
    return repr(float(value))


def comment(text: str) -> str:
    """A text as one line that is safe within a comment of any target: everything that could end one is a space."""
    return " ".join(_UNSAFE.sub(" ", text).split())[:200]


def finite(velocity: Array, target: str) -> Array:
    """The velocity that a target gave, as a float array."""
    found = np.asarray(velocity, dtype=np.float64)
    if not np.isfinite(found).all():
        raise NotRun(f"the {target} model diverges")
    return found
