"""Fuzzing everything of wayfarer that reads bytes which it did not write itself this second.

::

    python -m tests.fuzz --seconds 40                    # what CI runs: the same cases for the same speed of machine
    python -m tests.fuzz --minutes 30                    # other cases each time; the seed is printed
    python -m tests.fuzz --minutes 5 --only gpsd --seed 7 --keep found

A *target* (``target.py``) is one reader: where its cases come from, and what is tried with each. A try returns its
outcome in a few words, such as a refusal's text, or raises: what is no ``WayfarerError``, or no error that the reader
documents, is a bug. So is what a target asserts: a reading in range, a server that still answers.

Cases are Hypothesis's, because it makes a failing one small. They begin with real input (a shipped rover file, a log
of a run, a gpsd's report) and damage it by bytes or by its structure (``damage.py``). ``engine.py`` runs them in
batches and counts which lines of the reader each reached (``covered.py``); a case that reached new ones is damaged
further in the batches after it. A batch depends on nothing but the seed and those before it.

``test_fuzz.py`` tries a few cases of every target in each run of the tests.
"""
