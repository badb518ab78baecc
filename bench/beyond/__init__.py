"""What docs/how/beyond.md shows: a file per item, each with `section(pictures) -> str`; `make beyond` runs all."""
