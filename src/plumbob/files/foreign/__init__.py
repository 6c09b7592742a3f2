"""Other people's files: each module knows one family, says its frames, units and clock, and reads it as a Recording."""
