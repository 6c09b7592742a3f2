"""Chips on SPI, emulated: the time and what is felt come with ``sample(values, t_ns)``, bytes with ``transfer``.

Their numbers are made by the catalogue's encoder; each call of ``sample`` is one sample of the chip.
"""
