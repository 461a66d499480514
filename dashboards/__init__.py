"""What an engineer opens in rerun to see why a unit failed."""
