"""The network of Pfeiffer et al. 2018: grids around a person, an LSTM for each input, a joint LSTM."""
