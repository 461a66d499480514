"""The four papers' own tables and figures, made again on the virtual bench."""
