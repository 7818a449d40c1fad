"""How fast wayfarer is: ``python -m benchmarks`` from the checkout."""
