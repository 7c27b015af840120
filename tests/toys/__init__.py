"""One file for each kind of thing that can be added to pedpred, as small as it can be."""
