"""Tests of the guarantees about foreign files, faults and leakage."""
