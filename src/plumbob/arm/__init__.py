"""A body of segments with a unit on each: joints found from motion, angles and hand estimated, taught and replayed."""
