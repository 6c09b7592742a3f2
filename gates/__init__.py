"""Every gate of the project: what runs them, and what they measure."""
