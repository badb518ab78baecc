"""The sentences of docs/measured/hidden.md; every number on that page comes from the results."""

OPENING = """# Is the missing effect found?

Machines with an effect that the model does not have; the tool is given the log and that model and nothing else. This
page says how often the verdict is right, how often it is wrong, and how far its stated certainty can be trusted. The
logs come from a generator that shares no code with the tool. All numbers are those of the last run, written by
`python -m bench hidden --page`.
"""

PEERS = """The same logs (those with a speed), given to PySINDy {version} and to the recipe of an experienced
engineer. They get more than the tool does: the residual of the believed model already in force units, columns that
pass the same observer filter and are aligned to a fraction of a sample, the true delay of the believed model, and
with "every shape" the searched values laid out by hand: Stribeck speeds, Dahl reaches, widths, limits, lags and
resonances on a grid, and the *true* cogging periods and disturbance frequency among others. Named is the effect whose
terms contribute most (for the expert: the one taken first). "With a tolerance" counts only effects without which the
held-out error would be 1.5 % larger or more; the peers have no such rule, somebody has to set it.
Where nothing is missing their residual is the noise alone, because the believed model is exact; no rig offers that.
"""

HARD = """
## What is hard, and why

- **Only u and d_hat logged.** Speed and position are then reconstructed from u + d_hat, up to a constant speed that has
  to be guessed from the rests. What is left of it drives the position away, and viscous friction times a constant speed
  is a constant load. Laws that need the position are listed as not testable if the drift is too large.
- **Backlash.** While the load flies through the gap the motor alone is seen, and when it lands depends on how it
  left. Two free bodies with an impact are not a function of the logged channels, so small errors of the gap move the
  landings, and the fit sees a resonance: the usual confusion is with a flexible coupling, which differs from it only
  at small torque.
- **Coulomb friction, Dahl's presliding and friction that grows with load** are one law as soon as the axis moves at
  constant load: they differ in the first milliradians after a reversal, or in the dependence on torque. If the
  encoder cannot see the one and the moves do not vary the other, no method can identify either; then the tool is to
  state a tie.
- **Delay, lag of the amplifier and a soft coupling** all shift the phase of the command. A lag of a millisecond and a
  delay of a millisecond differ only above some 50 Hz; under much noise a wrong delay takes the lag's place.
- **Stiffness and gravity**: q and sin q are one function on a short stroke, and part only where the moves are long.
- **A short push from outside under much noise**: the pulses must stand out of the residual before they can be placed.
- **Viscous friction, quadratic drag and inertia** part only if fast and slow moves are mixed.
- **Small dead zones and saturation** show in few samples: the command passes zero quickly, and rarely reaches the
  limit.
- **Stribeck friction** lives at crawling speed. A log with few slow moves holds a few dozen samples of it.
- **An effect that is in no library** is often taken in part by a known one (friction that grows with time by Coulomb
  friction); what matters is that the tool does not stop there content.

What went wrong in this run:
"""

METHOD = """
## How the study is made

- **Machines** (`tests/oracle/machine_*.py`): inertia from 0.05 to 2 kg m², a delay of 0.5 to 12 ms that is no whole
  number of samples, half of them with believed viscous friction. Own integration in steps of 0.1 ms, friction as an
  elasto-plastic bristle, not as the tool models it. Trapezoidal moves, slow and fast, under a cascaded loop that sees
  only the measured signals; half with a multisine or sweep on top.
- **Amplitudes**: rms of the hidden force over the rms of the drive: plain 0.30 to 0.60, moderate 0.10 to 0.25, faint
  0.03 to 0.08. Noise of d_hat: 0.005 to 0.03 of the drive; "buried" is a faint effect under noise of 0.08 of the
  drive.
- **Sensing**: everything logged, or u, velocity and position (in turn); u and an encoder's position; u and d_hat.
  Encoders have steps.
- **Counted** is a log if the true law would lower the error of the believed model by 5 % or more: sqrt(hidden² +
  floor²) / floor at least 1.0526, both known to the generator.
- **Right** is strict: the first verdict is the hidden effect, nothing else. Ties are reported beside it.
- **Calibration** takes the logs that are too faint to count as well; there `none` is right too. For pairs the first
  verdict must be one of the two; for strangers the last one must be `unknown`.
- A crash counts as a wrong verdict.
"""

CLOSING = """
To run it again:

```
pip install -e ".[bench]"
python -m bench hidden --seeds 2                 # everything; see the table above for how long it takes
python -m bench hidden --seeds 2 --only pairs    # one part; the others keep their numbers
python -m bench hidden --failures                # the calls that make every log that went wrong
python -m bench hidden --page                    # this page
```"""
