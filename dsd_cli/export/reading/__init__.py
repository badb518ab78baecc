"""Reads joints of simulators and tables of values as models."""
