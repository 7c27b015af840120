"""How fast it is, beside a bound or a peer, in one run: `python -m benchmarks.<name>`."""
