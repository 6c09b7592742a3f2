"""Timing: from a device's clock and the time of arrival to one time of a host, with what it is worth."""
