"""Steps of a procedure: a closed set, each a small class."""
