"""The workbench in a browser: pages, their parts, and the HTTP interface next to them.

Nothing here knows how to calibrate or to compensate: pages call functions of the lower rooms, long
work is a job of the store. ``server.py`` starts it all, ``gate.py`` controls access, every page is
one file in ``pages/``, what several pages show is in ``parts/``.
"""
