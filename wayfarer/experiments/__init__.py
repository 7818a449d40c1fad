"""Experiments on a simulated rover: trials, campaigns, sweeps, comparison, reports, Gymnasium.

``trial.py`` is one trial. A campaign is many of them (``campaign.py``, ``run.py``), in this process, on all
cores or on a Dask cluster (``pool.py``, ``dask_cluster.py``).
"""
