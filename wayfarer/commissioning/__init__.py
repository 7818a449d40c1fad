"""Commissioning of a rover: checks, guided calibration, and their interface to the operator."""
