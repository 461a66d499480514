"""What is on the wire between the bench and its devices: identifiers, frames, codecs."""
