"""Drivers of virtual rigs: all devices belong to one emulated world; the CAN channel ends in a virtual Allegro hand."""
