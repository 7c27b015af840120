"""The comparison of the literature on ETH and UCY: 3.2 s seen, 4.8 s forecast, best of 20."""
