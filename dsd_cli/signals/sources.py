"""Where the channels of a motion are from."""

from __future__ import annotations

from collections.abc import Mapping


def only_channel(provenance: Mapping[str, str]) -> str:
    """The measured channel from which alone the motion is known; "" where there are more, or d_hat has it.

    provenance : channel -> where it is from, as `identify.recordings.recording.Recording` has it.
    """
    if provenance.get("position") == "integrated from velocity":
        return "velocity"
    by_position = (provenance.get("velocity"), provenance.get("d_hat")) == ("from position", "computed from position")
    return "position" if by_position else ""
