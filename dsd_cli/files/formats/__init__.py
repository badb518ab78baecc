"""Files of other tools: one file here per format, all behind `Container` (base.py).

A new format is a file with a class that is a `Container`, and a line in known.py.
"""
