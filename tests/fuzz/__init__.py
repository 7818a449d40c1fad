"""Property tests of everything in wayfarer that reads bytes which it did not write itself this second.

A *target* (``target.py``) is one reader: its cases, and what is tried with each. A try returns its outcome in a few
words, such as a refusal's text, or raises: what is no ``WayfarerError``, or no error that the reader documents, is a
bug. So is what a target asserts: a reading in range, a server that still answers.

Cases are Hypothesis's, because it makes a failing one small. They begin with real input (a shipped rover file, a log
of a run, a gpsd's report) and damage it by bytes or by its structure (``damage.py``).

``test_fuzz.py`` tries a few cases of every target in each run of the tests, and many in the tier ``long``.
"""
