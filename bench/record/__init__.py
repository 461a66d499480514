"""What a run leaves behind: samples, frames, events, record, report."""
