"""Emulated rigs: the hardware of the papers, speaking its real bytes."""
