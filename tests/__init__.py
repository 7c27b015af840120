"""Laws of the house, as tests."""
