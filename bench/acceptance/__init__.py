"""From readings, uncertainty and limits to a verdict."""
