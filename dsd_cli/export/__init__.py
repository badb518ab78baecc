"""Carries a model out of the project: into simulators, controllers and other tools, one file of `targets/` each."""
