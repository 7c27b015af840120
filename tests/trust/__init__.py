"""What pedpred promises about foreign files, faults and leaks, tried out."""
