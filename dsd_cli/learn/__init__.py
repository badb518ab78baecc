"""The law that the catalogue lacks: which channels it depends on, its curve, its formula."""
