"""From what a bench and a part are known to within, to the uncertainty of each heading error."""
