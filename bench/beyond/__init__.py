"""What docs/beyond.md shows: one file per item, each with `section(pictures) -> str`; `make beyond` runs them all."""
