"""Scripts that people run by hand; no DVC stage calls them."""
