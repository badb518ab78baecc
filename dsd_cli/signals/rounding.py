"""What counts as equal in double precision."""

#: Share by which two numbers differ that were computed along different ways from the same values.
ROUNDING = 1e-9
